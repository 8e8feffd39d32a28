"""Radioss starter files as blocks: a keyword line and its cards, includes followed, comments left out.

A block remembers of each card the file and the line, so that messages can name them. Columns are fixed: integers 10
wide and reals 20 wide, in formats before 5.1 8 and 16 wide; the title of a block stands on its keyword line there, on
its first card since.
"""

from codecs import BOM_UTF8
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..._core import SceneError
from ...schema import shortened
from .. import parameters
from ..card_block import CardBlock
from ..numbers import column, real, whole

MOST_INCLUDES = 1000


@dataclass
class Source:
    """A deck's files while they are read. version: of the input format, e.g. 2021 or 44; same_units: ids of /UNIT that
    are the deck's own."""

    file: str
    version: int = 2026
    files: list[str] = field(default_factory=list)
    same_units: set[int] = field(default_factory=set)

    @property
    def old(self) -> bool:
        return self.version < 50

    @property
    def integer(self) -> int:
        return 8 if self.old else 10

    @property
    def real(self) -> int:
        return 16 if self.old else 20


@dataclass
class Offsets:
    """What a //SUBMODEL adds to the ids of its blocks; submodel: its own id."""

    other: int = 0
    node: int = 0
    element: int = 0
    part: int = 0
    material: int = 0
    property: int = 0
    submodel: int = 0
    inside: tuple[int, ...] = ()  # this submodel and those around it


@dataclass
class Block(CardBlock):
    """key: the keyword's words, e.g. ["INTER", "TYPE2", "7"]; file, number: where it stands; lines: its cards, as
    bytes; numbers: their lines; files: [(first card, file)] of those in an include; scope: what &name is."""

    source: Source
    key: list[str]
    file: str
    number: int
    offsets: Offsets
    lines: list[bytes] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    files: list[tuple[int, str]] = field(default_factory=list)
    scope: parameters.Scope = field(default_factory=parameters.Scope)

    @property
    def name(self) -> str:
        return "/" + "/".join(self.key)

    @property
    def called(self) -> str:
        return shortened(self.name)

    def file_of(self, card: int) -> str:
        return next((file for first, file in reversed(self.files) if first <= card), self.file)

    def word(self, place: int) -> str:
        """The keyword's word at `place`, e.g. TYPE2; '' where it has none."""
        return self.key[place].upper() if place < len(self.key) else ""

    def id(self, place: int, what: str) -> int:
        """The number at `place` of the keyword's words, with the submodel's offset for `what`."""
        word = self.key[place] if place < len(self.key) else ""
        if not word.isdecimal() or len(word) > 18:
            self.fail(f"expected an id in the keyword, found '{shortened(word)}'")
        return int(word) + getattr(self.offsets, what)

    def titled(self) -> tuple[str, "Cards"]:
        """The title, and the cards behind it."""
        if self.source.old:
            last = self.key[-1]
            return ("" if len(self.key) < 2 or last.isdecimal() else last), Cards(self, 0)
        if not self.lines:
            self.fail("is cut off: no title")
        return self.lines[0].decode("utf-8", "replace").strip(), Cards(self, 1)

    def cards(self) -> "Cards":
        return Cards(self, 0)


class Cards:
    """The cards of a block from `first` on, read column by column."""

    def __init__(self, block: Block, first: int):
        self.block, self.first = block, first

    def __len__(self) -> int:
        return len(self.block.lines) - self.first

    def without_blanks(self) -> "Cards":
        """The same without blank cards at the end."""
        lines = self.block.lines
        while len(lines) > self.first and not lines[-1].strip():
            lines.pop()
        return self

    def need(self, card: int) -> bytes:
        if card >= len(self):
            self.block.fail(f"is cut off: card {card + 1} is missing", self.first + card)
        return self.block.lines[self.first + card]

    def read(self, card: int, layout: str) -> list:
        """Fields of one card: i an integer, r a real, s a text of an integer's width, . a blank integer's width.
        Fields that are blank or missing are 0 or ''."""
        line, found, start = self.need(card), [], 0
        source = self.block.source
        for letter in layout:
            width = source.real if letter == "r" else source.integer
            text = line[start : start + width].decode("latin-1").strip()
            start += width
            if letter == ".":
                continue
            if "&" in text:
                text = self.parameter(card, text)
            try:
                found.append(text if letter == "s" else (whole(text) if letter == "i" else real(text)))
            except ValueError:
                self.refuse(card, start - width, width, letter == "r", text)
        return found

    def table(self, integers: int, reals: int = 0, start: int = 0, step: int = 1, blank: int = 0):
        """Columns of all cards from `start` on, every `step`-th: (integers (n, k), reals (n, m), card indices).
        `integers` columns come first, then `blank` columns of an integer's width, then `reals`. Blank cards are left
        out."""
        source = self.block.source
        lines = self.block.lines[self.first + start :: step]
        wide = source.integer * (integers + blank) + source.real * reals
        if not lines:
            return np.empty((0, integers), np.int64), np.empty((0, reals)), np.empty(0, int)
        if any(b"&" in line for line in lines):
            widths = [source.integer] * (integers + blank) + [source.real] * reals
            lines = [self.filled(start + step * number, line, widths) for number, line in enumerate(lines)]
        text = np.array(lines, dtype=f"S{wide}")
        text = text.view(np.uint8).reshape(len(lines), wide).copy()
        text[(text == 0) | (text == 9)] = 32
        index = np.arange(len(lines)) * step + start
        if step == 1:
            given = (text != 32).any(axis=1)
            text, index = text[given], index[given]

        def columns(first: int, width: int, count: int, dtype) -> list[np.ndarray]:
            found = []
            for start in range(first, first + count * width, width):

                def refuse(row: int, word: str, start=start):
                    self.refuse(int(index[row]), start, width, dtype is float, word)

                found.append(column(text[:, start : start + width], dtype, refuse))
            return found

        whole_columns = columns(0, source.integer, integers, np.int64)
        real_columns = columns((integers + blank) * source.integer, source.real, reals, float)
        return (
            np.stack(whole_columns, axis=1) if integers else np.empty((len(index), 0), np.int64),
            np.stack(real_columns, axis=1) if reals else np.empty((len(index), 0)),
            index,
        )

    def refuse(self, card: int, first: int, width: int, real: bool, word: str):
        self.block.fail(
            f"columns {first + 1} to {first + width}: expected {'a number' if real else 'a whole number'}, found "
            f"'{shortened(word)}'",
            self.first + card,
        )

    def parameter(self, card: int, word: str) -> str:
        """A field with the parameter that it names put in."""
        try:
            return parameters.field(word, self.block.scope)
        except KeyError:
            self.block.fail(f"parameter {shortened(word)} is not in the deck", self.first + card)

    def filled(self, card: int, line: bytes, widths: list[int]) -> bytes:
        """A card with its parameters put in, as wide as before: a number of a table has at most 17 digits."""
        if b"&" not in line:
            return line
        found, start = [], 0
        for width in widths:
            word = line[start : start + width].decode("latin-1").strip()
            start += width
            if "&" in word:
                word = self.parameter(card, word)
                digits = 17
                while len(word) > width and digits > 1:
                    digits -= 1
                    word = f"{float(word):.{digits}g}"
            found.append(word.rjust(width))
        return "".join(found).encode("latin-1")

    def ids(self, start: int = 0) -> np.ndarray:
        """All integers of all cards from `start` on, ten to a card, zeros left out; negative ones as they are."""
        whole_columns, _, _ = self.table(10, start=start)
        found = whole_columns.ravel()
        return found[found != 0]


def read(path: Path, file: str) -> list[Block]:
    """The blocks of a deck and of what it includes. `file`: how messages call it."""
    reader = Reader(Source(file))
    reader.read(path, file)
    if len(reader.offsets) > 1:
        raise SceneError(f"{file}: //SUBMODEL {reader.offsets[-1].submodel}: //ENDSUB is missing")
    return reader.blocks


class Reader:
    """Reads files one into the other; `block` is the one that cards go to."""

    def __init__(self, source: Source):
        self.source, self.blocks = source, []
        self.block: Block | None = None
        self.offsets, self.open = [Offsets()], []

    def read(self, path: Path, name: str):
        if path.resolve() in self.open:
            raise SceneError(f"{name}: includes itself")
        if len(self.source.files) > MOST_INCLUDES:
            raise SceneError(f"{name}: more than {MOST_INCLUDES} includes")
        self.open.append(path.resolve())
        self.source.files.append(name)
        data = path.read_bytes().removeprefix(BOM_UTF8)
        if self.block is not None:
            self.block.files.append((len(self.block.lines), name))
        for number, line in enumerate(data.split(b"\n"), 1):
            first = line[:1]
            if first == b"#" or first == b"$":
                if line[:8].lower() == b"#include":
                    self.include(path, name, number, line)
                elif line.strip().lower() in (b"#enddata", b"#end"):
                    break
            elif first == b"/":
                if line[:5].strip().upper() == b"/END":
                    break
                self.keyword(name, number, line)
            elif self.block is not None:
                self.block.lines.append(line[:-1] if line.endswith(b"\r") else line)
                self.block.numbers.append(number)
                if len(self.block.lines) == 2:
                    self.look(self.block)
            elif line.strip():
                raise SceneError(f"{name}: line {number}: expected a keyword such as /BEGIN, found '{excerpt(line)}'")
        self.open.pop()

    def keyword(self, name: str, number: int, line: bytes):
        words = [word.strip() for word in line.decode("utf-8", "replace").split("/")]
        while len(words) > 2 and not words[-1]:
            words.pop()
        if line.startswith(b"//"):
            inner = self.submodel(name, number, [words[2].upper(), *words[3:]] if len(words) > 2 else [""])
            if inner is None:
                self.block = None
                return
            words = inner
        else:
            words = words[1:]
            words[:2] = [word.upper() for word in words[:2]]
        self.block = Block(self.source, words, name, number, self.offsets[-1])
        self.blocks.append(self.block)

    def look(self, block: Block):
        """What changes how the rest is read: the version of the format, and offsets of a submodel."""
        if block.key[0] == "BEGIN":
            word = block.lines[1][:10].split()
            if word and word[0].isdigit():
                self.source.version = int(word[0])
        elif block.key[0] == "SUBMODEL":
            off = Cards(block, 0).read(1, "iiiiii")
            outer, own = self.offsets[-2], self.offsets[-1]
            for key, value in zip(("other", "node", "element", "part", "material", "property"), off):
                setattr(own, key, getattr(outer, key) + (value or off[0]))

    def submodel(self, name: str, number: int, words: list[str]) -> list[str] | None:
        """Words of the keyword //SUBMODEL; None for //ENDSUB."""
        if words[0] == "SUBMODEL":
            own = Offsets(**vars(self.offsets[-1]))
            own.submodel = int(words[1]) if len(words) > 1 and words[1].isdecimal() and len(words[1]) < 19 else 0
            if len(words) > 2 and words[2].strip("0"):
                raise SceneError(
                    f"{name}: line {number}: //SUBMODEL: its unit {shortened(words[2])} is not supported; give it in "
                    "the units of /BEGIN"
                )
            own.inside = (*own.inside, own.submodel)
            self.offsets.append(own)
            return words
        if words[0] == "ENDSUB":
            if len(self.offsets) == 1:
                raise SceneError(f"{name}: line {number}: //ENDSUB without //SUBMODEL")
            self.offsets.pop()
            return None
        raise SceneError(
            f"{name}: line {number}: //{shortened(words[0])} is not understood; //SUBMODEL and //ENDSUB are"
        )

    def include(self, path: Path, name: str, number: int, line: bytes):
        words = line.decode("utf-8", "replace").split(None, 1)
        if len(words) < 2:
            raise SceneError(f"{name}: line {number}: #include names no file")
        target = words[1].strip().strip("\"'")
        try:
            before = self.block
            self.read(path.parent / target, target)
            if before is not None and self.block is before:
                before.files.append((len(before.lines), name))
        except OSError as error:
            raise SceneError(f"{name}: line {number}: #include: {target}: {error.strerror or error}") from None


def excerpt(line: bytes) -> str:
    return shortened(line.decode("utf-8", "replace").strip())
