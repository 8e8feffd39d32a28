"""Reads every other format by meshio, which drops the ids that a file may have: nodes and elements are numbered from 1
in file order, unless the file carries them as data of points and cells (VTK's global ids).

Sets: meshio's, and for formats that put numbers on their elements "ref 3" and the like: the part of the data's name
behind the colon (medit:ref, su2:tag, ...) and the number.
"""

import contextlib
import io
import re
import warnings
from pathlib import Path

import numpy as np

from .._core import SceneError
from ..errors import one_line
from .data import Block, MeshFile

GLOBAL_IDS = re.compile(r"(?i)global_?(node|point|element|cell)?_?ids?")
HDF5 = "pip install 'tiefmu[hdf5]'"


def read(path: Path) -> MeshFile:
    import meshio  # here, because importing it takes a third of a second

    said = io.StringIO()
    try:  # meshio prints, and ends the program, where it cannot read
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = meshio.read(path)
    except ImportError as error:
        raise needed(error) from None
    except (Exception, SystemExit) as error:
        words = one_line(said.getvalue() if isinstance(error, SystemExit) else error)
        if path.suffix.lower() == ".cgns":
            words = "it knows CGNS of tetrahedra alone; save the mesh as Exodus, MED or Gmsh"
        elif isinstance(error, KeyError):
            words = f"it does not know {error.args[0]}"  # such as the number of a kind of cell
        raise SceneError(f"meshio cannot read it{f': {words}' if words else ''}") from None
    try:
        return converted(mesh)
    except (ValueError, TypeError, IndexError, AttributeError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"meshio cannot read it: {one_line(error)}") from None


def needed(error: ImportError) -> SceneError:
    """For a format that needs a library which is not there."""
    return SceneError(f"reading it needs {error.name or 'HDF5'}: {HDF5}")


def converted(mesh) -> MeshFile:
    if mesh.points.ndim != 2 or not 1 <= mesh.points.shape[1] <= 3:
        raise SceneError("meshio cannot read it: its points have no coordinates x, y, z")
    position = np.zeros((len(mesh.points), 3))
    position[:, : mesh.points.shape[1]] = mesh.points
    node_id = global_ids(mesh.point_data)
    sizes = [len(block.data) for block in mesh.cells]
    element_id = global_ids({key: np.concatenate(value) for key, value in mesh.cell_data.items() if len(value)})
    own_ids = node_id is not None and (element_id is not None or not sum(sizes))
    if node_id is None:
        node_id = np.arange(1, len(position) + 1)
    blocks, row, counted = [], 0, {True: 0, False: 0}
    for cells in mesh.cells:
        n = len(cells.data)
        nodes = nodes_of(cells, node_id)
        shape = re.sub("[^a-z].*", "", cells.type)
        if shape == "polygon":
            shape = {3: "triangle", 4: "quad"}.get(nodes.shape[1], "other")
        is_segment = shape in ("triangle", "quad")
        if element_id is None:  # segments by themselves, and all else by itself
            ids = counted[is_segment] + np.arange(1, n + 1)
        else:
            ids = element_id[row : row + n]
        blocks.append(Block(shape, ids, nodes))
        row += n
        counted[is_segment] += n
    file = MeshFile(node_id, position, blocks, own_ids=own_ids)
    starts = np.cumsum([0, *sizes])
    for name, parts in element_sets(mesh).items():
        rows = [start + np.asarray(part, int) for start, part in zip(starts, parts) if part is not None]
        file.element_sets[name] = np.unique(np.concatenate([np.empty(0, int), *rows]))
    for name, members in mesh.point_sets.items():
        file.node_sets[name] = node_id[np.unique(np.asarray(members, int))]
    return file


def nodes_of(cells, node_id: np.ndarray) -> np.ndarray:
    """Node ids of the cells of a block (n, k)."""
    data = cells.data
    if not isinstance(data, np.ndarray) or data.ndim != 2:  # polyhedra: lists of faces
        return np.zeros((len(data), 1), np.int64)
    data = data.astype(np.int64)
    if data.size and not 0 <= data.min() <= data.max() < len(node_id):
        bad = data.max() if data.min() >= 0 else data.min()
        raise SceneError(f"a {cells.type} names point {bad} (from 0), of {len(node_id)} points")
    return node_id[data]


def global_ids(data: dict) -> np.ndarray | None:
    """The array that holds ids, if there is one and it does."""
    for name, values in data.items():
        values = np.asarray(values)
        if GLOBAL_IDS.fullmatch(name) and values.ndim == 1 and values.dtype.kind in "iu" and len(values):
            values = values.astype(np.int64)
            if values.min() >= 1 and len(np.unique(values)) == len(values):
                return values
    return None


def element_sets(mesh) -> dict[str, list]:
    """name -> per block of cells the members' indices."""
    sets = {name: blocks for name, blocks in mesh.cell_sets.items() if not name.startswith("gmsh:")}
    for name, arrays in mesh.cell_data.items():
        _, colon, word = name.partition(":")
        if not colon or any(np.asarray(array).dtype.kind not in "iu" for array in arrays):
            continue
        for number in np.unique(np.concatenate([np.ravel(array) for array in arrays])):
            key = f"{word} {number}"
            if key not in sets and number != 0:
                sets[key] = [np.flatnonzero(np.ravel(array) == number) for array in arrays]
    return sets
