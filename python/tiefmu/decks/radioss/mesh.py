"""Nodes, elements and parts of a Radioss deck, and what moves nodes before the start (/TRANSFORM)."""

import numpy as np

from ..._core import SceneError
from ..model import KINDS, Deck, Elements, Part
from .cards import Block

# keyword -> kind, cards of an element, columns of node ids
ELEMENTS = {
    "SHELL": ("shell4", 1, 4),
    "SH3N": ("shell3", 1, 3),
    "BRICK": ("hex8", 1, 8),
    "TETRA4": ("tet4", 1, 4),
    "TETRA10": ("tet10", 2, 10),
    "PENTA6": ("wedge6", 1, 6),
    "SPRING": ("spring", 1, 2),
    "TRUSS": ("truss", 1, 2),
    "BEAM": ("beam", 1, 2),
}


def read_nodes(deck: Deck, blocks: list[Block]) -> np.ndarray:
    """/NODE and /CNODE: fills node_id and position; returns the number of the block of each node."""
    ids, positions, source = [], [], []
    for number, block in enumerate(blocks):
        whole, real, _ = block.cards().table(1, 3)
        ids.append(whole[:, 0] + block.offsets.node)
        positions.append(real)
        source.append(np.full(len(whole), number))
    if not ids:
        raise SceneError(f"{deck.file}: /NODE: the deck has no nodes")
    deck.node_id, deck.position = np.concatenate(ids), np.concatenate(positions)
    block_of = np.concatenate(source)
    for bad, words in ((deck.node_id < 1, "is no id"), (~np.isfinite(deck.position).all(axis=1), "is not finite")):
        if bad.any():
            first = int(np.argmax(bad))
            blocks[block_of[first]].fail(f"node {deck.node_id[first]}: {words}")
    return block_of[deck.merge_repeated_nodes("/NODE", lambda row, text: blocks[block_of[row]].fail(text))]


def read_elements(deck: Deck, blocks: list[Block]):
    """/SHELL and so on, block by block: fills elements."""
    found: dict[str, list] = {}
    sides = []  # of beams: from the first node to the third, which their second axis looks to
    for block in blocks:
        kind, cards, columns = ELEMENTS[block.key[0]]
        columns += kind == "beam"
        part = block.id(1, "part")
        if cards == 1:
            thick = kind in ("shell4", "shell3")
            blank = {"shell4": 1, "shell3": 2}.get(kind, 0)
            whole, real, index = block.cards().table(columns + 1, 2 if thick else 0, blank=blank)
            nodes = whole[:, 1:]
            thickness = real[:, 1] if thick else np.zeros(len(whole))
        else:
            rows = block.cards().without_blanks()
            if len(rows) % 2:
                block.fail("is cut off: an element takes two cards", len(rows) - 1)
            whole, _, index = rows.table(1, start=0, step=2)
            nodes, _, _ = rows.table(columns, start=1, step=2)
            thickness = np.zeros(len(whole))
        ids = whole[:, 0] + block.offsets.element
        if block.offsets.node:
            nodes = np.where(nodes == 0, 0, nodes + block.offsets.node)
        optional = {"tet10": 4, "shell4": 3, "beam": 2}.get(kind, columns)
        bad = (nodes[:, :optional] <= 0).any(axis=1) | (whole[:, 0] <= 0)
        if bad.any():
            first = int(np.argmax(bad))
            block.fail(f"element {ids[first]}: a node or its id is missing", int(index[first]))
        try:
            corners = deck.nodes(nodes, "")
        except SceneError:
            missing = (deck._find(nodes) < 0) & (nodes != 0)
            first = int(np.argmax(missing.any(axis=1)))
            node = nodes[first][missing[first]][0]
            block.fail(f"element {ids[first]}: node {node} is not in the deck", int(index[first]))
        if part not in deck.parts and len(ids):
            block.fail(f"element {ids[0]}: part {part} is not in the deck", int(index[0]))
        if kind == "beam":
            third = np.where(nodes[:, 2] > 0, corners[:, 2], corners[:, 0])
            sides.append(deck.position[third] - deck.position[corners[:, 0]])
            corners = corners[:, :2]
        found.setdefault(kind, []).append((ids, corners, np.full(len(ids), part), thickness, block))
    for kind, groups in found.items():
        ids, nodes, of_part, thickness = (np.concatenate([group[i] for group in groups]) for i in range(4))
        order = np.argsort(ids, kind="stable")
        twice = order[1:][ids[order][1:] == ids[order][:-1]]
        if len(twice):
            ends = np.cumsum([len(group[0]) for group in groups])
            block = groups[int(np.searchsorted(ends, twice[0], side="right"))][4]
            block.fail(f"element {ids[twice[0]]} is repeated")
        side = np.concatenate(sides) if kind == "beam" else None
        deck.elements[kind] = Elements(kind, ids, nodes, of_part, thickness, side)


def read_parts(deck: Deck, blocks: list[Block]) -> dict[int, int]:
    """/PART: fills parts; returns part -> subset."""
    subsets = {}
    for block in blocks:
        number = block.id(1, "part")
        title, cards = block.titled()
        prop, material, subset, thickness = cards.read(0, "iiir")
        if number in deck.parts:
            block.fail(f"part {number} is repeated; the first one stands in {deck.parts[number].where}")
        offsets = block.offsets
        deck.parts[number] = Part(
            number,
            title,
            prop + offsets.property if prop else 0,
            material + offsets.material if material else 0,
            thickness,
            block.where,
        )
        if subset:
            subsets[number] = subset + offsets.other
    return subsets


def check_references(deck: Deck):
    """Properties and materials of parts that have elements exist."""
    for elements in deck.elements.values():
        for number in np.unique(elements.part).tolist():
            part = deck.parts[number]
            if part.property not in deck.properties:
                raise SceneError(f"{part.where}: property {part.property} is not in the deck")
            if elements.kind != "spring" and part.material not in deck.materials:
                raise SceneError(f"{part.where}: material {part.material} is not in the deck")


def transform(deck: Deck, blocks: list[Block], node_block: np.ndarray, node_blocks: list[Block], group):
    """/TRANSFORM, submodels first as the starter does, then node groups. group(id, block): node indices."""
    moves = []
    for block in blocks:
        kind = block.word(1)
        _, cards = block.titled()
        layout = {"TRA": "irrriii", "ROT": "irrriii", "SYM": "irrriii", "SCA": "irrriii", "MATRIX": "irrrri"}.get(kind)
        if layout is None:
            block.fail("is not understood and would move nodes; TRA, ROT, SYM, SCA and MATRIX are")
        first = cards.read(0, layout)
        sub = first[-1]
        if sub and first[0]:
            block.fail("names a node group and a submodel; it can move one of them")
        if not sub and not first[0]:
            block.fail("names neither a node group nor a submodel")
        moves.append((not sub, block, cards, kind, first, sub))
    for _, block, cards, kind, first, sub in sorted(moves, key=lambda move: move[0]):
        if sub:
            inside = np.array([sub in one.offsets.inside for one in node_blocks])
            nodes = np.flatnonzero(inside[node_block])
            if not len(nodes):
                block.fail(f"submodel {sub} holds no nodes")
        else:
            nodes = group(first[0] + block.offsets.other, block)
        x = deck.position
        x[nodes] = moved(deck, block, cards, kind, first, x[nodes])
    if moves:
        deck.notes.append(f"/TRANSFORM: {len(moves)} of them moved nodes before anything else")


def moved(deck: Deck, block: Block, cards, kind: str, first: list, x: np.ndarray) -> np.ndarray:
    """Positions x (n, 3) after one transformation."""

    def at(node: int) -> np.ndarray:
        return deck.position[deck.nodes([node + block.offsets.node], block.where)[0]]

    if kind == "MATRIX":
        rows = [first[1:5], cards.read(1, ".rrrr"), cards.read(2, ".rrrr")]
        matrix = np.array(rows)
        if np.abs(matrix[:, :3] @ matrix[:, :3].T - np.eye(3)).max() > 2e-3:
            block.fail("its matrix does not turn rigidly")
        return x @ matrix[:, :3].T + matrix[:, 3]
    p, node1, node2 = np.array(first[1:4]), first[4], first[5]
    if kind == "SCA":
        centre = at(node1) if node1 else np.zeros(3)
        factors = np.where(p == 0, 1.0, p)
        return centre + factors * (x - centre)
    if kind == "TRA":
        return x + (at(node2) - at(node1) if node1 and node2 else p)
    second = cards.read(1, ".rrrr")
    p, q = (at(node1), at(node2)) if node1 and node2 else (p, np.array(second[:3]))
    axis = q - p
    length = np.linalg.norm(axis)
    if not length:
        block.fail("its two points are one")
    axis = axis / length
    if kind == "SYM":
        return x - 2 * ((x - p) @ axis)[:, None] * axis
    angle = np.radians(second[3])
    r = x - p
    along = (r @ axis)[:, None] * axis
    return p + along + np.cos(angle) * (r - along) + np.sin(angle) * np.cross(axis, r)


assert set(KINDS) >= {kind for kind, _, _ in ELEMENTS.values()}
