"""*DEFINE_TRANSFORMATION, and where *INCLUDE_TRANSFORM puts the nodes of a file."""

import numpy as np

from ..model import Deck
from .cards import Block, Origin

KNOWN = ("MIRROR", "POINT", "POS6N", "POS6P", "ROTATE", "ROTATE3NA", "SCALE", "TRANSL", "TRANSL2ND")

BY_NODES = ("TRANSL2ND", "ROTATE3NA", "POS6N")


class Transformations:
    """The transformations of a deck, by id."""

    def __init__(self, deck: Deck, blocks: list[Block]):
        self.deck, self.blocks = deck, {}
        for block in blocks:
            first = 1 if block.has("TITLE") else 0
            number = block.id("define", block.read(first, "i")[0])
            if number in self.blocks:
                block.fail(
                    f"transformation {number} is repeated; the first one stands in {self.blocks[number][0].where}"
                )
            self.blocks[number] = (block, first + 1)

    def place(self, x: np.ndarray, origin: Origin) -> np.ndarray:
        """Positions (n, 3) of nodes of a file, in the deck's units and place."""
        for length, named in origin.steps:
            x = x * length
            if named is not None:
                number, asker = named
                if number not in self.blocks:
                    asker.fail(f"transformation {number} is not in the deck")
                x = self.apply(x, *self.blocks[number], asker)
        return x

    def apply(self, x: np.ndarray, block: Block, first: int, asker: Block) -> np.ndarray:
        """One transformation, its lines in their order, in the units of the file that asks for it."""
        points: dict[int, np.ndarray] = {}
        unit = block.origin.length / asker.origin.length
        for card in range(first, block.end):
            word, *values = block.read(card, "srrrrrrr")
            word = word.upper()
            if not word:
                continue
            if word not in KNOWN:
                block.fail(f"'{word}' is not understood; {', '.join(KNOWN)} are", card)
            if word in BY_NODES and asker.origin.steps:
                asker.fail(f"{word} moves only what the main file includes")
            a = np.array(values)
            if word == "POINT":
                points[int(a[0])] = a[1:4] * unit
            elif word == "SCALE":
                x = x * np.where(a[:3] == 0, 1.0, a[:3])
            elif word == "TRANSL":
                x = x + a[:3] * unit
            elif word == "TRANSL2ND":
                p, q = self.node(a[0], block, card), self.node(a[1], block, card)
                x = x + a[2] * unit * direction(q - p, block, card)
            elif word == "MIRROR":
                p, q = a[:3] * unit, a[3:6] * unit
                n = direction(q - p, block, card)
                x = x - 2 * ((x - p) @ n)[:, None] * n
            elif word == "ROTATE":
                if not a[3:].any():
                    p, q = (self.point(value, points, block, card) for value in a[:2])
                    x = rotated(x, p, direction(q - p, block, card), a[2])
                else:
                    x = rotated(x, a[3:6] * unit, direction(a[:3], block, card), a[6])
            elif word == "ROTATE3NA":
                p, q, r = (self.node(value, block, card) for value in a[:3])
                x = rotated(x, p, direction(np.cross(q - p, r - p), block, card), a[3])
            else:
                nodes = word == "POS6N"
                six = [
                    self.node(value, block, card) if nodes else self.point(value, points, block, card)
                    for value in a[:6]
                ]
                before, after = frame(six[:3], block, card), frame(six[3:], block, card)
                x = (x - six[0]) @ (before.T @ after) + six[3]
        return x

    def node(self, number: float, block: Block, card: int) -> np.ndarray:
        return self.deck.position[self.deck.nodes([block.id("node", int(number))], block.at(card))[0]]

    def point(self, number: float, points: dict, block: Block, card: int) -> np.ndarray:
        if int(number) not in points:
            block.fail(f"POINT {int(number)} does not stand before this line", card)
        return points[int(number)]


def direction(vector: np.ndarray, block: Block, card: int) -> np.ndarray:
    length = np.linalg.norm(vector)
    if not length:
        block.fail("its points or its vector give no direction", card)
    return vector / length


def frame(points: list[np.ndarray], block: Block, card: int) -> np.ndarray:
    """Axes as rows: x from the first point to the second, z across the third."""
    p, q, r = points
    x = direction(q - p, block, card)
    z = direction(np.cross(x, r - p), block, card)
    return np.stack([x, np.cross(z, x), z])


def rotated(x: np.ndarray, p: np.ndarray, axis: np.ndarray, degrees: float) -> np.ndarray:
    angle, r = np.radians(degrees), x - p
    along = (r @ axis)[:, None] * axis
    return p + along + np.cos(angle) * (r - along) + np.sin(angle) * np.cross(axis, r)
