"""*SET_... and *DEFINE_BOX of an LS-DYNA deck, resolved when asked for."""

import numpy as np

from ...schema import shortened
from ..model import Deck, Faces
from ..selected import Selected
from ..surfaces import exterior, segments_of_nodes, shells_of
from .cards import Block
from .tables import Tables

# Sets of elements: keyword behind SET_ -> kinds.
ELEMENTS = {
    "SHELL": ("shell4", "shell3"),
    "SOLID": ("hex8", "tet4", "tet10"),
    "TSHELL": ("hex8",),
    "BEAM": ("beam", "truss", "spring"),
    "DISCRETE": ("spring",),
}
KINDS = ("NODE", "SEGMENT", "PART", *ELEMENTS)
NOT_READ = ("INTERSECT", "TREE", "ADVANCED", "SMOOTH")
RANGES = ("GENERATE", "INCREMENT")


class Sets:
    """The sets of a deck by kind (NODE, SEGMENT, PART, SHELL, ...) and id."""

    def __init__(self, deck: Deck, tables: Tables, blocks: list[Block], boxes: list[Block]):
        self.deck, self.tables = deck, tables
        self.blocks: dict[tuple[str, int], list[Block]] = {}
        self.boxes: dict[int, np.ndarray] = {}
        self.open: list[tuple[str, int]] = []
        for block in blocks:
            kind = block.words[1] if len(block.words) > 1 else ""
            if kind in KINDS:
                self.keep(kind, block)
        for block in boxes:
            self.box(block)

    def keep(self, kind: str, block: Block):
        first = self.first(block)
        number = block.id("set", block.read(first, "i")[0])
        same = self.blocks.setdefault((kind, number), [])
        if same and not (block.has("COLLECT") or same[0].has("COLLECT")):
            block.fail(f"{kind.lower()} set {number} is repeated; the first one stands in {same[0].where}", first)
        same.append(block)

    @staticmethod
    def first(block: Block) -> int:
        """The card with the id."""
        return 1 if block.has("TITLE") else 0

    def title(self, block: Block) -> str:
        return block.text(0) if block.has("TITLE") else ""

    def box(self, block: Block):
        card, step = self.first(block), 2 if block.has("TITLE") else 1
        if set(block.words) - {"DEFINE", "BOX", "TITLE"}:
            return  # boxes in axes of their own, or for other keywords
        while card < block.end:
            number, *sides = block.read(card, "irrrrrr")
            low, high = np.array(sides[::2]), np.array(sides[1::2])
            self.boxes[block.id("define", number)] = np.stack([low, high]) * block.origin.unit(length=1)
            card += step

    def inside(self, number: int, asker: Block) -> np.ndarray:
        """Which nodes a box holds."""
        if number not in self.boxes:
            asker.fail(f"box {number} is not in the deck")
        low, high = self.boxes[number]
        return ((self.deck.position >= low) & (self.deck.position <= high)).all(axis=1)

    def resolve(self, kind: str, number: int, asker: Block, read):
        """read(block) of each block of a set, guarded against circles."""
        key = (kind, number)
        if key not in self.blocks:
            asker.fail(f"{kind.lower()} set {number} is not in the deck")
        if key in self.open:
            asker.fail(f"{kind.lower()} set {number} holds itself")
        self.open.append(key)
        found = []
        for block in self.blocks[key]:
            for word in NOT_READ:
                if block.has(word):
                    block.fail(f"sets with {word} are not understood")
            found.append(read(block))
        self.open.pop()
        return found

    # what a set lists

    def listed(self, block: Block, what: str, universe: np.ndarray) -> np.ndarray:
        """Ids that a list, a column or ranges name; what: offset of the ids; universe: the ids that the deck has, from
        which ranges choose."""
        first = self.first(block) + 1
        if block.has("INCREMENT"):
            (begin, end, step), _ = block.table("iii", range(first, block.end))
            shift = getattr(block.origin, what)
            which = np.zeros(len(universe), bool)
            for a, b, c in zip((begin + shift).tolist(), (end + shift).tolist(), step.tolist()):
                which |= (universe >= a) & (universe <= b) & ((universe - a) % max(c, 1) == 0)
            return universe[which]
        if block.has("GENERATE"):
            (*columns,), _ = block.table("iiiiiiii", range(first, block.end))
            shift = getattr(block.origin, what)
            which = np.zeros(len(universe), bool)
            for a, b in zip(columns[::2], columns[1::2]):
                for begin, end in zip(a.tolist(), b.tolist()):
                    if begin or end:
                        which |= (universe >= begin + shift) & (universe <= (end or begin) + shift)
            return universe[which]
        if block.has("COLUMN"):
            (ids,), _ = block.table("i", range(first, block.end))
            return ids[ids != 0] + getattr(block.origin, what)
        return block.ids(first, what)

    def missing(self, block: Block, what: str, ids: np.ndarray, bad: np.ndarray):
        """Fails with the card that names the first missing id."""
        if bad.any():
            number = int(ids[np.argmax(bad)])
            word = str(number - getattr(block.origin, {"node": "node", "part": "part"}.get(what, "element"))).encode()
            cards = range(self.first(block) + 1, block.end)
            card = next((c for c in cards if word in block.lines[c].replace(b",", b" ").split()), None)
            block.fail(f"{what} {number} is not in the deck", card)

    def clauses(self, block: Block):
        """Word and numbers of each card of a _GENERAL set."""
        for card in range(self.first(block) + 1, block.end):
            word, *numbers = block.read(card, "siiiiiii")
            if word:
                yield word.upper(), numbers, card

    # nodes

    def nodes(self, number: int, asker: Block) -> np.ndarray:
        """Sorted node indices of a *SET_NODE."""
        return np.flatnonzero(self.node_mask(number, asker))

    def node_mask(self, number: int, asker: Block) -> np.ndarray:
        return np.logical_or.reduce(self.resolve("NODE", number, asker, self.nodes_of))

    def nodes_of(self, block: Block) -> np.ndarray:
        mask = np.zeros(len(self.deck.node_id), bool)
        if block.has("ADD"):
            for number in block.ids(self.first(block) + 1, "set").tolist():
                mask |= self.node_mask(number, block)
        elif block.has("GENERAL"):
            for word, numbers, card in self.clauses(block):
                self.general_nodes(mask, word, numbers, block, card)
        else:
            ids = self.listed(block, "node", self.deck.node_id)
            index = self.deck._find(ids)
            self.missing(block, "node", ids, index < 0)
            mask[index] = True
        return mask

    def general_nodes(self, mask: np.ndarray, word: str, numbers: list[int], block: Block, card: int):
        add, name = True, word
        if word.startswith("D") and word != "DISCRETE":
            add, name = False, word[1:]
        given = [number for number in numbers if number]
        if name == "ALL":
            which = np.ones(len(mask), bool)
        elif name == "NODE":
            ids = np.array(given, np.int64) + block.origin.node
            index = self.deck._find(ids)
            self.missing(block, "node", ids, index < 0)
            which = np.zeros(len(mask), bool)
            which[index] = True
        elif name == "BOX":
            which = np.logical_or.reduce([self.inside(block.id("define", n), block) for n in given])
        elif name == "PART":
            which = Selected.of_parts(self.deck, self.parts_known(given, block, card)).nodes(self.deck)
        elif name == "SET_NODE" or name == "SET_N":
            which = np.logical_or.reduce([self.node_mask(block.id("set", n), block) for n in given])
        elif name in ELEMENTS:
            ids = np.array(given, np.int64) + block.origin.element
            which = Selected.of_ids(self.deck, ELEMENTS[name], ids, block.fail).nodes(self.deck)
        else:
            block.fail(f"'{shortened(word)}' is not understood", card)
        if given or name == "ALL":
            mask[which] = add

    # parts

    def parts_known(self, given: list[int], block: Block, card: int | None = None) -> set[int]:
        ids = [block.id("part", number) for number in given]
        for number in ids:
            if number not in self.deck.parts:
                block.fail(f"part {number} is not in the deck", card)
        return self.tables.with_stand_ins(set(ids))

    def parts(self, number: int, asker: Block) -> set[int]:
        """Parts of a *SET_PART."""
        return set().union(*self.resolve("PART", number, asker, self.parts_of))

    def parts_of(self, block: Block) -> set[int]:
        if block.has("ADD"):
            return set().union(*(self.parts(n, block) for n in block.ids(self.first(block) + 1, "set").tolist()))
        if block.has("GENERAL"):
            found: set[int] = set()
            for word, numbers, card in self.clauses(block):
                known = self.parts_known([n for n in numbers if n], block, card)
                if word in ("PART", "ALL"):
                    found |= set(self.deck.parts) if word == "ALL" else known
                elif word == "DPART":
                    found -= known
                else:
                    block.fail(f"'{shortened(word)}' is not understood", card)
            return found
        universe = np.array(sorted(self.deck.parts), np.int64)
        ids = self.listed(block, "part", universe)
        self.missing(block, "part", ids, ~np.isin(ids, universe))
        return self.tables.with_stand_ins(set(ids.tolist()))

    # elements

    def elements(self, kind: str, number: int, asker: Block) -> Selected:
        """Elements of a *SET_SHELL, _SOLID, _BEAM, ..."""
        found = Selected({})
        for some in self.resolve(kind, number, asker, lambda block: self.elements_of(kind, block)):
            found = found.plus(some)
        return found

    def elements_of(self, kind: str, block: Block) -> Selected:
        deck, kinds, found = self.deck, ELEMENTS[kind], Selected({})
        if block.has("ADD"):
            for number in block.ids(self.first(block) + 1, "set").tolist():
                found = found.plus(self.elements(kind, number, block))
        elif block.has("GENERAL"):
            for word, numbers, card in self.clauses(block):
                add, name = (False, word[1:]) if word in ("DELEM", "DPART") else (True, word)
                given = [number for number in numbers if number]
                if name == "ALL":
                    some = Selected({k: np.ones(len(one.id), bool) for k, one in deck.elements.items()}).only(kinds)
                elif name in ("ELEM", kind):
                    ids = np.array(given, np.int64) + block.origin.element
                    some = Selected.of_ids(deck, kinds, ids, block.fail)
                elif name == "PART":
                    some = Selected.of_parts(deck, self.parts_known(given, block, card)).only(kinds)
                else:
                    block.fail(f"'{shortened(word)}' is not understood", card)
                found = found.plus(some) if add else found.minus(some)
        else:
            universe = np.concatenate([deck.elements[k].id for k in kinds if k in deck.elements] or [np.empty(0, int)])
            ids = self.listed(block, "element", universe)
            self.missing(block, "element", ids, ~np.isin(ids, universe))
            found = Selected.of_ids(deck, kinds, ids, block.fail)
        return found

    # surfaces

    def faces_of_parts(self, parts: set[int]) -> Faces:
        """Shells and outer faces of the solids of parts."""
        return self.faces_of_elements(Selected.of_parts(self.deck, parts))

    def faces_of_elements(self, selected: Selected) -> Faces:
        outer = exterior(self.deck, selected.kinds)
        outer.thickness = np.zeros(len(outer))  # a solid's face has no thickness in a contact
        return Faces.joined([shells_of(self.deck, selected.kinds), outer])

    def segments(self, number: int, asker: Block) -> Faces:
        """Faces of a *SET_SEGMENT."""
        return Faces.joined(self.resolve("SEGMENT", number, asker, self.segments_of))

    def segments_of(self, block: Block) -> Faces:
        first = self.first(block) + 1
        if block.has("ADD"):
            return Faces.joined([self.segments(n, block) for n in block.ids(first, "set").tolist()])
        if block.has("GENERAL"):
            return self.general_segments(block)
        if block.has(*RANGES):
            block.fail("segments in ranges are not understood")
        columns, cards = block.table("iiii", [card for card in range(first, block.end) if block.lines[card].strip()])
        return self.faces_of_nodes(np.stack(columns, axis=1), block, cards)

    def faces_of_nodes(self, nodes: np.ndarray, block: Block, cards) -> Faces:
        few = (nodes[:, :3] <= 0).any(axis=1)
        if few.any():
            block.fail("a segment has fewer than three nodes", int(cards[np.argmax(few)]))
        nodes = np.where(nodes == 0, 0, nodes + block.origin.node)
        index = self.deck._find(nodes)
        missing = (index < 0) & (nodes != 0)
        if missing.any():
            row = int(np.argmax(missing.any(axis=1)))
            block.fail(f"node {nodes[row][missing[row]][0]} is not in the deck", int(cards[row]))
        return Faces.joined([segments_of_nodes(self.deck, index)])

    def general_segments(self, block: Block) -> Faces:
        found = []
        for word, numbers, card in self.clauses(block):
            given = [number for number in numbers if number]
            if word == "ALL":
                found.append(self.faces_of_parts(set(self.deck.parts)))
            elif word == "PART":
                found.append(self.faces_of_parts(self.parts_known(given, block, card)))
            elif word == "SEG":
                found.append(self.faces_of_nodes(np.array([numbers[:4]], np.int64), block, [card]))
            elif word == "SHELL":
                ids = np.array(given, np.int64) + block.origin.element
                found.append(self.faces_of_elements(Selected.of_ids(self.deck, ELEMENTS["SHELL"], ids, block.fail)))
            elif word in ("SET_SEG", "SET_SEGMEN", "SET_SEGMENT"):
                found += [self.segments(block.id("set", number), block) for number in given]
            elif word in ("SET_SHELL", "SET_SOLID"):
                kind = word.removeprefix("SET_")
                found += [self.faces_of_elements(self.elements(kind, block.id("set", n), block)) for n in given]
            elif word == "BOX":
                every = self.faces_of_parts(set(self.deck.parts))
                found += [self.in_box(every, block.id("define", number), block) for number in given]
            else:
                block.fail(f"'{shortened(word)}' is not understood", card)
        return Faces.joined(found)

    def in_box(self, faces: Faces, number: int, asker: Block) -> Faces:
        """Faces of which all nodes lie in a box."""
        inside = self.inside(number, asker)
        return faces.take((inside[faces.nodes] | (faces.nodes < 0)).all(axis=1))
