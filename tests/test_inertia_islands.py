"""Segments that share no free node with another are solved by themselves: against the dense equations, theory (4.4)."""

import numpy as np
import pytest
from in_process import Run
from independent import Problem
from random_scenes import rows, segment, slave_over

FORMS = [("default", True), ("default", False), ("optimized", False), ("optimized", True)]
forms = pytest.mark.parametrize("formulation, rotations", FORMS)
SLAVES = [1, 2, 1, 3, 1, 5, 4, 1, 1, 7]  # of each segment: kernels take four segments at once, and then the rest


def welds(seed, formulation, rotations, mixed=False, ratio=1.0, equal=False):
    """Quads and triangles apart from each other; of each second one a corner is driven and (default) one fixed. Node
    100 e + i is corner i of segment e, 100 e + 50 + j its slave j."""
    rng = np.random.default_rng(seed)
    nodes, segments, tables, slaves, initial = [], [], [], [], []
    turns = formulation == "optimized" or rotations
    for e, count in enumerate(SLAVES, 1):
        n = 3 if e % 3 == 0 else 4
        corners = segment(rng, n, aspect=3.0) + [10.0 * e, 0, 0]
        ids = [100 * e + i for i in range(n)]
        nodes += rows(100 * e, corners)
        segments.append([e, *ids])
        mass, inertia = rng.uniform(0.5, 2, n), rng.uniform(0.1, 0.4, n)
        if equal:
            mass[:], inertia[:] = 1.0, 0.2
        motion = ["free"] * n
        if mixed and e % 2 == 0 and (n == 4 or formulation == "default"):
            motion[e % n] = "driven"
            if formulation == "default":
                motion[(e + 1) % n] = "fixed"
        for k, i in enumerate(ids):
            own = {"inertia": inertia[k]} if rotations else {}
            tables.append({"nodes": [i], "motion": motion[k], "rotations": rotations, "mass": mass[k], **own})
            if motion[k] == "free":
                v, w = rng.uniform(-1, 1, (2, 3)).tolist()
                initial.append({"nodes": [i], "v": v} | ({"w": w} if rotations else {}))
        for j in range(count):
            i = 100 * e + 50 + j
            nodes += rows(i, [slave_over(rng, corners, outside=1.0, offset=0.5)])
            own = {"inertia": ratio * rng.uniform(0.01, 0.2)} if turns else {}
            tables.append({"nodes": [i], "mass": ratio * rng.uniform(0.1, 2), **own})
            slaves.append(i)
    scene = {
        "mesh": {"nodes": nodes, "segments": segments},
        "node": tables,
        "tie": [
            {"name": "welds", "segments": "all", "slaves": slaves, "formulation": formulation, "search_distance": 5.0}
        ],
        "initial": initial,
        "model": {"inertia": "consistent", **({"reaction": "full"} if mixed else {})},
    }
    inputs = {}
    for i in slaves:
        inputs["f", i] = rng.uniform(-3, 3, 3)
        if turns:
            inputs["t", i] = rng.uniform(-1, 1, 3)
    for table in tables:
        i = table["nodes"][0]
        if table.get("motion") == "free":
            inputs["f", i] = rng.uniform(-3, 3, 3)
            if rotations:
                inputs["t", i] = rng.uniform(-1, 1, 3)
        if table.get("motion") == "driven":
            inputs["v", i], inputs["a", i] = rng.uniform(-1, 1, (2, 3))
            if rotations:
                inputs["w", i], inputs["z", i] = rng.uniform(-1, 1, (2, 3))
    return scene, inputs


def started(scene, inputs):
    program = Run(scene)
    for (kind, i), value in inputs.items():
        name = kind + "_ext" if kind in "ft" and i % 100 < 50 else kind
        program.set_of(i, name, value)
    return program


def accelerations(program, problem):
    """(N, 6) of the free nodes. The solver's order: by kind of motion, then by id (src/model.hpp)."""
    found = np.zeros((len(problem.ids), 6))
    a, z = program.simulation.get("acceleration"), np.zeros((0, 3))
    if "angular_acceleration" in program.simulation.fields:
        z = program.simulation.get("angular_acceleration")
    order = {True: ["driven", "fixed", "free"], False: ["free", "fixed", "driven"]}
    rank = [
        (not problem.rotating[k], order[bool(problem.rotating[k])].index(problem.motion[k]), problem.ids[k])
        for k in range(len(problem.ids))
    ]
    for place, k in enumerate(sorted(range(len(rank)), key=rank.__getitem__)):
        found[k, :3] = a[place]
        found[k, 3:] = z[place] if place < len(z) else 0
    return found


def constant(inputs):
    def of(value):
        return lambda t: value

    return {key: of(value) for key, value in inputs.items()}


@forms
@pytest.mark.parametrize("geometry", ["finite", "small"])
@pytest.mark.parametrize("equal", [False, True])
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("ratio", [1.0, 1e-3, 300.0])
def test_accelerations(ratio, mixed, equal, geometry, formulation, rotations):
    """At the start, with loads, spins and known accelerations."""
    scene, inputs = welds(3, formulation, rotations, mixed, ratio, equal)
    scene["model"]["geometry"] = geometry
    problem = Problem(scene)
    exact = problem.evaluate(0.0, problem.start(), constant(inputs))["a"]
    found = accelerations(started(scene, inputs), problem)
    free = problem.motion == "free"
    size = np.abs(exact[free]).max()
    assert np.abs(found - exact)[free].max() < 1e-12 * size * max(1, ratio)


@forms
def test_motion(formulation, rotations):
    """Large rotations on the way, some corners held: nothing else keeps loaded corners together."""
    scene, inputs = welds(4, formulation, rotations, mixed=True)
    inputs = {key: value for key, value in inputs.items() if key[0] not in "az"}
    problem, end = Problem(scene), 0.5
    expected = problem.solve([0.0, end], constant(inputs))[-1]
    scene["integrator"] = {"method": "rk4"}
    program = started(scene, inputs)
    program.step(end / 400, 400)
    assert np.abs(expected["x"] - problem.x0).max() > 0.3
    for k, i in enumerate(problem.ids):
        np.testing.assert_allclose(program.of(i, "v"), expected["v"][k], rtol=0, atol=2e-8)
        if problem.motion[k] == "free":
            np.testing.assert_allclose(program.of(i, "r"), expected["x"][k], rtol=0, atol=2e-8)


@forms
def test_momentum_and_energy_in_free_flight(formulation, rotations):
    """No loads: both are kept to the order of central difference, and exactly where nothing turns with the masters."""
    scene, _ = welds(5, formulation, rotations)
    program = started(scene, {})
    problem = Problem(scene)

    def momentum():
        total = sum(m * program.of(i, "v") for i, m in zip(problem.ids, problem.mass))
        return total + sum(s.mass * program.of(s.id, "v") for s in problem.slaves)

    before, energy = momentum(), program["energy.kinetic"]
    change = []
    for steps in (100, 200):
        program = started(scene, {})
        program.step(0.2 / steps, steps)
        drift = np.abs(momentum() - before).max() / np.abs(before).max()
        change.append(np.array([drift, abs(program["energy.kinetic"] / energy - 1)]))
    assert (change[1] < np.maximum(1e-12, 0.35 * change[0])).all()
