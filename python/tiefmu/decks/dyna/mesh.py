"""Nodes and elements of an LS-DYNA deck."""

import numpy as np

from ..._core import SceneError
from ..model import Deck, Elements
from .cards import Block
from .tables import Tables
from .transform import Transformations

# Cards that an option adds to each element.
MORE = {
    "ELEMENT_SHELL": {"OFFSET": 1, "DOF": 1},
    "ELEMENT_SOLID": {"ORTHO": 2, "DOF": 1},
    "ELEMENT_TSHELL": {"BETA": 1},
    "ELEMENT_BEAM": {
        **{"THICKNESS": 1, "SCALAR": 1, "SCALR": 1, "SECTION": 1, "PID": 1, "OFFSET": 1, "ORIENTATION": 1},
        **{"WARPAGE": 1, "ELBOW": 1},
    },
}
THICK = ("THICKNESS", "BETA", "MCID")
NOT_READ = ("COMPOSITE", "LONG", "H20", "H27", "T15", "P21", "P40", "H64", "T20", "PERI", "NURBS")


def read_nodes(deck: Deck, blocks: list[Block], transformations: list[Block]) -> list[tuple[np.ndarray, int, int]]:
    """*NODE: fills node_id and position; returns groups of nodes that are held: (ids, code of translations, of
    rotations)."""
    ids, positions, source, held = [], [], [], []
    for number, block in enumerate(blocks):
        (node, x, y, z, tc, rc), _ = block.table("IRRRFF")
        node = node + block.origin.node
        ids.append(node)
        positions.append(np.stack([x, y, z], axis=1))
        source.append(np.full(len(node), number))
        if tc.any() or rc.any():
            for pair in np.unique(np.stack([tc, rc], axis=1), axis=0):
                if pair.any() and np.all((pair >= 0) & (pair <= 7)):
                    held.append((node[(tc == pair[0]) & (rc == pair[1])], int(pair[0]), int(pair[1])))
    if not ids or not sum(map(len, ids)):
        raise SceneError(f"{deck.file}: *NODE: the deck has no nodes")
    deck.node_id, deck.position = np.concatenate(ids), np.concatenate(positions)
    block_of = np.concatenate(source)
    bad = deck.node_id < 1
    if bad.any():
        first = int(np.argmax(bad))
        blocks[block_of[first]].fail(f"node {deck.node_id[first]}: is no id")
    moves = Transformations(deck, transformations)
    for number, block in enumerate(blocks):  # nodes by which others are placed stand where they are first
        if not block.origin.steps:
            continue
        mine = np.flatnonzero(block_of == number)
        deck.position[mine] = moves.place(deck.position[mine], block.origin)
    if not np.isfinite(deck.position).all():
        first = int(np.argmin(np.isfinite(deck.position).all(axis=1)))
        blocks[block_of[first]].fail(f"node {deck.node_id[first]}: is not finite")
    deck.merge_repeated_nodes("*NODE", lambda row, text: blocks[block_of[row]].fail(text))
    return held


class Collected:
    """Elements while they are read: groups of one kind, each with the block and the cards that it comes from."""

    def __init__(self, deck: Deck):
        self.deck = deck
        self.groups: dict[str, list[tuple]] = {}
        self.sides: dict[str, list[np.ndarray]] = {}

    def add(self, kind: str, block: Block, cards, ids, nodes, part, thickness=None, side=None):
        """ids, nodes and part with their offsets; nodes as indices. cards: where each element stands; side: of beams,
        see Elements.second_axis."""
        if not len(ids):
            return
        thickness = np.zeros(len(ids)) if thickness is None else thickness
        if side is not None:
            self.sides.setdefault(kind, []).append(side)
        self.groups.setdefault(kind, []).append((ids, nodes, part, thickness, block, cards))

    def finish(self):
        for kind, groups in self.groups.items():
            ids, nodes, part, thickness = (np.concatenate([group[i] for group in groups]) for i in range(4))
            order = np.argsort(ids, kind="stable")
            twice = order[1:][ids[order][1:] == ids[order][:-1]]
            if len(twice):
                ends = np.cumsum([len(group[0]) for group in groups])
                number = int(np.searchsorted(ends, twice[0], side="right"))
                *_, block, cards = groups[number]
                row = int(twice[0] - (ends[number - 1] if number else 0))
                block.fail(f"element {ids[twice[0]]} is repeated", int(cards[row]))
            side = np.concatenate(self.sides[kind]) if kind in self.sides else None
            self.deck.elements[kind] = Elements(kind, ids, nodes, part, thickness, side)


def known(deck: Deck, block: Block, cards, ids, part, nodes, optional: int) -> np.ndarray:
    """Indices of node ids (n, k); columns from `optional` on may be 0. Fails by name where an id, a node or a part is
    missing."""
    nodes = np.where(nodes == 0, 0, nodes + block.origin.node)
    bad = (nodes[:, :optional] <= 0).any(axis=1) | (nodes < 0).any(axis=1) | (ids <= block.origin.element)
    if bad.any():
        row = int(np.argmax(bad))
        block.fail(f"element {ids[row]}: a node or its id is missing", int(cards[row]))
    index = deck._find(nodes)
    missing = (index < 0) & (nodes != 0)
    if missing.any():
        row = int(np.argmax(missing.any(axis=1)))
        block.fail(f"element {ids[row]}: node {nodes[row][missing[row]][0]} is not in the deck", int(cards[row]))
    for number in np.unique(part).tolist():
        if number not in deck.parts:
            row = int(np.argmax(part == number))
            block.fail(f"element {ids[row]}: part {number} is not in the deck", int(cards[row]))
    return index


def extra_cards(block: Block, keyword: str) -> int:
    for word in NOT_READ:
        if block.has(word):
            block.fail(f"elements with {word} are not understood")
    return sum(count for word, count in MORE[keyword].items() if block.has(word))


def ends_at(block: Block, card: int, count: int) -> bool:
    """Whether the fields of an element's card behind the first `count` are blank or 0."""
    line = block.need(card)
    rest = line.split(b",")[count:10] if b"," in line else [line[count * block.width("I") : 10 * block.width("I")]]
    return not b"".join(rest).strip(b" 0\t\r")


def shells(deck: Deck, block: Block, found: Collected):
    """*ELEMENT_SHELL: corners; the mean thickness of the corners with _THICKNESS, _BETA or _MCID."""
    more, thick = extra_cards(block, "ELEMENT_SHELL"), block.has(*THICK)
    step, end = 1 + thick + more, block.end
    if step == 1:
        columns, cards = block.table("I" * 10)
    else:
        where, card = [], 0
        while card < end:
            where.append(card)
            card += step + (thick and not ends_at(block, card, 6))  # a card more where mid-side nodes are given
        cards = np.array(where, np.int64)
        columns, _ = block.table("I" * 10, cards)
        if thick and len(cards) and cards[-1] + 1 >= len(block.lines):
            block.fail("is cut off: its last element has no thickness", int(cards[-1]))
    if any(column.any() for column in columns[6:]):
        deck.warn(f"{block.where}: mid-side nodes are left aside; shells have the mass of their corners")
    ids, part = columns[0] + block.origin.element, columns[1] + block.origin.part
    nodes = known(deck, block, cards, ids, part, np.stack(columns[2:6], axis=1), 3)
    triangle = (nodes[:, 3] < 0) | (nodes[:, 3] == nodes[:, 2])
    thickness = np.zeros(len(ids))
    if thick and len(ids):
        own, _ = block.table("RRRR", cards + 1)
        own = np.stack(own, axis=1)
        own[triangle, 3] = 0.0
        given = (own > 0).sum(axis=1)
        if (own < 0).any():
            row = int(np.argmax((own < 0).any(axis=1)))
            block.fail(f"element {ids[row]}: its thickness is negative", int(cards[row]) + 1)
        thickness = own.sum(axis=1) / np.maximum(given, 1) * block.origin.unit(length=1)
    for kind, which, columns_of in (("shell4", ~triangle, 4), ("shell3", triangle, 3)):
        found.add(kind, block, cards[which], ids[which], nodes[which, :columns_of], part[which], thickness[which])


def solids(deck: Deck, block: Block, found: Collected):
    """*ELEMENT_SOLID and *ELEMENT_TSHELL: an element on one card, or its nodes on a second one."""
    keyword = "ELEMENT_TSHELL" if block.name.startswith("ELEMENT_TSHELL") else "ELEMENT_SOLID"
    more = extra_cards(block, keyword)
    if more:
        first, body, card = [], [], 0
        while card < block.end:
            first.append(card)
            card += ends_at(block, card, 2)
            body.append(card)
            card += 1 + more
        columns, cards = block.table("I" * 10, sorted({*first, *body}))
        heads, bodies = np.searchsorted(cards, first), np.searchsorted(cards, body)
        rows = np.stack(columns, axis=1)
    else:
        columns, cards = block.table("I" * 10)
        rows = np.stack(columns, axis=1)
        heads = bodies = np.arange(len(rows))
        alone = np.asarray(~rows[:, 2:].any(axis=1))
        if alone.any():
            first, body, row = [], [], 0
            while row < len(rows):
                first.append(row)
                row += int(alone[row])
                body.append(row)
                row += 1
            if body[-1] >= len(rows):
                block.fail("is cut off: the last element has no nodes", int(cards[-1]))
            heads, bodies = np.array(first), np.array(body)
    if not len(rows):
        return
    two = heads != bodies
    ids, part = rows[heads, 0] + block.origin.element, rows[heads, 1] + block.origin.part
    nodes = np.zeros((len(heads), 10), np.int64)
    nodes[~two, :8] = rows[bodies[~two], 2:]
    nodes[two] = rows[bodies[two]]
    nodes = known(deck, block, cards[bodies], ids, part, nodes, 4)
    cards = cards[bodies]
    ten = (nodes[:, 8:] >= 0).any(axis=1)
    found.add("tet10", block, cards[ten], ids[ten], nodes[ten], part[ten])
    eight = nodes[:, :8].copy()
    few = ~ten & (eight[:, 4:] < 0).all(axis=1)  # four nodes and blanks
    eight[few, 4:] = eight[few, 3:4]
    gaps = ~ten & (eight < 0).any(axis=1)
    if gaps.any():
        row = int(np.argmax(gaps))
        block.fail(f"element {ids[row]}: a node or its id is missing", int(cards[row]))
    fourth = (eight[:, 4:] == eight[:, 3:4]).all(axis=1) & ~ten  # N1 N2 N3 N4 N4 N4 N4 N4
    other = (eight[:, 4:] == eight[:, 4:5]).all(axis=1) & (eight[:, 2] == eight[:, 3]) & ~fourth & ~ten
    found.add("tet4", block, cards[fourth], ids[fourth], eight[fourth, :4], part[fourth])
    found.add("tet4", block, cards[other], ids[other], eight[other][:, [0, 1, 2, 4]], part[other])
    rest = ~fourth & ~other & ~ten
    found.add("hex8", block, cards[rest], ids[rest], eight[rest], part[rest])


def beams(deck: Deck, block: Block, found: Collected, tables: Tables):
    """*ELEMENT_BEAM: beams, trusses and discrete beams by the section of their part."""
    more = extra_cards(block, "ELEMENT_BEAM")
    if more:
        cards = np.arange(0, block.end, 1 + more)
        columns, _ = block.table("I" * 9, cards)
    else:
        columns, cards = block.table("I" * 9)
    if block.has("THICKNESS", "SECTION", "SCALAR", "SCALR"):
        deck.warn(f"{block.where}: sections of single elements are left aside; that of the part counts")
    if block.has("OFFSET"):
        deck.warn(f"{block.where}: offsets of beams are left aside")
    ids, part = columns[0] + block.origin.element, columns[1] + block.origin.part
    nodes = np.stack(columns[2:5], axis=1)
    released = np.stack(columns[5:9], axis=1).any(axis=1)
    if released.any():
        deck.warn(
            f"{block.at(int(cards[np.argmax(released)]))}: {released.sum()} beams let go of directions at an end (RT, "
            "RR), which is left aside"
        )
    grounded = nodes[:, 1] == 0
    if grounded.any():
        deck.warn(f"{block.at(int(cards[np.argmax(grounded)]))}: {grounded.sum()} beams have one node and are left out")
        cards, ids, part, nodes = cards[~grounded], ids[~grounded], part[~grounded], nodes[~grounded]
    index = known(deck, block, cards, ids, part, nodes, 2)
    side = sides_of_beams(deck, block, cards, index)
    kinds = {number: tables.beam_kind(number) for number in np.unique(part).tolist()}
    for kind in ("beam", "truss", "spring"):
        which = np.isin(part, [number for number, one in kinds.items() if one == kind])
        found.add(
            kind,
            block,
            cards[which],
            ids[which],
            index[which, :2],
            part[which],
            side=side[which] if kind == "beam" else None,
        )


def sides_of_beams(deck: Deck, block: Block, cards: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Where the second (s) axis of beams looks to: from N1 to N3, or the vector of _ORIENTATION; zeros where neither is
    given. index: N1, N2, N3."""
    if block.has("ORIENTATION"):
        words = block.words
        before = words[: words.index("ORIENTATION")]
        vectors, _ = block.table("rrr", cards + 1 + sum(MORE["ELEMENT_BEAM"].get(word, 0) for word in before))
        return np.stack(vectors, axis=1)
    third = np.where(index[:, 2] < 0, index[:, 0], index[:, 2])
    return deck.position[third] - deck.position[index[:, 0]]


def discrete(deck: Deck, block: Block, found: Collected, tables: Tables):
    """*ELEMENT_DISCRETE: springs and dampers between two nodes."""
    (number, pid, a, b, vid, scale, *_), cards = block.table("IIIIIRIR")
    ids, part = number + block.origin.element, pid + block.origin.part
    scale = np.where(scale == 0, 1.0, scale)
    aimless = (b == 0) & (vid == 0)
    if aimless.any():
        deck.warn(
            f"{block.at(int(cards[np.argmax(aimless)]))}: {aimless.sum()} springs to the ground without orientation "
            "have no direction and are left out"
        )
        ids, part, a, b, vid, scale, cards = (one[~aimless] for one in (ids, part, a, b, vid, scale, cards))
    index = known(deck, block, cards, ids, part, np.stack([a, b], axis=1), 1)
    own = np.stack([part.astype(float), vid.astype(float), scale], axis=1)
    for row in np.unique(own, axis=0):
        which = (own == row).all(axis=1)
        first = int(cards[np.argmax(which)])
        orientation = block.id("define", int(row[1]))
        stand_in = tables.spring_part(int(row[0]), row[2], orientation, block, first)
        found.add("spring", block, cards[which], ids[which], index[which], np.full(which.sum(), stand_in))
