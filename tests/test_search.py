"""Which segment holds a slave (theory 7): inputs of the kinds that meshes bring, each with its right answer."""

import numpy as np
import pytest
import tiefmu
from hypothesis import given, settings
from hypothesis import strategies as some
from independent_kernels import default_search_distance, find, shape
from random_scenes import patch, rotation, rows
from scipy.optimize import minimize_scalar
from tiefmu._core import kernels


def scene(nodes, segments, slaves, unit="m", node=(), model=None, **tie):
    """nodes: rows of masters and slaves; slaves: ids."""
    return {
        "units": {"length": unit},
        "mesh": {"nodes": [list(row) for row in nodes], "segments": segments},
        "node": [{"nodes": "all", "motion": "driven", "rotations": True}, *node],
        "tie": [{"name": "tie", "segments": "all", "slaves": slaves, **tie}],
        "model": model or {},
    }


def report(*arguments, **keys):
    return tiefmu.report(tiefmu.load(scene(*arguments, **keys)))


def refusal(*arguments, **keys) -> str:
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(scene(*arguments, **keys))
    return str(error.value)


def grid(columns, rows_, dx=1.0, dy=1.0):
    """Positions (N, 3) in a plane, and quads by index (E, 4)."""
    y, x = np.meshgrid(dy * np.arange(rows_ + 1), dx * np.arange(columns + 1), indexing="ij")
    position = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    a = (np.arange(rows_)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    return position, np.column_stack([a, a + 1, a + columns + 2, a + columns + 1])


def search(position, quads, slaves, method="box", reach=0.0):
    return kernels.search(position, np.asarray(quads, np.int32), np.asarray(slaves, float), method, reach)


def turned(angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


# ------------------------------------------------------------------------------------------------------ the projection


def test_a_panel_element_at_car_coordinates():
    nodes = [
        (1, 3999.75, 799.8, 1199.91),
        (2, 4005.22, 799.97, 1199.93),
        (4, 3999.9, 804.61, 1199.98),
        (5, 4004.48, 805.01, 1200.0),
        (101, 4003.76, 803.18, 1199.97),
    ]
    (slave,) = report(nodes, [[1, 1, 2, 5, 4]], [101], unit="mm")["slaves"]
    assert slave["xi"] == pytest.approx(0.599617, abs=5e-7)
    assert slave["eta"] == pytest.approx(0.299175, abs=5e-7)
    assert slave["distance"] == pytest.approx(1.467e-6, abs=5e-10)
    weights = shape(4, slave["xi"], slave["eta"])
    assert weights == pytest.approx([0.07015, 0.28026, 0.51955, 0.13004], abs=5e-6)


@pytest.mark.parametrize("centre", [0.0, 3200.0, 40000.0])
def test_a_mesh_of_small_quads_far_away(centre):
    """20 x 20 quads of 1 mm with coordinates rounded to 2 decimals of mm, one slave over each, inside by a tenth."""
    rng = np.random.default_rng(3)
    position, quads = grid(20, 20)
    position[:, 2] = 0.1 * rng.uniform(-1, 1, len(position))
    position = np.round(position + centre, 2)
    local = rng.uniform(-0.8, 0.8, (len(quads), 2))
    slaves = np.array([shape(4, *at) @ position[quad] for at, quad in zip(local, quads)])
    slaves = np.round(slaves + np.array([0, 0, 0.2]), 2)
    found = search(position, quads, slaves)
    assert (found["segment"] == np.arange(len(quads))).all()
    assert np.abs(found["local"]).max() < 1


@pytest.mark.parametrize("height", [0.0, 0.25])
def test_a_slave_at_the_apex_of_a_quad_with_two_nodes_in_one_place(height):
    """3 and 4 share it, with different ids: they carry the slave together."""
    nodes = [(1, 0, 0, 0), (2, 1, 0, 0), (3, 0.4, 1, 0), (4, 0.4, 1, 0), (101, 0.4, 1, height)]
    (slave,) = report(nodes, [[1, 1, 2, 3, 4]], [101], search_distance=1.0)["slaves"]
    weights = shape(4, slave["xi"], slave["eta"])
    assert weights[2] + weights[3] == pytest.approx(1, abs=1e-14)
    assert slave["distance"] == height


@pytest.mark.parametrize("pair", range(4))
def test_a_quad_with_two_nodes_in_one_place_is_the_triangle(pair):
    rng = np.random.default_rng(pair)
    corners = np.insert(np.array([[0, 0, 0], [1, 0.1, 0], [0.3, 0.8, 0.2]]), 0, [0.0, 0, 0], axis=0)
    corners = np.roll(corners, pair, axis=0) @ rotation(rng).T + rng.normal(size=3)
    three = np.delete(corners, (pair + 1) % 4, axis=0)
    points = three.mean(axis=0) + rng.normal(size=(200, 3))
    quad, triangle = kernels.project(corners, points), kernels.project(three, points)
    assert quad["converged"].all()
    np.testing.assert_allclose(quad["phi"] @ corners, triangle["phi"] @ three, atol=1e-13)
    np.testing.assert_allclose(quad["nearest"], triangle["nearest"], atol=1e-13)
    inside = triangle["outside"] < 1
    assert (quad["outside"][inside] <= 1 + 1e-12).all() and (quad["phi"][inside] > -1e-12).all()
    assert (quad["outside"][~inside] >= 1 - 1e-12).all()


@pytest.mark.parametrize("top", [0.9, 0.5, 0.1, 0.01, 1e-4])
def test_a_trapezoid_does_not_warn(top):
    """The sides meet in one point, where the map folds; its centre is an ordinary place."""
    nodes = [(1, -1, 0, 0), (2, 1, 0, 0), (3, top, 1, 0), (4, -top, 1, 0), (101, 0, 0.5, 0.1)]
    found = report(nodes, [[1, 1, 2, 3, 4]], [101])
    assert found["warnings"] == []
    assert (found["slaves"][0]["xi"], found["slaves"][0]["eta"]) == pytest.approx((0, 0), abs=1e-14)


CROSSING = [(1, 0, 0, 0), (2, 1, 0, 0), (3, -0.3, 1, 0), (4, 1, 1, 0)]
BESIDE = [(11, 5, 0, 0), (12, 6, 0, 0), (13, 6, 1, 0), (14, 5, 1, 0)]


def test_a_quad_that_crosses_itself_is_an_error_where_a_slave_would_use_it():
    said = refusal([*CROSSING, (101, 0.5, 0.2, 0.1)], [[7, 1, 2, 3, 4]], [101])
    assert "slave 101: no segment found" in said
    assert said.endswith("; the nearest is segment 7, which crosses itself (its nodes are not in order round it)")


def test_a_quad_that_crosses_itself_is_a_note_where_no_slave_uses_it():
    segments = [[7, 1, 2, 3, 4], [8, 11, 12, 13, 14]]
    found = report([*CROSSING, *BESIDE, (101, 5.5, 0.5, 0.1)], segments, [101])
    assert found["warnings"] == []
    assert any("segment 7: crosses itself" in note for note in found["notes"])


@pytest.mark.parametrize("height", [0.0, 1e-3])
def test_swapped_nodes_cross(height):
    """A panel of ordinary warp whose third and fourth node are swapped; without area or not."""
    nodes = [(1, 0, 0, 0), (2, 1, 0, height), (3, 0, 1, height), (4, 1, 1, 0), (101, 0.5, 0.3, 0.1)]
    assert "crosses itself" in refusal(nodes, [[1, 1, 2, 3, 4]], [101])


CHEVRON = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.3, 0], [0, 1, 0]], float)


def test_a_chevron_holds_what_lies_in_it():
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 1, (4000, 2))
    x, y = points.T
    inside = (7 * y < 3 * (1 - x)) | (7 * x < 3 * (1 - y))  # below one of the lines from the tips to the inward corner
    points = np.column_stack([points, np.zeros(len(points))])[inside]
    found = kernels.project(CHEVRON, points)
    assert found["converged"].all() and not found["folded"].any()
    assert found["outside"].max() <= 1 + 1e-9
    np.testing.assert_allclose(found["phi"] @ CHEVRON, points, atol=1e-12)


def warped_chevron(warp):
    return CHEVRON + np.array([0, 0, 1])[None] * np.array([[0], [0], [warp], [0]])


@pytest.mark.parametrize("warp", [0, 1e-15, 1e-5, 0.01, 0.05])
def test_a_slave_where_a_chevron_folds_is_an_error(warp):
    """On the diagonal, x = y = (1.3 + 0.6 t - 0.7 t^2) / 4: up to 5/14 = 0.357, beyond the corner at 0.3."""
    nodes = [(k + 1, *x) for k, x in enumerate(warped_chevron(warp).tolist())]
    for x in ((0.31, 0.31, 0.0), (0.32, 0.32, 0.05), (0.32, 0.32, -0.05)):
        said = refusal([*nodes, (101, *x)], [[1, 1, 2, 3, 4]], [101])
        assert "which folds onto itself there (one of its corners points inward)" in said


@pytest.mark.parametrize("warp", [0, 1e-5, 0.01, 0.05])
def test_a_chevron_folds_outside_its_outline_alone(warp):
    """Seen along the mean normal; slaves on the surface itself, whose places are known."""
    rng = np.random.default_rng(4)
    corners = warped_chevron(warp)
    points = np.array([shape(4, *at) @ corners for at in rng.uniform(-1, 1, (4000, 2))])
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    plane = np.linalg.svd(normal[None])[2][1:]  # two directions across it
    (a, b, c, d), seen = corners @ plane.T, points @ plane.T

    def left(p, q):  # of the line from p to q, on the side of the first corner
        across = np.array([p[1] - q[1], q[0] - p[0]])
        return ((seen - p) @ across) * ((a - p) @ across) > 0

    inside = left(b, c) | left(c, d)
    found = kernels.project(corners, points)
    assert found["converged"].all() and found["outside"].max() <= 1 + 1e-9
    assert (~inside).sum() > 100 and (found["folded"] == ~inside).all()
    np.testing.assert_allclose((found["phi"] @ corners)[inside], points[inside], atol=1e-9)


def test_a_corner_inward_by_rounding_is_straight():
    """n4 near the middle of the edge from n3 to n1 of a triangle, inward by 1e-3: a slave at that node is found."""
    for inward in (0, 1e-3, -1e-3):
        middle = np.array([0.5, 0.5, 0]) - inward * np.array([1, 1, 0]) / np.sqrt(2)
        nodes = [(1, 0, 1, 0), (2, 0, 0, 0), (3, 1, 0, 0), (4, *middle), (101, *middle)]
        found = report(nodes, [[1, 1, 2, 3, 4]], [101])
        assert found["warnings"] == [] and found["slaves"][0]["distance"] < 1e-15


@pytest.mark.parametrize("height, segment", [(0.05, 2), (0.13, 2), (0.15, 2)])
def test_a_nearer_segment_that_folds_is_told(height, segment):
    """Under a plane square at z = 0.2; the chevron is nearer up to 0.1."""
    nodes = [(k + 1, *x) for k, x in enumerate(CHEVRON.tolist())]
    square = [(11, -1, -1, 0.2), (12, 2, -1, 0.2), (13, 2, 2, 0.2), (14, -1, 2, 0.2)]
    found = report([*nodes, *square, (101, 0.32, 0.32, height)], [[1, 1, 2, 3, 4], [2, 11, 12, 13, 14]], [101])
    assert found["slaves"][0]["segment"] == segment
    told = "tie 'tie': slave 101: segment 1 is nearer, but folds onto itself there (one of its corners points inward); "
    assert found["warnings"] == ([told + "passed over"] if height < 0.1 else [])


def test_a_chevron_leaves_slaves_beside_it_to_its_neighbour():
    nodes = [(k + 1, *x) for k, x in enumerate(CHEVRON.tolist())]
    found = report([*nodes, (5, 1, 1, 0), (101, 0.32, 0.32, 0.05)], [[1, 1, 2, 3, 4], [2, 2, 5, 4, 3]], [101])
    assert found["slaves"][0]["segment"] == 2 and found["warnings"] == []


def distance_to_patch(corners):
    """Of the origin: over the lines of fixed eta, each of which has its closest point."""

    def to_line(eta):
        eta = np.asarray(eta)[..., None]
        a, b = (
            (1 - eta) / 2 * corners[0] + (1 + eta) / 2 * corners[3],
            (1 - eta) / 2 * corners[1] + (1 + eta) / 2 * corners[2],
        )
        t = np.clip(-np.sum(a * (b - a), axis=-1) / np.maximum(np.sum((b - a) ** 2, axis=-1), 1e-300), 0, 1)
        return np.linalg.norm(a + t[..., None] * (b - a), axis=-1)

    sample = np.linspace(-1, 1, 1001)
    value = to_line(sample)
    best = value.min()
    for k in np.argsort(value)[:5]:
        around = sample[max(k - 1, 0)], sample[min(k + 1, 1000)]
        best = min(best, minimize_scalar(to_line, bounds=around, method="bounded", options={"xatol": 1e-12}).fun)
    return best


@settings(max_examples=200, deadline=None)
@given(
    seed=some.integers(0, 2**32 - 1),
    decimals=some.integers(3, 16),
    away=some.floats(0, 1e5),
    gap=some.sampled_from([0.0, 1e-9, 1e-3, 0.3, 1.0]),
)
def test_a_projection_is_the_closest_point(seed, decimals, away, gap):
    """Of the segment against a fine sample of it; of the surface by (7.1). Far from the origin, too."""
    rng = np.random.default_rng(seed)
    plane = np.array([[0, 0], [1, 0], [1, 1 / rng.uniform(1, 20)], [0, 0]])
    plane[3, 1] = plane[2, 1]
    short = plane[2, 1]
    corners = np.column_stack([plane, np.zeros(4)]) + short * rng.uniform(-0.2, 0.2, (4, 3))
    turn, shift = rotation(rng), away * rng.uniform(-1, 1, 3)
    xi, eta = rng.uniform(-1.4, 1.4, 2)
    a, b = corners[1] - corners[0], corners[3] - corners[0]
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    slave = np.round(turn @ (shape(4, xi, eta) @ corners + gap * normal) + shift, decimals)
    corners = np.round(corners @ turn.T + shift, decimals)
    found = kernels.project(corners, slave[None])
    local = corners - slave  # exact enough: of one size
    nearest = distance_to_patch(local)
    assert found["nearest"][0] == pytest.approx(nearest, abs=1e-8 + 4e-16 * away)
    if found["converged"][0]:  # then it is stationary, and no farther
        xi, eta = found["local"][0]
        offset = -shape(4, xi, eta) @ local
        assert np.linalg.norm(offset) == pytest.approx(found["distance"][0], abs=1e-13 + 4e-16 * away)
        along = [(local[1] - local[0]) * (1 - eta) + (local[2] - local[3]) * (1 + eta)]
        along.append((local[3] - local[0]) * (1 - xi) + (local[2] - local[1]) * (1 + xi))
        for tangent in along:
            assert abs(offset @ tangent) < 1e-13 * (1 + gap) * np.linalg.norm(tangent)


# ------------------------------------------------------------------------------------------------------- which segment


@pytest.mark.parametrize("method", ["box", "nearest-node"])
@pytest.mark.parametrize("slope", [1.0, 0.01])
def test_a_slave_above_a_ridge_is_not_tied_to_the_wall_below(method, slope):
    """mm: a roof of 20 mm quads, its ridge along y, and a wall 8 mm below; a slave 1 mm above the ridge."""
    fall = 20 * np.tan(np.radians(slope))
    top = [[x, y, -fall * abs(x) / 20] for y in (0, 20) for x in (-20, 0, 20)]
    wall = [[x, y, -8] for y in (0, 20) for x in (-20, 0, 20)]
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [6, 7, 10, 9], [7, 8, 11, 10]]
    found = search(np.array(top + wall, float), quads, [[0, 10, 1.0]], method)
    assert found["segment"][0] == 0  # the tie between both slopes goes to the lower id
    assert found["distance"][0] == pytest.approx(1.0)
    assert found["rival"][0] == -1


def test_slaves_on_a_double_panel_go_to_the_outer_one():
    """mm: cylinders of R = 500 and 492, 20 mm quads, slaves 1.1 mm outside the outer one at half its spacing."""
    radius, gap, size, columns, rows_ = 500.0, 8.0, 20.0, 6, 4
    angle = 2 * np.arcsin(size / 2 / radius)

    def cylinder(r, j, i):
        return [r * np.sin(i * angle), size * j, r * np.cos(i * angle)]

    position = [cylinder(r, j, i) for r in (radius, radius - gap) for j in range(rows_ + 1) for i in range(columns + 1)]
    _, quads = grid(columns, rows_)
    count = (columns + 1) * (rows_ + 1)
    slaves = [cylinder(radius + 1.1, j / 2, i / 2) for j in range(2 * rows_ + 1) for i in range(2 * columns + 1)]
    assert len(slaves) == 117
    found = search(np.array(position), np.vstack([quads, quads + count]), slaves)
    assert (found["segment"] < len(quads)).all() and (found["segment"] >= 0).all()
    assert (found["distance"] < 1.3).all() and (found["rival"] == -1).all()


@pytest.mark.parametrize("beside", [0.0, 1e-8, 0.09])
def test_a_slave_beside_an_edge_is_as_far_as_the_edge(beside):
    nodes = [(1, 0, 0, 0), (2, 1, 0, 0), (3, 1, 1, 0), (4, 0, 1, 0), (101, 1 + beside, 0.5, 0)]
    (slave,) = report(nodes, [[1, 1, 2, 3, 4]], [101], search_distance=0.1)["slaves"]
    assert slave["xi"] == pytest.approx(1 + 2 * beside, abs=1e-15)


def test_the_distance_of_a_refusal_is_that_to_the_segment():
    nodes = [(1, 0, 0, 0), (2, 1, 0, 0), (3, 1, 1, 0), (4, 0, 1, 0), (101, 1.2, 0.5, 0.05)]
    said = refusal(nodes, [[1, 1, 2, 3, 4]], [101], unit="mm", search_distance=0.1)
    distance = f"{np.hypot(0.2, 0.05):.6g}"
    assert said.endswith(f"within search_distance 0.1 mm; the nearest is segment 1 at {distance} mm")


def test_single_precision_coordinates_lose_no_slave():
    """11 x 11 slaves on and in a square that was written in single precision, some a rounding outside."""
    position, quads = grid(5, 5, 0.02, 0.02)
    turn = rotation(np.random.default_rng(4))
    slaves = np.array([[x, y, 0] for y in 0.01 * np.arange(11) for x in 0.01 * np.arange(11)])

    def single(x):
        return (x @ turn.T + np.array([1.7, -0.3, 2.2])).astype(np.float32).astype(float)

    found = search(single(position), quads, single(slaves), "box", 1e-5)
    assert (found["segment"] >= 0).all()
    assert np.abs(found["local"]).max() < 1.001


@pytest.mark.parametrize("angle", [0.0, 1.0, 30.0, 45.0])
def test_nearest_node_of_a_turned_square(angle):
    position, quads = grid(1, 1)
    found = search(position @ turned(angle).T, quads, np.array([[0.5, 0.5, 0]]) @ turned(angle).T, "nearest-node")
    assert found["segment"][0] == 0
    assert found["search_distance"] == pytest.approx(np.sqrt(2))


def test_nearest_node_of_a_turned_mesh_of_two_to_one_quads():
    position, quads = grid(10, 10, 2.0, 1.0)
    slaves = np.array([[x, y, 0] for y in np.linspace(0, 10, 11) for x in np.linspace(0, 20, 11)])
    straight = search(position, quads, slaves, "nearest-node")
    found = search(position @ turned(30).T, quads, slaves @ turned(30).T, "nearest-node")
    assert (found["segment"] >= 0).all() and (found["segment"] == straight["segment"]).all()
    np.testing.assert_allclose(found["local"], straight["local"], atol=1e-12)


@pytest.mark.parametrize("method", ["box", "nearest-node"])
def test_a_slave_in_a_coarse_quad_is_not_tied_to_a_fine_one(method):
    """A quad of 1 x 1 beside 4 x 4 quads of 0.25, whose nodes hang on its edge."""
    fine, quads = grid(4, 4, 0.25, 0.25)
    position = np.vstack([[[-1, 0, 0], [0, 0, 0], [0, 1, 0], [-1, 1, 0]], fine])
    rng = np.random.default_rng(2)
    slaves = np.column_stack([rng.uniform(-1, 0, 200), rng.uniform(0, 1, 200), np.zeros(200)])
    found = search(position, np.vstack([[[0, 1, 2, 3]], quads + 4]), slaves, method)
    assert (found["segment"] == 0).all()
    assert np.abs(found["local"]).max() <= 1 + 1e-12


def test_a_slave_midway_between_two_sheets_is_told():
    position, quads = grid(1, 1)
    both = np.vstack([position, position + np.array([0, 0, 0.008])])
    nodes = [*rows(1, both), (101, 0.4, 0.3, 0.004)]
    segments = [[3, *(quads[0] + 1).tolist()], [9, *(quads[0] + 5).tolist()]]
    assert report(nodes, segments, [101], unit="m")["warnings"] == [
        "tie 'tie': slave 101: is as near to segment 9 as to segment 3, which it is tied to (0.004 m)"
    ]
    nodes[-1] = (101, 0.4, 0.3, 0.0041)
    assert report(nodes, segments, [101])["warnings"] == []


@pytest.mark.parametrize("xi, said", [(1.01, None), (1.03, "lies outside"), (1.49, "lies outside")])
@pytest.mark.parametrize("formulation", ["default", "optimized"])
def test_outside_is_told(xi, said, formulation):
    nodes = [(1, -1, -1, 0), (2, 1, -1, 0), (3, 1, 1, 0), (4, -1, 1, 0), (101, xi, 0, 0)]
    warnings = report(nodes, [[1, 1, 2, 3, 4]], [101], formulation=formulation)["warnings"]
    assert len(warnings) == (said is not None)
    for line in warnings:
        assert said in line and ("clamped" in line) == (formulation == "default")


def test_far_outside_is_refused_in_true_words():
    nodes = [(1, -1, -1, 0), (2, 1, -1, 0), (3, 1, 1, 0), (4, -1, 1, 0), (101, 1.51, 0, 0)]
    assert refusal(nodes, [[1, 1, 2, 3, 4]], [101], search_distance=1.0).endswith(
        "no segment found within search_distance 1 m; the nearest is segment 1 at 0.51 m, but the slave lies beyond "
        "its edge by more than a quarter of its size (|xi| or |eta| above 1.5)"
    )


@settings(max_examples=40, deadline=None)
@given(
    seed=some.integers(0, 2**32 - 1),
    method=some.sampled_from(["box", "nearest-node"]),
    reach=some.sampled_from([0.0, 0.3, 2.0]),
    away=some.sampled_from([0.0, 1.0, 1e3, 1e5]),
)
def test_every_search_is_that_of_trying_all_segments(seed, method, reach, away):
    """Random patches, turned and moved: the answers of the patch where it stood."""
    rng = np.random.default_rng(seed)
    position, listed = patch(rng, 4, 3, warp=rng.uniform(0, 0.2))
    segments = [tuple(i - 1 for i in s[1:]) for s in listed]
    points = rng.uniform([-0.5, -0.5, -0.7], [4.5, 3.5, 0.7], (40, 3))
    turn, shift = rotation(rng), away * rng.uniform(-1, 1, 3)
    ids = range(len(segments))
    within = reach or default_search_distance(position, segments, method)
    expected = find(position, segments, ids, points, method, within)
    quads = [(*s, -1) if len(s) == 3 else s for s in segments]
    found = search(position @ turn.T + shift, quads, points @ turn.T + shift, method, reach)
    assert found["segment"].tolist() == [-1 if e is None else e for e, _ in expected]
    for local, (e, projection) in zip(found["local"], expected):
        if e is not None:
            np.testing.assert_allclose(local, [projection.xi, projection.eta], atol=1e-11 + 1e-14 * away)


@pytest.mark.parametrize("count", [1, 4, 5, 16, 17, 64, 65, 300])
@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_the_tree_leaves_out_no_segment(count, spread):
    """Rectangles of sizes 0.01 to 1 in every direction, also all round one place; against each by itself."""
    rng = np.random.default_rng(count)
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    place, size = spread * rng.uniform(-2, 2, (count, 1, 3)), 10 ** rng.uniform(-2, 0, (count, 1, 1))
    corners = np.array([square @ rotation(rng).T for _ in range(count)]) * size + place
    slaves = rng.uniform(-2.5, 2.5, (300, 3))
    each = [kernels.project(x, slaves) for x in corners]
    distance = np.array([np.where(p["converged"] & (p["outside"] <= 1.5), p["nearest"], np.inf) for p in each])
    found = search(corners.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4), slaves, reach=100.0)
    none = np.isinf(distance.min(axis=0))
    assert (found["segment"] == np.where(none, -1, distance.argmin(axis=0))).all()
    np.testing.assert_allclose(found["distance"][~none], distance.min(axis=0)[~none], rtol=1e-14)


# ------------------------------------------------------------------------------------------------------ what is told


SQUARE = [(1, 0, 0, 0), (2, 0.01, 0, 0), (3, 0.01, 0.01, 0), (4, 0, 0.01, 0)]


def test_a_tie_all_of_whose_slaves_are_dropped_is_an_error():
    said = refusal([*SQUARE, (101, 5, 5, 5)], [[1, 1, 2, 3, 4]], [101], unresolved="drop")
    assert "tie 'tie': all its slaves are dropped (slave 101: no segment found" in said
    assert said.endswith("which leaves nothing to model: an FMU without variables is of no use")


def test_an_offset_of_rounding_is_none():
    """A slave in the plane of a quad that lies askew: no inertia comes from it, which is said."""
    turn = rotation(np.random.default_rng(11))
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.3, 0.6, 0]]) @ turn.T + [3.1, 2.7, 1.3]
    nodes = [*rows(1, corners[:4]), (101, *corners[4])]
    free = [{"nodes": "all", "motion": "free", "mass": 1.0}, {"nodes": [101], "mass": 1.0}]
    spring = [{"nodes": [101, 102], "kind": "bushing", "stiffness": 1.0, "rotational_stiffness": 1.0}]
    tied = scene([*nodes, (102, *corners[4])], [[1, 1, 2, 3, 4]], [101], node=free)
    tied["spring"] = spring
    tied["node"].append({"nodes": [102], "motion": "fixed"})
    with pytest.raises(tiefmu.SceneError, match="no inertia"):
        tiefmu.load(tied)


def test_added_mass_is_told():
    """m = 1 g at d = 0.5 m of a square of a = 10 mm: 4 m d^2 / a^2 = 10 kg (theory 4), on masters of 1 g each."""
    masses = [{"nodes": [1, 2, 3, 4], "motion": "free", "mass": 0.001}, {"nodes": [101], "mass": 0.001}]
    nodes = [*SQUARE, (101, 0.005, 0.005, 0.5)]
    heavy = {"node": masses, "search_distance": 1.0, "formulation": "optimized"}
    (line,) = report(nodes, [[1, 1, 2, 3, 4]], [101], **heavy)["warnings"]
    assert line.startswith(
        "tie 'tie': adds 10 kg to free masters of 0.004 kg, most of it from slave 101 of 0.001 kg at an "
    )
    assert "0.5 m" in line and 'inertia = "consistent"' in line
    assert report(nodes, [[1, 1, 2, 3, 4]], [101], **heavy, model={"inertia": "consistent"})["warnings"] == []
    masses[0]["mass"] = 26.0  # 10 kg on 104 kg
    assert report(nodes, [[1, 1, 2, 3, 4]], [101], **heavy)["warnings"] == []


def test_a_segment_that_repeats_a_node_is_an_error_only_where_a_tie_uses_it():
    nodes = [*SQUARE, (101, 0.003, 0.004, 0)]
    segments = [[1, 1, 2, 3, 4], [2, 1, 2, 1, 4]]
    said = refusal(nodes, segments, [101])
    assert said.endswith(
        "tie 'tie': segment 2: repeats node 1; only the third and fourth node of a triangle may be the same"
    )
    one = scene(nodes, segments, [101])
    one["tie"][0]["segments"] = [1]
    assert tiefmu.report(tiefmu.load(one))["slaves"][0]["segment"] == 1
