"""Abaqus and CalculiX input files: from the file to a Deck.

The mesh is read by mesh/abaqus.py, as for scenes; docs/decks_abaqus.md lists the keywords.
"""

import mmap
import re
from pathlib import Path

import numpy as np

from ..._core import SceneError
from .. import units
from ..model import Deck
from . import elements, loads, springs, ties
from .keywords import CONNECTORS, KNOWN, REASON, REFUSED_PLAIN, WARNING, plain
from .source import Source
from .surfaces import nodes_of_rows

TIE = re.compile(rb"\*[ \t]*(?:tie|include)[ \t]*(?:,|\r?\n|\Z)", re.IGNORECASE)
# Keywords that CalculiX decks have and Abaqus/CAE does not write.
CALCULIX = {"NODEFILE", "ELFILE", "CONTACTFILE", "FACEPRINT", "SECTIONPRINT"}


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is an input file with ties, or with includes where they may be: a mesh alone is no deck."""
    lines = map(bytes.strip, head.split(b"\n"))
    first = next((line for line in lines if line and line[:2] != b"**"), b"")
    if first[:1] != b"*" or first[:8].upper() == b"*KEYWORD":
        return False
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        return any(not text[text.rfind(b"\n", 0, one.start()) + 1 : one.start()].strip() for one in TIE.finditer(text))


def read(path: Path, file: str, wanted: list[str] | None = None) -> Deck:
    """The deck, with the ties named in `wanted`, or all of them. SceneError on the first thing that is wrong:
    "FILE: line N: *KEYWORD: message"."""
    with np.errstate(all="ignore"):  # what is not finite is found by name
        source = Source(path, file)
        deck = source.deck
        if not len(deck.node_id):
            raise SceneError(f"{file}: *NODE: the deck has no nodes")
        bad = np.flatnonzero(~(np.abs(deck.position) < 1e30).all(axis=1))
        if len(bad):
            raise SceneError(f"{file}: *NODE: node {deck.node_id[bad[0]]}: a coordinate is not a finite number")
        refuse(source)
        if not source.input.instances and any(block.key in CALCULIX for _, block in source.cards()):
            deck.language = "CalculiX"
        deck.title = title(source)
        elements.read(source)
        springs.read(source)
        units.check(deck, file, False)
        ties.read(source, wanted)
        loads.masses(source)
        loads.boundaries(source)
        loads.rigid_bodies(source)
        loads.initial(source)
        loads.gravity(source)
        loads.loaded_slaves(source)
    deck.lookup = lambda name: lookup(source, name)
    say_what_is_left(source)
    return deck


def title(source: Source) -> str:
    for _, block in source.cards("HEADING"):
        return next((line.strip() for line in block.lines if line.strip()), "")
    return ""


def refuse(source: Source):
    for _, block in source.cards():
        if plain(block.key) in REFUSED_PLAIN:
            block.fail(REFUSED_PLAIN[plain(block.key)])


def lookup(source: Source, name: str) -> np.ndarray | None:
    """Node indices of an instance, node set, element set or surface called `name`; None where there is none."""
    deck, assembly, name = source.deck, source.assembly, name.strip()
    if name.upper() in assembly.by_name:
        scope = assembly.by_name[name.upper()]
        return deck.nodes(scope.node_ids() + scope.offset, deck.file)
    for sets in (source.mesh.node_sets, source.mesh.element_sets):
        if name in sets:
            if sets is source.mesh.node_sets:
                return deck.nodes(sets[name], deck.file)
            rows = sets[name]
            return np.unique(nodes_of_rows(source, rows))
    parts = {
        scope.name: scope for scope in assembly.scopes if scope.instance and scope.instance.part.upper() == name.upper()
    }
    if parts:
        ids = np.concatenate([scope.node_ids() + scope.offset for scope in parts.values()])
        return deck.nodes(ids, deck.file)
    return None


def say_what_is_left(source: Source):
    """Nothing is dropped in silence: a reason, or a warning with the line."""
    deck, seen = source.deck, set()
    for _, block in source.cards():
        if id(block) in seen:  # once, however many instances its part has
            continue
        seen.add(id(block))
        name = plain(block.key)
        if name in KNOWN:
            continue
        if name in REASON:
            deck.ignored.setdefault(f"*{block.keyword}", [REASON[name], 0])[1] += 1
        elif name in WARNING:
            deck.warn(f"{block.where}: is not read; {WARNING[name]}")
        elif name.startswith("CONNECTOR"):
            deck.warn(f"{block.where}: {CONNECTORS}")
        else:
            deck.warn(f"{block.where}: is not understood and is left aside")
    steps = source.steps()
    if steps:
        deck.notes.append(
            "of the steps, conditions and gravity of the first are taken"
            + (f"; {steps - 1} later ones are left aside" if steps > 1 else "")
        )
