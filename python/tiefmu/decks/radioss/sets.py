"""Sets of a Radioss deck, resolved when asked for: /GRNOD, /GRSHEL and the like, /GRPART, /SURF, /SET, /BOX."""

import numpy as np

from ..model import Deck, Faces
from ..selected import Selected, combine
from ..surfaces import all_faces, exterior, segments_of_nodes, shells_of
from .cards import Block

# Groups of elements: keyword -> kinds of elements, and the words by which the type names single elements.
GROUPS = {
    "GRSHEL": ("shell4",),
    "GRSH3N": ("shell3",),
    "GRBRIC": ("hex8", "wedge6", "tet4", "tet10"),
    "GRSPRI": ("spring",),
    "GRTRUS": ("truss",),
    "GRBEAM": ("beam",),
}
SINGLE = ("SHEL", "SHELL", "SH3N", "BRIC", "SPRI", "SPRING", "TRUS", "BEAM", "TRIA", "QUAD")
SET_KINDS = {
    "SHELL": ("shell4",),
    "SH3N": ("shell3",),
    "SOLID": ("hex8", "wedge6", "tet4", "tet10"),
    "SPRING": ("spring",),
    "TRUSS": ("truss",),
    "BEAM": ("beam",),
}


class Sets:
    """The sets of a deck by keyword and id; `subsets`: part -> subset."""

    def __init__(self, deck: Deck, blocks: list[Block], subsets: dict[int, int], node_submodel):
        self.deck, self.subsets, self.node_submodel = deck, subsets, node_submodel
        self.blocks: dict[tuple[str, int], list[Block]] = {}
        self.open: list[tuple[str, int]] = []
        for block in blocks:
            name = block.key[0]
            digits = [word for word in block.key[1:] if word.isdecimal()]
            if not digits:
                block.fail("expected an id in the keyword")
            number = int(digits[0]) + block.offsets.other
            same = self.blocks.setdefault((name, number), [])
            if same and not (name == "SET" and block.word(1) == "COLLECT"):
                block.fail(f"{name} {number} is repeated; the first one stands in {same[0].where}")
            same.append(block)

    def find(self, names: tuple[str, ...], number: int, asker: Block) -> list[Block]:
        for name in names:
            if (name, number) in self.blocks:
                key = (name, number)
                if key in self.open:
                    asker.fail(f"{name} {number} holds itself")
                return self.blocks[key]
        asker.fail(f"{names[0]} {number} is not in the deck")

    def nested(self, name: str, numbers: np.ndarray, asker: Block, read):
        """read(block) of each set, guarded against circles; pairs of sign and result."""
        for number in numbers.tolist():
            blocks = self.find((name,), abs(number), asker)
            self.open.append((name, abs(number)))
            for block in blocks:
                yield number > 0, read(block)
            self.open.pop()

    # sets of nodes

    def nodes(self, number: int, asker: Block) -> np.ndarray:
        """Sorted node indices of a /GRNOD or a /SET."""
        blocks = self.find(("GRNOD", "SET"), number, asker)
        self.open.append((blocks[0].key[0], number))
        masks = [self.node_mask(block) for block in blocks]
        self.open.pop()
        return np.flatnonzero(np.logical_or.reduce(masks))

    def node_mask(self, block: Block) -> np.ndarray:
        if block.key[0] == "SET":
            return self.set_of(block).node_mask()
        kind = block.word(1)
        _, cards = block.titled()
        mask = np.zeros(len(self.deck.node_id), bool)
        if kind == "GEN_INCR":
            rows, _, _ = cards.table(3)
            for first, last, step in rows.tolist():
                mask |= self.id_range(first, last, step, block)
            return mask
        ids = cards.ids()
        if kind in ("NODE", "NODENS"):
            offset = block.offsets.node
            index = self.known_nodes(np.abs(ids) + offset, block)
            mask[index[ids > 0]] = True
            mask[index[ids < 0]] = False
            return mask
        if kind == "GENE":
            for first, last in ids[: len(ids) // 2 * 2].reshape(-1, 2).tolist():
                mask |= self.id_range(first, last, 1, block)
            return mask
        if kind == "GRNOD":
            return combine(mask, self.nested("GRNOD", self.shifted(ids, block.offsets.other), block, self.node_mask))
        if kind == "SURF":
            read = self.nested("SURF", self.shifted(ids, block.offsets.other), block, self.faces_of)
            return combine(mask, ((sign, self.corner_mask(faces)) for sign, faces in read))
        if kind in ("BOX", "BOX2"):
            return combine(mask, self.nested("BOX", self.shifted(ids, block.offsets.other), block, self.box_mask))
        if kind == "SUBMODEL":
            for number in ids.tolist():
                inside = self.node_submodel(abs(number))
                mask = mask | inside if number > 0 else mask & ~inside
            return mask
        selected = self.elements_named(kind, ids, block)
        if selected is None:
            block.fail(f"sets of type {kind} are not understood")
        return selected.nodes(self.deck)

    def known_nodes(self, ids: np.ndarray, block: Block) -> np.ndarray:
        index = self.deck._find(ids)
        if (index < 0).any():
            node = int(ids[np.argmax(index < 0)])
            word = str(node - block.offsets.node).encode()
            card = next((i for i, line in enumerate(block.lines[1:], 1) if word in line.split()), 0)
            block.fail(f"node {node} is not in the deck", card)
        return index

    def id_range(self, first: int, last: int, step: int, block: Block) -> np.ndarray:
        ids, offset = self.deck.node_id, block.offsets.node
        first, last, step = first + offset, last + offset, max(step, 1)
        return (ids >= first) & (ids <= last) & ((ids - first) % step == 0)

    def corner_mask(self, faces: Faces) -> np.ndarray:
        mask = np.zeros(len(self.deck.node_id), bool)
        mask[faces.nodes[faces.nodes >= 0]] = True
        return mask

    def box_mask(self, block: Block) -> np.ndarray:
        """/BOX/RECTA, SPHER, CYLIN and boxes of boxes; by position."""
        x, (_, cards) = self.deck.position, block.titled()
        kind = block.word(1) if not block.word(1).isdecimal() else "RECTA"
        if kind == "BOX":
            mask = np.zeros(len(x), bool)
            return combine(
                mask, self.nested("BOX", self.shifted(cards.ids(), block.offsets.other), block, self.box_mask)
            )
        first = cards.read(0, "iiir" if kind != "RECTA" else "iii")
        corners = []
        for card in range(1, 3):
            if card < len(cards):
                corners.append(cards.read(card, "rrr"))
        if kind == "RECTA" and len(corners) == 2 and not any(first):
            low, high = np.min(corners, axis=0), np.max(corners, axis=0)
            return ((x >= low) & (x <= high)).all(axis=1)
        if kind == "SPHER" and corners and not any(first[:3]):
            return np.linalg.norm(x - corners[0], axis=1) <= first[3] / 2
        if kind == "CYLIN" and len(corners) == 2 and not any(first[:3]):
            axis = np.subtract(corners[1], corners[0])
            r = x - corners[0]
            along = r @ axis / (axis @ axis)
            radial = np.linalg.norm(r - along[:, None] * axis, axis=1)
            return (along >= 0) & (along <= 1) & (radial <= first[3] / 2)
        block.fail("this box is not understood; boxes by two corners, SPHER and CYLIN by points are")

    # sets of elements and parts

    @staticmethod
    def shifted(ids: np.ndarray, offset: int) -> np.ndarray:
        return ids + np.sign(ids) * offset

    def parts_named(self, kind: str, ids: np.ndarray, block: Block) -> set[int] | None:
        """Parts that PART, SUBSET, MAT, PROP or GRPART and ids mean; None for another kind."""
        deck, off = self.deck, block.offsets
        if kind == "PART":
            numbers = self.shifted(ids, off.part)
            missing = [number for number in np.abs(numbers).tolist() if number not in deck.parts]
            if missing:
                block.fail(f"part {missing[0]} is not in the deck")
            return {number for number in numbers.tolist() if number > 0} - set((-numbers[numbers < 0]).tolist())
        if kind == "MAT":
            wanted = set(self.shifted(ids, off.material).tolist())
            return {part.id for part in deck.parts.values() if part.material in wanted}
        if kind == "PROP":
            wanted = set(self.shifted(ids, off.property).tolist())
            return {part.id for part in deck.parts.values() if part.property in wanted}
        if kind == "SUBSET":
            return self.subset_parts(self.shifted(ids, off.other).tolist())
        if kind == "GRPART":
            found: set[int] = set()
            for sign, parts in self.nested("GRPART", self.shifted(ids, off.other), block, self.grpart):
                found = found | parts if sign else found - parts
            return found
        return None

    def subset_parts(self, numbers: list[int]) -> set[int]:
        """Parts of subsets and of the subsets in them."""
        todo, seen = list(numbers), set()
        while todo:
            number = todo.pop()
            if number in seen:
                continue
            seen.add(number)
            for block in self.blocks.get(("SUBSET", number), []):
                _, cards = block.titled()
                todo += (cards.ids() + block.offsets.other).tolist()
        return {part for part, subset in self.subsets.items() if subset in seen}

    def grpart(self, block: Block) -> set[int]:
        _, cards = block.titled()
        found = self.parts_named(block.word(1), cards.ids(), block)
        if found is None:
            block.fail(f"groups of parts by {block.word(1)} are not understood")
        return found

    def parts_of_group(self, number: int, asker: Block) -> set[int]:
        """Parts of a /GRPART."""
        return set().union(*(self.grpart(block) for block in self.find(("GRPART",), number, asker)))

    def elements_named(self, kind: str, ids: np.ndarray, block: Block) -> "Selected | None":
        """Elements of parts or of groups of elements."""
        parts = self.parts_named(kind, ids, block)
        if parts is not None:
            return Selected.of_parts(self.deck, parts)
        if kind in GROUPS:
            found = Selected({})
            for sign, some in self.nested(kind, self.shifted(ids, block.offsets.other), block, self.group):
                found = found.plus(some) if sign else found.minus(some)
            return found
        return None

    def group(self, block: Block) -> "Selected":
        """Elements of a /GRSHEL and so on."""
        kinds, kind = GROUPS[block.key[0]], block.word(1)
        _, cards = block.titled()
        ids = cards.ids()
        if kind in SINGLE:
            return Selected.of_ids(self.deck, kinds, self.shifted(ids, block.offsets.element), block.fail)
        if kind == "GENE":
            ranges = ids[: len(ids) // 2 * 2].reshape(-1, 2) + block.offsets.element
            return Selected.of_ranges(self.deck, kinds, ranges.tolist())
        found = self.elements_named(kind, ids, block)
        if found is None:
            block.fail(f"groups of type {kind} are not understood")
        return found.only(kinds)

    # surfaces

    def faces(self, number: int, asker: Block) -> Faces:
        """Faces of a /SURF or a /SET."""
        blocks = self.find(("SURF", "SET"), number, asker)
        self.open.append((blocks[0].key[0], number))
        found = Faces.joined([self.faces_of(block) for block in blocks])
        self.open.pop()
        return found

    def faces_of(self, block: Block) -> Faces:
        if block.key[0] == "SET":
            return self.set_of(block).faces()
        kind = block.word(1)
        _, cards = block.titled()
        if kind == "SEG":
            rows, _, index = cards.table(5)
            return self.segments(rows[:, 0], rows[:, 1:], block, index)
        ids = cards.ids()
        if kind in ("SURF", "DSURF"):
            found = [
                faces for _, faces in self.nested("SURF", self.shifted(ids, block.offsets.other), block, self.faces_of)
            ]
            return Faces.joined(found)
        selected = self.elements_named(kind, ids, block)
        if selected is None:
            block.fail(f"surfaces of type {kind} are not understood")
        how = block.word(2)
        if how == "FREE":
            block.fail("surfaces of free faces are not understood")
        if kind == "GRBRIC" and how != "ALL":
            how = "EXT"
        if how == "EXT":
            return Faces.joined([shells_of(self.deck, selected.kinds), exterior(self.deck, selected.kinds)])
        if how == "ALL":
            return all_faces(self.deck, selected.kinds)
        return shells_of(self.deck, selected.kinds)

    def segments(self, ids: np.ndarray, nodes: np.ndarray, block: Block, index: np.ndarray) -> Faces:
        """Faces given by nodes; they take part and thickness of the shell that has the same nodes."""
        offset = block.offsets.node
        nodes = np.where(nodes == 0, 0, nodes + offset)
        few = (nodes[:, :3] == 0).any(axis=1)
        if few.any():
            block.fail("a segment has fewer than three nodes", 1 + int(index[np.argmax(few)]))
        found = self.deck._find(nodes)
        missing = (found < 0) & (nodes != 0)
        if missing.any():
            row = int(np.argmax(missing.any(axis=1)))
            block.fail(f"node {nodes[row][missing[row]][0]} is not in the deck", 1 + int(index[row]))
        return Faces.joined([segments_of_nodes(self.deck, found)])

    # /SET/GENERAL and /SET/COLLECT

    def set_of(self, block: Block) -> "GeneralSet":
        found = GeneralSet(self, block)
        _, cards = block.titled()
        clause, rows = None, []
        for card in range(len(cards)):
            line = cards.need(card)
            word = line[:10].decode("latin-1").strip().upper()
            if word:
                if clause:
                    found.add(clause, rows)
                clause, rows = word, []
            if line.strip():
                rows.append(cards.read(card, "." + "i" * 9))
        if clause:
            found.add(clause, rows)
        return found


class GeneralSet:
    """A /SET, clause by clause: single nodes, elements, parts and segments."""

    def __init__(self, sets: Sets, block: Block):
        self.sets, self.block, self.deck = sets, block, sets.deck
        self.single = np.zeros(len(self.deck.node_id), bool)
        self.removed = np.zeros(len(self.deck.node_id), bool)
        self.elements, self.by_part = Selected({}), Selected({})
        self.segments: list[Faces] = []

    def add(self, word: str, rows: list[list[int]]):
        block, sets, deck = self.block, self.sets, self.deck
        kind, _, options = word.partition("_")
        if set(options) - set("GDOEA"):
            block.fail(f"the clause {word} is not understood")
        numbers = np.array([number for row in rows for number in row if number], np.int64)
        remove, generate = "D" in options, "G" in options
        if kind == "ALL":
            self.by_part = self.by_part.plus(Selected({k: np.ones(len(e.id), bool) for k, e in deck.elements.items()}))
            self.single |= True
        elif kind == "SEG":
            table = np.array([row[:5] for row in rows if any(row)], np.int64).reshape(-1, 5)
            self.segments.append(sets.segments(table[:, 0], table[:, 1:], block, np.arange(len(table))))
        elif kind == "NODE":
            mask = np.zeros_like(self.single)
            if generate:
                for row in rows:
                    first, last, step = row[:3]
                    mask |= sets.id_range(first, last, step, block)
            else:
                mask[sets.known_nodes(np.abs(numbers) + block.offsets.node, block)] = True
            self.single = self.single & ~mask if remove else self.single | mask
            self.removed |= mask & remove
        elif kind in SET_KINDS:
            shift = block.offsets.element
            if generate:
                found = Selected.of_ranges(deck, SET_KINDS[kind], [[r[0] + shift, r[1] + shift] for r in rows])
            else:
                found = Selected.of_ids(deck, SET_KINDS[kind], sets.shifted(numbers, shift), block.fail)
            self.elements = self.elements.minus(found) if remove else self.elements.plus(found)
            self.by_part = self.by_part.minus(found) if remove else self.by_part
        elif kind in ("PART", "SUBS", "MAT", "PROP"):
            if generate:
                known = [part for part in deck.parts if any(r[0] <= part - block.offsets.part <= r[1] for r in rows)]
                parts = set(known)
            else:
                parts = sets.parts_named({"SUBS": "SUBSET"}.get(kind, kind), numbers, block) or set()
            found = Selected.of_parts(deck, parts)
            self.by_part = self.by_part.minus(found) if remove else self.by_part.plus(found)
        elif kind in ("SET", "SETCOL"):
            for sign, other in sets.nested("SET", sets.shifted(numbers, block.offsets.other), block, sets.set_of):
                if sign and not remove:
                    self.single |= other.single
                    self.elements, self.by_part = self.elements.plus(other.elements), self.by_part.plus(other.by_part)
                    self.segments += other.segments
                else:
                    self.single &= ~other.single
                    self.elements, self.by_part = self.elements.minus(other.elements), self.by_part.minus(other.by_part)
                    self.removed |= other.node_mask()
        elif kind == "BOX":
            mask = np.zeros_like(self.single)
            self.single |= combine(
                mask, sets.nested("BOX", sets.shifted(numbers, block.offsets.other), block, sets.box_mask)
            )
        else:
            block.fail(f"the clause {word} is not understood")

    def node_mask(self) -> np.ndarray:
        mask = self.single | self.elements.nodes(self.deck) | self.by_part.nodes(self.deck)
        for faces in self.segments:
            mask |= self.sets.corner_mask(faces)
        return mask & ~(self.removed & ~self.single)

    def faces(self) -> Faces:
        """Shells, outer faces of solids of the elements and parts, and segments."""
        everything = self.elements.plus(self.by_part)
        return Faces.joined(
            [*self.segments, shells_of(self.deck, everything.kinds), exterior(self.deck, everything.kinds)]
        )
