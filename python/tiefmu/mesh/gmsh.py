"""Reads Gmsh files (.msh) of versions 2 and 4.1, text and binary, with their own ids and physical groups.

meshio reads them too, but it drops the ids, takes the last node for one that is missing, and knows physical groups by
their names only. A group without a name is called by its number; groups of one name are one set.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from .._core import SceneError
from ..schema import shortened
from .data import Block, MeshFile, Sets

# Gmsh's element types: shape and number of nodes
TYPES = {
    1: ("line", 2),
    2: ("triangle", 3),
    3: ("quad", 4),
    4: ("tetra", 4),
    5: ("hexahedron", 8),
    6: ("wedge", 6),
    7: ("pyramid", 5),
    8: ("line", 3),
    9: ("triangle", 6),
    10: ("quad", 9),
    11: ("tetra", 10),
    12: ("hexahedron", 27),
    13: ("wedge", 18),
    14: ("pyramid", 14),
    15: ("vertex", 1),
    16: ("quad", 8),
    17: ("hexahedron", 20),
    18: ("wedge", 15),
    19: ("pyramid", 13),
    20: ("triangle", 9),
    21: ("triangle", 10),
    26: ("line", 4),
    27: ("line", 5),
    28: ("line", 6),
    29: ("tetra", 20),
    36: ("quad", 16),
}
DIMENSIONS = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2}  # else 3
VERSIONS = ("2", "2.0", "2.1", "2.2", "4.1")


def version(path: Path) -> str | None:
    """Of the file format; None where the file is not Gmsh's."""
    with path.open("rb") as file:
        if file.readline().strip() != b"$MeshFormat":
            return None
        words = file.readline().decode("ascii", "replace").split()
    return words[0] if words else None


class Text:
    """The numbers of a text file, in order."""

    def __init__(self, data: bytes, at: int):
        self.data, self.at = data, at

    def line(self) -> bytes:
        end = self.data.find(b"\n", self.at)
        if end < 0:
            raise ValueError("the file ends early")
        line, self.at = self.data[self.at : end], end + 1
        return line

    def lines(self, count: int) -> list[bytes]:
        return [self.line() for _ in range(count)]

    def whole(self, count: int, size=None) -> list[int]:
        words = self.line().split()
        if len(words) < count:
            raise ValueError(f"expected {count} numbers, found {len(words)}")
        return list(map(int, words[:count]))

    def skip_line(self):
        pass


class Binary(Text):
    """The same of a binary file. Numbers are int32, or where size is "Q" size_t."""

    def __init__(self, data: bytes, at: int, order: str):
        super().__init__(data, at)
        self.order = order

    def array(self, kind, count: int) -> np.ndarray:
        kind = np.dtype(kind).newbyteorder(self.order)
        if count < 0 or self.at + count * kind.itemsize > len(self.data):
            raise ValueError("the file ends early")
        array = np.frombuffer(self.data, kind, count, self.at)
        self.at += count * kind.itemsize
        return array

    def whole(self, count: int, size="i") -> list[int]:
        return self.array("i4" if size == "i" else "u8", count).tolist()

    def skip_line(self):
        """Behind binary data stands the end of its line."""
        if self.data[self.at : self.at + 1] == b"\n":
            self.at += 1


class Reader:
    def __init__(self, data: bytes):
        self.names: dict[tuple[int, int], str] = {}  # (dimension, number) of physical groups
        self.groups_of: dict[tuple[int, int], list[int]] = {}  # (dimension, entity) -> its physical groups
        self.node_id, self.position = [], []
        self.blocks: list[Block] = []
        self.tags: list[list[tuple[str, np.ndarray]]] = []  # per block: (group, indices in the block)
        at = 0
        self.binary = self.new = False
        self.order = "<"
        while True:
            at = data.find(b"$", at)
            if at < 0:
                return
            end = data.find(b"\n", at)
            name = data[at + 1 : end if end >= 0 else len(data)].strip().decode("ascii", "replace")
            if end < 0 or name.startswith("End"):
                at += 1
                continue
            at = self.section(name, data, end + 1)

    def section(self, name: str, data: bytes, at: int) -> int:
        """Reads a section that starts at `at`; returns where it ends."""
        read = {
            "MeshFormat": self.read_format,
            "PhysicalNames": self.read_names,
            "Entities": self.read_entities,
            "PartitionedEntities": self.refuse_partitions,
            "Nodes": self.read_nodes_4 if self.new else self.read_nodes_2,
            "Elements": self.read_elements_4 if self.new else self.read_elements_2,
        }.get(name)
        if read is None:
            return max(data.find(b"$End" + name.encode("ascii", "replace"), at), at)
        text = name in ("MeshFormat", "PhysicalNames") or not self.binary
        source = Text(data, at) if text else Binary(data, at, self.order)
        try:
            read(source)
        except (ValueError, IndexError, OverflowError, struct.error) as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"${name}: cannot be read ({error})") from None
        return source.at

    def read_format(self, source: Text):
        words = source.line().split()
        self.new, self.binary = words[0].startswith(b"4"), words[1] == b"1"
        if self.binary:
            self.order = "<" if struct.unpack("<i", source.data[source.at : source.at + 4])[0] == 1 else ">"
            source.at += 5

    def read_names(self, source: Text):
        for line in source.lines(int(source.line())):
            dimension, number, name = line.decode("utf-8", "replace").split(None, 2)
            self.names[int(dimension), int(number)] = name.strip().strip('"')

    def refuse_partitions(self, source: Text):
        raise SceneError("is partitioned; save it in one piece")

    def read_entities(self, source):
        counts = source.whole(4, "Q")
        for dimension, count in enumerate(counts):
            for _ in range(count):
                if isinstance(source, Binary):
                    (tag,) = source.whole(1)
                    source.array("f8", 3 if dimension == 0 else 6)
                    groups = source.whole(*source.whole(1, "Q"))
                    if dimension:
                        source.whole(*source.whole(1, "Q"))
                else:
                    words = source.line().split()
                    first = 4 if dimension == 0 else 7
                    tag, number = int(words[0]), int(words[first])
                    groups = list(map(int, words[first + 1 : first + 1 + number]))
                self.groups_of[dimension, tag] = [abs(group) for group in groups]

    # nodes

    def read_nodes_2(self, source):
        count = int(source.line())
        if isinstance(source, Binary):
            table = source.array([("id", "i4"), ("x", "f8", 3)], count)
            self.node_id.append(table["id"].astype(np.int64))
            self.position.append(table["x"].astype(float))
            return
        rows = [line.split() for line in source.lines(count)]
        self.node_id.append(ids([row[0] for row in rows]))
        self.position.append(coordinates(rows, 1))

    def read_nodes_4(self, source):
        for _ in range(source.whole(4, "Q")[0]):
            if isinstance(source, Binary):
                dimension, _, parametric = source.whole(3)
                (count,) = source.whole(1, "Q")
                self.node_id.append(source.array("u8", count).astype(np.int64))
                columns = 3 + (dimension if parametric else 0)
                self.position.append(source.array("f8", columns * count).reshape(count, columns)[:, :3].astype(float))
            else:
                count = source.whole(4)[3]
                self.node_id.append(ids(source.lines(count)))
                self.position.append(coordinates([line.split() for line in source.lines(count)], 0))
        source.skip_line()

    # elements

    def add_block(self, kind: int, numbers: np.ndarray, nodes: np.ndarray, tags: list[tuple[int, np.ndarray]]):
        shape = TYPES[kind][0] if kind in TYPES else "other"
        if numbers.min(initial=1) < 1 or nodes.min(initial=1) < 1:
            raise SceneError("ids of nodes and elements start at 1")
        self.blocks.append(Block(shape, numbers, nodes))
        dimension = DIMENSIONS.get(shape, 3)
        self.tags.append([(self.names.get((dimension, tag), str(tag)), where) for tag, where in tags])

    def read_elements_2(self, source):
        count = int(source.line())
        grouped: dict[tuple[int, int], list[Any]] = {}  # (type, number of tags) -> rows
        if isinstance(source, Binary):
            while count > 0:
                kind, number, tags = source.whole(3)
                if kind not in TYPES or not 0 < number <= count:
                    raise ValueError(f"{number} elements of type {kind}")
                columns = 1 + tags + TYPES[kind][1]
                table = source.array("i4", number * columns).reshape(number, columns).astype(np.int64)
                grouped.setdefault((kind, tags), []).append(table)
                count -= number
            tables = {key: np.concatenate(rows) for key, rows in grouped.items()}
        else:
            for line in source.lines(count):
                row = line.split()
                grouped.setdefault((int(row[1]), int(row[2])), []).append(row)
            tables = {}
            for (kind, tags), rows in grouped.items():
                width = 3 + tags + TYPES[kind][1] if kind in TYPES else len(rows[0])
                short = next((row for row in rows if len(row) < width), None)
                if short is not None:
                    raise SceneError(f"element {shortened(short[0].decode('ascii', 'replace'))} has too few nodes")
                flat = [item for row in rows for item in row[:width]]
                table = ids(flat, least=None).reshape(len(rows), width)
                tables[kind, tags] = np.delete(table, [1, 2], axis=1)
        for (kind, tags), table in tables.items():
            physical = table[:, 1] if tags else np.zeros(len(table), np.int64)
            groups = [(int(g), np.flatnonzero(physical == g)) for g in np.unique(physical) if g != 0]
            self.add_block(kind, table[:, 0], table[:, 1 + tags :], groups)

    def read_elements_4(self, source):
        for _ in range(source.whole(4, "Q")[0]):
            if isinstance(source, Binary):
                dimension, entity, kind = source.whole(3)
                (count,) = source.whole(1, "Q")
                if kind not in TYPES:
                    raise ValueError(f"elements of type {kind}")
                columns = 1 + TYPES[kind][1]
                table = source.array("u8", count * columns).reshape(count, columns).astype(np.int64)
            else:
                dimension, entity, kind, count = source.whole(4)
                rows = [line.split() for line in source.lines(count)]
                columns = 1 + TYPES[kind][1] if kind in TYPES else min(map(len, rows), default=1)
                short = next((row for row in rows if len(row) < columns), None)
                if short is not None:
                    raise SceneError(f"element {shortened(short[0].decode('ascii', 'replace'))} has too few nodes")
                table = ids([item for row in rows for item in row[:columns]]).reshape(count, columns)
            everyone = np.arange(count)
            groups = [(group, everyone) for group in self.groups_of.get((dimension, entity), [])]
            self.add_block(kind, table[:, 0], table[:, 1:], groups)
        source.skip_line()

    def mesh_file(self) -> MeshFile:
        sizes = [len(block.ids) for block in self.blocks]
        starts = np.cumsum([0, *sizes])
        members: dict[str, list[np.ndarray]] = {}
        for start, tags in zip(starts, self.tags):
            for name, where in tags:
                members.setdefault(name, []).append(start + where)
        for (_, number), given in self.names.items():
            members.setdefault(given or str(number), [])
        sets = Sets()
        for name, rows in members.items():
            sets[name] = np.unique(np.concatenate([np.empty(0, int), *rows]))
        return MeshFile(
            np.concatenate([np.empty(0, np.int64), *self.node_id]),
            np.concatenate([np.empty((0, 3)), *self.position]),
            self.blocks,
            element_sets=sets,
        )


def read(path: Path) -> MeshFile:
    return Reader(path.read_bytes()).mesh_file()


def ids(items: list[bytes], least: int | None = 1) -> np.ndarray:
    values = list(map(int, items))
    if values and max(values) >= 2**63:
        raise SceneError(f"{max(values)} is no id; ids are less than {2**63}")
    if values and least is not None and min(values) < least:
        raise SceneError(f"{min(values)} is no id; ids are whole numbers from 1")
    return np.array(values, np.int64)


def coordinates(rows: list[list[bytes]], first: int) -> np.ndarray:
    position = np.empty((len(rows), 3))
    for k in range(3):
        position[:, k] = list(map(float, [row[first + k] for row in rows]))
    return position
