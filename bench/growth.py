"""Loads a scene file of N slaves and builds its FMU, in a process of its own so that its memory can be seen.

python bench/growth.py N        prints rows of the benchmark's table
"""

import json
import resource
import sys
import tempfile
import time
from pathlib import Path

ONE_SLAVE = {
    "title": "One slave",
    "mesh": {
        "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, 0.3, 0.6, 0.4]],
        "segments": [[1, 1, 2, 3, 4]],
    },
    "node": [{"nodes": [1, 2, 3, 4], "rotations": True}, {"nodes": [5], "mass": 0.7}],
    "tie": [{"name": "weld", "segments": "all", "slaves": [5]}],
}


def surface(slaves: int, motion: str = "driven") -> dict:
    """A scene with four slaves on each quad, without offset."""
    side = max(1, round((slaves / 4) ** 0.5))
    nodes = [[j * (side + 1) + i + 1, i, j, 0] for j in range(side + 1) for i in range(side + 1)]
    segments, first = [], len(nodes) + 1
    for j in range(side):
        for i in range(side):
            a = j * (side + 1) + i + 1
            segments.append([len(segments) + 1, a, a + 1, a + side + 2, a + side + 1])
            for k in range(4):
                nodes.append([len(nodes) + 1, i + 0.3 + 0.4 * (k % 2), j + 0.3 + 0.4 * (k // 2), 0])
    ids = [node[0] for node in nodes[first - 1 :]]
    return {
        "title": f"{len(ids)} slaves",
        "mesh": {"nodes": nodes, "segments": segments},
        "node": [{"nodes": "all", "motion": motion, "mass": 1.0}],
        "tie": [{"name": "surface", "segments": "all", "slaves": ids}],
    }


def write_toml(scene: dict, path: Path) -> None:
    mesh = scene["mesh"]
    lines = [
        f"title = {json.dumps(scene['title'])}",
        "[mesh]",
        f"nodes = {json.dumps(mesh['nodes'])}",
        f"segments = {json.dumps(mesh['segments'])}",
    ]
    for table in ("node", "tie"):
        for row in scene[table]:
            lines += [f"[[{table}]]", *(f"{key} = {json.dumps(value)}" for key, value in row.items())]
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "surface.toml"
        write_toml(surface(int(sys.argv[1])), file)
        import tiefmu

        start = time.perf_counter()
        scene = tiefmu.load(file)
        loaded = time.perf_counter()
        fmu = tiefmu.build(scene, Path(folder) / "surface.fmu")
        built = time.perf_counter()
        from fmpy import read_model_description

        variables = len(read_model_description(fmu).modelVariables)
        read = time.perf_counter()
    slaves = len(scene.model.report()["slaves"]["id"])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    for case, value, unit in (
        ("load", loaded - start, "s"),
        ("build", built - loaded, "s"),
        ("fmpy-read", 1e6 * (read - built) / variables, "us per variable"),
        ("peak-memory", peak / 1e9, "GB, FMPy included"),
    ):
        print(f'{case},{slaves},1,{value:.4g},"{unit}",0,0')


if __name__ == "__main__":
    main()
