"""Nodes, segments and named sets of a scene, inline or from a mesh file.

Ids: an Abaqus file (.inp) and a Gmsh text file (.msh, versions 2 and 4.1) keep their own node and element ids. Any
other format, and binary Gmsh, is numbered from 1 in file order - meshio does not hand the ids on - and a note says so.

Segments are the triangles and quads of the file. A set of nodes is usable where nodes are asked for; a set of elements
(a Gmsh physical group) where segments are asked for, with its triangles and quads, and where nodes are asked for,
with the nodes of all its elements.
"""

import contextlib
import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .._core import SceneError
from ..schema import LARGEST
from . import abaqus

QUADRATIC = {"triangle6", "triangle7", "quad8", "quad9"}
CORNERS = {"triangle": 3, "quad": 4}


@dataclass
class Mesh:
    """Positions are in the units of the file; node indices in `segments` (n, 4), a triangle's fourth is -1;
    sets: name -> sorted indices of nodes or of segments."""

    node_id: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    position: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    segment_id: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    segments: np.ndarray = field(default_factory=lambda: np.empty((0, 4), np.int32))
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    segment_sets: dict[str, np.ndarray] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add_nodes(self, ids, position):
        """Appends nodes: ids (n), position (n, 3)."""
        self.node_id = np.concatenate([self.node_id, np.asarray(ids, np.int64)])
        self.position = np.concatenate([self.position, np.asarray(position, float).reshape(-1, 3)])
        if self.node_id.min(initial=1) < 1:
            raise SceneError(f"node {self.node_id.min()}: ids start at 1")
        refuse_repeated("node", self.node_id)

    def add_segments(self, ids, node_ids):
        """Appends segments: ids (n), node_ids (n, 4) with 0 as a triangle's fourth."""
        node_ids = np.asarray(node_ids, np.int64).reshape(-1, 4)
        ids = np.asarray(ids, np.int64)
        if ids.min(initial=1) < 1:
            raise SceneError(f"segment {ids.min()}: ids start at 1")
        nodes = find(self.node_id, node_ids)
        missing = np.argwhere((nodes < 0) & (node_ids != 0))
        if len(missing):
            row, column = missing[0]
            raise SceneError(f"segment {ids[row]}: node {node_ids[row, column]} is not in the mesh{span(self.node_id)}")
        ordered = np.sort(np.where(node_ids == 0, -np.arange(1, 5), node_ids), axis=1)
        twice = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
        if len(twice):
            row = ordered[twice[0]]
            node = row[1:][row[1:] == row[:-1]][0]
            raise SceneError(f"segment {ids[twice[0]]}: node {node} is repeated; a triangle has three node ids")
        self.segment_id = np.concatenate([self.segment_id, ids])
        self.segments = np.concatenate([self.segments, nodes.astype(np.int32)])
        refuse_repeated("segment", self.segment_id)


def find(ids: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Index of each wanted id in ids; -1 where there is none."""
    if not len(ids):
        return np.full(np.shape(wanted), -1)
    order = np.argsort(ids, kind="stable")
    place = np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)
    index = order[place]
    return np.where(ids[index] == wanted, index, -1)


def span(ids: np.ndarray) -> str:
    """' (ids 1..101)', to go behind 'is not in the mesh'."""
    return f" (ids {ids.min()}..{ids.max()})" if len(ids) else " (it has none)"


def refuse_repeated(what: str, ids: np.ndarray):
    ordered = np.sort(ids)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if len(twice):
        raise SceneError(f"{what} {twice[0]} is repeated")


def build(table, folder: Path) -> Mesh:
    """The mesh of a scene's [mesh] table: its file, if any, relative to `folder`, then what is inline."""
    mesh = Mesh()
    try:
        if table.file is not None:
            read_into(mesh, folder / table.file, table.file)
        if table.nodes:
            mesh.add_nodes([row[0] for row in table.nodes], [row[1:] for row in table.nodes])
        if not len(mesh.node_id):
            raise SceneError("has no nodes; give nodes = [[id, x, y, z], ...] or file")
        if table.segments:
            mesh.add_segments(
                [row[0] for row in table.segments], [row[1:] + [0] * (5 - len(row)) for row in table.segments]
            )
    except SceneError as error:
        raise SceneError(f"mesh: {error}") from None
    return mesh


def read_into(mesh: Mesh, path: Path, name: str):
    """Reads the file into the empty mesh; `name` is how messages call it."""
    try:
        if not path.is_file():
            raise SceneError("no such file")
        if path.suffix.lower() == ".inp":
            read_abaqus(mesh, path)
        else:
            read_meshio(mesh, path, name)
        bad = np.flatnonzero(~np.isfinite(mesh.position).all(axis=1))
        if len(bad):
            raise SceneError(f"node {mesh.node_id[bad[0]]}: a coordinate is not a finite number")
        bad = np.flatnonzero((abs(mesh.position) > LARGEST).any(axis=1))
        if len(bad):
            raise SceneError(f"node {mesh.node_id[bad[0]]}: a coordinate is too large; it must be at most {LARGEST:g}")
    except OSError as error:
        raise SceneError(f"file: {name}: {error.strerror or error}") from None
    except SceneError as error:
        raise SceneError(f"file: {name}: {error}") from None


def read_abaqus(mesh: Mesh, path: Path):
    file = abaqus.InputFile(path)
    mesh.add_nodes(list(file.nodes), list(file.nodes.values()))
    mesh.add_segments(list(file.segments), [nodes + [0] * (4 - len(nodes)) for nodes in file.segments.values()])
    for name, ids in file.element_sets.items():
        unknown = [number for number in ids if number not in file.corners]
        if unknown:
            raise SceneError(f"set '{name}': element {unknown[0]} is not in the file")
        mesh.segment_sets[name] = set_of(mesh.segment_id, [number for number in ids if number in file.segments], name)
        mesh.node_sets[name] = set_of(mesh.node_id, [node for number in ids for node in file.corners[number]], name)
    for name, ids in file.node_sets.items():
        mesh.node_sets[name] = set_of(mesh.node_id, ids, name)


def set_of(ids: np.ndarray, members: list[int], name: str) -> np.ndarray:
    members = np.unique(np.asarray(members, np.int64))
    index = find(ids, members)
    if (index < 0).any():
        raise SceneError(f"set '{name}': node {members[index < 0][0]} is not in the file")
    return np.unique(index)


def read_meshio(mesh: Mesh, path: Path, name: str):
    import meshio  # here, because importing it takes a third of a second

    said = io.StringIO()
    try:  # meshio prints, and ends the program, where it cannot read
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            read = meshio.read(path)
    except (Exception, SystemExit) as error:
        words = " ".join((said.getvalue() if isinstance(error, SystemExit) else str(error)).split())
        raise SceneError(f"meshio cannot read it{f': {words}' if words else ''}") from None

    quadratic = next((block.type for block in read.cells if block.type in QUADRATIC), None)
    if quadratic:
        raise SceneError(f"its '{quadratic}' elements are quadratic; segments need linear triangles and quads")
    if read.points.ndim != 2 or not 1 <= read.points.shape[1] <= 3:
        raise SceneError("meshio cannot read it: its points have no coordinates x, y, z")
    position = np.zeros((len(read.points), 3))
    position[:, : read.points.shape[1]] = read.points[:, :3]
    counts = {kind: sum(len(block.data) for block in read.cells if block.type == kind) for kind in CORNERS}

    tags = gmsh_tags(path, len(position), counts)
    if tags is None:
        mesh.notes.append(f"mesh: {name}: nodes and segments are numbered from 1 in file order")
        tags = np.arange(1, len(position) + 1), None
    mesh.add_nodes(tags[0], position)

    # per block of cells: the index of its first segment, or None where its cells are no segments
    first, ids, rows, taken = [], [], [], dict.fromkeys(CORNERS, 0)
    total = 0
    for block in read.cells:
        corners = CORNERS.get(block.type)
        first.append(None if corners is None else total)
        if corners is None:
            continue
        n = len(block.data)
        nodes = np.zeros((n, 4), np.int64)
        nodes[:, :corners] = mesh.node_id[block.data]
        rows.append(nodes)
        start = taken[block.type]
        ids.append(np.arange(total + 1, total + n + 1) if tags[1] is None else tags[1][block.type][start : start + n])
        taken[block.type] += n
        total += n
    if total:
        mesh.add_segments(np.concatenate(ids), np.concatenate(rows))

    for set_name, blocks in element_sets(read).items():
        segments, nodes = [], []
        for start, block, members in zip(first, read.cells, blocks):
            if members is None or not len(members):
                continue
            nodes.append(np.ravel(block.data[members]))
            if start is not None:
                segments.append(start + np.asarray(members, int))
        mesh.segment_sets[set_name] = np.unique(np.concatenate(segments)) if segments else np.empty(0, int)
        mesh.node_sets[set_name] = np.unique(np.concatenate(nodes)) if nodes else np.empty(0, int)
    for set_name, members in read.point_sets.items():
        mesh.node_sets[set_name] = np.unique(np.asarray(members, int))


def element_sets(read) -> dict[str, list]:
    """name -> per block of cells the members' indices. Gmsh 2 files hold physical groups as numbers of the cells."""
    sets = {name: blocks for name, blocks in read.cell_sets.items() if not name.startswith("gmsh:")}
    physical = read.cell_data.get("gmsh:physical")
    for name, value in read.field_data.items():
        if physical is not None and name not in sets and len(value) == 2:
            tag, dimension = value
            sets[name] = [
                np.flatnonzero(numbers == tag) if block.dim == dimension else None
                for block, numbers in zip(read.cells, physical)
            ]
    return sets


def gmsh_tags(path: Path, nodes: int, counts: dict[str, int]):
    """Node ids, and element ids of the triangles and quads, in the order of a Gmsh text file; None where the file is
    none, or where they do not add up to what meshio found."""
    if path.suffix.lower() != ".msh":
        return None
    lines = path.read_bytes().split(b"\n")
    sections = {line.strip(): number for number, line in enumerate(lines) if line.startswith(b"$")}
    try:
        version, mode = lines[sections[b"$MeshFormat"] + 1].split()[:2]
        if mode != b"0" or version not in (b"2", b"2.2", b"4", b"4.1"):
            return None
        parse = tags_of_version_2 if version.startswith(b"2") else tags_of_version_4
        node_tags, element_tags = parse(lines, sections[b"$Nodes"] + 1, sections[b"$Elements"] + 1)
    except (KeyError, ValueError, IndexError):
        return None
    if len(node_tags) != nodes or any(len(element_tags[kind]) != counts[kind] for kind in CORNERS):
        return None
    for what, tags in ("node", node_tags), *(("segment", element_tags[kind]) for kind in CORNERS):
        if max(tags, default=1) >= 2**63:
            raise SceneError(f"{what} {max(tags)}: ids are less than {2**63}")
    return np.array(node_tags), element_tags


GMSH_TYPES = {2: "triangle", 3: "quad"}


def tags_of_version_2(lines: list[bytes], nodes: int, elements: int):
    node_tags = [int(line.split(None, 1)[0]) for line in lines[nodes + 1 : nodes + 1 + int(lines[nodes])]]
    element_tags = {kind: [] for kind in CORNERS}
    for line in lines[elements + 1 : elements + 1 + int(lines[elements])]:
        tag, kind = map(int, line.split(None, 2)[:2])
        if kind in GMSH_TYPES:
            element_tags[GMSH_TYPES[kind]].append(tag)
    return node_tags, element_tags


def tags_of_version_4(lines: list[bytes], nodes: int, elements: int):
    node_tags, element_tags = [], {kind: [] for kind in CORNERS}
    line = nodes + 1
    for _ in range(int(lines[nodes].split()[0])):
        count = int(lines[line].split()[3])
        node_tags += map(int, lines[line + 1 : line + 1 + count])
        line += 1 + 2 * count
    line = elements + 1
    for _ in range(int(lines[elements].split()[0])):
        _, _, kind, count = map(int, lines[line].split())
        if kind in GMSH_TYPES:
            element_tags[GMSH_TYPES[kind]] += [int(row.split(None, 1)[0]) for row in lines[line + 1 : line + 1 + count]]
        line += 1 + count
    return node_tags, element_tags
