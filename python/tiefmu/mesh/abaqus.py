"""Reads what a tie needs from an Abaqus or CalculiX input file: nodes, elements, sets and surfaces, by part.

meshio reads this format too, but it drops the ids, keeps only the last *NODE block, and can put an element set on the
wrong block of elements - all without a word. Parts are put together in abaqus_assembly.py.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .._core import SceneError
from ..schema import found, shortened
from .data import Block, Sets

# Families of elements and the number of nodes behind their names: shells, membranes, surface, rigid and plane
# elements; solids, continuum shells, cohesive elements.
KIND = re.compile(
    r"(?P<surface>STRI|SFM3D|M3D|R3D|CPS|CPEG|CPE|CAX|AC2D|DC2D|DS|S)(?P<n>\d)|"
    r"(?:DCC3D|DC3D|AC3D|EC3D|C3D|COH3D|CSS|SC)(?P<m>\d+)"
)
SURFACES = {3: "triangle", 6: "triangle", 4: "quad", 8: "quad", 9: "quad"}
SOLIDS = {4: "tetra", 10: "tetra", 5: "pyramid", 13: "pyramid", 6: "wedge", 15: "wedge"} | dict.fromkeys(
    (8, 20, 27), "hexahedron"
)
# Keywords that make nodes or elements, or move them, without listing them.
GENERATORS = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM"}
MOST = 10**8  # ids in a generated set


@dataclass
class SetLine:
    """Part of the definition of a set or surface. members: ids; names: of other sets; `label`: of a surface's faces;
    elements: of a node set: the names are of element sets, whose nodes are meant."""

    members: np.ndarray
    names: list[str]
    label: str = ""
    instance: str = ""
    elements: bool = False


@dataclass
class Surface:
    """lines; of_nodes: TYPE=NODE; combine: how the surfaces that its lines name are combined, or nothing;
    unknown: a type that is not read."""

    lines: list[SetLine] = field(default_factory=list)
    of_nodes: bool = False
    combine: str = ""
    unknown: str = ""


class Part:
    """What stands between *PART and *END PART, in an instance or in the assembly, or a file without parts."""

    def __init__(self, name: str = ""):
        self.name = name
        self.nodes: list[tuple[np.ndarray, np.ndarray]] = []  # ids (n), positions (n, 3)
        self.blocks: list[Block] = []
        self.node_sets, self.element_sets, self.surfaces = Sets(True), Sets(True), Sets(True)

    def add(self, sets: Sets, name: str, lines: list[SetLine]):
        if name not in sets:
            sets[name] = []
        sets[name].extend(lines)


@dataclass
class Instance:
    """A part put into the assembly: own content besides the part's, translation (3), then rotation about the axis
    from a to b by an angle in degrees (a, b, angle: 7 numbers)."""

    part: str
    own: Part
    translation: np.ndarray
    rotation: np.ndarray | None


class InputFile:
    """root: what is outside parts and instances; parts by name in upper case; instances in order."""

    def __init__(self, path: Path):
        self.folder = path.parent
        self.root, self.parts, self.instances = Part(), {}, []
        self.scope = self.root
        keyword, options, block = "", {}, []
        for line in joined(included(path, self.folder, ())):
            if line[0] == "*":
                self.block(keyword, options, block)
                keyword, options = parse_keyword(line)
                block = []
            else:
                block.append(line)
        self.block(keyword, options, block)

    def block(self, keyword: str, options: dict, lines: list[str]):
        try:
            if keyword in ("NODE", "ELEMENT", "NSET", "ELSET") and options.get("INPUT"):
                lines = [*lines, *joined(included(self.folder / options["INPUT"], self.folder, ()))]
            if keyword == "NODE":
                self.read_nodes(options, lines)
            elif keyword == "ELEMENT":
                self.read_elements(options, lines)
            elif keyword == "NSET":
                self.read_set(self.scope.node_sets, options["NSET"], options, lines)
            elif keyword == "ELSET":
                self.read_set(self.scope.element_sets, options["ELSET"], options, lines)
            elif keyword == "SURFACE":
                self.read_surface(options, lines)
            elif keyword == "PART":
                self.scope = self.parts[options["NAME"].upper()] = Part(options["NAME"])
            elif keyword == "INSTANCE":
                self.read_instance(options, lines)
            elif keyword in ("END PART", "END INSTANCE"):
                self.scope = self.root
            elif keyword in GENERATORS:
                raise SceneError(f"*{keyword} makes or moves nodes without listing them; write the mesh out in full")
        except KeyError as error:
            raise SceneError(f"*{keyword}: parameter {error.args[0]} is missing") from None
        except (ValueError, IndexError, OverflowError) as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"*{keyword}: cannot be read ({error})") from None

    def read_nodes(self, options: dict, lines: list[str]):
        rows = [line.split(",") for line in lines]
        ids = whole([row[0] for row in rows])
        position = np.zeros((len(rows), 3))
        for k in range(min(3, max((len(row) for row in rows), default=1) - 1)):
            position[:, k] = numbers([row[k + 1] if len(row) > k + 1 else "" for row in rows])
        system = options.get("SYSTEM", "R").upper()[:1]
        if system == "C":
            r, angle = position[:, 0].copy(), np.radians(position[:, 1])
            position[:, 0], position[:, 1] = r * np.cos(angle), r * np.sin(angle)
        elif system == "S":
            r, theta, phi = position[:, 0].copy(), np.radians(position[:, 1]), np.radians(position[:, 2])
            position = np.column_stack(
                [r * np.cos(theta) * np.cos(phi), r * np.sin(theta) * np.cos(phi), r * np.sin(phi)]
            )
        elif system != "R":
            raise SceneError(f"*NODE: SYSTEM = {shortened(options['SYSTEM'])} is none of R, C, S")
        self.scope.nodes.append((ids, position))
        if options.get("NSET"):
            self.scope.add(self.scope.node_sets, options["NSET"], [SetLine(ids, [])])

    def read_elements(self, options: dict, lines: list[str]):
        match = KIND.match(options["TYPE"].upper())
        if match is None:
            shape, count = "other", None
        elif match["surface"]:
            count = int(match["n"])
            shape = SURFACES.get(count, "other")
        else:
            count = int(match["m"])
            shape = SOLIDS.get(count, "other")
        ids, nodes = records(lines, None if shape == "other" else count, shape == "quad")
        self.scope.blocks.append(Block(shape, ids, nodes))
        if options.get("ELSET"):
            self.scope.add(self.scope.element_sets, options["ELSET"], [SetLine(ids, [])])

    def read_set(self, sets: Sets, name: str, options: dict, lines: list[str]):
        if not name:
            raise SceneError("a set has no name")
        instance = options.get("INSTANCE", "")
        self.scope.add(sets, name, [])
        if sets is self.scope.node_sets and options.get("ELSET"):
            elements = SetLine(np.empty(0, np.int64), [options["ELSET"]], instance=instance, elements=True)
            self.scope.add(sets, name, [elements])
        if "GENERATE" in options:
            for line in lines:
                self.scope.add(sets, name, [SetLine(generated(name, line), [], instance=instance)])
            return
        items = ",".join(lines).split(",")
        try:
            members, names = whole([item for item in items if item.strip()]), []
        except ValueError:
            items = [item.strip() for item in items if item.strip()]
            members = whole([item for item in items if item.isdecimal()])
            names = [item.strip('"') for item in items if not item.isdecimal()]
        self.scope.add(sets, name, [SetLine(members, names, instance=instance)])

    def read_surface(self, options: dict, lines: list[str]):
        name = options["NAME"]
        surface = self.scope.surfaces[name] if name in self.scope.surfaces else Surface()
        self.scope.surfaces[name] = surface
        kind = options.get("TYPE", "ELEMENT").upper()
        surface.of_nodes = kind == "NODE"
        surface.combine = options.get("COMBINE", "").upper()
        if kind not in ("NODE", "ELEMENT"):
            surface.unknown = kind
            return
        for line in lines:
            what, _, label = line.partition(",")
            what, label = what.strip().strip('"'), label.split(",")[0].strip().upper()
            if surface.combine:
                names = [item.strip().strip('"') for item in line.split(",") if item.strip()]
                surface.lines.append(SetLine(np.empty(0, np.int64), names))
            elif what.isdecimal():
                surface.lines.append(SetLine(whole([what]), [], label))
            elif what:
                surface.lines.append(SetLine(np.empty(0, np.int64), [what], label))

    def read_instance(self, options: dict, lines: list[str]):
        name = options["NAME"]
        if "PART" not in options:
            raise SceneError(
                f"instance '{name}' comes from another file, which is not read; write the mesh out in full"
            )
        values = [numbers(line.rstrip(", ").split(",")) for line in lines]
        if len(values) > 2 or (values and len(values[0]) > 3) or (len(values) > 1 and len(values[1]) != 7):
            raise SceneError(f"instance '{name}': expected a translation (3 numbers) and a rotation (7 numbers)")
        translation = np.zeros(3)
        if values:
            translation[: len(values[0])] = values[0]
        self.scope = Part(name)
        self.instances.append(
            Instance(options["PART"], self.scope, translation, values[1] if len(values) > 1 else None)
        )


INCLUDE = re.compile(r"\*\s*include\s*,", re.IGNORECASE)


def included(path: Path, folder: Path, above: tuple[Path, ...]) -> list[str]:
    """Lines of the file and of those that it includes, comments and blank lines left out."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        if not above:
            raise
        raise SceneError(f"*INCLUDE: {path}: {error.strerror}") from None
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and line[:2] != "**"]
    if not INCLUDE.search(text):
        return lines
    flat = []
    for line in joined(lines):
        if line[0] == "*" and INCLUDE.match(line):
            name = parse_keyword(line)[1].get("INPUT", "")
            inner = path.parent / name
            if not inner.is_file():
                inner = folder / name  # as a path in Abaqus is one from the folder of the job
            if inner.resolve() in (*above, path.resolve()):
                raise SceneError(f"*INCLUDE: {name} includes itself")
            flat += included(inner, folder, (*above, path.resolve()))
        else:
            flat.append(line)
    return flat


def joined(lines: list[str]) -> list[str]:
    """The same with keyword lines that end with a comma and the lines that go on with them made one."""
    if not any(line[0] == "*" and line[-1] == "," for line in lines):
        return lines
    whole_lines = []
    for line in lines:
        before = whole_lines[-1] if whole_lines else ""
        if before[:1] == "*" and before[-1] == "," and line[0] != "*":
            whole_lines[-1] += line
        else:
            whole_lines.append(line)
    return whole_lines


def parse_keyword(line: str) -> tuple[str, dict[str, str]]:
    """ "*Element, type=S4R" -> ("ELEMENT", {"TYPE": "S4R"}); names of sets keep their case."""
    keyword, *rest = line[1:].split(",")
    options = {}
    for item in rest:
        key, _, value = item.partition("=")
        options[" ".join(key.upper().split())] = value.strip().strip('"')
    return " ".join(keyword.upper().split()), options


def whole(items: list[str]) -> np.ndarray:
    """Ids, or steps between ids; ValueError for what is no number."""
    values = list(map(int, items))
    bad = next((value for value in values if not 1 <= value < 2**63), None) if values else None
    if bad is not None:
        raise SceneError(f"{shortened(str(bad))} is no id; ids are whole numbers from 1")
    return np.array(values, np.int64)


def numbers(items: list[str]) -> np.ndarray:
    """Numbers as Fortran writes them (1.D0); blank: 0."""
    try:
        return np.array(list(map(float, items)))
    except ValueError:
        return np.array([float(re.sub("[dD]", "e", item)) if item.strip() else 0.0 for item in items])


def generated(name: str, line: str) -> np.ndarray:
    first, last, *step = whole([item for item in line.split(",") if item.strip()]).tolist()
    if len(step) > 1:
        raise SceneError(f"set '{name}': GENERATE takes first, last and step, found {found(line)}")
    if last - first > MOST:
        raise SceneError(f"set '{name}': {first} to {last} is more than a file can hold")
    return np.arange(first, last + 1, *step, dtype=np.int64)


def records(lines: list[str], count: int | None, quads: bool) -> tuple[np.ndarray, np.ndarray]:
    """Element records: ids (n), node ids (n, k), 0 where a record has fewer. A record of `count` nodes goes on over
    lines until it has them, of unknown count while lines end with a comma; one of three nodes for a quad ends where
    its line does."""
    rows = [line.split(",") for line in lines]
    if count is None or any(len(row) != count + 1 or not row[-1] for row in rows):
        rows = irregular(rows, count, quads)
    if not rows:
        return np.empty(0, np.int64), np.empty((0, count or 1), np.int64)
    width = max(map(len, rows))
    columns = [[row[k] if len(row) > k else "0" for row in rows] for k in range(width)]
    ids = whole(columns[0])
    nodes = np.zeros((len(rows), max(width - 1, count or 1)), np.int64)
    for k, column in enumerate(columns[1:]):
        nodes[:, k] = [int(item) for item in column]
    if nodes.min(initial=0) < 0:
        raise SceneError(f"{nodes.min()} is no id; ids are whole numbers from 1")
    return ids, nodes


def irregular(rows: list[list[str]], count: int | None, quads: bool) -> list[list[str]]:
    """Rows of lines put together to records, see above."""
    together, record = [], []

    def close():
        have = len(record) - 1
        if count and have != count and not (quads and count == 4 and have == 3):
            raise SceneError(f"element {shortened(record[0].strip())} has {have} nodes, its type has {count}")
        together.append(record)

    for row in rows:
        items = [item for item in row if item.strip()]
        goes_on = not row[-1].strip()
        if record and quads and count == 4 and len(record) == 4 and len(items) != 1:  # "5, 1, 2, 3," and no fourth
            close()
            record = []
        record = record + items
        if not record:
            continue
        full = len(record) > count if count else not goes_on
        if full or (quads and count == 4 and len(record) == 4 and not goes_on):
            close()
            record = []
    if record:
        close()
    return together
