"""Surfaces of an input file: as faces for masters, as nodes for slaves."""

import numpy as np

from ..._core import SceneError
from ...mesh import faces as mesh_faces
from ...mesh.abaqus import SetLine, Surface
from ...mesh.abaqus_assembly import Scope
from ...mesh.abaqus_cards import Block
from ..lumping import EDGES
from ..model import Faces
from .source import NONE, Source

SECOND_ORDER = {("triangle", 6): "tri6", ("quad", 8): "quad8", ("quad", 9): "quad8", ("tetra", 10): "tet10",
    ("wedge", 15): "wedge15", ("hexahedron", 20): "hex20"}  # fmt: skip


def slaves(source: Source, scope: Scope, name: str, block: Block, line: int) -> tuple[np.ndarray, bool]:
    """Nodes of a surface, else of a node set, else of the elements of an element set; and whether they are those of
    faces, whose thickness counts."""
    if source.has("surfaces", scope, name):
        nodes, of_faces = nodes_of_surface(source, scope, name, block, line)
    elif source.has("node_sets", scope, name):
        nodes, of_faces = source.nodes(scope, name, block, line), False
    elif source.has("element_sets", scope, name):
        nodes, of_faces = nodes_of_rows(source, source.rows(scope, name, block, line)), False
    else:
        block.fail(f"there is no surface or set '{name}'", line)
    return np.unique(nodes), of_faces


def masters(source: Source, scope: Scope, name: str, block: Block, line: int) -> Faces:
    """Faces of a surface, else of an element set: its shells, or where it has none the outer faces of its solids."""
    try:
        if source.has("surfaces", scope, name):
            kind, *value = source.assembly.surface(scope, name)
            if kind == "nodes":
                block.fail(
                    f"master '{name}' is a surface of nodes; a tie here needs faces: swap them, or give faces", line
                )
            return of_faces(source, *value)
        if source.has("element_sets", scope, name):
            rows = source.rows(scope, name, block, line)
            return of_faces(source, rows, np.zeros(len(rows), int))
        if source.has("node_sets", scope, name):
            block.fail(f"master '{name}' is a set of nodes; a tie here needs faces", line)
    except SceneError as error:
        words = str(error)
        raise (
            error if words.startswith(block.at(line)) else SceneError(f"{block.at(line)}: '{name}': {words}")
        ) from None
    block.fail(f"there is no surface or set '{name}'", line)


def nodes_of_surface(source: Source, scope: Scope, name: str, block: Block, line: int) -> tuple[np.ndarray, bool]:
    """Nodes of faces, mid-side ones too, of edges, or of a surface of nodes."""
    place, definitions = source.assembly.defined("surfaces", scope, name)
    edges = [one for surface in definitions for one in surface.lines if is_edge(surface, one)]
    nodes, of_faces = NONE, False
    try:
        if edges:
            nodes = np.concatenate([edge_nodes(source, place, one, block) for one in edges])
            rest = [faces_only(surface) for surface in definitions]
            values = [source.assembly.one_surface(place, surface) for surface in rest if surface.lines]
        else:
            values = [source.assembly.surface(scope, name)]
        for kind, *value in values:
            if kind == "nodes":
                found = source.deck.nodes(value[0], block.at(line))
            else:
                found, of_faces = of_faces_nodes(source, *value), True
            nodes = np.concatenate([nodes, found])
    except SceneError as error:
        words = str(error)
        raise (
            error if words.startswith(block.at(line)) else SceneError(f"{block.at(line)}: '{name}': {words}")
        ) from None
    return nodes, of_faces


def is_edge(surface: Surface, line: SetLine) -> bool:
    return not surface.of_nodes and not surface.combine and line.label.startswith("E") and "END" not in line.label


def faces_only(surface: Surface) -> Surface:
    lines = [line for line in surface.lines if not is_edge(surface, line)]
    return Surface(lines, surface.of_nodes, surface.combine, surface.unknown)


def edge_nodes(source: Source, scope: Scope, line: SetLine, block: Block) -> np.ndarray:
    """Nodes of the edge E1, E2, ... of shells; of EDGE those that belong to one of them alone."""
    rows = source.assembly.rows_of(source.assembly.members("element_sets", scope, line))
    pairs, middles = [np.empty((0, 2), np.int64)], [NONE]
    for shape, nodes in blocks(source, rows):
        corners = mesh_faces.CORNERS.get(shape, 0)
        if shape not in ("triangle", "quad"):
            raise SceneError("an edge is one of a shell")
        for k in range(corners):
            if line.label in ("EDGE", f"E{k + 1}"):
                pairs.append(nodes[:, [k, (k + 1) % corners]])
                full = nodes.shape[1] > corners
                middles.append(nodes[:, corners + k] if full else np.full(len(nodes), -1))
    every, middle = np.concatenate(pairs), np.concatenate(middles)
    if not len(every):
        raise SceneError(f"'{line.label}' names no edge of an element")
    if line.label == "EDGE":
        _, inverse, count = np.unique(np.sort(every, axis=1), axis=0, return_inverse=True, return_counts=True)
        free = count[inverse.ravel()] == 1
        every, middle = every[free], middle[free]
    found = np.concatenate([every.ravel(), middle])
    return found[found >= 0]


def blocks(source: Source, rows: np.ndarray):
    """(shape, node indices) of elements, block by block."""
    assembly = source.assembly
    for number in np.unique(assembly.block_of[rows]):
        mine = rows[assembly.block_of[rows] == number] - assembly.first_row[number]
        yield assembly.blocks[number].shape, source.nodes_of_block[number][mine]


def nodes_of_rows(source: Source, rows: np.ndarray) -> np.ndarray:
    found = np.concatenate([NONE, *(nodes.ravel() for _, nodes in blocks(source, rows))])
    return found[found >= 0]


def explicit(source: Source, rows: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same faces, those of solids numbered 0 (any that no other solid shares) by their numbers."""
    assembly = source.assembly
    solid = np.array([block.shape in mesh_faces.FACES for block in assembly.blocks], bool)[assembly.block_of]
    automatic = (numbers == 0) & solid[rows]
    if not automatic.any():
        return rows, numbers
    every = []
    for number, block in enumerate(assembly.blocks):
        if block.shape in mesh_faces.FACES:
            start, corners = assembly.first_row[number], mesh_faces.CORNERS[block.shape]
            row = np.arange(start, start + len(block.ids))
            every.append((block.shape, row, source.nodes_of_block[number][:, :corners]))
    all_rows, all_numbers, all_corners = mesh_faces.of_solids(every)
    wanted = np.zeros(len(solid), bool)
    wanted[rows[automatic]] = True
    outer = mesh_faces.not_shared(all_corners) & wanted[all_rows]
    return np.concatenate([rows[~automatic], all_rows[outer]]), np.concatenate(
        [numbers[~automatic], all_numbers[outer]]
    )


def each_face(source: Source, rows: np.ndarray, numbers: np.ndarray):
    """(rows, corners (n, 3 or 4), mid-side nodes in the same order or None), faces of one kind at a time."""
    assembly = source.assembly
    rows, numbers = explicit(source, rows, numbers)
    for number in np.unique(assembly.block_of[rows]):
        block, all_nodes = assembly.blocks[number], source.nodes_of_block[number]
        mine = assembly.block_of[rows] == number
        if block.shape not in mesh_faces.CORNERS:
            card = assembly.cards[number]
            raise SceneError(f"element {block.ids[rows[mine][0] - assembly.first_row[number]]} of type "
                             f"{card.get('TYPE')} has no face")  # fmt: skip
        kind = SECOND_ORDER.get((block.shape, all_nodes.shape[1]))
        for face in np.unique(numbers[mine]):
            some = mine & (numbers == face)
            nodes = all_nodes[rows[some] - assembly.first_row[number]]
            if block.shape in mesh_faces.FACES:
                if not 1 <= face <= len(mesh_faces.FACES[block.shape]):
                    first = rows[some][0]
                    raise SceneError(f"element {source.element_id[first]} has no face {face}")
                local = [corner - 1 for corner in mesh_faces.FACES[block.shape][face - 1]]
            else:
                local = list(range(mesh_faces.CORNERS[block.shape]))
            middle = None
            if kind:
                pairs = {frozenset(pair): k + mesh_faces.CORNERS[block.shape] for k, pair in enumerate(EDGES[kind])}
                ring = zip(local, local[1:] + local[:1])
                middle = nodes[:, [pairs[frozenset(pair)] for pair in ring]]
                if nodes.shape[1] == 9:
                    middle = np.column_stack([middle, nodes[:, 8]])
            yield rows[some], nodes[:, local], middle


def of_faces_nodes(source: Source, rows: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    found = [NONE]
    for _, corners, middle in each_face(source, rows, numbers):
        found += [corners.ravel()] if middle is None else [corners.ravel(), middle.ravel()]
    nodes = np.unique(np.concatenate(found))
    return nodes[nodes >= 0]


def of_faces(source: Source, rows: np.ndarray, numbers: np.ndarray) -> Faces:
    """Faces; those of second order as triangles and quads over their mid-side nodes. thickness: of shells."""
    found = []
    for some, corners, middle in each_face(source, rows, numbers):
        for facet in facets(corners, middle):
            facet = mesh_faces.without_repeated(facet)
            whole = facet[:, 2] >= 0
            chosen = some[whole]
            found.append(
                Faces(
                    facet[whole], source.element_id[chosen], source.part_of_row[chosen], source.thickness_of_row[chosen]
                )
            )
    return Faces.joined(found)


def facets(corners: np.ndarray, middle: np.ndarray | None) -> list[np.ndarray]:
    """A face of first order as it is; else a triangle at each corner and what is left between them, or with a node in
    the middle of the face four quads."""
    if middle is None or (middle < 0).any():
        return [corners]
    n = corners.shape[1]
    if middle.shape[1] > n:
        quads = [(corners[:, k], middle[:, k], middle[:, n], middle[:, k - 1 if k else n - 1]) for k in range(n)]
        return [np.stack(quad, axis=1) for quad in quads]
    around = [np.stack([corners[:, k], middle[:, k], middle[:, k - 1]], axis=1) for k in range(n)]
    return [*around, middle]
