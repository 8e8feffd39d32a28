"""Mass, inertia and nodal stiffness that elements give to their nodes, as an explicit code computes them at time 0.

The formulas are those of the OpenRadioss starter (revision bd4557b); each function names its file. Symbols: rho
density, E Young's modulus, nu Poisson's ratio, A area, t thickness, V volume, l length; A11 = E / (1 - nu^2), G =
E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)). v = sqrt(1 + d^2) - d with the damping d of a shell: its dm, or that of its
material; QBAT and QEPH take at least dn. Stiffness is a nodal one: the nodal step is sqrt(2 m / K).

Values of a Property:
shell: thickness, formulation (q4, qbat, qeph), triangle (c0, dkt18), dm, dn, offset (of the mid-surface, in t)
solid: qb (linear bulk viscosity), rotary (true: nodes rotate), tetra10 (0, 2: time step of a tetra4)
truss, beam: area; beam: iyy, izz, ixx, dm, df, and what beams.py names
spring: mass, inertia, per_length, and vectors of three: stiffness, damping, rotational_stiffness,
rotational_damping; type: axial (only the first counts), general, beam (shear turns its ends); turning: false where a
general one has no rotations
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .._core import SceneError
from . import lumping, second_order
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
from .model import SHELLS, Deck, Elements


@dataclass
class Nodal:
    """Per node of the deck, in its units: mass, spherical inertia, nodal and rotational nodal stiffness; rotations:
    nodes that can turn."""

    mass: np.ndarray
    inertia: np.ndarray
    stiffness: np.ndarray
    rotational_stiffness: np.ndarray
    rotations: np.ndarray
    where: str = ""  # of the elements that are added, for messages
    element: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    limp: bool = False  # what is added now has no stiffness

    @staticmethod
    def zeros(n: int) -> "Nodal":
        mass, inertia, stiffness, rotational_stiffness = np.zeros((4, n))
        return Nodal(mass, inertia, stiffness, rotational_stiffness, np.zeros(n, bool))

    def add(self, nodes: np.ndarray, mass=0.0, inertia=0.0, stiffness=0.0, rotational_stiffness=0.0):
        """Adds to each of `nodes` (n, k): values per element (n) or per corner (n, k)."""
        given = nodes >= 0
        for target, value in (
            (self.mass, mass),
            (self.inertia, inertia),
            (self.stiffness, stiffness),
            (self.rotational_stiffness, rotational_stiffness),
        ):
            if np.ndim(value) == 1:
                value = np.asarray(value)[:, None]
            value = np.broadcast_to(value, nodes.shape)
            if not np.all((value >= 0) & (value < np.inf)):
                self.refuse(value)
            value = value[given]
            if self.limp and (target is self.stiffness or target is self.rotational_stiffness):
                continue
            if value.any():
                target += np.bincount(nodes[given], weights=value, minlength=len(target))

    def refuse(self, value: np.ndarray):
        row = int(np.argmin(((value >= 0) & (value < np.inf)).all(axis=1)))
        word = "negative" if value[row].min() < 0 else "infinite"
        raise SceneError(
            f"{self.where}: element {self.element[row]}: its mass or stiffness would be {word}: it has no area, volume "
            "or length, or a value of its part is wrong"
        )


def nodal(deck: Deck, in_scene: dict[str, np.ndarray] | None = None) -> Nodal:
    """What all elements and added masses give to the nodes. in_scene: by kind, of which elements (bool per element) the
    scene holds the stiffness itself, so that only their mass counts here."""
    found = Nodal.zeros(len(deck.node_id))
    for kind, elements in deck.elements.items():
        function = FUNCTIONS[kind]
        held = (in_scene or {}).get(kind, np.zeros(len(elements.id), bool))
        for part, prop, material, members in deck.part_values(elements.part):
            where = f"{part.where or deck.file}: {part.name}"
            for limp in (False, True):
                rows = members[held[members] == limp]
                if not len(rows):
                    continue
                found.limp = limp
                some = Elements(kind, *(getattr(elements, key)[rows] for key in ("id", "nodes", "part", "thickness")))
                found.where, found.element = where, some.id
                with np.errstate(all="ignore"):
                    function(found, deck, some, part, prop, material, where)
    found.limp = False
    for nodes, mass in deck.added_mass:
        np.add.at(found.mass, nodes, mass)
    if found.mass.min(initial=0.0) < 0:
        node = int(np.argmin(found.mass))
        raise SceneError(
            f"{deck.file}: node {deck.node_id[node]}: its mass would be {found.mass[node]:g}, as a mass is negative"
        )
    for nodes, inertia in deck.added_inertia:
        np.add.at(found.inertia, nodes, inertia)
        found.rotations[nodes] = True
    return found


def warn_of_nothing(deck: Deck, used: np.ndarray):
    """Elements at nodes of the scene that weigh or hold nothing, as a card out of its place makes them. used: nodes."""
    for kind, elements in deck.elements.items():
        near = (used[elements.nodes] & (elements.nodes >= 0)).any(axis=1)
        flat = kind.startswith(("shell", "membrane"))
        thin = deck.thickness(elements) <= 0
        for part, prop, material, members in deck.part_values(elements.part):
            members = members[near[members]]
            if not len(members) or prop is None or prop.kind in ("void", "other", "spring"):
                continue
            if material is None or material.void:
                continue
            said = any(line.startswith(f"{material.where}: ") for line in deck.warnings)
            bare = int(np.sum(thin[members])) if flat else 0
            if bare:
                count, lack = bare, "have no thickness; they add no mass and no stiffness"
            elif kind in ("truss", "beam") and not prop.values.get("area"):
                count, lack = len(members), "have no cross-section; they add no mass and no stiffness"
            elif not material.density and not said:
                count, lack = len(members), "have a material without density; they add no mass"
            elif not material.young and not said:
                count, lack = len(members), "have a material without Young's modulus; they add no stiffness"
            else:
                continue
            deck.warn(f"{part.where or deck.file}: {part.name}: {count} elements at the ties {lack}")


def structural_mass(deck: Deck, parts: set[int]) -> np.ndarray:
    """Mass that the elements of some parts give to the nodes of the deck."""
    wanted = np.array(sorted(parts), np.int64)
    some = dataclasses.replace(deck, elements={}, added_mass=[], added_inertia=[])
    for kind, one in deck.elements.items():
        rows = np.isin(one.part, wanted)
        some.elements[kind] = Elements(kind, *(getattr(one, k)[rows] for k in ("id", "nodes", "part", "thickness")))
    return nodal(some).mass


def shell4(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """Four-node shells: cinmas.F; cdleni.F (Q4), cndleni.F (QBAT, QEPH). Membranes the same without rotations."""
    nodes = np.where(some.nodes < 0, some.nodes[:, [2]], some.nodes)
    x = deck.position[nodes]
    t = shell_thickness(some, part, prop)
    area = shell_area(x)
    if material is None or prop is None:
        raise SceneError(f"{where}: its shells need a property and a material")
    formulation = prop.values.get("formulation", "q4")
    full = formulation != "q4"
    mass = material.density * t * area / 4
    z0 = prop.values.get("offset", 0.0)
    gyration = area / (12 if full else 9) + t * t * (1 / 12 + z0 * z0)
    if deck.shape_lumping:
        mass, gyration = mass[:, None] * (4 * lumping.quad_shares(x)), gyration[:, None]
    turning = some.kind in SHELLS
    found.add(nodes, mass, mass * gyration if turning else 0.0)
    if prop.kind != "void" and not material.void:
        if turning:
            found.rotations[nodes] = True
        a11 = material.young / (1 - material.poisson**2)
        if not full:
            v = damping_factor(prop, material)
            d13, d24 = (((x[:, i] - x[:, i + 2]) ** 2).sum(axis=1) for i in (0, 1))
            k = np.maximum(d13, d24) / 4 * t * a11 / (area * v * v)
            found.add(nodes, stiffness=k, rotational_stiffness=k * (t * t + area) / 12 if turning else 0.0)
        else:
            v = damping_factor(prop, material, prop.values.get("dn", 0.0))
            length = full_shell_length(x, area, formulation)
            k = 0.5 * t * area * a11 / (v * length) ** 2
            found.add(nodes, stiffness=k, rotational_stiffness=k * t * t / 12 if turning else 0.0)


def full_shell_length(x: np.ndarray, area: np.ndarray, formulation: str) -> np.ndarray:
    """Characteristic length of QBAT and QEPH: cndleni.F. x (n, 4, 3), taken in the plane of the diagonals."""
    normal = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    c = x - x.mean(axis=1, keepdims=True)
    c = c - (c * normal[:, None, :]).sum(axis=2)[:, :, None] * normal[:, None, :]
    h13, h24 = (c[:, 0] - c[:, 2]) / 2, (c[:, 1] - c[:, 3]) / 2
    al1 = np.maximum((h13**2).sum(axis=1), (h24**2).sum(axis=1))
    cross = [(np.cross(c[:, i], c[:, i + 2]) * normal).sum(axis=1) for i in (0, 1)]
    al2 = np.maximum(*np.abs(cross)) / area
    r, s = np.linalg.norm(h24 - h13, axis=1), np.linalg.norm(h24 + h13, axis=1)
    f1 = 1 + np.minimum(0.5, 0.25 * (np.maximum(r, s) / np.minimum(r, s) - 1))
    f2 = 0.78 + 0.22 * (3.413 * np.maximum(0, area / (r * s) - 0.7071)) ** 3
    return area / np.sqrt(2 * f1 * f2 * ((4 / 3 if formulation == "qbat" else 5 / 4) + al2) * al1)


def shell3(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """Three-node shells: c3inmas.F; c3derii.F (C0), cdkderii.F (DKT18). Membranes the same without rotations."""
    if material is None or prop is None:
        raise SceneError(f"{where}: its shells need a property and a material")
    x = deck.position[some.nodes]
    t = shell_thickness(some, part, prop)
    area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    side = np.stack([np.linalg.norm(x[:, (i + 2) % 3] - x[:, (i + 1) % 3], axis=1) for i in range(3)], axis=1)
    a, b, c = side.T  # opposite to corners 0, 1, 2
    cosines = np.stack([(b * b + c * c - a * a) / (2 * b * c), (a * a + c * c - b * b) / (2 * a * c)], axis=1)
    share = np.arccos(np.clip(cosines, -1, 1)) / np.pi
    share = np.concatenate([share, np.maximum(1 - share.sum(axis=1, keepdims=True), 0)], axis=1)
    if deck.shape_lumping:
        share = np.full(share.shape, 1 / 3)
    turning = some.kind in SHELLS
    mass = material.density * t * area
    z0 = prop.values.get("offset", 0.0)
    inertia = mass * (area / 4.5 + t * t * (1 / 12 + z0 * z0))
    found.add(some.nodes, mass[:, None] * share, inertia[:, None] * share if turning else 0.0)
    if prop.kind == "void" or material.void:
        return
    if turning:
        found.rotations[some.nodes] = True
    if not material.young:
        return
    v = damping_factor(prop, material)
    a11 = material.young / (1 - material.poisson**2)
    longest = side.max(axis=1) ** 2
    if prop.values.get("triangle", "c0") == "dkt18":
        longest = longest * (1 + 0.6 * (1 + material.poisson) * t * t / side.min(axis=1) ** 2)
        k = t * area * a11 * longest / (2 * area * v) ** 2
        kr = k * t * t / 12
    else:
        k = t * area * a11 * longest / (2 * area * v) ** 2
        g = material.young / (2 * (1 + material.poisson))
        kr = k * (t * t / 12 + area * g / (2 * a11))
    found.add(some.nodes, stiffness=k, rotational_stiffness=kr if turning else 0.0)


def brick(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """Eight-node bricks, wedges as bricks with repeated nodes: smass3.F, sdlen3.F, dtel.F, sinit3.F."""
    need_solid(prop, material, where)
    nodes = some.nodes if some.kind == "hex8" else some.nodes[:, [0, 1, 2, 2, 3, 4, 5, 5]]
    x = deck.position[nodes]
    volume = hex_volume(x)
    mass = material.density * volume / 8
    if material.per_area:
        mass = material.density * shell_area((x[:, :4] + x[:, 4:]) / 2) / 8
    elif deck.shape_lumping:
        exact, shares = lumping.hex_shares(x)
        mass = material.density * exact[:, None] * shares
    rotary = bool(prop.values.get("rotary"))
    found.add(nodes, mass, mass * volume ** (2 / 3) / 6 if rotary else 0.0)
    if rotary:
        found.rotations[nodes] = True
    if prop.kind == "void" or material.void or not material.density:
        return
    step = solid_step(hex_length(x, volume), prop, material)
    found.add(nodes, stiffness=material.density * volume / (4 * step * step))


def tetra4(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """s4mass3.F, s4init3.F."""
    need_solid(prop, material, where)
    volume, length = tetra_length(deck.position[some.nodes])
    found.add(some.nodes, material.density * volume / 4)
    if prop.kind != "void" and not material.void and material.density:
        step = solid_step(length, prop, material)
        found.add(some.nodes, stiffness=material.density * volume / (2 * step * step))


def tetra10(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """s10mass3.F: 1/32 of the mass to each corner, 7/48 to each mid-side node; a mid-side node that is missing hands
    its share to its corners. The stiffness keeps the step of the tetrahedron of its corners, halved: the step of a
    quadratic edge."""
    need_solid(prop, material, where)
    if deck.shape_lumping and (some.nodes >= 0).all():
        second_order.curved_solid(found, deck, some, part, prop, material, where)
        return
    corners, middle = some.nodes[:, :4], some.nodes[:, 4:]
    volume, length = tetra_length(deck.position[corners])
    mass = material.density * volume
    live = prop.kind != "void" and not material.void and material.density > 0
    k = np.zeros(len(mass))
    if live:
        step = solid_step(length / 2, prop, material)
        k = 2 * mass / (step * step)
    found.add(corners, mass / 32, 0.0, k / 32)
    found.add(middle, mass * 7 / 48, 0.0, k * 7 / 48)
    for edge, (a, b) in enumerate([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]):
        lone = middle[:, edge] < 0
        if lone.any():
            ends = corners[lone][:, [a, b]]
            found.add(ends, mass[lone] * 7 / 96, 0.0, k[lone] * 7 / 96)


def truss(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """tmass.F."""
    if material is None or prop is None:
        raise SceneError(f"{where}: its trusses need a property and a material")
    length = np.linalg.norm(deck.position[some.nodes[:, 1]] - deck.position[some.nodes[:, 0]], axis=1)
    area = prop.values.get("area", 0.0)
    k = 0.0 if material.void else material.young * area / length
    found.add(some.nodes, material.density * area * length / 2, 0.0, k)


def beam(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """pmass.F."""
    if material is None or prop is None:
        raise SceneError(f"{where}: its beams need a property and a material")
    values = prop.values
    length = np.linalg.norm(deck.position[some.nodes[:, 1]] - deck.position[some.nodes[:, 0]], axis=1)
    area = values.get("area", 0.0)
    if not material.young or not area:
        found.add(some.nodes, material.density * length * area / 2)
        return
    ixx, bending = values.get("ixx", 0.0), max(values["iyy"], values["izz"], 1e-30)
    young, g = material.young, material.young / (2 * (1 + material.poisson))
    slenderness = area * length**2 / bending / 12
    shear = 1.2 * young / g / slenderness
    phi = np.maximum(1, (4 + shear) / (1 + shear) / (1 + slenderness))
    mass = material.density * length * area / 2
    inertia = mass * length**2 / 12 + material.density * length / 2 * bending
    inertia = np.where(slenderness < 1, phi, 1) * inertia
    inertia = np.maximum(inertia, material.density * length / 2 * ixx)
    d = max(values.get("dm", 0.0), values.get("df", 0.01)) * np.sqrt(2)
    damped = length * (np.sqrt(1 + d * d) - d) ** 2
    found.rotations[some.nodes] = True
    found.add(some.nodes, mass, inertia, area * young / damped, np.maximum(g * ixx, phi * young * bending) / damped)


def spring(found: Nodal, deck: Deck, some: Elements, part, prop, material, where: str):
    """rmass.F, rinit3.F."""
    if prop is None or prop.kind != "spring":
        return
    values = prop.values
    end = np.where(some.nodes[:, 1] < 0, some.nodes[:, 0], some.nodes[:, 1])
    length = np.linalg.norm(deck.position[end] - deck.position[some.nodes[:, 0]], axis=1)
    scale = length if values.get("per_length") else np.ones(len(length))
    mass, inertia = values["mass"] * scale, values["inertia"] * scale
    turning = values["type"] != "axial" and values.get("turning", True)
    found.add(some.nodes, mass / 2, inertia / 2 if turning else 0.0)
    if turning:
        found.rotations[some.nodes[some.nodes >= 0]] = True
    axes = 1 if values["type"] == "axial" else 3
    k, c = (max(values[key][:axes]) / scale for key in ("stiffness", "damping"))
    kr = cr = np.zeros(len(length))
    if turning:
        kr, cr = (max(values[key]) / scale for key in ("rotational_stiffness", "rotational_damping"))
    if values["type"] == "beam":
        kr = kr + max(values["stiffness"][1:]) / scale * length**2
        cr = cr + max(values["damping"][1:]) / scale * length**2
    found.add(some.nodes, stiffness=damped_stiffness(k, c, mass))
    if turning:
        found.add(some.nodes, rotational_stiffness=damped_stiffness(kr, cr, inertia))


def damped_stiffness(k: np.ndarray, c: np.ndarray, m: np.ndarray) -> np.ndarray:
    """(sqrt(c^2 + k m) + c)^2 / m: the stiffness whose undamped step with the mass m is that of k and c."""
    return np.where(m > 0, (np.sqrt(c * c + k * m) + c) ** 2 / m, k)


FUNCTIONS: dict[str, Callable[..., None]] = {
    "shell4": shell4,
    "shell3": shell3,
    "hex8": brick,
    "wedge6": brick,
    "tet4": tetra4,
    "tet10": tetra10,
    "truss": truss,
    "beam": beam,
    "spring": spring,
    "membrane4": shell4,
    "membrane3": shell3,
    **second_order.FUNCTIONS,
}
