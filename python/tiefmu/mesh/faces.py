"""Faces of solid elements: which there are, and which lie outside.

Corners are numbered as every format here does it: those of the first face around, then those of the opposite face in
the same order, or the apex. Faces are numbered as in Abaqus.
"""

from collections.abc import Iterable

import numpy as np

CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}

FACES: dict[str, list[tuple[int, ...]]] = {  # corners of face 1, 2, ..., counted from 1
    "tetra": [(1, 2, 3), (1, 4, 2), (2, 4, 3), (3, 4, 1)],
    "pyramid": [(1, 2, 3, 4), (1, 5, 2), (2, 5, 3), (3, 5, 4), (4, 5, 1)],
    "wedge": [(1, 2, 3), (4, 6, 5), (1, 4, 5, 2), (2, 5, 6, 3), (3, 6, 4, 1)],
    "hexahedron": [(1, 2, 3, 4), (5, 8, 7, 6), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 8, 4), (4, 8, 5, 1)],
}


def of_solids(solids: Iterable[tuple[str, np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All faces of solids, given as (shape, row of each, node indices (n, corners)): row of the solid, number of the
    face, and its node indices (n, 4); of a triangle the fourth is -1, of what has fewer than three distinct nodes
    (in collapsed solids) the third too."""
    rows, numbers, corners = [np.empty(0, int)], [np.empty(0, int)], [np.empty((0, 4), int)]
    for shape, row, nodes in solids:
        for number, face in enumerate(FACES[shape], 1):
            rows.append(row)
            numbers.append(np.full(len(row), number))
            corners.append(without_repeated(nodes[:, np.array(face) - 1]))
    return np.concatenate(rows), np.concatenate(numbers), np.concatenate(corners)


def without_repeated(nodes: np.ndarray) -> np.ndarray:
    """Faces (n, 3 or 4) without the nodes that a face has met before, filled up to four with -1."""
    nodes = np.pad(nodes, ((0, 0), (0, 4 - nodes.shape[1])), constant_values=-1)
    again = np.zeros(nodes.shape, bool)
    for i in range(1, 4):
        again[:, i] = (nodes[:, :i] == nodes[:, i : i + 1]).any(axis=1)
    if again.any():
        nodes = np.where(again, -1, nodes)
        order = np.argsort(nodes < 0, axis=1, kind="stable")
        nodes = np.take_along_axis(nodes, order, axis=1)
    return nodes


def not_shared(corners: np.ndarray) -> np.ndarray:
    """Mask of the faces (n, 4) whose nodes, in any order, no other of them has."""
    key = np.sort(corners, axis=1)
    order = np.lexsort(key.T)
    key = key[order]
    same = (key[1:] == key[:-1]).all(axis=1)
    alone = np.ones(len(corners), bool)
    alone[order[1:][same]] = False
    alone[order[:-1][same]] = False
    return alone
