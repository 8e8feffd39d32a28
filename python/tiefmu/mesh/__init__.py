"""The mesh of a scene: nodes, segments and named sets, inline or from a file, and a table of node properties.

data.py              Mesh (what ties ask), MeshFile (what a reader hands on)
faces.py             faces of solids
abaqus.py, abaqus_assembly.py, nastran.py, gmsh.py, exodus.py, med.py, arrays.py, meshio_reader.py    the readers
properties.py        [mesh] properties
"""

from pathlib import Path

import numpy as np

from .._core import SceneError
from ..schema import LARGEST
from . import abaqus_assembly, arrays, exodus, gmsh, med, meshio_reader, nastran
from .data import Mesh, MeshFile

BY_ENDING = {
    ".inp": abaqus_assembly.read,
    ".bdf": nastran.read,
    ".nas": nastran.read,
    ".fem": nastran.read,
    ".npz": arrays.read,
    ".med": med.read,
    ".e": exodus.read,
    ".exo": exodus.read,
    ".ex2": exodus.read,
}


def build(table, folder: Path) -> Mesh:
    """The mesh of a scene's [mesh] table: its file, if any, relative to `folder`, then what is inline."""
    mesh = Mesh()
    try:
        if table.file is not None:
            read_into(mesh, folder / table.file, table.file)
        if table.nodes:
            mesh.add_nodes([row[0] for row in table.nodes], [row[1:] for row in table.nodes])
        if not len(mesh.node_id):
            file = f"file: {table.file}: " if table.file is not None else ""
            raise SceneError(f"{file}has no nodes; give nodes = [[id, x, y, z], ...]{'' if file else ' or file'}")
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
        with np.errstate(all="ignore"):  # what is not finite, or becomes so when turned, is found below
            file = read(path)
        bad = np.flatnonzero(~np.isfinite(file.position).all(axis=1))
        if len(bad):
            raise SceneError(f"node {file.node_id[bad[0]]}: a coordinate is not a finite number")
        bad = np.flatnonzero((abs(file.position) > LARGEST).any(axis=1))
        if len(bad):
            raise SceneError(f"node {file.node_id[bad[0]]}: a coordinate is too large; it must be at most {LARGEST:g}")
        mesh.take(file, name)
    except OSError as error:
        raise SceneError(f"file: {name}: {error.strerror or error}") from None
    except SceneError as error:
        raise SceneError(f"file: {name}: {error}") from None


def read(path: Path) -> MeshFile:
    """By the reader of the file's ending; Gmsh's, and Nastran's .dat, by their first lines."""
    ending = path.suffix.lower()
    if ending in BY_ENDING:
        return BY_ENDING[ending](path)
    if ending == ".msh" and gmsh.version(path) in gmsh.VERSIONS:
        return gmsh.read(path)
    if ending == ".dat" and nastran.looks_so(path):
        return nastran.read(path)
    return meshio_reader.read(path)
