"""Random segments, scenes and motions for the tests. Every scene is the dict of a TOML file, in SI."""

import numpy as np
from independent_kernels import local_coordinates, shape, shape_gradient


def rotation(rng):
    """A random proper rotation matrix."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def segment(rng, n=4, aspect=20.0, skewness=0.25, warp=0.25):
    """Corners (n, 3), about 1 long and up to `aspect` times shorter across; skewness and warp in short edges."""
    short = 1 / np.exp(rng.uniform(0, np.log(aspect)))
    plane = np.array([[0, 0], [1, 0], [1, short], [0, short]]) if n == 4 else np.array([[0, 0], [1, 0], [0.3, short]])
    corners = np.column_stack([plane, np.zeros(n)])
    corners[:, :2] += rng.uniform(-skewness, skewness, (n, 2)) * short
    corners[:, 2] += rng.uniform(-warp, warp, n) * short
    return corners @ rotation(rng).T + rng.normal(size=3)


def slave_over(rng, corners, outside=1.4, offset=5.0):
    """A point whose projection is well defined: up to `offset` mean edges off the surface, |xi|, |eta| <= outside."""
    n = len(corners)
    edge = np.mean(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))
    while True:
        xi, eta = rng.uniform(-outside, outside, 2) if n == 4 else rng.dirichlet([1, 1, 1])[1:] * 1.2 - 0.06
        a, b = shape_gradient(n, xi, eta) @ corners
        normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        point = shape(n, xi, eta) @ corners + rng.choice([0, 1]) * rng.uniform(-offset, offset) * edge * normal
        # A far point of a warped quad can have several closest ones, or lie near a focal point where none is well
        # defined; wanted is one that Newton finds from the centre, with a curvature term that leaves it well defined.
        first = np.array([a, b]) @ np.array([a, b]).T
        cross = (shape(n, xi, eta) @ corners - point) @ (0.25 * np.array([1, -1, 1, -1]) @ corners) if n == 4 else 0
        well_defined = abs(cross) < 0.8 * np.sqrt(np.linalg.det(first)) * np.linalg.det(first) / np.prod(np.diag(first))
        if n == 3 or (
            well_defined and np.abs(local_coordinates(corners[None], point[None])[0] - (xi, eta)).max() < 1e-9
        ):
            return point


def rows(first, positions):
    return [[first + k, *map(float, p)] for k, p in enumerate(positions)]


def one_segment(rng, n=4, formulation="default", rotations=True, slaves=3, motion="driven", offset=5.0, warp=0.25):
    """A segment (nodes 1..n) with slaves 101.. on it, random masses; the model table is empty."""
    corners = segment(rng, n, warp=warp)
    points = [slave_over(rng, corners, offset=offset) for _ in range(slaves)]
    turns = formulation == "optimized" or rotations
    node = [{"nodes": "all", "motion": motion, "rotations": rotations}]
    for i in range(1, n + 1):
        node.append({"nodes": [i], "mass": rng.uniform(0.5, 2), "inertia": rng.uniform(0.1, 0.4) if rotations else 0.0})
    for j in range(slaves):
        node.append(
            {
                "nodes": [101 + j],
                "mass": rng.uniform(0.1, 2),
                "stiffness": rng.uniform(1, 5),
                "inertia": rng.uniform(0.01, 0.2) if turns else 0.0,
                "rotational_stiffness": rng.uniform(1, 5) if turns else 0.0,
            }
        )
    return {
        "mesh": {"nodes": rows(1, corners) + rows(101, points), "segments": [[1, *range(1, n + 1)]]},
        "node": node,
        "tie": [
            {
                "name": "tie",
                "segments": [1],
                "slaves": [101 + j for j in range(slaves)],
                "search_distance": 100.0,
                "formulation": formulation,
            }
        ],
        "model": {},
    }


def patch(rng, columns=3, rows_=3, size=1.0, warp=0.1, triangles=0.3):
    """Positions (N, 3) and segments [id, nodes...] of a patch of quads, some of them cut into triangles. Ids from 1."""
    y, x = np.meshgrid(np.arange(rows_ + 1.0), np.arange(columns + 1.0), indexing="ij")
    position = size * np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    position += warp * size * rng.uniform(-1, 1, position.shape)
    segments = []
    for j in range(rows_):
        for i in range(columns):
            a = 1 + j * (columns + 1) + i
            b, c, d = a + 1, a + columns + 2, a + columns + 1
            cut = rng.uniform() < triangles
            for nodes in ([a, b, c], [a, c, d]) if cut else ([a, b, c, d],):
                segments.append([len(segments) + 1, *nodes])
    return position, segments


def structure(rng, formulation="default", rotations=True, inertia="consistent", gap=0.3, slaves=4, speed=1.0):
    """A free patch on ground bushings with slaves, one of which carries a bushing to a free point (node 301)."""
    position, segments = patch(rng, 2, 2)
    count = len(position)
    picked = rng.choice(len(segments), slaves)
    points = []
    for e in picked:
        corners = position[np.array(segments[e][1:]) - 1]
        phi = rng.dirichlet(np.full(len(corners), 3.0))
        points.append(phi @ corners + gap * np.array([0, 0, 1.0]) * rng.uniform(0.5, 1))
    turns = formulation == "optimized" or rotations
    slave_ids = [101 + k for k in range(slaves)]
    node = [
        {"nodes": "all", "motion": "free", "rotations": rotations, "mass": 1.0, "inertia": 0.2 if rotations else 0.0},
        {"nodes": slave_ids, "mass": 0.5, "inertia": 0.05 if turns else 0.0},
        {"nodes": [301], "rotations": turns, "mass": 0.7, "inertia": 0.1 if turns else 0.0},
    ]
    turning = {"rotational_stiffness": 30.0} if turns else {}
    held = {"rotational_stiffness": 40.0} if rotations else {}
    spring = [
        {"ground": list(range(1, count + 1)), "kind": "bushing", "stiffness": 200.0, **held},
        {"nodes": [slave_ids[0], 301], "kind": "bushing", "stiffness": 150.0, **turning},
        {"nodes": [slave_ids[-1], 301], "kind": "axial", "stiffness": 100.0},
    ]
    initial = []
    for i in range(1, count + 1):
        v, w = rng.uniform(-speed, speed, (2, 3)).tolist()
        initial.append({"nodes": [i], "v": v} | ({"w": w} if rotations else {}))
    return {
        "mesh": {
            "nodes": rows(1, position) + rows(101, points) + rows(301, [points[0] + [0.1, 0.2, 0.5]]),
            "segments": segments,
        },
        "node": node,
        "tie": [{"name": "tie", "segments": "all", "slaves": slave_ids, "formulation": formulation}],
        "spring": spring,
        "initial": initial,
        "model": {"inertia": inertia},
    }


def moved(scene, turn, shift):
    """The same scene turned and shifted in space (isotropic springs only)."""

    def vector(v):
        return (turn @ np.asarray(v, float)).tolist()

    def place(row):
        return [row[0], *(turn @ np.array(row[1:]) + shift).tolist()]

    model = dict(scene["model"])
    if "gravity" in model:
        model["gravity"] = vector(model["gravity"])
    initial = [{k: v if k == "nodes" else vector(v) for k, v in table.items()} for table in scene.get("initial", [])]
    mesh = {"nodes": [place(row) for row in scene["mesh"]["nodes"]], "segments": scene["mesh"]["segments"]}
    return scene | {"mesh": mesh, "model": model, "initial": initial}


def renumbered(scene, new):
    """The same scene with node ids i -> new[i], tables in another order."""

    def ids(which):
        return which if which == "all" else [new[i] for i in which]

    mesh = {
        "nodes": [[new[row[0]], *row[1:]] for row in scene["mesh"]["nodes"]][::-1],
        "segments": [[row[0], *(new[i] for i in row[1:])] for row in scene["mesh"]["segments"]][::-1],
    }
    tables = {}
    for name in ("node", "tie", "spring", "initial"):
        if name in scene:
            tables[name] = [
                {k: ids(v) if k in ("nodes", "slaves", "ground") else v for k, v in table.items()}
                for table in scene[name]
            ]
    return scene | {"mesh": mesh} | tables
