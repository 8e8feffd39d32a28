"""What second-order elements give to their nodes.

Mass: the diagonal of the consistent mass matrix scaled to the total (lumping.py). Stiffness: nodal step 1 / sqrt(6) of
that of the first-order element of the corners. For a straight bar of three nodes with this mass that is exact: its
largest eigenvalue is 24 c^2 / l^2, so its step 2 / sqrt(24) l / c, against l / c of the bar of two nodes.
"""

import numpy as np

from .._core import SceneError
from .element_lengths import (
    damping_factor,
    hex_length,
    hex_volume,
    need_solid,
    shell_area,
    shell_thickness,
    solid_step,
    tetra_length,
)
from .lumping import second_order_shares
from .model import TURNING, Deck, Elements

SHORTER = 6.0  # square of the ratio of the steps
PLANE = {3: "tri6", 4: "quad8"}


def curved_solid(found, deck: Deck, some: Elements, part, prop, material, where: str):
    """Twenty-node bricks, fifteen-node wedges."""
    need_solid(prop, material, where)
    x = deck.position[some.nodes]
    volume, shares = second_order_shares(some.kind, x)
    mass = material.density * volume
    found.add(some.nodes, mass[:, None] * shares)
    if prop.kind != "void" and not material.void and material.density:
        if some.kind == "tet10":
            length = tetra_length(x[:, :4])[1]
        else:
            corners = x[:, :8] if some.kind == "hex20" else x[:, [0, 1, 2, 2, 3, 4, 5, 5]]
            length = hex_length(corners, hex_volume(corners))
        step = solid_step(length, prop, material)
        found.add(some.nodes, stiffness=(2 * SHORTER * mass / step**2)[:, None] * shares)


def curved_shell(found, deck: Deck, some: Elements, part, prop, material, where: str):
    """Shells and membranes of six, eight and nine nodes. Inertia as that of shells of half their size."""
    if material is None or prop is None:
        raise SceneError(f"{where}: its shells need a property and a material")
    corners = 3 if some.nodes.shape[1] == 6 else 4
    x = deck.position[some.nodes]
    t = shell_thickness(some, part, prop)
    area, shares = second_order_shares("quad9" if some.nodes.shape[1] == 9 else PLANE[corners], x)
    turning = some.kind in TURNING
    mass = (material.density * t * area)[:, None] * shares
    z0 = prop.values.get("offset", 0.0)
    gyration = area / (36 if corners == 4 else 18) + t * t * (1 / 12 + z0 * z0)
    found.add(some.nodes, mass, mass * gyration[:, None] if turning else 0.0)
    if prop.kind == "void" or material.void:
        return
    a11, v = material.young / (1 - material.poisson**2), damping_factor(prop, material)
    if corners == 4:
        flat = shell_area(x[:, :4])
        longest = np.maximum(*(((x[:, i] - x[:, i + 2]) ** 2).sum(axis=1) for i in (0, 1)))
    else:
        flat = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
        longest = np.max([((x[:, i] - x[:, i - 1]) ** 2).sum(axis=1) for i in range(3)], axis=0)
    first_order = longest / 4 * t * a11 / (flat * v * v)  # of each corner
    k = (SHORTER * corners * first_order)[:, None] * shares
    if turning:
        found.rotations[some.nodes] = True
    found.add(some.nodes, stiffness=k, rotational_stiffness=k * (gyration * 3)[:, None] if turning else 0.0)


FUNCTIONS = dict.fromkeys(("hex20", "wedge15"), curved_solid) | dict.fromkeys(
    ("shell8", "shell9", "shell6", "membrane8", "membrane9", "membrane6"), curved_shell
)
