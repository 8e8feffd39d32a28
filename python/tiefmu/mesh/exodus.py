"""Reads Exodus II files with their own ids, element blocks, node sets and side sets.

meshio knows node sets only, and not every element type. A block or set without a name is called "block 7",
"nodeset 7" or "sideset 7" by its id.
"""

from pathlib import Path

import numpy as np

from .._core import SceneError
from ..errors import one_line
from .data import Block, MeshFile
from .meshio_reader import needed

# Beginnings of element types. Shells are triangles or quads by their number of nodes.
SHAPES = {
    "TRI": "triangle",
    "QUAD": "quad",
    "SHELL": "quad",
    "TET": "tetra",
    "PYR": "pyramid",
    "WEDGE": "wedge",
    "HEX": "hexahedron",
}
SIDES = {  # face numbers of faces.py for the sides 1, 2, ... of Exodus
    "tetra": [2, 3, 4, 1],
    "pyramid": [2, 3, 4, 5, 1],
    "wedge": [3, 4, 5, 1, 2],
    "hexahedron": [3, 4, 5, 6, 1, 2],
}


def read(path: Path) -> MeshFile:
    try:
        import netCDF4
    except ImportError as error:
        raise needed(error) from None
    try:
        with netCDF4.Dataset(path) as data:
            data.set_auto_mask(False)
            return converted(data)
    except (OSError, RuntimeError, KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"cannot be read as Exodus ({one_line(error)})") from None


def converted(data) -> MeshFile:
    variables = data.variables
    dimension = len(data.dimensions["num_dim"])
    count = len(data.dimensions["num_nodes"])
    position = np.zeros((count, 3))
    for k in range(min(dimension, 3)):
        position[:, k] = variables["coord"][k] if "coord" in variables else variables["coord" + "xyz"[k]][:]
    node_id = numbered(variables, "node_num_map", count)
    blocks = []
    number = 1
    while f"connect{number}" in variables:
        connect = variables[f"connect{number}"]
        nodes = np.atleast_2d(connect[:]).astype(np.int64)
        if nodes.size and not 1 <= nodes.min() <= nodes.max() <= count:
            raise SceneError(f"element block {number} names node {nodes.max()}, of {count} nodes")
        shape = shape_of(str(getattr(connect, "elem_type", "")).upper(), nodes.shape[1])
        blocks.append((shape, node_id[nodes - 1]))
        number += 1
    sizes = [len(nodes) for _, nodes in blocks]
    element_id = numbered(variables, "elem_num_map", sum(sizes))
    starts = np.cumsum([0, *sizes])
    file = MeshFile(
        node_id,
        position,
        [Block(shape, element_id[a : a + len(nodes)], nodes) for (shape, nodes), a in zip(blocks, starts)],
        own_ids="node_num_map" in variables and "elem_num_map" in variables,
    )
    for k, name in enumerate(names(variables, "eb", "block", len(blocks))):
        file.element_sets[name] = np.arange(starts[k], starts[k + 1])
    for k, name in enumerate(names(variables, "ns", "nodeset", sets(variables, "node_ns"))):
        members = np.ravel(variables[f"node_ns{k + 1}"][:]).astype(np.int64)
        file.node_sets[name] = checked(members, count, node_id)
    kinds = [(shape, dimension) for shape, _ in blocks]
    for k, name in enumerate(names(variables, "ss", "sideset", sets(variables, "elem_ss"))):
        rows = np.ravel(variables[f"elem_ss{k + 1}"][:]).astype(np.int64) - 1
        sides = np.ravel(variables[f"side_ss{k + 1}"][:]).astype(np.int64)
        try:
            file.face_sets[name] = rows, face_numbers(rows, sides, kinds, starts)
        except SceneError as error:
            file.face_sets[name] = error
    return file


def numbered(variables, name: str, count: int) -> np.ndarray:
    """Ids by the map of this name; without one they are 1, 2, ..., as the format has it."""
    if name not in variables:
        return np.arange(1, count + 1)
    return np.ravel(variables[name][:]).astype(np.int64)[:count]


def shape_of(kind: str, nodes: int) -> str:
    shape = next((shape for start, shape in SHAPES.items() if kind.startswith(start)), "other")
    return "triangle" if shape == "quad" and nodes in (3, 6, 7) else shape


def sets(variables, start: str) -> int:
    count = 0
    while f"{start}{count + 1}" in variables:
        count += 1
    return count


def names(variables, prefix: str, word: str, count: int) -> list[str]:
    """Names of the blocks or sets; where one has none, by its id."""
    texts = [""] * count
    if f"{prefix}_names" in variables:
        rows = np.asarray(variables[f"{prefix}_names"][:])
        texts = [b"".join(row.tolist()).split(b"\0")[0].decode("utf-8", "replace").strip() for row in rows[:count]]
    ids = variables[f"{prefix}_prop1"][:].tolist() if f"{prefix}_prop1" in variables else range(1, count + 1)
    texts += [""] * (count - len(texts))
    return [text or f"{word} {number}" for text, number in zip(texts, ids)]


def checked(members: np.ndarray, count: int, node_id: np.ndarray):
    if members.size and not 1 <= members.min() <= members.max() <= count:
        return SceneError(f"names node {members.max()}, of {count} nodes")
    return np.unique(node_id[members - 1])


def face_numbers(rows: np.ndarray, sides: np.ndarray, kinds: list, starts: np.ndarray) -> np.ndarray:
    if rows.size and not 0 <= rows.min() <= rows.max() < starts[-1]:
        raise SceneError(f"names element {rows.max() + 1}, of {starts[-1]} elements")
    block = np.searchsorted(starts, rows, side="right") - 1
    numbers = np.ones(len(rows), np.int64)
    for k, (shape, dimension) in enumerate(kinds):
        mine = block == k
        most = len(SIDES[shape]) if shape in SIDES else 2 if shape in ("triangle", "quad") and dimension == 3 else 0
        wrong = sides[mine][(sides[mine] < 1) | (sides[mine] > most)]
        if len(wrong):
            raise SceneError(f"holds side {wrong[0]} of a {shape}, which is no face")
        if shape in SIDES:
            numbers[mine] = np.array(SIDES[shape])[sides[mine] - 1]
    return numbers
