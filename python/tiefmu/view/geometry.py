"""Where things are in a scene, from its tie report, which an FMU carries too."""

import numpy as np

from ..errors import UsageError


class Geometry:
    """At the start; SI.

    nodes: masters and points of the report in its order, their ids (n,) and positions (n, 3); segments: (id, places of
    its corners in nodes) of those that hold slaves; slaves, feet: positions of the slaves, and of their projections on
    their segments, (slaves, 3), in the order of the report.
    """

    def __init__(self, found: dict):
        """found: a report. Raises UsageError where it holds no positions."""
        self.rows = found["masters"] + found["points"]
        if any("position" not in row for row in self.rows):
            raise UsageError("the FMU holds no positions, as its nodes are too many; give its scene")
        self.ids = np.array([row["id"] for row in self.rows], dtype=np.int64)
        self.positions = np.array([row["position"] for row in self.rows], dtype=float).reshape(-1, 3)
        place = {node: k for k, node in enumerate(self.ids.tolist())}
        rows = found["slaves"]
        self.corners = np.zeros((len(rows), 4), dtype=np.int64)  # places in nodes; a triangle's fourth weighs nothing
        self.shapes, weights = np.zeros((len(rows), 4)), np.zeros((len(rows), 4))
        self.segments: dict[int, list[int]] = {}
        for k, row in enumerate(rows):
            corners = [place[node] for node in row["nodes"]]
            n = len(corners)
            self.segments.setdefault(row["segment"], corners)
            self.corners[k, :n], weights[k, :n] = corners, row["weights"]
            self.shapes[k, :n] = shapes(row["xi"], row["eta"], n)
        # the offset is to where the weights of the tie put the slave's foot: theory 2 and 3
        offset = np.array([row["offset"] for row in rows]).reshape(-1, 3)
        self.slaves = np.einsum("sc,sck->sk", weights, self.positions[self.corners]) + offset
        self.feet = self.projections(self.positions)

    def projections(self, positions: np.ndarray) -> np.ndarray:
        """Of the slaves on their segments, (slaves, 3), with the nodes at `positions`."""
        return np.einsum("sc,sck->sk", self.shapes, positions[self.corners])


def shapes(xi: float, eta: float, corners: int) -> np.ndarray:
    """Shape functions of a quad or a triangle: theory 2."""
    if corners == 3:
        return np.array([1 - xi - eta, xi, eta])
    return np.array([(1 + s * xi) * (1 + t * eta) / 4 for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
