"""What holds, moves and loads nodes in a Radioss deck: /BCS, /IMPVEL and the like, /RBODY, /ADMAS, /INIVEL, /GRAV."""

import numpy as np

from ..element_properties import shell_area, structural_mass
from ..model import Deck, Fixed, Initial, RigidBody
from .cards import Block
from .sets import Sets

DIRECTIONS = {"X": 0, "Y": 1, "Z": 2}


def group(sets: Sets, number: int, block: Block) -> np.ndarray:
    return sets.nodes(number + block.offsets.other, block)


def bcs(deck: Deck, sets: Sets, block: Block):
    _, cards = block.titled()
    for card in range(len(cards)):
        if not cards.need(card).strip():
            continue
        code, skew, number = cards.read(card, "sii")
        digits = code.replace(" ", "")
        if len(digits) != 6 or set(digits) - {"0", "1"}:
            block.fail(f"expected six digits 0 or 1 such as '111 000', found '{code}'", cards.first + card)
        held = [digit == "1" for digit in digits]
        if not number or not any(held):
            continue
        nodes = group(sets, number, block)
        if skew and not (all(held[:3]) or not any(held[:3])):
            deck.warn(f"{block.at(cards.first + card)}: its skew {skew} is left aside; directions are taken as global")
        deck.fixed.append(Fixed(nodes, tuple(held[:3]), tuple(held[3:]), block.where))


def imposed(deck: Deck, sets: Sets, block: Block):
    if not (block.word(1) or "0").isdecimal():
        deck.warn(f"{block.where}: is left aside; nodes that it moves are not known to be moved")
        return
    _, cards = block.titled()
    *_, number = cards.read(0, "isiii")
    if number:
        deck.imposed = np.union1d(deck.imposed, group(sets, number, block))


def rbody(deck: Deck, sets: Sets, block: Block):
    if not (block.word(1) or "0").isdecimal():
        deck.warn(f"{block.where}: is not understood; its nodes are treated as if it were not there")
        return
    title, cards = block.titled()
    main, _, _, _, mass, number, *_ = cards.read(0, "iiiiriiii")
    if not number:
        return
    nodes = group(sets, number, block)
    index = int(deck.nodes([main + block.offsets.node], block.where)[0]) if main else -1
    name = title or f"rigid body {block.id(1, 'other')}"
    deck.rigid.append(RigidBody(name, index, nodes, block.where))
    if mass and index >= 0:
        deck.added_mass.append((np.array([index]), mass))


def rbe2(deck: Deck, sets: Sets, block: Block):
    """A rigid link of a group to its node."""
    title, cards = block.titled()
    main, code, _, number = cards.read(0, "isii")
    if not number or not main:
        return
    directions = code.replace(" ", "")
    if directions.strip("0") and "0" in directions:
        deck.warn(f"{block.where}: joins directions {code} only; its nodes are treated as if it were not there")
        return
    nodes = group(sets, number, block)
    index = int(deck.nodes([main + block.offsets.node], block.where)[0])
    deck.rigid.append(RigidBody(title or f"rigid link {block.id(1, 'other')}", index, nodes, block.where))


def admas(deck: Deck, sets: Sets, block: Block):
    kind = block.word(1) if len(block.key) > 2 else "0"
    if not kind.isdecimal():
        block.fail(f"expected a type from 0 to 7, found '{kind}'")
    what, (_, cards) = int(kind), block.titled()
    if what in (0, 1):
        mass, number = cards.read(0, "ri")
        nodes = group(sets, number, block)
        if len(nodes):
            deck.added_mass.append((nodes, mass / len(nodes) if what == 1 else mass))
    elif what == 2:
        mass, number = cards.read(0, "ri")
        faces = sets.faces(number + block.offsets.other, block)
        four = np.where(faces.nodes < 0, faces.nodes[:, [2]], faces.nodes)
        area = shell_area(deck.position[four])
        corners = np.where(faces.nodes[:, 3] < 0, 3, 4)
        for column in range(4):
            given = faces.nodes[:, column] >= 0
            deck.added_mass.append((faces.nodes[given, column], (mass * area / corners)[given]))
    elif what == 5:
        for card in range(len(cards)):
            mass, node = cards.read(card, "ri")
            if node:
                deck.added_mass.append((deck.nodes([node + block.offsets.node], block.at(cards.first + card)), mass))
    elif what in (3, 4):
        mass, number = cards.read(0, "ri")
        spread_mass(deck, block, cards.first, mass, sets.parts_of_group(number + block.offsets.other, block), what == 4)
    elif what in (6, 7):
        for card in range(len(cards)):
            mass, part = cards.read(card, "ri")
            if part:
                part += block.offsets.part
                if part not in deck.parts:
                    block.fail(f"part {part} is not in the deck", cards.first + card)
                spread_mass(deck, block, cards.first + card, mass, {part}, what == 7)
    else:
        block.fail(f"expected a type from 0 to 7, found '{kind}'")


def spread_mass(deck: Deck, block: Block, card: int, mass: float, parts: set[int], final: bool):
    """Adds a mass, or what is missing to a final one, in proportion to the parts' own: addmaspart.F."""
    own = structural_mass(deck, parts)
    whole = own.sum()
    if final:
        if mass <= whole:
            block.fail(f"its final mass {mass:g} is not more than that of its parts, {whole:g}", card)
        mass -= whole
    if not whole > 0:
        deck.warn(f"{block.at(card)}: its parts have no mass, and nothing is added")
        return
    nodes = np.flatnonzero(own)
    deck.added_mass.append((nodes, mass * own[nodes] / whole))


def inivel(deck: Deck, sets: Sets, block: Block):
    kind = block.word(1)
    _, cards = block.titled()
    if kind not in ("TRA", "ROT", "T+G"):
        if kind not in ("GRID", "FVM"):
            deck.warn(f"{block.where}: its start velocities are not taken; give them as [[initial]]")
        return
    *vector, number, skew = cards.read(0, "rrrii")
    if skew:
        deck.warn(
            f"{block.where}: its start velocities stand in skew {skew} and are not taken; give them as [[initial]]"
        )
        return
    nodes = group(sets, number, block) if number else np.arange(len(deck.node_id))
    values = np.array(vector)
    deck.initial.append(
        Initial(nodes, w=values, where=block.where) if kind == "ROT" else Initial(nodes, v=values, where=block.where)
    )


def grav(deck: Deck, sets: Sets, block: Block, functions: dict[int, np.ndarray]):
    _, cards = block.titled()
    function, direction, skew, _, number, _, scale = cards.read(0, "isiii.rr")
    axis = DIRECTIONS.get(direction.upper())
    if axis is None or skew:
        deck.warn(f"{block.where}: gravity along '{direction}' in skew {skew} is not taken; give [model] gravity")
        return
    values = np.ones(1)
    if function:
        curve = functions.get(function + block.offsets.other)
        if curve is None or not len(curve):
            block.fail(f"function {function} is not in the deck")
        values = curve[:, 1]
    if np.ptp(values) > 1e-9 * max(abs(values).max(), 1e-300):
        deck.warn(f"{block.where}: gravity changes with time (function {function}) and is not taken")
        return
    if number:
        nodes = group(sets, number, block)
        if len(nodes) < len(deck.node_id):
            deck.warn(f"{block.where}: gravity acts on node group {number} only; it is taken for all nodes")
    if deck.gravity is None:
        deck.gravity = np.zeros(3)
    deck.gravity[axis] += (scale or 1.0) * float(values[0])


def functions_of(blocks: list[Block]) -> dict[int, np.ndarray]:
    """/FUNCT: id -> points (n, 2)."""
    found = {}
    for block in blocks:
        _, cards = block.titled()
        _, points, _ = cards.table(0, 2)
        found[block.id(1, "other")] = points
    return found


def skews_of(blocks: list[Block]) -> dict[int, np.ndarray]:
    """/SKEW/FIX: id -> axes as rows (3, 3)."""
    found = {}
    for block in blocks:
        if block.word(1) != "FIX":
            continue
        _, cards = block.titled()
        first = 1 if len([1 for i in range(len(cards)) if cards.need(i).strip()]) > 2 else 0
        y, z = np.array(cards.read(first, "rrr")), np.array(cards.read(first + 1, "rrr"))
        if not np.linalg.norm(y) or not np.linalg.norm(np.cross(y, z)):
            block.fail("its axes do not span a frame")
        x = np.cross(y, z)
        z = np.cross(x, y)
        found[block.id(2, "other")] = np.stack([one / np.linalg.norm(one) for one in (x, y, z)])
    return found
