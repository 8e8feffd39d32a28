"""Elements of an input file, by family, into the deck."""

import re
from dataclasses import dataclass

import numpy as np

from ..._core import SceneError
from ..model import KINDS, Elements
from .sections import Sections
from .source import Source

# Types, by how they begin; what follows names the integration, hybrid, thermal and other variants.
FAMILIES = [
    (r"S3|STRI3", "shell3"),
    (r"S4", "shell4"),
    (r"S8", "shell8"),
    (r"S9", "shell9"),
    (r"S6|STRI65", "shell6"),
    (r"M3D3", "membrane3"),
    (r"M3D4", "membrane4"),
    (r"M3D6", "membrane6"),
    (r"M3D8", "membrane8"),
    (r"M3D9", "membrane9"),
    (r"C3D4", "tet4"),
    (r"C3D10", "tet10"),
    (r"C3D5", "pyramid"),
    (r"C3D6|SC6R|CSS6", "wedge6"),
    (r"C3D8|SC8R|CSS8", "hex8"),
    (r"C3D15", "wedge15"),
    (r"C3D20", "hex20"),
    (r"T3D2", "truss"),
    (r"T3D3", "truss3"),
    (r"B3[13]|PIPE31", "beam"),
    (r"B32|PIPE32", "beam3"),
]
KINDS_OF = [(re.compile(f"(?:{begins})(?![0-9])"), kind) for begins, kind in FAMILIES]
# No mass and no stiffness of their own, but faces: rigid and surface elements.
MASSLESS = re.compile(r"(?:R3D|SFM3D)([34689])")
POINTS = {"MASS", "ROTARYI", "SPRINGA", "SPRING1", "SPRING2", "DASHPOTA", "DASHPOT1", "DASHPOT2"}  # read elsewhere
FULL = {"S4", "S4T"}  # fully integrated four-node shells


@dataclass
class Family:
    """kind: a key of KINDS, or "" for what adds nothing; full: fully integrated shell; massless: faces only."""

    kind: str
    full: bool = False
    massless: bool = False


def family(kind: str) -> Family:
    kind = kind.upper()
    match = MASSLESS.match(kind)
    if match:
        return Family(f"membrane{match[1]}", massless=True)
    for begins, name in KINDS_OF:
        if begins.match(kind):
            return Family(name, full=kind in FULL)
    return Family("")


def read(source: Source):
    """Fills deck.elements, and gives the deck the parts of their sections."""
    deck, assembly = source.deck, source.assembly
    sections = Sections(source)
    found: dict[str, list[Elements]] = {}
    unread: dict[str, list] = {}
    for number, (block, card) in enumerate(zip(assembly.blocks, assembly.cards)):
        nodes = indices(source, block, card)
        one = family(card.get("TYPE"))
        source.nodes_of_block.append(nodes)
        start = assembly.first_row[number]
        rows = np.arange(start, start + len(block.ids))
        if not one.kind:
            if card.get("TYPE").upper() not in POINTS and len(rows):
                unread.setdefault(card.get("TYPE").upper(), [card, 0])[1] += len(rows)
            continue
        parts = sections.parts(card, one, rows)
        source.part_of_row[rows] = parts
        thickness = np.zeros(len(rows))
        for kind, some in as_kinds(one.kind, complete(block, card, one.kind, nodes)):
            elements = Elements(kind, block.ids, some, parts, thickness)
            found.setdefault(kind, []).append(elements)
            if kind.startswith(("shell", "membrane")):
                source.thickness_of_row[rows] = deck.thickness(elements)
    for kind, pieces in found.items():
        deck.elements[kind] = Elements(
            kind, *(np.concatenate([getattr(p, key) for p in pieces]) for key in ("id", "nodes", "part", "thickness"))
        )
    for name, (card, count) in unread.items():
        deck.warn(f"{card.where}: {count} elements of type {name} are not read; they add no mass and no stiffness")
    sections.finish()


def indices(source: Source, block, card) -> np.ndarray:
    """Node indices (n, k) of a block of elements; -1 where a record has fewer."""
    nodes = source.deck._find(block.nodes)
    bad = (nodes < 0) & (block.nodes != 0)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        where = card.at(row) if len(card.lines) == len(block.ids) else card.where
        source.deck.nodes(block.nodes[row], f"{where}: element {block.ids[row]}")
    return nodes


def complete(block, card, kind: str, nodes: np.ndarray) -> np.ndarray:
    """The same; fails where a node is missing that an element of the kind must have."""
    need = {"pyramid": 5, "truss3": 3, "beam3": 3}.get(kind) or KINDS[kind]
    least = 3 if kind == "shell4" or kind == "membrane4" else need
    if nodes.shape[1] < need or (nodes[:, :least] < 0).any():
        row = int(np.argmax((nodes[:, :least] < 0).any(axis=1))) if len(nodes) else 0
        where = card.at(row) if len(card.lines) == len(block.ids) else card.where
        raise SceneError(f"{where}: element {block.ids[row]}: a node is missing")
    return nodes


def as_kinds(kind: str, nodes: np.ndarray):
    """(kind of the deck, nodes) of elements; a pyramid is a brick with repeated nodes, a line of three nodes two."""
    if kind == "pyramid":
        yield "hex8", nodes[:, [0, 1, 2, 3, 4, 4, 4, 4]]
    elif kind in ("truss3", "beam3"):
        for ends in ([0, 1], [1, 2]):
            yield kind[:-1], nodes[:, ends]
    else:
        yield kind, nodes[:, : KINDS[kind]]
