"""Another code's results: golden/README.md says where they come from and where that code differs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from in_process import Run
from independent import Problem
from independent_kernels import Spring, exponential, quaternion_product

GOLDEN = Path(__file__).resolve().parent / "golden"
KERNELS = ["a_spot0_translation", "b_spot0_rotation", "c_spot1", "d_triangles"]


# ---- whole runs


def run_scene(formulation, z, rotations):
    corners = [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0]]
    return {
        "mesh": {"nodes": [*corners, [5, 0.7, 0.4, z]], "segments": [[1, 1, 2, 3, 4]]},
        "node": [{"nodes": "all", "motion": "free", "rotations": rotations}],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "formulation": formulation}],
        "spring": [],
        "integrator": {"method": "central-difference", "time_step": 0.001},
    }


def truss_scene(formulation, z):
    """D1 and D2: each master on three axial springs of rest length 10 m."""
    scene = run_scene(formulation, z, False)
    scene["node"] += [{"nodes": [1, 2, 3, 4], "mass": 1 + 1.5e-9}, {"nodes": [5], "mass": 1.0}]
    anchors = []
    for i, *x in list(scene["mesh"]["nodes"][:4]):
        for k in range(3):
            anchor = 10 * i + 1 + k
            anchors.append(anchor)
            scene["mesh"]["nodes"].append([anchor, *(np.array(x, float) - 10 * np.eye(3)[k]).tolist()])
            scene["spring"].append({"nodes": [i, anchor], "kind": "axial", "stiffness": 1000.0})
    scene["node"].append({"nodes": anchors, "motion": "fixed"})
    return scene


def bushing_scene():
    """D3M0: masters on ground bushings, node 6 at the slave's place joined to it by a bushing."""
    scene = run_scene("default", 0.5, True)
    scene["mesh"]["nodes"].append([6, 0.7, 0.4, 0.5])
    scene["node"] += [
        {"nodes": [1, 2, 3, 4], "mass": 2.0, "inertia": 0.4},
        {"nodes": [5, 6], "mass": 2.0, "inertia": 0.2},
    ]
    scene["spring"] = [
        {"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 1000.0, "rotational_stiffness": 500.0},
        {"nodes": [5, 6], "kind": "bushing", "stiffness": 4000.0, "rotational_stiffness": 300.0},
    ]
    return scene


# Scene, loads, tolerances relative to the largest displacement: of the masters, of all. D2: that code integrates the
# slave's position from its velocity, so that its offset grows a little. D3M0: its bushings add up rotation increments;
# the tests below show that nothing else is behind the difference.
RUNS = {
    "D1": (truss_scene("default", 0.0), {"slave[1].f": [0, 0, 10]}, 1e-9, 1e-9),
    "D2": (truss_scene("optimized", 0.5), {"slave[1].f": [3, -2, 10]}, 1e-8, 1e-5),
    "D3M0": (bushing_scene(), {"point[1].f_ext": [3, -2, 10], "point[1].t_ext": [0.5, 1.0, -0.7]}, 1e-3, 1e-3),
}


def displacements(name):
    """Times (n,) and displacements (n, nodes, 3) of the golden run."""
    with open(GOLDEN / f"{name}.csv") as file:
        table = list(csv.DictReader(file))
    nodes = len(table[0]) // 3
    u = [[[float(row[f"u[{i}].{k}"]) for k in "xyz"] for i in range(1, nodes + 1)] for row in table]
    return np.array([float(row["time"]) for row in table]), np.array(u)


def our_displacements(name):
    scene, loads, *_ = RUNS[name]
    times, given = displacements(name)
    run = Run(scene, inputs=loads)
    nodes = range(1, given.shape[1] + 1)
    start = {row[0]: np.array(row[1:], float) for row in scene["mesh"]["nodes"]}
    u = []
    for k, duration in enumerate(np.diff(times, prepend=0.0)):
        if k:
            run.step(duration)
        u.append([run.of(i, "r") - start[i] for i in nodes])
    return np.array(u)


@pytest.mark.parametrize("name", RUNS)
def test_run(name):
    given, ours = displacements(name)[1], our_displacements(name)
    assert len(given) == 100
    difference, (*_, for_masters, for_all) = np.abs(ours - given) / np.abs(given).max(), RUNS[name]
    assert difference[:, :4].max() < for_masters
    assert difference.max() < for_all


class SummingSpring(Spring):
    """A bushing whose angle is the sum of the steps' rotation increments; evaluated once a step."""

    def load(self, x1, x2, v1, v2, q1, q2, w1, w2):
        self.angle = getattr(self, "angle", 0.0) + 0.001 * (w1 - w2)
        f, m = -self.k * (x1 - x2 - self.arm), -self.kr * self.angle
        return np.concatenate([f, m]), np.concatenate([-f, -m - np.cross(x1 - x2, f)]), 0.0, 0.0


def march(problem, inputs, h, steps):
    """Central difference from rest, the first kick a half; the slave of a default tie. Displacements of all steps."""
    x, v, w, qn, qs, _ = problem.unpack(problem.start())

    def turn(q, w):
        return quaternion_product(exponential(h * w), q)

    slave, kick, u = problem.slaves[0], h / 2, []
    for k in range(steps + 1):
        now = problem.evaluate(k * h, np.concatenate([part.ravel() for part in (x, v, w, qn, qs)]), inputs)
        u.append(np.vstack([x - problem.x0, now["slave_x"] - problem.x0[slave.nodes].T @ slave.phi - slave.d0]))
        v, w, kick = v + kick * now["a"][:, :3], w + kick * now["a"][:, 3:], h
        x = x + h * v
        qn = np.array([turn(*pair) for pair in zip(qn, w)])
        qs = np.array([turn(qs[0], slave.phi @ w[slave.nodes])])
    return np.array(u)[:, [0, 1, 2, 3, 5, 4]]  # the slave, node 5, before node 6


@pytest.mark.parametrize("summing, tolerance", [(False, 1e-11), (True, 1e-6)])
def test_what_is_behind_the_difference_of_d3m0(summing, tolerance):
    """The independent solution repeats our run with rotation vectors, and the golden one with added-up increments."""
    scene, loads, *_ = RUNS["D3M0"]
    problem = Problem(scene)
    if summing:
        for spring in problem.springs:
            spring.__class__ = SummingSpring
    force, moment = (np.array(loads[f"point[1].{kind}_ext"]) for kind in "ft")
    times, given = displacements("D3M0")
    ours = given if summing else our_displacements("D3M0")
    theirs = march(problem, {("f", 6): lambda t: force, ("t", 6): lambda t: moment}, 0.001, round(times[-1] / 0.001))
    assert np.abs(theirs[::10] - ours).max() < tolerance * np.abs(given).max()


# ---- kernels


def cases():
    """(file, number of the case); without d_spot1: optimized triangles count node 3 twice there, another tie."""
    for name in KERNELS:
        for k, case in enumerate(json.loads((GOLDEN / f"{name}.json").read_text())["cases"]):
            if not case["name"].startswith("d_spot1"):
                yield pytest.param(name, k, id=case["name"])


class OneSlave:
    """One slave of a golden case in one cycle, as a scene with a single segment of driven masters.

    The default tie depends on Phi and d alone; its segment is drawn anew, flat and normal to d with the slave at the
    given (s, t), because that code projects warped quads differently. The optimized tie keeps its true corners.
    """

    def __init__(self, case, k, coordinates):
        segment = case["segments"][case["slave_segment"][k]]
        self.corners = list(dict.fromkeys(segment))
        self.node, n = case["slave_nodes"][k], len(self.corners)
        s, t = case["slave_st"][k]
        corners, slave = coordinates[self.corners], coordinates[self.node]
        optimized = case["spotflag"] == 1
        if not optimized:
            phi = np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)]) / 4
            phi = phi if n == 4 else np.array([phi[0], phi[1], phi[2] + phi[3]])
            d = slave - phi @ corners
            normal = d / np.linalg.norm(d) if np.linalg.norm(d) > 1e-12 else np.array([0.0, 0, 1])
            a, b = np.linalg.svd(normal[None])[2][1:]
            flat = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]] if n == 4 else [[0, 0], [1, 0], [0, 1]], float)
            corners = 0.01 * flat @ np.array([a, b])
            slave = phi @ corners + d

        def pick(key):
            return np.array(case[key])[[*self.corners, self.node]]

        self.rotations = bool(case["rotational_dof"] and np.any(pick("inertia")[:n]) and not optimized)
        turns = optimized or self.rotations
        node = [{"nodes": "all", "rotations": self.rotations}]
        for i, mass, inertia in zip((*range(1, n + 1), 9), pick("mass"), pick("inertia")):
            keep = turns if i == 9 else self.rotations
            node.append({"nodes": [i], "mass": mass, "inertia": inertia if keep else 0.0})
        self.scene = {
            "mesh": {
                "nodes": [[i + 1, *x] for i, x in enumerate(corners.tolist())] + [[9, *slave.tolist()]],
                "segments": [[1, *range(1, n + 1)]],
            },
            "node": node,
            "tie": [
                {
                    "name": "tie",
                    "segments": "all",
                    "slaves": [9],
                    "search_distance": 10.0,
                    "formulation": "optimized" if optimized else "default",
                }
            ],
        }

    def give(self, run, names, values, masters):
        """Sets vectors of the masters or of the slave, where the model has them."""
        for i in self.corners if masters else [self.node]:
            prefix = f"master[{self.corners.index(i) + 1}]" if masters else "slave[1]"
            run.set({f"{prefix}.{name}": v[i] for name, v in zip(names, values) if f"{prefix}.{name}" in run})


def close(value, expected):
    expected = np.array(expected)
    np.testing.assert_allclose(value, expected, rtol=0, atol=2e-13 * np.abs(expected).max())


class Cycle:
    """What the program makes of one cycle of a case: totals on the masters, and each slave's motion."""

    def __init__(self, case, cycle, velocity, spin):
        n, given, wanted = case["n_masters"], cycle["input"], cycle["output"]
        force, moment = np.array(given["force"]), np.array(given["moment"])
        acceleration = np.array(wanted["master_acceleration"])
        turning = np.array(wanted.get("master_angular_acceleration", 0 * acceleration))
        self.force, self.moment = force[:n].copy(), moment[:n].copy()
        self.mass, self.inertia = np.array(case["mass"])[:n], np.array(case["inertia"])[:n]
        self.velocity, self.spin, self.acceleration = [], [], []
        for k in range(len(case["slave_nodes"])):
            one = OneSlave(case, k, np.array(given["coordinates"]))
            run = Run(one.scene)
            one.give(run, ["f", "t"], [force, moment], masters=False)
            one.give(run, ["v", "w"], [velocity, spin], masters=True)
            for c, i in enumerate(one.corners, start=1):
                self.force[i] += run[f"master[{c}].f"]
                self.mass[i] += run[f"master[{c}].added_mass"]
                if one.rotations:
                    self.moment[i] += run[f"master[{c}].t"]
                    self.inertia[i] += run[f"master[{c}].added_inertia"]
            w = run["slave[1].w"] if "slave[1].w" in run else np.zeros(3)
            self.velocity.append(run["slave[1].v"])
            self.spin.append(w)
            # T q'', and of the centripetal part what that code keeps: half (default), nothing (optimized)
            run = Run(one.scene | {"model": {"reaction": "full"}})
            one.give(run, ["a", "z"], [acceleration, turning], masters=True)
            d = np.array(tiefmu.report(run.scene)["slaves"][0]["offset"])
            half = 0.5 * np.cross(w, np.cross(w, d)) if one.rotations else 0.0
            self.acceleration.append(run["slave[1].a"] + half)


@pytest.mark.parametrize("name, number", list(cases()))
def test_kernels(name, number):
    case = json.loads((GOLDEN / f"{name}.json").read_text())["cases"][number]
    velocity, spin = np.array(case["velocity"]), np.array(case["angular_velocity"])
    rotations = case["rotational_dof"] and np.any(case["inertia"][: case["n_masters"]])
    default = case["spotflag"] == 0
    square = case["name"] in ("c_1_square_center", "c_2_square_inside")
    for number, cycle in enumerate(case["cycles"]):
        ours, wanted = Cycle(case, cycle, velocity, spin), cycle["output"]
        close(ours.force, wanted["master_force"])
        close(ours.velocity, wanted["slave_velocity"])
        close(ours.acceleration, wanted["slave_acceleration"])
        if rotations:
            close(ours.spin, wanted["slave_angular_velocity"])
        if rotations and default:
            close(ours.moment, wanted["master_moment"])
        if number == 0 and (default or square):  # elsewhere it divides by the largest row sum, not by lambda
            close(ours.mass, wanted["master_mass"])
            if rotations and default:
                close(ours.inertia, wanted["master_inertia"])
        velocity = np.array(wanted["velocity_after_update"])
        spin = np.array(wanted.get("angular_velocity_after_update", 0 * velocity))
