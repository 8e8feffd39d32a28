"""Abaqus and CalculiX input files as blocks: a keyword line and its data lines, includes followed, comments left out.

A block remembers where its lines stand, so that messages can name them.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from .._core import SceneError
from ..schema import shortened
from .fortran_numbers import FieldError, numbers, table, whole

MOST_INCLUDES = 1000
# Parameters without a value, which may stand alone on the line that a keyword line goes on to.
FLAGS = {"GENERATE", "INTERNAL", "UNSORTED", "COMPOSITE", "NOROTATION", "NOTHICKNESS", "MASTERNODES"}


@dataclass
class Block:
    """keyword: in capitals, its words a blank apart; options: names in capitals without blanks, values as written;
    file, number: where the keyword stands; step: 0 before the first *STEP, else its number; lines: data lines; runs:
    (first line, file, its number) of those that follow one another in a file."""

    keyword: str
    options: dict[str, str]
    file: str
    number: int
    step: int = 0
    lines: list[str] = field(default_factory=list)
    runs: list[tuple[int, str, int]] = field(default_factory=list)

    def __post_init__(self):
        self.key = self.keyword.replace(" ", "")  # CalculiX knows no blanks

    @property
    def name(self) -> str:
        return f"*{shortened(self.keyword)}"

    @property
    def where(self) -> str:
        return f"{place(self.file, self.number)}: {self.name}"

    def at(self, line: int) -> str:
        """How messages call a data line."""
        first, file, number = next(
            (run for run in reversed(self.runs) if run[0] <= line), (line, self.file, self.number)
        )
        return f"{place(file, number + line - first)}: {self.name}"

    def fail(self, text: str, line: int | None = None) -> NoReturn:
        raise SceneError(f"{self.where if line is None else self.at(line)}: {text}")

    def get(self, option: str, default: str = "") -> str:
        return self.options.get(option.replace(" ", ""), default)

    def need(self, option: str) -> str:
        value = self.get(option)
        if not value:
            self.fail(f"parameter {option} is missing")
        return value

    def has(self, option: str) -> bool:
        return option.replace(" ", "") in self.options

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """(number of the data line, its fields without blanks around them and quotes)."""
        for index, line in enumerate(self.lines):
            yield index, [item.strip().strip('"') for item in line.split(",")]

    def numbers(self, line: int, items: list[str]) -> np.ndarray:
        try:
            return numbers(items)
        except FieldError as error:
            self.fail(str(error), line)

    def whole(self, line: int, items: list[str]) -> np.ndarray:
        try:
            return whole(items)
        except FieldError as error:
            self.fail(str(error), line)

    def ids(self, line: int, items: list[str]) -> np.ndarray:
        """Ids, or steps between them: whole numbers from 1."""
        values = self.whole(line, items)
        if values.min(initial=1) < 1:
            self.fail(f"{values.min()} is no id; ids are whole numbers from 1", line)
        return values

    def data(self, line: int = 0) -> list[float]:
        """Numbers of a data line; none where the block has no such line."""
        if line >= len(self.lines):
            return []
        return self.numbers(line, self.lines[line].rstrip(", \t").split(",")).tolist()

    def table(self, columns: int, dtype: type) -> np.ndarray | None:
        """All data lines at once, as fortran_numbers.table."""
        return table(self.lines, columns, dtype)


def place(file: str, number: int) -> str:
    return f"{file}: line {number}" if file else f"line {number}"


class Reader:
    """Reads a file and its includes. name: how messages call it; "": not at all."""

    def __init__(self, path: Path, name: str):
        self.folder, self.blocks, self.step, self.files = path.parent, [], 0, 0
        self.read(path, name, ())

    def read(self, path: Path, name: str, above: tuple[Path, ...]):
        self.files += 1
        if self.files > MOST_INCLUDES:
            raise SceneError(f"*INCLUDE: more than {MOST_INCLUDES} files")
        lines = path.read_text(encoding="utf-8-sig", errors="replace").split("\n")
        special = [i for i, line in enumerate(lines) if not line or (line[0] in "* \t\r" and not is_data(line))]
        done = 0
        for i in special:
            if i < done:  # went on with the keyword line before
                continue
            self.add(lines, done, i, name)
            text, done = lines[i].strip(), i + 1
            if text[:1] != "*" or text[:2] == "**":
                continue
            while text[-1] == ",":
                following = next((k for k in range(done, len(lines)) if not is_remark(lines[k])), None)
                if following is None or not goes_on(lines[following]):
                    break
                text, done = text + lines[following].strip(), following + 1
            self.keyword(text, name, i + 1, path, above)
        self.add(lines, done, len(lines), name)

    def add(self, lines: list[str], start: int, end: int, name: str):
        """Data lines, to the block that is open."""
        if start >= end:
            return
        if not self.blocks:
            raise SceneError(
                f"{place(name, start + 1)}: expected a keyword such as *NODE, found {found_in(lines[start])}"
            )
        block = self.blocks[-1]
        block.runs.append((len(block.lines), name, start + 1))
        block.lines += lines[start:end]

    def keyword(self, text: str, name: str, number: int, path: Path, above: tuple[Path, ...]):
        keyword, options = parse_keyword(text)
        block = Block(keyword, options, name, number, self.step)
        if block.key == "INCLUDE":
            self.include(block, block.need("INPUT"), path, above)
            return
        if block.key == "STEP":
            self.step += 1
            block.step = self.step
        self.blocks.append(block)
        if block.key in ("NODE", "ELEMENT", "NSET", "ELSET") and block.get("INPUT"):
            self.include(block, block.get("INPUT"), path, above)

    def include(self, block: Block, wanted: str, path: Path, above: tuple[Path, ...]):
        inner = path.parent / wanted
        if not inner.is_file():
            inner = self.folder / wanted  # as a path in Abaqus is one from the folder of the job
        if not inner.is_file() and "\\" in wanted:
            inner = path.parent / wanted.replace("\\", "/")
        try:
            if inner.resolve() in (*above, path.resolve()):
                block.fail(f"{wanted} includes itself")
            self.read(inner, printable(wanted), (*above, path.resolve()))
        except (OSError, ValueError) as error:
            if isinstance(error, SceneError):
                raise
            block.fail(f"{shortened(wanted)}: {getattr(error, 'strerror', None) or error}")


def is_remark(line: str) -> bool:
    text = line.strip()
    return not text or text[:2] == "**"


def is_data(line: str) -> bool:
    text = line.lstrip()
    return bool(text) and text[0] != "*"


def goes_on(line: str) -> bool:
    """Whether a line goes on with the keyword line before, which ends with a comma: it gives parameters. CalculiX reads
    a comma at the end of a keyword line as none, and data after it."""
    text = line.strip()
    if text[0] == "*":
        return False
    items = [item.replace(" ", "").upper() for item in text.split(",") if item.strip()]
    return any("=" in item for item in items) or all(item in FLAGS for item in items)


def found_in(line: str) -> str:
    return f"'{shortened(''.join(c if c.isprintable() else ' ' for c in line).strip())}'"


def parse_keyword(line: str) -> tuple[str, dict[str, str]]:
    """ "*Element, type=S4R" -> ("ELEMENT", {"TYPE": "S4R"}); names of sets keep their case."""
    keyword, *rest = split_quoted(line[1:]) if '"' in line else line[1:].split(",")
    options = {}
    for item in rest:
        key, _, value = item.partition("=")
        key = "".join(key.upper().split())
        if key:
            options[key] = printable(value.strip().strip('"'))
    return printable(" ".join(keyword.upper().split())), options


def printable(text: str) -> str:
    return text if text.isprintable() else "".join(c if c.isprintable() else " " for c in text)


def split_quoted(text: str) -> list[str]:
    """Items between commas that do not stand between quotes."""
    return re.findall(r'(?:[^,"]|"[^"]*"?)+|(?<=,)(?=,|$)', text)
