"""*SPRING and *DASHPOT of an input file, with *ORIENTATION."""

import numpy as np

from ...mesh.abaqus_cards import Block
from ..model import Elements, Part, Property
from .source import Source

AXIAL, GROUND = ("SPRINGA", "DASHPOTA"), ("SPRING1", "DASHPOT1")
TYPES = (*AXIAL, *GROUND, "SPRING2", "DASHPOT2")


def read(source: Source):
    """Adds the springs to deck.elements."""
    deck, assembly = source.deck, source.assembly
    frames = orientations(source)
    behaviour = np.full(len(source.element_id), -1)
    blocks: list[Block] = []
    for scope, block in source.cards("SPRING", "DASHPOT"):
        rows = source.rows(scope, block.need("ELSET"), block)
        behaviour[rows] = len(blocks)
        blocks.append(block)
    known: dict[tuple, int] = {}
    pieces = []
    for number, (elements, card) in enumerate(zip(assembly.blocks, assembly.cards)):
        kind = card.get("TYPE").upper()
        if kind not in TYPES or not len(elements.ids):
            continue
        start, nodes = assembly.first_row[number], source.nodes_of_block[number]
        mine = behaviour[start : start + len(elements.ids)]
        if (mine < 0).any():
            lone = elements.ids[np.argmax(mine < 0)]
            deck.warn(
                f"{card.where}: {(mine < 0).sum()} elements, the first is {lone}, have no stiffness and are left out"
            )
        ends = np.full((len(nodes), 2), -1)
        ends[:, : min(2, nodes.shape[1])] = nodes[:, :2]
        if kind in GROUND:
            ends[:, 1] = -1
        missing = (ends[:, 0] < 0) | ((ends[:, 1] < 0) & (kind not in GROUND))
        if missing.any():
            row = int(np.argmax(missing))
            card.fail(f"element {elements.ids[row]}: a node is missing", row if len(card.lines) == len(nodes) else None)
        for chosen in np.unique(mine[mine >= 0]):
            key = (int(chosen), kind)
            if key not in known:
                known[key] = part_of(source, blocks[chosen], kind, frames)
            if known[key]:
                some = mine == chosen
                count = int(some.sum())
                pieces.append((elements.ids[some], ends[some], np.full(count, known[key]), np.zeros(count)))
    if pieces:
        deck.elements["spring"] = Elements("spring", *map(np.concatenate, zip(*pieces)))


def part_of(source: Source, block: Block, kind: str, frames: dict[str, int]) -> int:
    """The part of these springs; 0 where they cannot be read."""
    deck = source.deck
    axis = 0 if kind in AXIAL else freedom(source, block, kind)
    if axis is None:
        return 0
    size = coefficient(source, block, 0 if kind in AXIAL else 1)
    values = {"mass": 0.0, "inertia": 0.0, "type": "axial", "turning": False}
    vectors = {name: np.zeros(3) for name in ("stiffness", "damping", "rotational_stiffness", "rotational_damping")}
    vectors[("rotational_" if axis >= 3 else "") + ("stiffness" if block.key == "SPRING" else "damping")][axis % 3] = (
        size
    )
    if kind not in AXIAL:
        values |= {"type": "general", "turning": axis >= 3}
        if block.get("ORIENTATION"):
            if block.get("ORIENTATION").upper() not in frames:
                block.fail(f"orientation '{block.get('ORIENTATION')}' is not in the deck")
            values["skew"] = frames[block.get("ORIENTATION").upper()]
    number = max(deck.parts, default=0) + 1
    deck.properties[number] = Property(number, "spring", kind, values=values | vectors, where=block.where)
    title = block.get("ELSET")
    deck.parts[number] = Part(number, title, number, where=block.where, name=f"springs '{title}'")
    return number


def freedom(source: Source, block: Block, kind: str) -> int | None:
    """The degree of freedom that a spring of fixed direction acts on, from 0; None, with a warning, for none."""
    row = block.data(0)
    freedoms = [int(value) for value in (row if kind not in GROUND else row[:1])[:2] if np.isfinite(value)]
    if not freedoms or not all(1 <= one <= 6 for one in freedoms):
        block.fail("expected its degrees of freedom, 1 to 6", 0 if block.lines else None)
    if len(set(freedoms)) > 1:
        source.deck.warn(f"{block.where}: couples degrees of freedom {freedoms[0]} and {freedoms[1]}; it is left out")
        return None
    return freedoms[0] - 1


def coefficient(source: Source, block: Block, first: int) -> float:
    """Stiffness or damping; of a nonlinear one its slope at rest. first: of the data lines that are not blank; blank
    is the line of the degrees of freedom of axial ones."""
    lines = [line for line, items in block.rows() if any(items)][first:]
    if not block.has("NONLINEAR"):
        if not lines:
            block.fail("has no stiffness" if block.key == "SPRING" else "has no damping")
        value = block.data(lines[0])[0]
    else:
        points = np.array([(block.data(line) + [0.0, 0.0])[:2] for line in lines])
        if len(points) < 2:
            block.fail("expected at least two points of force and displacement")
        points = points[np.argsort(points[:, 1], kind="stable")]
        right = int(np.clip(np.searchsorted(points[:, 1], 0.0, side="right"), 1, len(points) - 1))
        (f0, x0), (f1, x1) = points[right - 1], points[right]
        value = (f1 - f0) / (x1 - x0) if x1 > x0 else np.nan
        source.deck.warn(f"{block.where}: is nonlinear; its slope at rest, {value:g}, is taken")
    if not 0 <= value < np.inf:
        block.fail(f"{value:g} is no {'stiffness' if block.key == 'SPRING' else 'damping'}")
    return float(value)


def orientations(source: Source) -> dict[str, int]:
    """Rectangular *ORIENTATION, by name in capitals: the id of its axes in deck.frames."""
    found = {}
    for _, block in source.cards("ORIENTATION"):
        name = block.get("NAME").upper()
        if block.get("SYSTEM", "RECTANGULAR").upper() != "RECTANGULAR" or block.get(
            "DEFINITION", "COORDINATES"
        ).upper() != ("COORDINATES"):
            continue
        points = (block.data() + [0.0] * 9)[:9]
        a, b, c = np.array(points).reshape(3, 3)
        x, y = a - c, b - c
        z = np.cross(x, y)
        if not np.linalg.norm(z) > 0:
            block.fail("its axes do not span a frame", 0 if block.lines else None)
        y = np.cross(z, x)
        number = len(source.deck.frames) + 1
        source.deck.frames[number] = np.stack([axis / np.linalg.norm(axis) for axis in (x, y, z)])
        found[name] = number
    return found
