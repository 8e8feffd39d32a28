"""Reads MED files (Salome, code_aster) with their groups, and their own ids where they have any.

meshio reads them too, but its groups need putting together, fields can cost the mesh, and ids are dropped.
"""

from pathlib import Path

import numpy as np

from .._core import SceneError
from ..errors import one_line
from .data import Block, MeshFile
from .meshio_reader import needed

TYPES = {
    "PO1": "vertex",
    "SE2": "line",
    "SE3": "line",
    "SE4": "line",
    "TR3": "triangle",
    "TR6": "triangle",
    "TR7": "triangle",
    "QU4": "quad",
    "QU8": "quad",
    "QU9": "quad",
    "TE4": "tetra",
    "T10": "tetra",
    "PY5": "pyramid",
    "P13": "pyramid",
    "PE6": "wedge",
    "P15": "wedge",
    "P18": "wedge",
    "HE8": "hexahedron",
    "H20": "hexahedron",
    "H27": "hexahedron",
}


def read(path: Path) -> MeshFile:
    try:
        import h5py
    except ImportError as error:
        raise needed(error) from None
    try:
        with h5py.File(path, "r") as data:
            return converted(data)
    except (OSError, RuntimeError, KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"cannot be read as MED ({one_line(error)})") from None


def converted(data) -> MeshFile:
    meshes = list(data["ENS_MAA"])
    if len(meshes) != 1:
        raise SceneError(f"holds {len(meshes)} meshes; save the one that is meant by itself")
    mesh = data["ENS_MAA"][meshes[0]]
    dimension = int(mesh.attrs["ESP"])
    if "NOE" not in mesh:  # computing steps; the mesh as it starts is the first
        mesh = mesh[sorted(mesh)[0]]
    nodes = mesh["NOE"]
    count = int(nodes["COO"].attrs["NBR"])
    position = np.zeros((count, 3))
    position[:, :dimension] = nodes["COO"][()].reshape((count, dimension), order="F")[:, :3]
    node_id = own_numbers(nodes, count)
    file = MeshFile(np.arange(1, count + 1) if node_id is None else node_id, position)
    cells, families, numbers = [], [], []
    for kind, group in mesh["MAI"].items() if "MAI" in mesh else []:
        if kind not in TYPES:
            continue
        n = int(group["NOD"].attrs["NBR"])
        connect = group["NOD"][()].reshape((n, -1), order="F").astype(np.int64)
        if connect.size and not 1 <= connect.min() <= connect.max() <= count:
            raise SceneError(f"{kind}: names node {connect.max()}, of {count} nodes")
        cells.append((TYPES[kind], file.node_id[connect - 1]))
        families.append(np.ravel(group["FAM"][()])[:n] if "FAM" in group else np.zeros(n, int))
        numbers.append(own_numbers(group, n))
    element_id = element_ids(cells, numbers)
    file.own_ids = node_id is not None and element_id is not None
    counted = {True: 0, False: 0}
    row = 0
    for shape, connect in cells:
        is_segment, n = shape in ("triangle", "quad"), len(connect)
        # without ids: segments by themselves, and all else by itself
        ids = counted[is_segment] + np.arange(1, n + 1) if element_id is None else element_id[row : row + n]
        file.blocks.append(Block(shape, ids, connect))
        counted[is_segment] += n
        row += n
    names = data["FAS"][meshes[0]] if "FAS" in data else mesh["FAS"]
    of_nodes = np.ravel(nodes["FAM"][()]) if "FAM" in nodes else np.zeros(count, int)
    for name, numbers_of in groups(names, "NOEUD").items():
        file.node_sets[name] = file.node_id[np.flatnonzero(np.isin(of_nodes, numbers_of))]
    of_cells = np.concatenate([np.empty(0, int), *families])
    for name, numbers_of in groups(names, "ELEME").items():
        file.element_sets[name] = np.flatnonzero(np.isin(of_cells, numbers_of))
    return file


def own_numbers(group, count: int) -> np.ndarray | None:
    return np.ravel(group["NUM"][()])[:count].astype(np.int64) if "NUM" in group else None


def element_ids(cells: list, numbers: list) -> np.ndarray | None:
    """Ids of all cells, if each has one and none is used twice (MED numbers each type by itself)."""
    if not cells or any(own is None for own in numbers):
        return None
    ids = np.concatenate(numbers)
    return ids if len(np.unique(ids)) == len(ids) and ids.min(initial=1) >= 1 else None


def groups(families, kind: str) -> dict[str, list[int]]:
    """Name of a group -> numbers of the families that belong to it."""
    found: dict[str, list[int]] = {}
    for family in families[kind].values() if kind in families else []:
        if "GRO" not in family:
            continue
        for row in np.asarray(family["GRO"]["NOM"][()]).astype(np.uint8).reshape(-1, 80):
            text = bytes(row.tolist()).split(b"\0")[0]
            try:
                name = text.decode().strip()
            except UnicodeDecodeError:
                name = text.decode("latin-1").strip()
            if name:
                found.setdefault(name, []).append(int(family.attrs["NUM"]))
    return found
