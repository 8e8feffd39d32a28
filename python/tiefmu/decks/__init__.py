"""Finite-element decks as scenes: `tiefmu import DECK`, and decks where scenes are asked for.

A reader of a language (radioss/, abaqus/, dyna/) fills a Deck (model.py); element_properties.py gives its nodes
masses, inertias and stiffnesses; to_scene.py makes the scene of its ties; settle.py looks at pairs of slave and
segment; write.py puts it into files.
"""

import dataclasses
import tempfile
from codecs import BOM_UTF8
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import schema
from .._core import SceneError
from ..arguments import check_folder_of
from ..errors import UsageError
from ..report import of_each_kind
from ..scene import Scene, escaped
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
        head = file.read(HEAD).removeprefix(BOM_UTF8)
    return next((one for one in LANGUAGES if one.recognises(path, head)), None)


def is_deck(path: Path) -> bool:
    try:
        return language(path) is not None
    except OSError:
        return False


def read(path: Path, ties: list[str] | None = None, free: tuple[str, ...] = ()) -> Imported:
    """Reads a deck. ties: names or ids of the ties to take, None: all; free: names or ids of parts or node sets whose
    masters the FMU moves itself. SceneError, one line "FILE: line N: /KEYWORD: message", on what is wrong; UsageError
    where there is no deck."""
    if not path.is_file():
        raise UsageError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}")
    reader = language(path)
    if reader is None:
        raise UsageError(
            f"{path}: is no deck; Radioss starter decks, LS-DYNA keyword decks and Abaqus or CalculiX input files with "
            "*TIE can be imported"
        )
    deck = reader.read(path, str(path), ties)
    untangle(deck)
    found = Imported(deck, to_scene.convert(deck, free))
    bodies = found.scene.tables.pop("interface", None)
    if found.scene.pairwise:
        settle(deck, found.scene, compiled(found))
    if bodies:
        keep_ports(found, bodies["ports"])
    return found


def keep_ports(found: Imported, ports: list[dict]):
    """Ports of rigid bodies that hold a node of the model; others lie on the ties' surfaces where nothing is tied."""
    nodes = compiled(found).model.report()["nodes"]["id"]
    kept = [port for port in ports if np.isin(found.scene.node_sets[port["nodes"]], nodes).any()]
    lone = [port["name"] for port in ports if port not in kept]
    if lone:
        found.deck.notes.append(f"no tie holds a node of {len(lone)} rigid bodies, the first is '{lone[0]}': no ports")
    if kept:
        found.scene.tables["interface"] = {"ports": kept}


def untangle(deck: Deck):
    """Ties of whole parts share nodes far from where they hold. Where that is so, ties with a tolerance per pair keep
    the slaves within it and the segments that these find."""
    if len(deck.ties) < 2:
        return
    slave, master = np.zeros((2, len(deck.node_id)), np.int64)
    for tie in deck.ties:
        slave[np.setdiff1d(tie.slaves, tie.faces.nodes)] += 1
        master[np.unique(tie.faces.nodes[tie.faces.nodes >= 0])] += 1
    shared = (slave > 1) | ((slave > 0) & (master > 0))
    for tie in deck.ties:
        corners = tie.faces.nodes
        crossed = bool((shared[corners] & (corners >= 0)).any())
        if tie.pairwise is None or not (crossed or shared[tie.slaves].any()):
            continue
        # the tie alone, without elements: its own distances
        slaves = np.setdiff1d(tie.slaves, corners)
        alone = Deck(deck.file, deck.language, units=deck.units, node_id=deck.node_id, position=deck.position)
        alone.ties = [dataclasses.replace(tie, slaves=slaves, adjust=False)]
        alone.added_mass = [(np.arange(len(deck.node_id)), 1.0)]
        try:
            found = Imported(alone, to_scene.convert(alone))
            segments, scene = found.scene.pairwise[tie.name]["segment"], compiled(found)
            settle(alone, found.scene, scene)
        except SceneError:
            continue  # none of them is near, which is said later
        kept = next(iter(found.scene.node_sets.values()))
        rows = scene.model.report()["slaves"]
        used = np.isin(segments, rows["segment"][np.isin(rows["id"], kept)])
        if len(kept) < len(slaves):
            lost = np.setdiff1d(deck.node_id[slaves], kept)
            deck.warn(
                f"{tie.where}: tie '{tie.name}': {len(lost)} slaves, the first is node {lost[0]}, are farther from the "
                "surface than their tolerance and are dropped"
            )
        tie.slaves = deck.nodes(kept, tie.where)
        if crossed and not used.all():
            tie.faces = tie.faces.take(used)
            deck.notes.append(
                f"tie '{tie.name}': of its {len(used)} segments the {used.sum()} that hold slaves are taken, as others "
                "belong to slaves of other ties"
            )


def load(path: Path, ties: list[str] | None = None, free: tuple[str, ...] = (), positions: bool = False) -> Scene:
    """The compiled Scene of a deck. positions: its FMU shows where its nodes are."""
    found = read(path, ties, free)
    scene = compiled(found)
    return compiled(found, scene.hidden_positions()) if positions else scene


def tables(path: Path, folder: Path) -> dict:
    """The tables of a deck's scene, whose mesh and node properties are written to `folder`."""
    return write.files(read(path), folder, path.stem, to_keep=False)


def compiled(found: Imported, expose: Sequence[str] = ()) -> Scene:
    path = Path(found.deck.file)
    with tempfile.TemporaryDirectory(prefix="tiefmu-") as folder:
        try:
            made = schema.parse(write.files(found, Path(folder), path.stem, to_keep=False))
            made.interface.expose += expose
            scene = Scene(found.deck.file, path.stem, made, Path(folder))
        except SceneError as error:
            raise SceneError(escaped(f"{found.deck.file}: {error}")) from None
    for remarks, lines in ((scene.notes, write.remarks(found.deck)), (scene.warnings, found.deck.warnings)):
        # The file is named by whoever shows a scene's remarks, and its folder is no matter of the FMU.
        remarks += [line.removeprefix(f"{path}: ").replace(str(path), path.name) for line in lines]
    return scene


def import_deck(deck: Path, scene: Path, ties: list[str] | None = None, free: tuple[str, ...] = ()) -> Imported:
    """Writes the scene of a deck: `scene` and, beside it, its mesh and its node properties."""
    check_folder_of(scene)
    found = read(deck, ties, free)
    made = compiled(found)  # what cannot be built is not written
    for line in of_each_kind(made.model.report()["warnings"], 10, f": tiefmu info {scene} --json"):
        found.deck.warn(f"{found.deck.file}: {line}")
    write.scene(found, scene)
    return found
