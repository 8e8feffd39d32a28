"""Reads what a tie needs from an Abaqus or CalculiX input file: nodes, elements, sets and surfaces, by part.

meshio reads this format too, but it drops the ids, keeps only the last *NODE block, and can put an element set on the
wrong block of elements - all without a word. Parts are put together in abaqus_assembly.py.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..schema import found, shortened
from . import abaqus_cards as cards
from . import fortran_numbers
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
        self.nodes: list[tuple[np.ndarray, np.ndarray, cards.Block]] = []  # ids (n), positions (n, 3), where
        self.blocks: list[Block] = []
        self.element_cards: list[cards.Block] = []  # of the blocks
        self.other_cards: list[cards.Block] = []  # what a mesh does not need
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
    where: str = ""


class InputFile:
    """root: what is outside parts and instances; parts by name in upper case; instances in order. file: how messages
    call it."""

    def __init__(self, path: Path, file: str = ""):
        self.file = file
        self.root, self.parts, self.instances = Part(), {}, []
        self.scope = self.root
        for block in cards.Reader(path, file).blocks:
            if block.key in READ:
                READ[block.key](self, block)
            elif block.key in GENERATORS:
                block.fail("makes or moves nodes without listing them; write the mesh out in full")
            else:
                self.scope.other_cards.append(block)

    def read_nodes(self, block: cards.Block):
        values = block.table(4, float)
        if values is not None and abs(values[:, 0]).max(initial=0) < 2**53 and (values[:, 0] % 1 == 0).all():
            ids, position = values[:, 0].astype(np.int64), values[:, 1:].copy()
            if ids.min(initial=1) < 1:
                row = int(np.argmin(ids))
                block.ids(row, [str(ids[row])])
        else:
            ids, position = self.nodes_line_by_line(block)
        system = block.get("SYSTEM", "R").upper()[:1]
        if system == "C":
            r, angle = position[:, 0].copy(), np.radians(position[:, 1])
            position[:, 0], position[:, 1] = r * np.cos(angle), r * np.sin(angle)
        elif system == "S":
            r, theta, phi = position[:, 0].copy(), np.radians(position[:, 1]), np.radians(position[:, 2])
            position = np.column_stack(
                [r * np.cos(theta) * np.cos(phi), r * np.sin(theta) * np.cos(phi), r * np.sin(phi)]
            )
        elif system != "R":
            block.fail(f"SYSTEM = {shortened(block.get('SYSTEM'))} is none of R, C, S")
        self.scope.nodes.append((ids, position, block))
        if block.get("NSET"):
            self.scope.add(self.scope.node_sets, block.get("NSET"), [SetLine(ids, [])])

    def nodes_line_by_line(self, block: cards.Block) -> tuple[np.ndarray, np.ndarray]:
        """Ids and positions where a line is shorter, longer or written otherwise than most are."""
        ids, position = np.zeros(len(block.lines), np.int64), np.zeros((len(block.lines), 3))
        for index, line in enumerate(block.lines):
            number, *x = line.split(",")
            ids[index : index + 1] = block.ids(index, [number])
            position[index, : len(x[:3])] = block.numbers(index, x[:3])
        return ids, position

    def read_elements(self, block: cards.Block):
        kind = block.need("TYPE").upper()
        match = KIND.match(kind)
        if match is None:
            shape, count = "other", None
        elif match["surface"]:
            count = int(match["n"])
            shape = SURFACES.get(count, "other")
        else:
            count = int(match["m"])
            shape = SOLIDS.get(count, "other")
        ids, nodes = records(block, None if shape == "other" else count, shape == "quad")
        self.scope.blocks.append(Block(shape, ids, nodes))
        self.scope.element_cards.append(block)
        if block.get("ELSET"):
            self.scope.add(self.scope.element_sets, block.get("ELSET"), [SetLine(ids, [])])

    def read_node_set(self, block: cards.Block):
        self.read_set(self.scope.node_sets, block.need("NSET"), block)

    def read_element_set(self, block: cards.Block):
        self.read_set(self.scope.element_sets, block.need("ELSET"), block)

    def read_set(self, sets: Sets, name: str, block: cards.Block):
        instance = block.get("INSTANCE")
        self.scope.add(sets, name, [])
        if sets is self.scope.node_sets and block.get("ELSET"):
            elements = SetLine(np.empty(0, np.int64), [block.get("ELSET")], instance=instance, elements=True)
            self.scope.add(sets, name, [elements])
        if block.has("GENERATE"):
            for index in range(len(block.lines)):
                self.scope.add(sets, name, [SetLine(generated(name, block, index), [], instance=instance)])
            return
        items = ",".join(block.lines).split(",")
        names: list[str] = []
        try:
            members = whole([item for item in items if item.strip()])
        except ValueError:
            ids = [np.empty(0, np.int64)]
            for index, items in block.rows():
                ids.append(block.ids(index, [item for item in items if item.isdecimal()]))
                names += [item for item in items if item and not item.isdecimal()]
            members = np.concatenate(ids)
        self.scope.add(sets, name, [SetLine(members, names, instance=instance)])

    def read_surface(self, block: cards.Block):
        name = block.need("NAME")
        surface = self.scope.surfaces[name] if name in self.scope.surfaces else Surface()
        self.scope.surfaces[name] = surface
        kind = block.get("TYPE", "ELEMENT").upper()
        surface.of_nodes = kind == "NODE"
        surface.combine = block.get("COMBINE").upper()
        if kind not in ("NODE", "ELEMENT"):
            surface.unknown = kind
            return
        for index, items in block.rows():
            what, label = items[0], items[1].upper() if len(items) > 1 else ""
            if surface.combine:
                surface.lines.append(SetLine(np.empty(0, np.int64), [item for item in items if item]))
            elif what.isdecimal():
                surface.lines.append(SetLine(block.ids(index, [what]), [], label))
            elif what:
                surface.lines.append(SetLine(np.empty(0, np.int64), [what], label))

    def read_part(self, block: cards.Block):
        name = block.need("NAME")
        if name.upper() in self.parts:
            block.fail(f"part '{shortened(name)}' is repeated")
        self.scope = self.parts[name.upper()] = Part(name)

    def read_instance(self, block: cards.Block):
        name = block.need("NAME")
        if not block.get("PART"):
            block.fail(f"instance '{name}' comes from another file, which is not read; write the mesh out in full")
        values = [block.numbers(index, line.rstrip(", \t\r").split(",")) for index, line in enumerate(block.lines)]
        if len(values) > 2 or (values and len(values[0]) > 3) or (len(values) > 1 and len(values[1]) != 7):
            block.fail(f"instance '{name}': expected a translation (3 numbers) and a rotation (7 numbers)")
        translation = np.zeros(3)
        if values:
            translation[: len(values[0])] = values[0]
        self.scope = Part(name)
        rotation = values[1] if len(values) > 1 else None
        self.instances.append(Instance(block.get("PART"), self.scope, translation, rotation, block.where))

    def end(self, block: cards.Block):
        self.scope = self.root


READ = {
    "NODE": InputFile.read_nodes,
    "ELEMENT": InputFile.read_elements,
    "NSET": InputFile.read_node_set,
    "ELSET": InputFile.read_element_set,
    "SURFACE": InputFile.read_surface,
    "PART": InputFile.read_part,
    "INSTANCE": InputFile.read_instance,
    "ENDPART": InputFile.end,
    "ENDINSTANCE": InputFile.end,
}


def whole(items: list[str]) -> np.ndarray:
    """Ids; ValueError for what is none."""
    values = fortran_numbers.whole(items)
    if values.min(initial=1) < 1:
        raise ValueError
    return values


def generated(name: str, block: cards.Block, index: int) -> np.ndarray:
    items = [item for item in block.lines[index].split(",") if item.strip()]
    values = block.ids(index, items).tolist()
    if not 2 <= len(values) <= 3:
        block.fail(
            f"set '{name}': GENERATE takes first, last and step, found {found(block.lines[index].strip())}", index
        )
    first, last, *step = values
    if last - first > MOST:
        block.fail(f"set '{name}': {first} to {last} is more than a file can hold", index)
    return np.arange(first, last + 1, *step, dtype=np.int64)


def records(block: cards.Block, count: int | None, quads: bool) -> tuple[np.ndarray, np.ndarray]:
    """Element records: ids (n), node ids (n, k), 0 where a record has fewer. A record of `count` nodes goes on over
    lines until it has them, of unknown count while lines end with a comma; one of three nodes for a quad ends where
    its line does."""
    values = block.table(count + 1, np.int64) if count is not None else None
    if values is not None and values.max(initial=0) < 2**62:
        starts = list(range(len(values)))
    else:
        rows, starts = irregular(block, count, quads)
        width = max(max(map(len, rows), default=1), (count or 1) + 1)
        values = np.zeros((len(rows), width), np.int64)
        for row, (items, start) in enumerate(zip(rows, starts)):
            values[row, : len(items)] = block.whole(start, items)
    ids, nodes = values[:, 0], values[:, 1:]
    for column in (np.where(ids < 1, ids, 1), nodes.min(axis=1, initial=0)):
        if column.min(initial=1) < 0 or ids.min(initial=1) < 1:
            row = int(np.argmin(column))
            block.fail(f"{column[row]} is no id; ids are whole numbers from 1", starts[row])
    return ids, nodes


def irregular(block: cards.Block, count: int | None, quads: bool) -> tuple[list[list[str]], list[int]]:
    """Lines put together to records, see above, and the line where each starts."""
    together, starts, record, start = [], [], [], 0

    def close():
        have = len(record) - 1
        if count and have != count and not (quads and count == 4 and have == 3):
            block.fail(f"element {shortened(record[0].strip())} has {have} nodes, its type has {count}", start)
        together.append(record)
        starts.append(start)

    for index, line in enumerate(block.lines):
        row = line.split(",")
        items = [item for item in row if item.strip()]
        goes_on = not row[-1].strip()
        if record and quads and count == 4 and len(record) == 4 and len(items) != 1:  # "5, 1, 2, 3," and no fourth
            close()
            record = []
        if not record:
            start = index
        record = record + items
        if not record:
            continue
        full = len(record) > count if count else not goes_on
        if full or (quads and count == 4 and len(record) == 4 and not goes_on):
            close()
            record = []
    if record:
        close()
    return together, starts
