"""A picture of a scene at its start, as SVG and as PNG: segments, masters, slaves and what they are tied to.

Drawn here and not by matplotlib, whose import takes longer than all of a build.
"""

import struct
import zlib

import numpy as np

LABELLED = 30  # nodes: with more of them ids would hide the picture
FILLED = 2000  # segments: with more of them a PNG has their edges only
WIDTH, HEIGHT, MARGIN = 480, 360, 24
FACE, EDGE, SLAVE = "#dde8f2", "#445566", "#bb4400"
COLOURS = ["#ffffff", FACE, EDGE, SLAVE]


class Picture:
    """found: that of Model.report()."""

    def __init__(self, found: dict):
        nodes, slaves = found["nodes"], found["slaves"]
        by_id = np.argsort(nodes["id"], kind="stable")
        # Places of each slave's corners; a triangle's fourth has no weight.
        corner = np.arange(4) < slaves["corners"][:, None]
        index = np.where(corner, np.searchsorted(nodes["id"][by_id], slaves["nodes"]), 0)
        places = nodes["position"][by_id][index] if len(index) else np.zeros((0, 4, 3))
        # S = P + d, or C + d: the weights are those of the tie.
        mean = slaves["coupling"] == found["couplings"].index("meanMotion")
        weights = np.where(mean[:, None], corner / slaves["corners"][:, None], slaves["weights"])
        order = np.argsort(slaves["id"], kind="stable")
        feet = np.einsum("ji,jik->jk", weights, places)[order]
        offsets = slaves["offset"][order]
        masters = by_id[nodes["master"][by_id].astype(bool)]
        self.labels = nodes["id"][masters].tolist()
        self.slave_labels = slaves["id"][order].tolist()
        first = order[np.sort(np.unique(slaves["segment"][order], return_index=True)[1])]  # a slave of each segment
        shape = [corners[:n] for corners, n in zip(places[first], slaves["corners"][first].tolist())]
        masters = nodes["position"][masters]
        project = projection(np.vstack([masters, feet + offsets]))
        self.segments = [project(points) for points in shape]
        self.masters, self.feet, self.slaves = project(masters), project(feet), project(feet + offsets)

    def svg(self) -> str:
        """An <svg> element; ids are written beside the nodes where they are few."""

        def point(p):
            return f"{p[0]:.1f} {p[1]:.1f}"

        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
            f'height="{HEIGHT}" font-family="sans-serif" font-size="11">',
            f'<g fill="{FACE}" stroke="{EDGE}" fill-opacity="0.8">',
        ]
        parts += ['<path d="M' + " L".join(map(point, corners)) + ' z"/>' for corners in self.segments]
        parts.append(f'</g><g stroke="{SLAVE}" stroke-dasharray="4 3">')
        parts += [f'<path d="M{point(a)} L{point(b)}"/>' for a, b in zip(self.feet, self.slaves)]
        for colour, radius, points, ids in (
            (EDGE, 3, self.masters, self.labels),
            (SLAVE, 4, self.slaves, self.slave_labels),
        ):
            parts.append(f'</g><g fill="{colour}">')
            parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}"/>' for x, y in points]
            if len(self.labels) + len(self.slave_labels) <= LABELLED:
                parts += [f'<text x="{x + 6:.1f}" y="{y - 5:.1f}">{i}</text>' for (x, y), i in zip(points, ids)]
        return "".join(parts) + "</g></svg>"

    def png(self) -> bytes:
        """The same without ids. Drawn twice as large and averaged, which smooths the edges."""
        canvas = np.zeros((HEIGHT * 2, WIDTH * 2), np.uint8)  # indexes of COLOURS
        segments = [corners * 2 for corners in self.segments]
        if len(segments) <= FILLED:
            for corners in segments:
                fill(canvas, corners, COLOURS.index(FACE))
        edges = np.vstack(
            [np.hstack([corners, np.roll(corners, -1, axis=0)]) for corners in segments] or [np.zeros((0, 4))]
        )
        many = len(self.slaves) + len(self.masters) > LABELLED
        lines(canvas, edges[:, :2], edges[:, 2:], COLOURS.index(EDGE), 1)
        lines(canvas, self.feet * 2, self.slaves * 2, COLOURS.index(SLAVE), 1)
        lines(canvas, self.masters * 2, self.masters * 2, COLOURS.index(EDGE), 2 if many else 5)
        lines(canvas, self.slaves * 2, self.slaves * 2, COLOURS.index(SLAVE), 2 if many else 6)
        palette = np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in COLOURS], np.uint16)
        quarters = [palette[canvas[i::2, j::2]] for i in (0, 1) for j in (0, 1)]
        return png((sum(quarters) // 4).astype(np.uint8))


def projection(points: np.ndarray):
    """Axonometric view from space to the page, with the thinnest direction of the scene up. Returns the function."""
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.ones(3))
    thin = [2, 1, 0][int(np.argmin((high - low)[::-1]))]  # of equals, z
    first, second = [(1, 2), (2, 0), (0, 1)][thin]
    view = np.zeros((3, 2))
    view[first], view[second], view[thin] = (0.94, 0.17), (-0.34, 0.47), (0.0, 0.87)
    flat = points @ view if len(points) else np.zeros((1, 2))
    middle, extent = (flat.min(axis=0) + flat.max(axis=0)) / 2, np.ptp(flat, axis=0)
    room = np.array([WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN])
    scale = min((r / e for r, e in zip(room.tolist(), extent.tolist()) if e > 0), default=1.0)
    return lambda p: (p @ view - middle) * [scale, -scale] + [WIDTH / 2, HEIGHT / 2]


def fill(canvas: np.ndarray, corners: np.ndarray, colour: int):
    """A convex polygon: pixels on the same side of every edge."""
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + 1
    part = canvas[low[1] : high[1], low[0] : high[0]]
    y, x = low[1] + np.arange(part.shape[0])[:, None], low[0] + np.arange(part.shape[1])
    left, right = np.ones(part.shape, bool), np.ones(part.shape, bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        side = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        left &= side >= 0
        right &= side <= 0
    part[left | right] = colour


def lines(canvas: np.ndarray, a: np.ndarray, b: np.ndarray, colour: int, half: int):
    """Lines from each a to each b, of 2 half + 1 pixels; a point where both are one."""
    counts = np.ceil(np.abs(b - a).max(axis=1, initial=0)).astype(int) + 1
    which = np.repeat(np.arange(len(a)), counts)
    along = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)) / np.maximum(counts[which] - 1, 1)
    at = np.round(a[which] + along[:, None] * (b - a)[which]).astype(int)
    for dx in range(-half, half + 1):
        for dy in range(-half, half + 1):
            if dx * dx + dy * dy <= half * half + 1:
                x, y = at[:, 0] + dx, at[:, 1] + dy
                seen = (x >= 0) & (x < canvas.shape[1]) & (y >= 0) & (y < canvas.shape[0])
                canvas[y[seen], x[seen]] = colour


def png(pixels: np.ndarray) -> bytes:
    """(height, width, 3) uint8 as a PNG file."""
    height, width, _ = pixels.shape

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = np.hstack([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)]).tobytes()  # 0: unfiltered
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(rows, 3))
        + chunk(b"IEND", b"")
    )
