"""Both searches against trying every segment, on random and on contrived slaves (theory 7)."""

import numpy as np
import pytest
import tiefmu
from independent_kernels import default_search_distance, find
from random_scenes import patch, rows


def search_scene(position, segments, points, method, reach):
    return {
        "mesh": {"nodes": rows(1, position) + rows(10001, points), "segments": segments},
        "node": [{"nodes": "all", "rotations": True}],
        "tie": [
            {
                "name": "tie",
                "segments": "all",
                "slaves": list(range(10001, 10001 + len(points))),
                "search": method,
                "search_distance": reach,
                "unresolved": "drop",
            }
        ],
    }


def found_by_program(scene):
    """Slave id -> segment id or None."""
    report = tiefmu.report(tiefmu.load(scene))
    found = {row["id"]: row["segment"] for row in report["slaves"]}
    return found | {row["id"]: None for row in report["dropped"]}


def found_by_brute_force(position, segments, points, method, reach):
    ids = [s[0] for s in segments]
    nodes = [tuple(i - 1 for i in s[1:]) for s in segments]
    reach = reach or default_search_distance(position, nodes, method)
    winners = find(position, nodes, ids, points, method, reach)
    return {10001 + k: None if e is None else ids[e] for k, (e, _) in enumerate(winners)}


@pytest.mark.parametrize(
    "method, reach, seed", [("box", 0.0, 1), ("box", 0.6, 2), ("nearest-node", 0.0, 3), ("nearest-node", 0.9, 4)]
)
def test_random_slaves(method, reach, seed):
    """4 x 2500 slaves above, below and beside a warped patch of quads and triangles."""
    rng = np.random.default_rng(seed)
    position, segments = patch(rng, 5, 4, warp=0.25)
    points = rng.uniform([-0.5, -0.5, -0.7], [5.5, 4.5, 0.7], (2500, 3))
    expected = found_by_brute_force(position, segments, points, method, reach)
    found = found_by_program(search_scene(position, segments, points, method, reach))
    assert sum(s is not None for s in expected.values()) > 800 and None in expected.values()
    assert {k: (found[k], expected[k]) for k in expected if found[k] != expected[k]} == {}


@pytest.mark.parametrize("method, reach", [("box", 0.0), ("nearest-node", 4.0)])
def test_ties_are_resolved_the_same_after_shuffling(method, reach):
    """Slaves over nodes, edges and centres of a regular patch: many segments at the same distance."""
    rng = np.random.default_rng(7)
    position, segments = patch(rng, 4, 4, warp=0.0, triangles=0.3)
    grid = np.arange(0, 4.01, 0.5)
    points = np.array([[x, y, z] for x in grid for y in grid for z in (0.0, 0.25)])
    expected = found_by_brute_force(position, segments, points, method, reach)
    scene = search_scene(position, segments, points, method, reach)
    assert found_by_program(scene) == expected
    for _ in range(5):
        mesh = {
            "nodes": [scene["mesh"]["nodes"][k] for k in rng.permutation(len(scene["mesh"]["nodes"]))],
            "segments": [segments[k] for k in rng.permutation(len(segments))],
        }
        tie = scene["tie"][0]
        tie = tie | {
            "slaves": [tie["slaves"][k] for k in rng.permutation(len(tie["slaves"]))],
            "segments": [int(k) + 1 for k in rng.permutation(len(segments))],
        }
        assert found_by_program(scene | {"mesh": mesh, "tie": [tie]}) == expected


def test_default_distance_is_the_root_mean_square_edge():
    """Two quads of edges 3 and 4: a slave reaches as far as the root mean square of the edges, and no farther."""
    position = np.array([[0, 0, 0], [4, 0, 0], [8, 0, 0], [0, 3, 0], [4, 3, 0], [8, 3, 0]], float)
    segments = [[1, 1, 2, 5, 4], [2, 2, 3, 6, 5]]
    report = tiefmu.report(tiefmu.load(search_scene(position, segments, np.array([[1.0, 1, 0]]), "box", 0.0)))
    reach = report["ties"][0]["search_distance"]
    assert reach in (pytest.approx(np.sqrt((4 * 16 + 4 * 9) / 8)), pytest.approx(np.sqrt((4 * 16 + 3 * 9) / 7)))
    points = np.array([[1, 1, 0.999 * reach], [1, 1, 1.001 * reach]])
    found = found_by_program(search_scene(position, segments, points, "box", 0.0))
    assert found == {10001: 1, 10002: None}


@pytest.mark.parametrize("xi, found", [(1.01, True), (1.49, True), (1.51, False)])
def test_far_outside_is_not_found(xi, found):
    position = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    scene = search_scene(position, [[1, 1, 2, 3, 4]], np.array([[xi, 0.9, 0.0], [0, 0, 0]]), "box", 2.0)
    assert (found_by_program(scene)[10001] == 1) == found


def test_zero_area_segment_never_wins():
    position = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [3, 0, 0]], float)
    segments = [[1, 2, 5, 6], [2, 1, 2, 3, 4]]  # 1: three nodes on a line, through the slave
    found = found_by_program(search_scene(position, segments, np.array([[1.0, 0, 0]]), "box", 2.0))
    assert found == {10001: 2}
