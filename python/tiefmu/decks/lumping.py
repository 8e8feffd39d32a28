"""Shares of an element's mass at its nodes where a code lumps by shape functions.

First order: the row sums of the consistent mass matrix, the integral of N_i. Second order, where row sums of corners
are negative: its diagonal, the integrals of N_i^2, scaled to the total (E. Hinton, T. Rock, O. C. Zienkiewicz, "A note
on mass lumping and related processes in the finite element method", Earthquake Engineering and Structural Dynamics
4(3), 245-249, 1976).
"""

from functools import cache

import numpy as np

CHUNK = 20000  # elements at a time, which bounds the memory


def quad_shares(x: np.ndarray) -> np.ndarray:
    """Integrals of N_i over a quad (n, 4, 3), over its area: (A + T_i) / (6 A), T_i the area of the triangle of corner
    i and its neighbours, in the plane of the diagonals. A repeated corner makes a triangle, whose corners get thirds.

    N_i is bilinear and the Jacobian J linear, so the integral is (2 J_0 + J_i) / 3 with J_0 = A / 4 at the centre and
    J_i = T_i / 2 at the corner."""
    normal = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    twice = np.linalg.norm(normal, axis=1)
    normal /= twice[:, None]
    corner = [np.cross(x[:, (i + 1) % 4] - x[:, i], x[:, i - 1] - x[:, i]) for i in range(4)]
    t = np.stack([(one * normal).sum(axis=1) for one in corner], axis=1) / 2
    return (1 + 2 * t / twice[:, None]) / 6


def hex_shares(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volume (n) and integrals of N_i over it (n, 8) of a brick (n, 8, 3), exact; a wedge or a pyramid has repeated
    nodes."""
    return integrate("hex8", x, power=1)


def second_order_shares(kind: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volume or area (n), and shares of the scaled diagonal (n, k)."""
    size, diagonal = integrate(kind, x, power=2)
    return size, diagonal / diagonal.sum(axis=1, keepdims=True)


def integrate(kind: str, x: np.ndarray, power: int) -> tuple[np.ndarray, np.ndarray]:
    """Volume or area, and for each node the integral of N_i^power (of power 1: over the volume)."""
    n, slopes, weights = shape_functions(kind)
    size, found = np.zeros(len(x)), np.zeros(x.shape[:2])
    for start in range(0, len(x), CHUNK):
        some = slice(start, start + CHUNK)
        by_node = np.ascontiguousarray(x[some].transpose(2, 0, 1))  # (3, n, k)
        for value, slope, weight in zip(n, slopes, weights):
            (a, b, c), *third = (by_node @ direction for direction in slope.T)  # the Jacobian, row by row
            d, e, f = third.pop(0)
            cross = b * f - c * e, c * d - a * f, a * e - b * d
            if third:
                measure = weight * sum(one * other for one, other in zip(cross, third[0]))
            else:
                measure = weight * np.sqrt(sum(one * one for one in cross))
            size[some] += measure
            found[some] += measure[:, None] * value**power
    return np.abs(size), found / size[:, None] if power == 1 else np.abs(found)


EDGES = {
    "tri6": [(0, 1), (1, 2), (2, 0)],
    "quad8": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tet10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "wedge15": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "hex20": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
}
SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
TRIANGLE = [(0, 0), (1, 0), (0, 1)]
CORNERS = {
    "tri6": TRIANGLE,
    "quad8": SQUARE,
    "tet10": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "wedge15": [(*p, t) for t in (-1, 1) for p in TRIANGLE],
    "hex20": [(*p, t) for t in (-1, 1) for p in SQUARE],
}


def powers(kind: str) -> np.ndarray:
    """Exponents of the monomials that span the shape functions."""
    all_of = np.array(list(np.ndindex(*(3,) * (2 if kind in ("tri6", "quad8", "quad9") else 3))))
    if kind == "hex8":
        return all_of[(all_of < 2).all(axis=1)]
    if kind in ("tri6", "tet10"):
        return all_of[all_of.sum(axis=1) <= 2]
    if kind == "quad9":
        return all_of
    if kind == "wedge15":
        plane = all_of[:, 0] + all_of[:, 1]
        return all_of[(plane + np.maximum(all_of[:, 2] - 1, 0) <= 2)]
    return all_of[np.where(all_of > 1, all_of, 0).sum(axis=1) <= 2]


def natural(kind: str) -> np.ndarray:
    """Coordinates of the nodes in the element's own system."""
    if kind == "hex8":
        return np.array(CORNERS["hex20"], float)
    if kind == "quad9":
        return np.vstack([natural("quad8"), [[0, 0]]])
    corners = np.array(CORNERS[kind], float)
    return np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in EDGES[kind]]])


def gauss(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights; of triangles and tetrahedra those of a square or cube that is pressed into them."""
    count = 2 if kind == "hex8" else 3 if kind in ("quad8", "quad9", "hex20") else 4
    line, weight = np.polynomial.legendre.leggauss(count)
    dimension = 2 if kind in ("tri6", "quad8", "quad9") else 3
    points = np.array(list(np.ndindex(*(count,) * dimension)))
    x, w = line[points], weight[points].prod(axis=1)
    if kind in ("tri6", "tet10", "wedge15"):
        pressed = 3 if kind == "tet10" else 2
        u = (x[:, :pressed] + 1) / 2
        w = w / 2**pressed
        left = np.ones(len(u))
        for axis in range(pressed):
            x[:, axis] = u[:, axis] * left
            w = w * left if axis else w
            left = left * (1 - u[:, axis])
    return x, w


@cache
def shape_functions(kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At the integration points: values (p, k), derivatives (p, k, d), weights (p)."""
    exponents, nodes = powers(kind), natural(kind)
    inverse = np.linalg.inv((nodes[:, None, :] ** exponents).prod(axis=2))
    points, weights = gauss(kind)
    values = (points[:, None, :] ** exponents).prod(axis=2) @ inverse
    slopes = []
    for axis in range(points.shape[1]):
        lower = exponents.copy()
        lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
        slopes.append(((points[:, None, :] ** lower).prod(axis=2) * exponents[:, axis]) @ inverse)
    return values, np.stack(slopes, axis=2), weights
