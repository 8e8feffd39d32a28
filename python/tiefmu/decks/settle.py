"""What a deck's ties say pair by pair, once each slave has found its segment: tolerances, and slaves moved to the
surface."""

import numpy as np

from .._core import SceneError
from .model import Deck
from .to_scene import Written

EPS = 1e-9  # of the size of the scene: what lies on the surface


def settle(deck: Deck, written: Written, scene):
    """Takes slaves out of ties with a tolerance per pair where the segment they find is farther than it, and moves
    those of ties that ask for it. scene: compiled from `written`."""
    found = scene.model.report()["slaves"]
    names = [table.name for table in scene.ties]
    for name, pair in written.pairwise.items():
        mine = np.flatnonzero(found["tie"] == names.index(name))
        ids = found["id"][mine]
        thick = thickness(pair, ids, found["segment"][mine])
        limit = (np.maximum(thick[0], pair["share"] * thick[1]) + pair["more"]) * pair["factor"]
        near = found["distance"][mine] <= limit * (1 + 1e-12)
        drop(deck, written, name, ids[near])
        if pair["adjust"]:
            gap = thick[1] * (0.0 if pair["onto_middle"] else pair["share"] * pair["factor"] / written.unit)
            keys = ("id", "nodes", "corners", "xi", "eta", "weights")
            move(deck, written, name, {key: found[key][mine[near]] for key in keys}, gap[near])
    written.pairwise = {}


def thickness(pair: dict, slaves: np.ndarray, segments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each pair of slave id and segment id, in the deck's units: share of the shorter diagonal, and the summed
    thicknesses."""

    def place(known, wanted):
        order = np.argsort(known, kind="stable")
        return order[np.searchsorted(known, wanted, sorter=order)]

    face, node = place(pair["segment"], segments), place(pair["slave"], slaves)
    return pair["diagonal"][face], pair["t_s"][node] + pair["t_m"][face]


def drop(deck: Deck, written: Written, name: str, kept: np.ndarray):
    table = next(table for table in written.tables["tie"] if table["name"] == name)
    lost = np.setdiff1d(written.node_sets[table["slaves"]], kept)
    if len(lost):
        deck.warn(
            f"tie '{name}': {len(lost)} slaves, the first is node {lost[0]}, are farther from the surface than "
            "their tolerance and are dropped"
        )
    if not len(kept):
        if len(written.tables["tie"]) == 1:
            raise SceneError(f"{deck.file}: tie '{name}': no slave is within its tolerance of the surface")
        deck.warn(f"tie '{name}': none of its slaves is left; it is left out")
        written.tables["tie"].remove(table)
        del written.node_sets[table["slaves"]], written.segment_sets[table["segments"]]
        return
    written.node_sets[table["slaves"]] = np.sort(kept)


def move(deck: Deck, written: Written, name: str, slaves: dict[str, np.ndarray], gap: np.ndarray):
    """Moves slaves along the line to their projections until they are `gap` away; those on the surface stay."""
    order = np.argsort(written.node_id)
    nodes = order[np.searchsorted(written.node_id, np.maximum(slaves["nodes"], written.node_id.min()), sorter=order)]
    foot = (inside(slaves)[:, :, None] * written.position[nodes]).sum(axis=1)
    index = order[np.searchsorted(written.node_id, slaves["id"], sorter=order)]
    arm = written.position[index] - foot
    distance = np.linalg.norm(arm, axis=1)
    size = np.ptp(written.position, axis=0).max()
    moved = (np.abs(distance - gap) > EPS * size) & ((distance > EPS * size) | (gap == 0))
    if not moved.any():
        return
    arm, distance, gap = arm[moved], distance[moved], gap[moved]
    written.position[index[moved]] = foot[moved] + arm * (gap / np.maximum(distance, 1e-300))[:, None]
    far = np.abs(distance - gap)
    worst = int(np.argmax(far))
    deck.notes.append(
        f"tie '{name}': {moved.sum()} slaves are moved to the surface, node {slaves['id'][moved][worst]} the "
        f"farthest, by {far[worst]:.4g}"
    )


def inside(slaves: dict[str, np.ndarray]) -> np.ndarray:
    """Shape functions (n, 4) at the projections, those beside their segment taken to its edge."""
    xi, eta = (np.clip(slaves[key], -1, 1) for key in ("xi", "eta"))
    quad = (
        np.stack([(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 + xi) * (1 + eta), (1 - xi) * (1 + eta)], axis=1) / 4
    )
    triangle = np.where(np.arange(4) < 3, np.maximum(slaves["weights"], 0), 0)
    triangle = triangle / np.maximum(triangle.sum(axis=1, keepdims=True), 1e-300)
    return np.where(slaves["corners"][:, None] == 4, quad, triangle)
