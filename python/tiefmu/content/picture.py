"""A picture of a scene at its start, as SVG and as PNG: segments, masters, slaves and what they are tied to.

Not by matplotlib, whose import takes longer than all of a build.
"""

import io

import numpy as np
from PIL import Image, ImageDraw

LABELLED = 30  # nodes: with more of them ids would hide the picture
DETAILED = 4000  # segments and slaves: with more of them a PNG has thin lines and points
WIDTH, HEIGHT, MARGIN = 480, 360, 24
FACE, EDGE, SLAVE = "#dde8f2", "#445566", "#bb4400"


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
        mean = slaves["coupling"] == found["couplings"].index("mean-motion")
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
        image = Image.new("RGB", (2 * WIDTH, 2 * HEIGHT), "white")
        draw = ImageDraw.Draw(image)
        many = len(self.segments) + len(self.slaves) > DETAILED
        width = 1 if many else 3
        for corners in self.segments:
            outline = (2 * corners).ravel().tolist()
            if not many:
                draw.polygon(outline, fill=FACE)
            draw.line([*outline, *outline[:2]], EDGE, width)
        for ends in np.hstack([2 * self.feet, 2 * self.slaves]).tolist():
            draw.line(ends, SLAVE, width)
        few = len(self.slaves) + len(self.masters) <= LABELLED
        for colour, radius, points in ((EDGE, 5, self.masters), (SLAVE, 6, self.slaves)):
            if many:
                draw.point((2 * points).ravel().tolist(), colour)
                continue
            for centre in (2 * points).tolist():
                draw.circle(centre, radius if few else 2, fill=colour)
        file = io.BytesIO()
        image.reduce(2).save(file, "PNG")
        return file.getvalue()


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
