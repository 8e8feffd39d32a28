"""Finite-element decks as scenes: `tiefmu import DECK`, and decks where scenes are asked for.

A reader of a language (radioss/, abaqus/, dyna/) fills a Deck (model.py); element_properties.py gives its nodes
masses, inertias and stiffnesses; to_scene.py makes the scene of its ties; settle.py looks at pairs of slave and
segment; write.py puts it into files.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from .._core import SceneError
from . import abaqus, dyna, radioss, to_scene, write
from .model import Deck
from .settle import settle

LANGUAGES = (radioss, dyna, abaqus)
HEAD = 4096  # bytes by which a language is told
NOT_DECKS = (".toml", ".fmu", ".json", ".csv")


@dataclass
class Imported:
    """A deck and the scene of its ties."""

    deck: Deck
    scene: to_scene.Written


def language(path: Path):
    """The reader of the deck's language, or None."""
    if path.suffix.lower() in NOT_DECKS or not path.is_file():
        return None
    with path.open("rb") as file:
        head = file.read(HEAD)
    return next((one for one in LANGUAGES if one.recognises(path, head)), None)


def is_deck(path: Path) -> bool:
    try:
        return language(path) is not None
    except OSError:
        return False


def read(path: Path, ties: list[str] | None = None, free: tuple[str, ...] = ()) -> Imported:
    """Reads a deck. ties: names or ids of the ties to take, None: all; free: names or ids of parts or node sets whose
    masters the FMU moves itself. SceneError, one line "FILE: line N: /KEYWORD: message", on what is wrong."""
    if not path.is_file():
        raise SceneError(f"{path}: no such file")
    reader = language(path)
    if reader is None:
        raise SceneError(
            f"{path}: is no deck; Radioss starter decks, LS-DYNA keyword decks and Abaqus or CalculiX input files with "
            "*TIE can be imported"
        )
    deck = reader.read(path, str(path), ties)
    found = Imported(deck, to_scene.convert(deck, free))
    if found.scene.pairwise:
        settle(deck, found.scene, compiled(found))
    return found


def load(path: Path, ties: list[str] | None = None, free: tuple[str, ...] = ()):
    """The compiled Scene of a deck."""
    return compiled(read(path, ties, free))


def compiled(found: Imported):
    from .. import schema
    from ..scene import Scene, one_line

    path = Path(found.deck.file)
    with tempfile.TemporaryDirectory(prefix="tiefmu-") as folder:
        tables = write.files(found, Path(folder), path.stem, to_keep=False)
        try:
            scene = Scene(found.deck.file, path.stem, schema.parse(tables), Path(folder))
        except SceneError as error:
            raise SceneError(one_line(f"{found.deck.file}: {error}")) from None
    prefix = f"{found.deck.file}: "  # which whoever shows a scene's remarks adds
    scene.notes += [line.removeprefix(prefix) for line in write.remarks(found.deck)]
    scene.warnings += [line.removeprefix(prefix) for line in found.deck.warnings]
    return scene


def import_deck(deck: Path, scene: Path, ties: list[str] | None = None, free: tuple[str, ...] = ()) -> Imported:
    """Writes the scene of a deck: `scene` and, beside it, its mesh and its node properties."""
    if not scene.parent.is_dir():
        raise SceneError(f"{scene}: folder {scene.parent} does not exist")
    found = read(deck, ties, free)
    compiled(found)  # what cannot be built is not written
    write.scene(found, scene)
    return found
