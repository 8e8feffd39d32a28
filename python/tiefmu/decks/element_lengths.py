"""Areas, volumes, characteristic lengths and steps of elements, as the OpenRadioss starter (revision bd4557b) takes
them; each function names its file. Positions x are (n, corners, 3).
"""

import numpy as np

from .._core import SceneError
from .model import Elements


def damping_factor(prop, material, least: float = 0.0) -> float:
    """v of shells: cdleni.F, cndleni.F, c3derii.F."""
    dm = 0.0 if material.undamped else prop.values.get("dm", 0.0) or material.damping
    d = max(dm, least)
    return np.sqrt(1 + d * d) - d


def shell_area(x: np.ndarray) -> np.ndarray:
    """x (n, 4, 3): half the cross product of the diagonals."""
    return 0.5 * np.linalg.norm(np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]), axis=1)


def shell_thickness(some: Elements, part, prop) -> np.ndarray:
    own = part.thickness or (prop.values.get("thickness", 0.0) if prop else 0.0)
    return np.where(some.thickness > 0, some.thickness, own)


HEX_FACES = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def hex_volume(x: np.ndarray) -> np.ndarray:
    """x (n, 8, 3): eight times the Jacobian at the centre, as the one-point brick takes it: sderi3.F."""
    r = x[:, [1, 2, 5, 6]].sum(axis=1) - x[:, [0, 3, 4, 7]].sum(axis=1)
    s = x[:, [2, 3, 6, 7]].sum(axis=1) - x[:, [0, 1, 4, 5]].sum(axis=1)
    q = x[:, [4, 5, 6, 7]].sum(axis=1) - x[:, [0, 1, 2, 3]].sum(axis=1)
    return np.abs((np.cross(r, s) * q).sum(axis=1)) / 64


def hex_length(x: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Characteristic length of a brick (n, 8, 3): sdlen3.F."""
    largest = np.zeros(len(x))
    for face in HEX_FACES:
        a, b, c, d = (x[:, i] for i in face)
        r, s = b + c - a - d, c + d - a - b
        e, f, g = (r * r).sum(axis=1), (r * s).sum(axis=1), (s * s).sum(axis=1)
        largest = np.maximum(largest, e * g - f * f)
    return 4 * volume / np.sqrt(largest)


def need_solid(prop, material, where: str):
    if material is None or prop is None:
        raise SceneError(f"{where}: its solids need a property and a material")


def solid_step(length: np.ndarray, prop, material) -> np.ndarray:
    """dt = L / (Q + sqrt(Q^2 + c^2)), Q = qb c, c^2 = (K + 4 G / 3) / rho: dtel.F."""
    nu = min(material.poisson, 0.499999)
    c = np.sqrt(material.young * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) / material.density)
    q = prop.values.get("qb", 0.05) * c
    return length / (q + np.sqrt(q * q + c * c))


def tetra_length(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volume, and 1 / the largest norm of the shape functions' gradients: s4deri3.F. x (n, 4, 3)."""
    volume = np.abs((np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) * (x[:, 3] - x[:, 0])).sum(axis=1)) / 6
    faces = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
    areas = [0.5 * np.linalg.norm(np.cross(x[:, b] - x[:, a], x[:, c] - x[:, a]), axis=1) for a, b, c in faces]
    return volume, 3 * volume / np.max(areas, axis=0)
