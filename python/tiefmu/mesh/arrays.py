"""A mesh as NumPy arrays in one file (.npz), as `tiefmu import` writes it; made by hand with numpy.savez.

node_id (n), position (n, 3); segment_id (m), segments (m, 4: node ids, 0 as a triangle's fourth); sets as arrays of ids
called "nodes:NAME" and "segments:NAME".
"""

from pathlib import Path

import numpy as np

from .._core import SceneError
from ..errors import one_line
from ..schema import shortened, suggestion
from .data import Block, MeshFile, find

SHAPES = {"node_id": (), "position": (3,), "segment_id": (), "segments": (4,)}


def write(path: Path, node_id, position, segment_id, segments, node_sets: dict, segment_sets: dict, small: bool = True):
    """small: compressed, which takes a while."""
    sets = {f"nodes:{name}": ids for name, ids in node_sets.items()}
    sets |= {f"segments:{name}": ids for name, ids in segment_sets.items()}
    with path.open("wb") as file:
        save = np.savez_compressed if small else np.savez
        save(file, node_id=node_id, position=position, segment_id=segment_id, segments=segments, **sets)


def load_npz(path: Path) -> dict[str, np.ndarray]:
    """All arrays of the file. Raises SceneError, OSError."""
    with path.open("rb") as opened:
        try:  # NumPy's messages for damaged files are of many types
            with np.load(opened, allow_pickle=False) as file:
                return {key: file[key] for key in file.files}
        except Exception as error:
            raise SceneError(f"cannot be read as npz ({one_line(error)})") from None


def read(path: Path) -> MeshFile:
    arrays = load_npz(path)
    for key, columns in SHAPES.items():
        array = arrays.get(key)
        if array is None:
            raise SceneError(f"has no array '{key}'{suggestion(key, arrays)}")
        if array.ndim != 1 + len(columns) or array.shape[1:] != columns:
            raise SceneError(f"{key}: expected the shape (n{''.join(f', {c}' for c in columns)}), found {array.shape}")
        if array.dtype.kind not in ("iuf" if key == "position" else "iu"):
            raise SceneError(f"{key}: expected numbers, found an array of type {array.dtype}")
    for one, other in (("node_id", "position"), ("segment_id", "segments")):
        if len(arrays[one]) != len(arrays[other]):
            raise SceneError(f"{one} has {len(arrays[one])} entries, {other} has {len(arrays[other])}")
    segment_id = arrays["segment_id"].astype(np.int64)
    mesh = MeshFile(
        arrays["node_id"].astype(np.int64),
        arrays["position"].astype(float),
        [Block("quad", segment_id, arrays["segments"].astype(np.int64))],
    )
    for key, ids in arrays.items():
        what, colon, name = key.partition(":")
        if key in SHAPES:
            continue
        if not colon or what not in ("nodes", "segments") or not name:
            raise SceneError(
                f"array '{shortened(key)}' is not understood; sets are called nodes:NAME and segments:NAME"
            )
        if ids.ndim != 1 or ids.dtype.kind not in "iu":
            raise SceneError(f"set '{name}': expected one row of ids")
        ids = ids.astype(np.int64)
        known = mesh.node_id if what == "nodes" else segment_id
        index = find(known, ids)
        if (index < 0).any():
            raise SceneError(f"set '{name}': {what[:-1]} {ids[index < 0][0]} is not in the file")
        if what == "nodes":
            mesh.node_sets[name] = ids
        else:
            mesh.element_sets[name] = index
    return mesh
