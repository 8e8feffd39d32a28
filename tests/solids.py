"""A block of unit hexahedra, also cut into wedges, tetrahedra or pyramids, and what its outer faces must be."""

import numpy as np

SIZE = (3, 2, 2)
# corners of the unit cell in the order of a hexahedron
CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
WEDGES = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]
# five tetrahedra, mirrored in every other cell so that neighbours share their diagonals
TETRA = [(0, 1, 2, 5), (0, 2, 3, 7), (0, 5, 7, 4), (2, 7, 5, 6), (0, 2, 7, 5)]
PYRAMIDS = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]  # and the centre


def block(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and cells (m, corners), indices from 0, of "hexahedron", "wedge", "tetra" or "pyramid"."""
    nx, ny, nz = (n + 1 for n in SIZE)
    points = np.array([[i, j, k] for k in range(nz) for j in range(ny) for i in range(nx)], float)
    cells = []
    for cell in np.ndindex(*SIZE):
        mirror = kind == "tetra" and sum(cell) % 2
        corners = np.array(cell) + (CUBE if not mirror else CUBE * [-1, 1, 1] + [1, 0, 0])
        at = corners @ [1, nx, nx * ny]
        if kind == "hexahedron":
            cells.append(at)
        elif kind == "pyramid":
            points = np.vstack([points, np.array(cell) + 0.5])
            cells += [[*at[list(base)], len(points) - 1] for base in PYRAMIDS]
        else:
            cells += [at[list(part)] for part in {"wedge": WEDGES, "tetra": TETRA}[kind]]
    return points, np.array(cells)


def outside(points: np.ndarray) -> bool:
    """Whether all of the points lie in one side of the block."""
    at_0 = (abs(points) < 1e-12).all(axis=0)
    at_1 = (abs(points - SIZE) < 1e-12).all(axis=0)
    return bool((at_0 | at_1).any())


def area(points: np.ndarray) -> float:
    """Of a plane triangle or quad."""
    if len(points) == 3:
        return float(np.linalg.norm(np.cross(points[1] - points[0], points[2] - points[0])) / 2)
    return float(np.linalg.norm(np.cross(points[2] - points[0], points[3] - points[1])) / 2)


TOTAL = 2 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[2] * SIZE[0])
