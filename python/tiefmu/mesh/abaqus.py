"""Reads what a tie needs from an Abaqus input file: nodes, shell-like elements and sets, with the file's own ids.

meshio reads this format too, but it drops the ids, keeps only the last *NODE block, and can put an element set on the
wrong block of elements - all without a word.
"""

import re
from pathlib import Path

from .._core import SceneError
from ..schema import shortened

# Three- and four-node elements that are surfaces: shells, membranes, surface, rigid and plane elements. The digit
# behind the family's name counts the nodes.
SURFACE = re.compile(r"(STRI|SFM3D|M3D|R3D|CPS|CPEG|CPE|CAX|DS|DC2D|S)(\d)")
# Keywords that make nodes or elements, or move them, without listing them.
MOST = 10**8  # ids in a generated set
GENERATORS = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM"}


class InputFile:
    """nodes: id -> [x, y, z]; segments: id -> node ids (three or four); node_sets: name -> node ids;
    element_sets: name -> element ids; corners: id -> node ids of every element, whatever its kind."""

    def __init__(self, path: Path):
        self.nodes, self.segments, self.corners = {}, {}, {}
        self.node_sets, self.element_sets = {}, {}
        self._read(path)

    def _read(self, path: Path):
        keyword, options, block = None, {}, []
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            line = line.strip()
            if not line or line.startswith("**"):
                continue
            if line.startswith("*"):
                self._block(path, keyword, options, block)
                keyword, options = parse_keyword(line)
                block = []
            else:
                block.append(line)
        self._block(path, keyword, options, block)

    def _block(self, path: Path, keyword: str | None, options: dict, lines: list[str]):
        try:
            if keyword == "NODE":
                self._nodes(options, lines)
            elif keyword == "ELEMENT":
                self._elements(options, lines)
            elif keyword == "NSET":
                self._set(self.node_sets, options["NSET"], options, lines)
            elif keyword == "ELSET":
                self._set(self.element_sets, options["ELSET"], options, lines)
            elif keyword == "INCLUDE":
                self._read(path.parent / options["INPUT"])
            elif keyword in GENERATORS or (keyword == "INSTANCE" and lines):
                raise SceneError(f"*{keyword} makes or moves nodes without listing them; write the mesh out in full")
        except (ValueError, KeyError, IndexError, OSError) as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"*{keyword}: cannot be read ({error})") from None

    def _nodes(self, options: dict, lines: list[str]):
        ids = []
        for line in lines:
            number, *rest = line.rstrip(",").split(",")
            position = [float(item) if item.strip() else 0.0 for item in rest[:3]]
            add(self.nodes, whole(number), position + [0.0] * (3 - len(position)), "node")
            ids.append(int(number))
        if "NSET" in options:
            self.node_sets.setdefault(options["NSET"], []).extend(ids)

    def _elements(self, options: dict, lines: list[str]):
        kind = options["TYPE"].upper()
        match = SURFACE.match(kind)
        count = int(match[2]) if match else None
        if count in (6, 8, 9):
            raise SceneError(f"element type {kind} is quadratic; segments need three or four nodes")
        ids = []
        for number, *nodes in records(lines, count if count in (3, 4) else None):
            add(self.corners, number, nodes, "element")
            if count in (3, 4):
                self.segments[number] = nodes
            ids.append(number)
        if "ELSET" in options:
            self.element_sets.setdefault(options["ELSET"], []).extend(ids)

    @staticmethod
    def _set(sets: dict, name: str, options: dict, lines: list[str]):
        members = sets.setdefault(name, [])
        for line in lines:
            items = [item.strip() for item in line.split(",") if item.strip()]
            if "GENERATE" in options:
                first, last, *step = map(whole, items)
                if len(step) > 1:
                    raise SceneError(f"set '{name}': GENERATE takes first, last and step, found '{line}'")
                if last - first > MOST:
                    raise SceneError(f"set '{name}': {first} to {last} is more than a file can hold")
                members.extend(range(first, last + 1, *step))
                continue
            for item in items:
                if item.isdigit():
                    members.append(whole(item))
                elif item in sets:
                    members.extend(sets[item])
                else:
                    raise SceneError(f"set '{name}': '{item}' is neither an id nor a set defined before")


def parse_keyword(line: str) -> tuple[str, dict]:
    """ "*Element, type=S4R" -> ("ELEMENT", {"TYPE": "S4R"}); names of sets keep their case."""
    keyword, *rest = line[1:].split(",")
    options = {}
    for item in rest:
        key, _, value = item.partition("=")
        options[key.strip().upper()] = value.strip().strip('"')
    return keyword.strip().upper(), options


def whole(text: str) -> int:
    """An id, or the step between ids."""
    number = int(text)
    if not 1 <= number < 2**63:
        raise SceneError(f"{shortened(text.strip())} is no id; ids are whole numbers from 1")
    return number


def records(lines: list[str], count: int | None):
    """Element records [id, nodes...]: of `count` nodes, or (None) continued where a line ends with a comma."""
    record = []

    def checked():
        if count and len(record) != count + 1:
            raise SceneError(f"element {record[0]} has {len(record) - 1} nodes, its type has {count}")
        return record

    for line in lines:
        record += [whole(item) for item in line.split(",") if item.strip()]
        if len(record) > count if count else not line.endswith(","):
            yield checked()
            record = []
    if record:
        yield checked()


def add(table: dict, number: int, value, what: str):
    if number in table:
        raise SceneError(f"{what} {number} is repeated")
    table[number] = value
