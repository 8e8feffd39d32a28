"""LS-DYNA keyword files as blocks: includes followed, comments left out, parameters known."""

import dataclasses
import re
from codecs import BOM_UTF8
from pathlib import Path, PureWindowsPath

from ..._core import SceneError
from ...schema import shortened
from .. import parameters
from .cards import Block, Origin

MOST_INCLUDES = 1000
DEEPEST = 50
OFFSETS = ("node", "element", "part", "material", "set", "function", "define")


class Reader:
    """Reads files one into the other. blocks: all keywords but those that this class answers itself; warnings."""

    def __init__(self, main: Path, file: str):
        self.main, self.file = main, file
        self.blocks: list[Block] = []
        self.warnings: list[str] = []
        self.included: list[str] = []  # a line for each *INCLUDE_TRANSFORM
        self.folders: list[Path] = []
        self.open: list[Path] = []
        self.files = 0
        self.redefine = False  # *PARAMETER_DUPLICATION: the last definition counts

    def read(self, path: Path, name: str, origin: Origin, parent: parameters.Scope | None, long=False, wide=False):
        if path.resolve() in self.open:
            raise SceneError(f"{name}: includes itself")
        self.files += 1
        if self.files > MOST_INCLUDES or len(self.open) > DEEPEST:
            raise SceneError(f"{name}: too many includes")
        self.open.append(path.resolve())
        scope = parameters.Scope(parent)
        data = path.read_bytes().removeprefix(BOM_UTF8)
        block: Block | None = None
        for number, line in enumerate(data.split(b"\n"), 1):
            first = line[:1]
            if first == b"$":
                continue
            if first == b"*":
                if block is not None:
                    self.take(block, path)
                    block = None
                key, rest = keyword(line)
                if key == "END":
                    break
                if key.split("_")[0] == "KEYWORD":
                    long, wide = formats(rest, long, wide)
                mark = rest[:1] if rest[:1] in "+-%" else ""
                block = Block(
                    key, name, number, origin, scope, (long or mark == "+") and mark != "-", wide or mark == "%"
                )
            elif block is not None:
                if line.startswith(b"-----BEGIN"):
                    block.fail("is encrypted and cannot be read")
                block.lines.append(line.rstrip(b"\r"))
                block.numbers.append(number)
            elif line.strip():
                text = shortened(line.decode("utf-8", "replace").strip())
                raise SceneError(f"{name}: line {number}: expected a keyword such as *KEYWORD, found '{text}'")
        if block is not None:
            self.take(block, path)
        self.open.pop()

    def take(self, block: Block, path: Path):
        name = block.name
        if name.split("_")[0] == "KEYWORD":
            return
        if name in ("INCLUDE", "INCLUDE_TRANSFORM"):
            self.include(block, path)
        elif name in ("INCLUDE_PATH", "INCLUDE_PATH_RELATIVE"):
            self.folders += [self.main.parent / native(line) for line, _ in names(block)]
        elif name in ("PARAMETER", "PARAMETER_LOCAL", "PARAMETER_TYPE"):
            self.parameters(block)
        elif name in ("PARAMETER_EXPRESSION", "PARAMETER_EXPRESSION_LOCAL"):
            self.expressions(block)
        elif name == "PARAMETER_DUPLICATION":
            self.redefine = block.or_blank(0, "i")[0] in (2, 4)
        else:
            self.blocks.append(block)

    # includes

    def include(self, block: Block, path: Path):
        found = names(block)
        if not found:
            block.fail("names no file")
        origin = block.origin
        if block.name == "INCLUDE_TRANSFORM":
            found, origin = found[:1], self.transformed(block, found[0][1] + 1, found[0][0])
        for word, card in found:
            target = self.locate(word, path)
            if target is None:
                block.fail(f"{shortened(word)}: no such file", card)
            try:
                self.read(target, word, origin, block.scope, block.long, block.wide)
            except OSError as error:
                block.fail(f"{shortened(word)}: {error.strerror or error}", card)

    def locate(self, word: str, path: Path) -> Path | None:
        for name in dict.fromkeys((word, native(word))):
            for folder in (self.main.parent, path.parent, *self.folders):
                if (folder / name).is_file():
                    return folder / name
        return None

    def transformed(self, block: Block, card: int, word: str) -> Origin:
        """The origin of a file included by *INCLUDE_TRANSFORM, whose cards behind the name start at `card`."""
        outer = block.origin
        offsets = dict(zip(OFFSETS, block.or_blank(card, "iiiiiii")))
        offsets["other"] = block.or_blank(card + 1, "i")[0]
        mass, time, length = (value or 1.0 for value in block.or_blank(card + 2, "rrr"))
        (number,) = block.or_blank(card + 3, "i")
        for value in (mass, time, length):
            if value < 0:
                block.fail(f"its factor {value:g} is negative", card + 2)
        said = [f"{key} + {value}" for key, value in offsets.items() if value]
        said += [f"{key} x {v:g}" for key, v in (("mass", mass), ("time", time), ("length", length)) if v != 1]
        said += [f"transformation {number}"] if number else []
        self.included.append(f"{word} ({block.where}): {', '.join(said) or 'as it is'}")
        step = (length, (block.id("define", number), block) if number else None)
        return dataclasses.replace(
            outer,
            **{key: getattr(outer, key) + value for key, value in offsets.items()},
            mass=outer.mass * mass,
            time=outer.time * time,
            length=outer.length * length,
            steps=(step, *outer.steps),
        )

    # parameters

    def define(self, block: Block, card: int, name: str, value: parameters.Value):
        names = block.scope.names if block.has("LOCAL") else block.scope.outermost().names
        if name in names and names[name] != value and not self.redefine:
            self.warnings.append(
                f"{block.at(card)}: parameter {name} is defined before; the first value, {names[name]}, counts"
            )
            return
        names[name] = value

    def parameters(self, block: Block):
        per = 3 if block.has("TYPE") else 2
        for card in range(block.end):
            words = block.fields(card, "s" * 8)
            for place in range(0, 8 - per + 1, per):
                word, text = words[place], words[place + 1]
                if not word:
                    continue
                try:
                    kind, name = parameters.declared(word)
                except ValueError:
                    block.fail(f"expected R, I or C and a name, found '{shortened(word)}'", card)
                try:
                    value = parameters.typed(kind, text)
                except (ValueError, OverflowError):
                    block.fail(f"parameter {name}: expected a number, found '{shortened(text)}'", card)
                self.define(block, card, name, value)

    def expressions(self, block: Block):
        """Cards of a name and an expression; a card without a name goes on with the expression before."""
        width = 20 if block.long else 10
        found: list[list] = []
        for card in range(block.end):
            line = block.lines[card].decode("latin-1")
            head, comma, rest = line.partition(",")
            if not comma or len(head) > width:
                head, rest = line[:width], line[width:]
            if head.strip():
                found.append([card, head.strip(), rest])
            elif found:
                found[-1][2] += rest
        for card, word, text in found:
            try:
                kind, name = parameters.declared(word)
            except ValueError:
                block.fail(f"expected R, I or C and a name, found '{shortened(word)}'", card)
            try:
                value: parameters.Value = (
                    text.strip().strip("\"'")
                    if kind == "C"
                    else parameters.typed(kind, parameters.evaluate(text, block.scope))
                )
            except KeyError as error:
                block.fail(f"parameter {name}: {shortened(str(error.args[0]))} is not in the deck", card)
            except ValueError as error:
                block.fail(f"parameter {name}: '{shortened(text.strip())}' {shortened(str(error))}", card)
            self.define(block, card, name, value)


def keyword(line: bytes) -> tuple[str, str]:
    """The keyword in capitals without its star, and what stands behind it."""
    text = line.decode("utf-8", "replace")[1:].split("$")[0].strip()
    match = re.match(r"[^\s+%,]*", text)
    word = match[0] if match else ""
    rest = text[len(word) :].strip()
    if not rest and word.endswith("-"):
        word, rest = word[:-1], "-"
    return word.upper(), rest.upper()


def formats(rest: str, long: bool, wide: bool) -> tuple[bool, bool]:
    """Long format and ten columns for integers, from the words behind *KEYWORD."""
    for key, value in re.findall(r"(LONG|I10)\s*=\s*(\w)", rest):
        if key == "LONG":
            long = value in "YK"
        else:
            wide = value == "Y"
    return long, wide


def names(block: Block) -> list[tuple[str, int]]:
    """File names of a block and the cards where they end; a name that ends on ' +' goes on on the next card."""
    found, begun = [], ""
    for card in range(block.end):
        word = block.text(card)
        if word.endswith(" +"):
            begun += word[:-2].strip()
            continue
        if begun or word:
            found.append(((begun + word).strip("\"'"), card))
        begun = ""
        if block.name == "INCLUDE_TRANSFORM":
            break
    return found


def native(word: str) -> str:
    """A path with this system's separators."""
    return PureWindowsPath(word).as_posix()
