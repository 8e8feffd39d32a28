"""Springs, beams and trusses of a deck that a scene holds: which, and as what.

A scene knows an axial spring, a bushing with axes of the inertial frame, and a beam between two nodes whose axes turn
with it. What has a length and can bend is a beam; what has none, or acts along fixed directions, a bushing.
"""

from collections import Counter

import numpy as np

from .._core import SceneError
from .beams import beam_stiffness
from .model import Deck

EPS = 1e-9
WORDS = {"spring": "springs", "beam": "beams", "truss": "trusses"}
NAMES = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")


def held_by_scene(deck: Deck, slave: np.ndarray, tied: np.ndarray, loose: np.ndarray) -> dict[str, np.ndarray]:
    """Which springs, beams and trusses the scene holds, a mask for each kind: those with an end that is a slave or a
    free node of the scene."""
    found = {}
    active = slave | (loose & tied)
    for kind in WORDS:
        elements = deck.elements.get(kind)
        if elements is None:
            continue
        held = found[kind] = np.zeros(len(elements.id), bool)
        for _, prop, material, members in deck.part_values(elements.part):
            if prop is None:
                continue
            both = elements.nodes[members]
            some = members[(active[both] & (both >= 0)).any(axis=1)]
            if not len(some):
                continue
            if kind == "spring" and prop.kind != "spring":
                deck.warn(f"{prop.where}: {len(some)} springs at tied nodes are of a type that is not understood")
            elif kind == "spring":
                held[some] = True
                if prop.values.get("nonlinear"):
                    function = prop.values["nonlinear"][0]
                    deck.warn(
                        f"{prop.where}: {len(some)} springs follow function {function}; only their linear part is taken"
                    )
            elif prop.kind == kind and prop.values.get("area") and material and material.young and not material.void:
                held[some] = ~in_one_body(deck, elements.nodes[some])
    return found


def in_one_body(deck: Deck, nodes: np.ndarray) -> np.ndarray:
    """Whether both nodes of a row (n, 2) belong to one rigid body."""
    found = np.zeros(len(nodes), bool)
    for body in deck.rigid:
        members = np.zeros(len(deck.node_id), bool)
        members[body.nodes] = True
        if body.main >= 0:
            members[body.main] = True
        found |= members[nodes].all(axis=1)
    return found


def spring_tables(deck: Deck, held: dict[str, np.ndarray], turns: np.ndarray) -> tuple[list[dict], np.ndarray]:
    """([[spring]] tables in the deck's units, nodes at their ends) of what the scene holds. turns: per node of the
    deck, whether a moment can act on it."""
    tables, ends = [], []
    pinned: Counter[str] = Counter()
    for kind, mask in held.items():
        elements = deck.elements[kind]
        for _, prop, material, members in deck.part_values(elements.part):
            for index in members[mask[members]]:
                a, b = elements.nodes[index]
                values = prop.values
                if kind != "spring":
                    values = as_spring(deck, kind, prop, material, elements, index)
                refuse_spring(deck, f"{prop.where}: element {elements.id[index]}", values, a, b)
                made, lost = tables_of(deck, values, prop.where, a, b, turns)
                if lost:
                    pinned[prop.where] += 1
                place = (
                    {"nodes": [int(deck.node_id[a]), int(deck.node_id[b])]}
                    if b >= 0
                    else {"ground": [int(deck.node_id[a])]}
                )
                tables += [place | table for table in made]
                ends += [a, b] if b >= 0 else [a]
        if mask.any():
            deck.notes.append(
                f"{mask.sum()} {WORDS[kind]} at slaves or free nodes are in the scene"
                + (" with their linear stiffness" if kind != "spring" else "")
                + "; the others are the host's"
            )
    for where, count in pinned.items():
        deck.warn(
            f"{where}: {count} of its elements end at nodes that cannot turn; what would bend or turn them there is "
            "left out"
        )
    return tables, np.unique(np.array(ends, np.int64))


def refuse_spring(deck: Deck, where: str, values: dict, a: int, b: int):
    if a == b:
        raise SceneError(f"{where}: both of its ends are node {deck.node_id[a]}")
    if values["type"] == "axial" and b >= 0 and (deck.position[a] == deck.position[b]).all():
        raise SceneError(f"{where}: its nodes {deck.node_id[a]} and {deck.node_id[b]} are at one place: it has no axis")
    least = min(float(np.min(values[key])) for key in NAMES)
    if least < 0:
        raise SceneError(f"{where}: a stiffness or damping of {least:g} is negative")


def as_spring(deck: Deck, kind: str, prop, material, elements, index: int) -> dict:
    """A beam or truss as a spring between its nodes: theory (3.15)."""
    a, b = elements.nodes[index]
    length = float(np.linalg.norm(deck.position[b] - deck.position[a]))
    if kind == "truss":
        k, kr = np.array([material.young * prop.values["area"] / length, 0.0, 0.0]), np.zeros(3)
    else:
        k, kr = beam_stiffness(prop.values, material, length)
    side = prop.values.get("second_axis") if elements.second_axis is None else elements.second_axis[index]
    zero = np.zeros(3)
    return {"type": "beam", "side": side} | dict(zip(NAMES, (k, zero, kr, zero)))


def tables_of(deck: Deck, values: dict, where: str, a: int, b: int, turns: np.ndarray) -> tuple[list[dict], bool]:
    """One or two tables for a spring between the nodes a and b, or a and the ground where b is -1; whether moments are
    left out, as an end cannot turn."""
    axis = deck.position[b] - deck.position[a] if b >= 0 else np.zeros(3)
    length = float(np.linalg.norm(axis))
    scale = length if values.get("per_length") else 1.0
    k, c, kr, cr = (np.array(values[key], float) / scale for key in NAMES)
    if values["type"] == "axial":
        return [{"kind": "axial", "stiffness": float(k[0]), "damping": float(c[0])}], False
    turning = bool(turns[a] and (b < 0 or turns[b]))
    if values["type"] == "beam" and length > 0:
        stiff_aside = any(vector.any() for vector in (k[1:], c[1:], kr, cr))
        if not stiff_aside or not turning:
            return [{"kind": "axial", "stiffness": float(k[0]), "damping": float(c[0])}], stiff_aside
        table: dict = {"kind": "beam"} | given(k, c, kr, cr)
        if not all(same(vector[1:]) for vector in (k, c, kr, cr)):
            table["orientation"] = side_of(deck, values, axis / length).tolist()
        return [table], False
    frame = frame_of(deck, values)
    lost = not turning and bool(kr.any() or cr.any())
    if lost:
        kr, cr = np.zeros((2, 3))
    if aligned(frame) or all(same(vector) for vector in (k, c, kr, cr)):
        bushing = [to_axes(frame, vector) for vector in (k, c, kr, cr)]
    else:
        bushing = [mean(deck, where, vector) for vector in (k, c, kr, cr)]
    return [{"kind": "bushing"} | given(*bushing)], lost


def given(*vectors: np.ndarray) -> dict:
    return {name: v.tolist() for name, v in zip(NAMES, vectors) if v.any() or name == "stiffness"}


def side_of(deck: Deck, values: dict, x: np.ndarray) -> np.ndarray:
    """Second axis of a beam along x: on the side that it names, or of its skew's y axis, or of the global one."""
    y = values.get("side")
    if y is None:
        skew = deck.frames.get(values.get("skew", 0))
        y = np.array([0.0, 1.0, 0.0]) if skew is None else skew[1]
    y = y - (y @ x) * x
    if np.linalg.norm(y) < 1e-6:
        y = np.array([0.0, 0.0, 1.0]) - x[2] * x
    if np.linalg.norm(y) < 1e-6:
        y = np.array([0.0, 1.0, 0.0])
    return y / np.linalg.norm(y)


def frame_of(deck: Deck, values: dict) -> np.ndarray:
    """Axes of a spring without length, or with fixed directions, as rows."""
    skew = deck.frames.get(values.get("skew", 0))
    return np.eye(3) if skew is None else skew


def aligned(frame: np.ndarray) -> bool:
    """Whether the axes are those of the inertial frame, in any order and direction."""
    return bool((np.abs(frame).max(axis=1) > 1 - EPS).all())


def same(vector: np.ndarray) -> bool:
    return bool(np.ptp(vector) <= EPS * max(np.abs(vector).max(), 1e-300))


def to_axes(frame: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Diagonal of the stiffness in inertial axes, of a frame aligned with them or an isotropic vector."""
    return (frame**2 * vector[:, None]).sum(axis=0) if not same(vector) else vector


def mean(deck: Deck, where: str, vector: np.ndarray) -> np.ndarray:
    if not same(vector):
        deck.warn(
            f"{where}: its axes are not those of the scene; the mean of its three stiffnesses is taken where they "
            "differ"
        )
    return np.full(3, vector.mean())
