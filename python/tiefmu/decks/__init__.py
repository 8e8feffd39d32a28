"""Finite-element decks as scenes: `tiefmu import DECK`, and decks where scenes are asked for.

A reader of a language (radioss/) fills a Deck (model.py); element_properties.py gives its nodes masses, inertias and
stiffnesses; to_scene.py makes the scene of its ties; write.py puts it into files.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._core import SceneError
from . import radioss, to_scene, write
from .model import Deck

LANGUAGES = (radioss,)
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
        raise SceneError(f"{path}: is no deck; Radioss starter decks can be imported")
    deck = reader.read(path, str(path), ties)
    found = Imported(deck, to_scene.convert(deck, free))
    if found.scene.pairwise:
        drop_far_pairs(found)
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


def drop_far_pairs(found: Imported):
    """Takes slaves out of ties with a tolerance per pair where the segment they find is farther than it."""
    from ..report import report

    waiting = dict(found.scene.pairwise)
    rows = report(compiled(found))["slaves"]
    for name, pair in waiting.items():
        mine = [row for row in rows if row["tie"] == name]
        ids, segments = (np.array([row[key] for row in mine], np.int64) for key in ("id", "segment"))
        distance = np.array([row["distance"] for row in mine])
        limit = pair_limit(pair, ids, segments) * pair["factor"]
        far = np.flatnonzero(distance > limit * (1 + 1e-12))
        table = next(table for table in found.scene.tables["tie"] if table["name"] == name)
        kept = np.setdiff1d(ids, ids[far])
        lost = np.setdiff1d(found.scene.node_sets[table["slaves"]], kept)
        if len(lost):
            found.deck.warn(
                f"tie '{name}': {len(lost)} slaves, the first is node {lost[0]}, are farther from the surface than "
                "their tolerance and are dropped"
            )
        if not len(kept):
            raise SceneError(f"{found.deck.file}: tie '{name}': no slave is within its tolerance of the surface")
        found.scene.node_sets[table["slaves"]] = kept
    found.scene.pairwise = {}


def pair_limit(pair: dict, slaves: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Tolerance of each pair of slave id and segment id, in the deck's units."""

    def place(known, wanted):
        order = np.argsort(known, kind="stable")
        return order[np.searchsorted(known, wanted, sorter=order)]

    face, node = place(pair["segment"], segments), place(pair["slave"], slaves)
    return np.maximum(pair["diagonal"][face], pair["share"] * (pair["t_s"][node] + pair["t_m"][face]))


def import_deck(deck: Path, scene: Path, ties: list[str] | None = None, free: tuple[str, ...] = ()) -> Imported:
    """Writes the scene of a deck: `scene` and, beside it, its mesh and its node properties."""
    if not scene.parent.is_dir():
        raise SceneError(f"{scene}: folder {scene.parent} does not exist")
    found = read(deck, ties, free)
    compiled(found)  # what cannot be built is not written
    write.scene(found, scene)
    return found
