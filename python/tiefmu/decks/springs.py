"""Springs of a deck that a scene holds: which, and as what.

A scene knows an axial spring and a bushing with axes of the inertial frame. A beam-like spring of axial stiffness k1
and shear stiffness k2 along a direction of its own is a bushing k2 in all directions and an axial spring k1 - k2.
"""

import numpy as np

from .model import Deck

EPS = 1e-9


def spring_tables(deck: Deck, slave: np.ndarray, tied: np.ndarray, loose: np.ndarray):
    """([[spring]] tables in the deck's units, which springs they hold, nodes at their ends): of springs with an end
    that is a slave or a free node of the scene."""
    springs = deck.elements.get("spring")
    if springs is None:
        return [], None, np.empty(0, np.int64)
    held = np.zeros(len(springs.id), bool)
    tables, ends, nonlinear = [], [], {}
    active = slave | (loose & tied)
    for _, prop, _, members in deck.part_values(springs.part):
        if prop is None:
            continue
        both = springs.nodes[members]
        some = members[(active[both] & (both >= 0)).any(axis=1)]
        if not len(some):
            continue
        if prop.kind != "spring":
            deck.warn(f"{prop.where}: {len(some)} springs at tied nodes are of a type that is not understood")
            continue
        if prop.values.get("nonlinear"):
            nonlinear[prop.where] = (len(some), prop.values["nonlinear"][0])
        for index in some:
            a, b = springs.nodes[index]
            found = tables_of(deck, prop, a, b, springs.id[index])
            place = (
                {"nodes": [int(deck.node_id[a]), int(deck.node_id[b])]}
                if b >= 0
                else {"ground": [int(deck.node_id[a])]}
            )
            tables += [place | table for table in found]
            ends += [a, b] if b >= 0 else [a]
        held[some] = True
    for where, (count, function) in nonlinear.items():
        deck.warn(f"{where}: {count} springs follow function {function}; only their linear part is taken")
    if tables:
        deck.notes.append(f"{held.sum()} springs at slaves or free nodes are in the scene; the others are the host's")
    return tables, held, np.unique(np.array(ends, np.int64))


def tables_of(deck: Deck, prop, a: int, b: int, number: int) -> list[dict]:
    """One or two tables for a spring between the nodes a and b, or a and the ground where b is -1."""
    values = prop.values
    axis = deck.position[b] - deck.position[a] if b >= 0 else np.zeros(3)
    length = float(np.linalg.norm(axis))
    scale = length if values.get("per_length") else 1.0
    k, c, kr, cr = (
        np.array(values[key]) / scale for key in ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    )
    if values["type"] == "axial":
        return [{"kind": "axial", "stiffness": float(k[0]), "damping": float(c[0])}]
    frame = frame_of(deck, values, axis, length)
    tables = []
    if aligned(frame) or all(same(vector) for vector in (k, c, kr, cr)):
        bushing = [to_axes(frame, vector) for vector in (k, c, kr, cr)]
    elif same(k[1:]) and same(c[1:]) and k[0] >= k[1] and c[0] >= c[1] and length > 0 and values["type"] == "beam":
        bushing = [np.full(3, k[1]), np.full(3, c[1]), mean(deck, prop, kr), mean(deck, prop, cr)]
        if k[0] > k[1] or c[0] > c[1]:
            tables.append({"kind": "axial", "stiffness": float(k[0] - k[1]), "damping": float(c[0] - c[1])})
    else:
        bushing = [mean(deck, prop, vector) for vector in (k, c, kr, cr)]
    names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    tables.insert(
        0, {"kind": "bushing"} | {n: v.tolist() for n, v in zip(names, bushing) if v.any() or n == "stiffness"}
    )
    return tables


def frame_of(deck: Deck, values: dict, axis: np.ndarray, length: float) -> np.ndarray:
    """Axes of a spring as rows: of its skew, or (beam-like) along it and by the global y axis: r4buf3.F."""
    skew = deck.frames.get(values.get("skew", 0))
    if values["type"] != "beam" or length == 0:
        return np.eye(3) if skew is None else skew
    x = axis / length
    y = np.array([0.0, 1.0, 0.0]) if skew is None else skew[1]
    y = y - (y @ x) * x
    if np.linalg.norm(y) < 1e-6:
        y = np.array([0.0, 0.0, 1.0]) - x[2] * x
    y = y / np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)])


def aligned(frame: np.ndarray) -> bool:
    """Whether the axes are those of the inertial frame, in any order and direction."""
    return bool((np.abs(frame).max(axis=1) > 1 - EPS).all())


def same(vector: np.ndarray) -> bool:
    return bool(np.ptp(vector) <= EPS * max(np.abs(vector).max(), 1e-300))


def to_axes(frame: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Diagonal of the stiffness in inertial axes, of a frame aligned with them or an isotropic vector."""
    return (frame**2 * vector[:, None]).sum(axis=0) if not same(vector) else vector


def mean(deck: Deck, prop, vector: np.ndarray) -> np.ndarray:
    if not same(vector):
        deck.warn(
            f"{prop.where}: its axes are not those of the scene; the mean of its three stiffnesses is taken where they "
            "differ"
        )
    return np.full(3, vector.mean())
