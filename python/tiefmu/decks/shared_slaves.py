"""Slaves of several ties: a node can follow one surface only, and stays with the nearest."""

import numpy as np

from .model import Deck


def settle_shared(deck: Deck):
    """Takes each slave that several ties name out of all but the one whose faces are nearest, the first of equals."""
    every = np.concatenate([tie.slaves for tie in deck.ties])
    nodes, count = np.unique(every, return_counts=True)
    shared = nodes[count > 1]
    if not len(shared):
        return
    distance = np.full((len(deck.ties), len(shared)), np.inf)
    for row, tie in enumerate(deck.ties):
        mine = np.isin(shared, tie.slaves)
        distance[row, mine] = distances(deck.position[shared[mine]], corners(deck, tie.faces.nodes))
    size = np.ptp(deck.position, axis=0).max()
    nearest = np.argmax(distance <= distance.min(axis=0) + 1e-9 * size, axis=0)
    for row, tie in enumerate(deck.ties):
        lost = shared[(nearest != row) & np.isin(shared, tie.slaves)]
        if len(lost):
            owner = deck.ties[nearest[shared == lost[0]][0]]
            tie.slaves = np.setdiff1d(tie.slaves, lost)
            deck.warn(
                f"{tie.where}: tie '{tie.name}': {len(lost)} slaves, the first is node {deck.node_id[lost[0]]}, are "
                f"slaves of tie '{owner.name}' or another too and stay with the nearer surface"
            )
            if not len(tie.slaves):
                deck.warn(f"{tie.where}: tie '{tie.name}': every slave belongs to another tie; it is left out")
    deck.ties = [tie for tie in deck.ties if len(tie.slaves)]


def corners(deck: Deck, faces: np.ndarray) -> np.ndarray:
    """Corners (n, 3, 3) of the triangles of faces (m, 4); a quad is two."""
    x = deck.position[np.where(faces < 0, faces[:, [2]], faces)]
    return np.concatenate([x[:, [0, 1, 2]], x[faces[:, 3] >= 0][:, [0, 2, 3]]])


def distances(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Of each point (k, 3) from the nearest of the triangles (n, 3, 3)."""
    a = triangles[:, 0]
    edges = [(i, triangles[:, (i + 1) % 3] - triangles[:, i]) for i in range(3)]
    normal = np.cross(edges[0][1], edges[1][1])
    square = np.maximum((normal**2).sum(axis=1), 1e-300)
    found = np.empty(len(points))
    for k, point in enumerate(points):
        best = np.inf
        inside = np.ones(len(a), bool)
        for i, edge in edges:
            arm = point - triangles[:, i]
            along = np.clip((arm * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300), 0, 1)
            best = min(best, ((arm - along[:, None] * edge) ** 2).sum(axis=1).min())
            inside &= (np.cross(edge, arm) * normal).sum(axis=1) >= 0
        height = ((point - a) * normal).sum(axis=1) ** 2 / square
        found[k] = np.sqrt(min(best, height[inside].min(initial=np.inf)))
    return found
