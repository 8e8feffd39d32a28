"""Slave motion, reactions and projection of random segments against theory 2 to 4 and 7 computed by independent.py."""

import numpy as np
import pytest
import tiefmu
from in_process import Run
from independent import Problem
from independent_kernels import clamp, mean_inertia, smallest_lambda
from random_scenes import one_segment

CASES = [
    (n, formulation, rotations)
    for n in (4, 3)
    for formulation in ("default", "optimized")
    for rotations in (True, False)
]
case = pytest.mark.parametrize("n, formulation, rotations", CASES)
SEEDS = range(25)


class Driven:
    """A driven segment with random motion and loads, in both programs."""

    def __init__(self, seed, n, formulation, rotations, **model):
        rng = np.random.default_rng(seed)
        scene = one_segment(rng, n, formulation, rotations)
        scene["model"] = model
        self.problem, self.run = Problem(scene), Run(scene)
        self.inputs, self.slaves = {}, [s.id for s in self.problem.slaves]
        accelerated = model.get("reaction", "loads") != "loads"
        for i in self.problem.ids:
            for kind in ["v"] + ["w"] * rotations + ["a"] * accelerated + ["z"] * (accelerated and rotations):
                self.give(i, kind, rng.normal(size=3))
        for s in self.problem.slaves:
            for kind in ["f"] + ["t"] * s.turns:
                self.give(s.id, kind, rng.normal(size=3))
        self.expected = self.problem.evaluate(0.0, self.problem.start(), self.inputs)

    def give(self, node, kind, value):
        self.inputs[kind, node] = lambda t: value
        self.run.set_of(node, kind, value)

    def input(self, kind, ids):
        return np.array([self.inputs[kind, i](0) if (kind, i) in self.inputs else np.zeros(3) for i in ids])

    def output(self, kind, ids):
        return np.array([self.run.of(i, kind) for i in ids])


def close(value, expected, scale, tolerance=1e-12):
    np.testing.assert_array_less(np.abs(value - expected), tolerance * scale + 1e-300)


@case
@pytest.mark.parametrize("seed", SEEDS)
def test_slave_motion_is_t_times_master_motion(seed, n, formulation, rotations):
    case = Driven(seed, n, formulation, rotations)
    q = np.hstack([case.input("v", case.problem.ids), case.input("w", case.problem.ids)]).ravel()
    scale = (np.abs(case.expected["T"]) @ np.abs(q)).reshape(-1, 6)
    close(case.output("v", case.slaves), case.expected["slave_v"], scale[:, :3].max())
    close(case.output("w", case.slaves), case.expected["slave_w"], scale[:, 3:].max())


@case
@pytest.mark.parametrize(
    "inertia, reaction",
    [("lumped", "loads"), ("consistent", "loads"), ("lumped", "full"), ("consistent", "full"), ("consistent", "split")],
)
@pytest.mark.parametrize("seed", range(8))
def test_reactions(seed, inertia, reaction, n, formulation, rotations):
    case = Driven(seed, n, formulation, rotations, inertia=inertia, reaction=reaction)
    now = case.expected
    expected = now["reaction"][reaction]
    twist = np.abs(now["T"]) @ np.abs(now["a"]).ravel() + np.abs(now["b"])
    loads = np.hstack([case.input("f", case.slaves), case.input("t", case.slaves)]).ravel()
    scale = np.abs(now["T"]).T @ (np.abs(loads) + case.problem.slave_masses() * twist)
    scale += case.problem.added_masses() * np.abs(now["a"]).ravel()
    scale = scale.reshape(-1, 6).max(axis=0)
    close(case.output("f", case.problem.ids), expected[:, :3], scale[:3].max())
    close(case.output("t", case.problem.ids), expected[:, 3:], scale[3:].max())


@case
@pytest.mark.parametrize("seed", SEEDS)
def test_virtual_power_and_totals(seed, n, formulation, rotations):
    """sum f.v + t.w = F.v_s + M.w_s for every motion; total force and, where it can be kept, total moment."""
    case = Driven(seed, n, formulation, rotations)
    f, t = (case.output(kind, case.problem.ids) for kind in "ft")
    v, w = (case.input(kind, case.problem.ids) for kind in "vw")
    force, moment = (case.input(kind, case.slaves) for kind in "ft")
    vs, ws = (case.output(kind, case.slaves) for kind in "vw")
    given = np.concatenate([(f * v).ravel(), (t * w).ravel()])
    taken = np.concatenate([(force * vs).ravel(), (moment * ws).ravel()])
    assert abs(given.sum() - taken.sum()) < 1e-13 * max(np.abs(given).sum(), np.abs(taken).sum())
    assert abs(case.run["power_residual"]) < 1e-13 * max(np.abs(given).sum(), np.abs(taken).sum())
    close(f.sum(axis=0), force.sum(axis=0), np.abs(f).sum() + np.abs(force).sum(), 1e-13)
    if formulation == "optimized" or rotations:
        place = np.array([case.run.of(i, "r") for i in case.slaves])
        master = case.problem.x0
        about_origin = np.cross(master, f).sum(axis=0) + t.sum(axis=0)
        wanted = np.cross(place, force).sum(axis=0) + moment.sum(axis=0)
        scale = np.abs(f).sum() * np.abs(master).max() + np.abs(force).sum() * np.abs(place).max() + np.abs(t).sum()
        close(about_origin, wanted, scale, 1e-13)


@case
@pytest.mark.parametrize("seed", SEEDS)
def test_projection_and_report(seed, n, formulation, rotations):
    scene = one_segment(np.random.default_rng(seed), n, formulation, rotations)
    problem, report = Problem(scene), tiefmu.report(tiefmu.load(scene))
    corners = problem.x0
    size = np.linalg.norm(corners - corners[0], axis=1).max()
    assert [s["id"] for s in report["slaves"]] == [s.id for s in problem.slaves]
    ibar = mean_inertia(corners)[2]
    added = 0
    for row, s in zip(report["slaves"], problem.slaves):
        p = s.projection
        assert row["segment"] == 1 and row["nodes"] == list(range(1, n + 1))
        expected_weights = np.full(n, 1 / n) if s.optimized else p.phi
        close(np.array(row["weights"]), expected_weights, 1.0)
        close(np.array([row["xi"], row["eta"]]), np.array([p.xi, p.eta]), 1.0)
        far = size + np.linalg.norm(s.d0)
        close(row["distance"], p.distance, far)
        close(np.array(row["offset"]), s.d0, far)
        close(row["d"], np.linalg.norm(s.d0), far)
        if s.optimized:
            close(row["lambda"], smallest_lambda(corners), smallest_lambda(corners) * np.linalg.cond(ibar))
            close(row["cond"], np.linalg.cond(ibar), np.linalg.cond(ibar) ** 2)
        if not s.optimized and np.abs(p.outside - 1) > 1e-9:
            assert row["clamped"] == (p.outside > 1)
            assert np.all(clamp(corners, p) >= 0)
        added = added + s.added
    for row, (mass, inertia) in zip(report["masters"], added):
        close(row["added_mass"], mass, mass, 1e-11)
        close(row["added_inertia"], inertia if rotations else 0, inertia, 1e-11)


@pytest.mark.parametrize("seed", SEEDS)
def test_projection_is_exact_on_warped_quads(seed):
    """P = sum Phi x, and S - P normal to the true bilinear surface, to 1e-12 of the segment's size."""
    scene = one_segment(np.random.default_rng(1000 + seed), warp=0.6, slaves=6)
    report = tiefmu.report(tiefmu.load(scene))
    place = {row[0]: np.array(row[1:]) for row in scene["mesh"]["nodes"]}
    corners = np.array([place[i] for i in (1, 2, 3, 4)])
    size = np.linalg.norm(corners - corners[0], axis=1).max()
    for row in report["slaves"]:
        gap = place[row["id"]] - np.array(row["weights"]) @ corners
        close(np.array(row["offset"]), gap, size, 1e-12)
        xi, eta = row["xi"], row["eta"]
        along_xi = 0.25 * np.array([eta - 1, 1 - eta, 1 + eta, -1 - eta]) @ corners
        along_eta = 0.25 * np.array([xi - 1, -1 - xi, 1 + xi, 1 - xi]) @ corners
        for tangent in (along_xi, along_eta):
            close(gap @ tangent / np.linalg.norm(tangent), 0.0, size + np.linalg.norm(gap), 1e-12)


@pytest.mark.parametrize("formulation, expected", [("default", 1.0), ("optimized", 0.0)])
def test_hourglass_work_on_a_flat_quad(formulation, expected):
    """Theory 8: on the unit square sum h_i f_i = xi eta F by the default, nothing by the optimized formulation."""
    s, t, force = 0.4, -0.7, np.array([1.0, -2.0, 3.0])
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, (1 + s) / 2, (1 + t) / 2, 0]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "formulation": formulation}],
    }
    run = Run(scene, inputs={"slave[1].f": force})
    work = sum(h * run[f"master[{i}].f"] for i, h in zip((1, 2, 3, 4), (1, -1, 1, -1)))
    close(work, expected * s * t * force, 10.0, 1e-14)
