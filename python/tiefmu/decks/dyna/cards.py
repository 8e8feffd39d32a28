"""Cards of LS-DYNA keywords: fixed columns, comma format, long format, parameters in fields.

Columns are 10 wide, those of nodes and elements 8 and 16; in long format all are 20 wide, and with I10=Y (or % behind
the keyword) those 8 wide are 10. A card with a comma is in free format.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from ...schema import shortened
from .. import parameters
from ..card_block import CardBlock
from ..numbers import column, real, whole

# Width of a field by its letter: i, r, s integer, real, text, . left out; I, F integer and real of nodes and elements,
# , one left out; R real of nodes and elements; Q real of curves.
WIDTHS = {"i": 10, "r": 10, "s": 10, ".": 10, "I": 8, "F": 8, ",": 8, "R": 16, "Q": 20}
REAL, LEFT_OUT = "rFRQ", ".,"


@dataclass(frozen=True)
class Origin:
    """What *INCLUDE_TRANSFORM does to a file: offsets on ids, factors on units, and steps for positions: pairs of a
    length factor and (transformation id, block that names it) or None, the innermost first."""

    node: int = 0
    element: int = 0
    part: int = 0
    material: int = 0
    set: int = 0
    function: int = 0
    define: int = 0
    other: int = 0
    mass: float = 1.0
    time: float = 1.0
    length: float = 1.0
    steps: tuple = ()

    def unit(self, length: int = 0, mass: int = 0, time: int = 0) -> float:
        """Factor on a value of these powers of length, mass and time."""
        return self.length**length * self.mass**mass * self.time**time


@dataclass
class Block(CardBlock):
    """A keyword without its star, e.g. SET_NODE_LIST, and its cards. title: it has _TITLE."""

    name: str
    file: str
    number: int
    origin: Origin
    scope: parameters.Scope
    long: bool = False
    wide: bool = False
    lines: list[bytes] = field(default_factory=list)
    numbers: array = field(default_factory=lambda: array("q"))

    @property
    def called(self) -> str:
        return f"*{shortened(self.name)}"

    @property
    def words(self) -> list[str]:
        return self.name.split("_")

    def has(self, *options: str) -> bool:
        """Whether the keyword has one of these words."""
        return any(option in self.words for option in options)

    @property
    def end(self) -> int:
        """Number of cards without blank ones at the end."""
        end = len(self.lines)
        while end and not self.lines[end - 1].strip():
            end -= 1
        return end

    def need(self, card: int) -> bytes:
        if card >= len(self.lines):
            self.fail(f"is cut off: card {card + 1} is missing", card)
        return self.lines[card]

    def text(self, card: int) -> str:
        return self.need(card).decode("utf-8", "replace").strip()

    def blank(self, card: int) -> bool:
        return card >= len(self.lines) or not self.lines[card].strip()

    def width(self, letter: str) -> int:
        return 20 if self.long else 10 if self.wide and WIDTHS[letter] == 8 else WIDTHS[letter]

    def fields(self, card: int, layout: str) -> list[str]:
        """Texts of a card's fields, parameters put in; '' where the card ends before."""
        line = self.need(card)
        if b"," in line:
            found = [word.strip() for word in line.decode("latin-1").split(",")][: len(layout)]
            found += [""] * (len(layout) - len(found))
        else:
            found, start = [], 0
            for letter in layout:
                width = self.width(letter)
                found.append(line[start : start + width].decode("latin-1").strip())
                start += width
        if b"&" in line:
            for place, word in enumerate(found):
                try:
                    found[place] = parameters.field(word, self.scope)
                except KeyError:
                    self.fail(f"parameter {shortened(word)} is not in the deck", card)
        return found

    def read(self, card: int, layout: str) -> list:
        """Values of one card; fields that are blank or missing are 0 or ''."""
        found = []
        for place, (letter, word) in enumerate(zip(layout, self.fields(card, layout))):
            if letter in LEFT_OUT:
                continue
            try:
                found.append(word if letter == "s" else real(word) if letter in REAL else integer(word))
            except (ValueError, OverflowError):
                self.refuse(card, layout, place, word)
        return found

    def or_blank(self, card: int, layout: str) -> list:
        """The same; all 0 or '' where the deck ends before this card."""
        if card < len(self.lines):
            return self.read(card, layout)
        return ["" if letter == "s" else 0.0 if letter in REAL else 0 for letter in layout if letter not in LEFT_OUT]

    def table(self, layout: str, cards: Sequence[int] | np.ndarray | None = None):
        """(one array per field, indices of the cards): of the cards given, or of all that are not blank."""
        if cards is None:
            lines, index = self.lines, np.arange(len(self.lines))
        else:
            index = np.asarray(cards, np.int64)
            lines = [self.need(card) for card in index.tolist()]
        places = [place for place, letter in enumerate(layout) if letter not in LEFT_OUT]
        if any(b"," in line or b"&" in line for line in lines):
            rows = [self.fields(card, layout) for card in index.tolist()]
            if cards is None:
                kept = [any(row) for row in rows]
                rows, index = [row for row, keep in zip(rows, kept) if keep], index[np.array(kept, bool)]
            width = max((len(word) for row in rows for word in row), default=0) + 1
            texts = [
                np.array([row[place].encode("latin-1", "replace").rjust(width) for row in rows], f"S{width}")
                for place in places
            ]
            columns = [text.view(np.uint8).reshape(len(rows), width) for text in texts]
        else:
            widths = [self.width(letter) for letter in layout]
            ends = np.cumsum(widths)
            text = np.array(lines, dtype=f"S{ends[-1]}").view(np.uint8).reshape(len(lines), ends[-1]).copy()
            text[(text == 0) | (text == 9)] = 32
            if cards is None and len(text):
                given = (text != 32).any(axis=1)
                text, index = text[given], index[given]
            columns = [text[:, ends[place] - widths[place] : ends[place]] for place in places]
        found = []
        for place, characters in zip(places, columns):

            def refuse(row: int, word: str, place=place):
                self.refuse(int(index[row]), layout, place, word)

            found.append(
                column(characters, float if layout[place] in REAL else np.int64, refuse)
                if len(index)
                else np.empty(0, float if layout[place] in REAL else np.int64)
            )
        return found, index

    def refuse(self, card: int, layout: str, place: int, word: str) -> NoReturn:
        what = "a number" if layout[place] in REAL else "a whole number"
        if b"," in self.lines[card]:
            where = f"field {place + 1}"
        else:
            widths = [self.width(letter) for letter in layout]
            start = sum(widths[:place])
            where = f"columns {start + 1} to {start + widths[place]}"
        self.fail(f"{where}: expected {what}, found '{shortened(word)}'", card)

    def id(self, what: str, number: int) -> int:
        """An id of the deck, with the offset of its file for `what`; 0 stays 0."""
        return number + getattr(self.origin, what) if number else 0

    def ids(self, first: int, what: str) -> np.ndarray:
        """All integers of all cards from `first` on, eight to a card, zeros left out, with the offset for `what`."""
        (*columns,), _ = self.table("iiiiiiii", range(first, self.end))
        found = np.stack(columns, axis=1).ravel() if columns else np.empty(0, np.int64)
        found = found[found != 0]
        return found + np.sign(found) * getattr(self.origin, what)


def integer(text: str) -> int:
    """A whole number, also one written as 3. or 3.0."""
    try:
        return whole(text)
    except ValueError:
        number = real(text)
        if number != int(number) or "e" in text.lower():
            raise
        return int(number)
