"""The solver's kernels on arrays: any number of slaves a segment, transposes, projections, limits (theory 2-7)."""

import numpy as np
import pytest
from independent_kernels import clamp, default_bias, default_map, lumped, optimized_bias, optimized_map, project, shape
from random_scenes import segment, slave_over
from tiefmu._core import kernels

SLAVES = [0, 1, 2, 3, 4, 5, 7, 8, 9, 16, 17]  # a segment: kernels may take several at once, and then the rest
couplings = pytest.mark.parametrize("coupling", ["translation", "rotation", "mean-motion"])
corners = pytest.mark.parametrize("n", [4, 3])


class Case:
    """Segments that share their first node, with random slaves, motion and loads."""

    def __init__(self, coupling, n, seed=0):
        rng = np.random.default_rng(seed)
        self.coupling, self.n = coupling, n
        self.nodes, self.position = np.zeros((len(SLAVES), n), np.int32), [np.zeros(3)]
        offset, weight = [], []
        for e, count in enumerate(SLAVES):
            shape_of = segment(rng, n, aspect=5)
            shape_of -= shape_of[0]
            self.nodes[e, 1:] = len(self.position) + np.arange(n - 1)
            self.position.extend(shape_of[1:])
            for _ in range(count):
                point = slave_over(rng, shape_of)
                phi = project(shape_of, point).phi
                weight.append(phi)
                offset.append(point - (shape_of.mean(axis=0) if coupling == "mean-motion" else phi @ shape_of))
        self.position, self.offset, self.weight = map(np.array, (self.position, offset, weight))
        begin = np.concatenate([[0], np.cumsum(SLAVES)]).astype(np.int32)
        self.owner = np.repeat(np.arange(len(SLAVES)), SLAVES)
        self.group = kernels.Group(coupling, self.nodes, begin, self.weight, len(self.position))
        self.group.set_geometry(self.position, self.offset)
        self.v, self.w = rng.normal(size=(2, *self.position.shape))
        self.force, self.moment = rng.normal(size=(2, *self.offset.shape))
        if coupling == "translation":
            self.moment[:] = 0

    def map(self, s):
        """T (6, 6 n) and the nodes of slave s."""
        nodes, d = self.nodes[self.owner[s]], self.offset[s]
        if self.coupling == "mean-motion":
            return optimized_map(self.position[nodes], d), nodes
        return default_map(self.weight[s], d, self.coupling == "rotation"), nodes


def close(value, expected, tolerance=1e-12):
    np.testing.assert_allclose(value, expected, rtol=0, atol=tolerance * np.abs(expected).max())


@couplings
@corners
def test_motion_mapping_and_load_distribution(coupling, n):
    case = Case(coupling, n)
    q, loads = np.hstack([case.v, case.w]), np.zeros((len(case.position), 6))
    twist = []
    for s in range(len(case.offset)):
        t, nodes = case.map(s)
        twist.append(t @ q[nodes].ravel())
        loads[nodes] += (t.T @ np.concatenate([case.force[s], case.moment[s]])).reshape(-1, 6)
    close(np.hstack(case.group.map_motion(case.v, case.w)), np.array(twist))
    close(np.hstack(case.group.distribute_loads(case.force, case.moment)), loads)


@couplings
@corners
@pytest.mark.parametrize("seed", range(10))
def test_one_is_the_transpose_of_the_other(coupling, n, seed):
    case = Case(coupling, n, seed)
    (vs, ws), (f, t) = case.group.map_motion(case.v, case.w), case.group.distribute_loads(case.force, case.moment)
    taken, given = case.force * vs + case.moment * ws, f * case.v + t * case.w
    assert abs(taken.sum() - given.sum()) < 1e-13 * np.abs(taken).sum()


@couplings
@corners
def test_bias(coupling, n):
    case = Case(coupling, n)
    expected = []
    for s, d in enumerate(case.offset):
        nodes = case.nodes[case.owner[s]]
        expected.append(
            np.zeros(6)
            if coupling == "translation"
            else optimized_bias(case.position[nodes], case.v[nodes], d)
            if coupling == "mean-motion"
            else default_bias(case.weight[s], case.w[nodes], d)
        )
    close(np.hstack(case.group.bias(case.v, case.w)), np.array(expected))


@pytest.mark.parametrize("coupling", ["rotation", "mean-motion"])
@corners
def test_bias_is_the_rate_of_the_map(coupling, n):
    """d/dt (T q') at q'' = 0 by central differences, the slave's offset turning with it."""
    case, h = Case(coupling, n), 1e-6
    ws = case.group.map_motion(case.v, case.w)[1]

    def twist(t):
        case.group.set_geometry(case.position + t * case.v, case.offset + t * np.cross(ws, case.offset))
        return np.hstack(case.group.map_motion(case.v, case.w))

    bias = np.hstack(case.group.bias(case.v, case.w))
    close(bias, (twist(h) - twist(-h)) / (2 * h), 1e-7)


@couplings
@corners
def test_lumped(coupling, n):
    case, rng = Case(coupling, n), np.random.default_rng(1)
    mass, inertia = rng.uniform(0.1, 2, (2, len(case.offset)))
    expected = np.zeros((len(case.position), 2))
    for s, d in enumerate(case.offset):
        nodes = case.nodes[case.owner[s]]
        shape_of = case.position[nodes]
        point = d + (shape_of.mean(axis=0) if coupling == "mean-motion" else case.weight[s] @ shape_of)
        added = lumped(
            shape_of, project(shape_of, point), np.linalg.norm(d), coupling == "mean-motion", mass[s], inertia[s]
        )
        if coupling == "translation":
            added[:, 1] = 0
        np.add.at(expected, nodes, added)
    close(np.column_stack(case.group.lumped(case.position, mass, inertia)), expected, 1e-11)


@corners
@pytest.mark.parametrize("seed", range(40))
def test_project(n, seed):
    rng = np.random.default_rng(seed)
    shape_of = segment(rng, n)
    points = np.array([slave_over(rng, shape_of) for _ in range(5)])
    ours = kernels.project(shape_of, points)
    assert ours["converged"].all()
    for k, point in enumerate(points):
        p = project(shape_of, point)
        close(ours["local"][k], [p.xi, p.eta])
        close(ours["phi"][k], p.phi)
        close(ours["clamped"][k], clamp(shape_of, p))
        assert abs(ours["distance"][k] - p.distance) < 1e-12 * (1 + p.distance)
        assert abs(ours["outside"][k] - p.outside) < 1e-11
        close(kernels.shape(n, p.xi, p.eta), shape(n, p.xi, p.eta))


def predicted_step(h, stiffness, damping, beta):
    """Central difference on x'' = -K x - C x' as a map of (x, h v_(n-1/2), h^2 a_(n-1)): dampers see
    v_(n-1/2) + beta h/2 a_(n-1)."""
    n = len(stiffness)
    one, none = np.eye(n), np.zeros((n, n))
    k, c = h * h * np.asarray(stiffness), h * np.asarray(damping)
    acceleration = np.hstack([-k, -c, -0.5 * beta * c])
    velocity = np.hstack([none, one, none]) + acceleration
    return np.vstack([np.hstack([one, none, none]) + velocity, velocity, acceleration])


def amplification(method, h, omega, c, beta=0.0):
    """Spectral radius of one step on x'' = -omega^2 x - c x'."""
    if method == "central-difference":  # symplectic Euler is the same map at beta = 0
        step = predicted_step(h, [[omega**2]], [[c]], beta)
    else:
        a = np.array([[0, 1], [-(omega**2), -c]]) * h
        step = np.eye(2) + a + a @ a / 2 + a @ a @ a / 6 + a @ a @ a @ a / 24
    return np.abs(np.linalg.eigvals(step)).max()


@pytest.mark.parametrize(
    "method, limit", [("central-difference", 2.0), ("symplectic-euler", 2.0), ("rk4", 2 * 2**0.5), ("noh-bathe", 3.74)]
)
def test_limits_without_damping(method, limit):
    assert kernels.stable_step(method, 5.0) == pytest.approx(limit / 5.0, rel=2e-3)


@pytest.mark.parametrize("method", ["central-difference", "rk4"])
@pytest.mark.parametrize("zeta", [0.01, 0.1, 0.5, 1.0, 3.0])
def test_limits_with_damping(method, zeta):
    omega, c = 5.0, 2 * zeta * 5.0
    h = kernels.stable_step(method, omega, c)
    assert amplification(method, 0.999 * h, omega, c) <= 1 + 1e-9
    assert amplification(method, 1.001 * h, omega, c) > 1
    if method == "central-difference":
        assert h == pytest.approx(2 / omega * (np.sqrt(1 + zeta**2) - zeta), rel=1e-9)


@pytest.mark.parametrize("zeta", [0.01, 0.05, 0.2, 0.5, 1.0, 3.0])
def test_damper_prediction_is_the_largest_stable(zeta):
    """Stable with its beta at every step up to the limit, which a predicted velocity does not lower; with a larger one
    not; 1 (second order) at small steps, 0 at the limit and beyond."""
    omega, c = 5.0, 2 * zeta * 5.0
    limit = kernels.stable_step("central-difference", omega, c)
    for part in (0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.999):
        beta = kernels.damper_prediction(part * limit, omega, c)
        assert amplification("central-difference", part * limit, omega, c, beta) <= 1 + 1e-9
        if beta < 1:
            assert amplification("central-difference", part * limit, omega, c, 1.02 * beta + 1e-3) > 1
    assert kernels.damper_prediction(0.01 * limit, omega, c) == 1.0
    assert kernels.damper_prediction(limit, omega, c) == pytest.approx(0.0, abs=1e-12)
    assert kernels.damper_prediction(1.1 * limit, omega, c) == 0.0
    assert kernels.damper_prediction(limit, omega, 0.0) == 1.0


@pytest.mark.parametrize("seed", range(20))
def test_damper_prediction_of_many_freedoms(seed):
    """Dampers that are not proportional: the largest omega and c bound every step."""
    rng = np.random.default_rng(seed)
    for _ in range(50):
        n = rng.integers(2, 7)
        a, b = rng.normal(size=(2, n, n)) * 10.0 ** rng.uniform(-1, 1, (2, 1, 1))
        stiffness = a @ a.T
        damping = b[:, : rng.integers(1, n + 1)]
        damping = damping @ damping.T
        omega, c = np.sqrt(np.linalg.eigvalsh(stiffness)[-1]), np.linalg.eigvalsh(damping)[-1]
        h = rng.uniform(0.1, 1.0) * kernels.stable_step("central-difference", omega, c)
        beta = kernels.damper_prediction(h, omega, c)
        assert np.abs(np.linalg.eigvals(predicted_step(h, stiffness, damping, beta))).max() <= 1 + 1e-7
