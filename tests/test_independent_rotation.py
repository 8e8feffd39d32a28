"""Large rotations: the offset keeps its length, free flight keeps its momentum (theory 2, 8)."""

import numpy as np
import pytest
from in_process import Run
from independent import Problem
from random_scenes import rotation

TURNS = 1000


def spinning_quad(formulation, **model):
    corners = np.array([[0, 0, 0], [1, 0, 0.1], [1, 0.8, 0], [0, 1, 0.05]])
    rows = [[k + 1, *x.tolist()] for k, x in enumerate(corners)] + [[5, 0.3, 0.6, 0.5]]
    return {
        "mesh": {"nodes": rows, "segments": [[1, 1, 2, 3, 4]]},
        "node": [{"nodes": "all", "rotations": formulation == "default", "mass": 1.0}],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "formulation": formulation}],
        "model": model,
    }, corners


def test_offset_of_the_default_tie_after_1000_revolutions():
    scene, corners = spinning_quad("default")
    axis = np.array([1.0, 2.0, -2.0]) / 3
    run = Run(scene)
    length = np.linalg.norm(run["slave[1].r"] - Problem(scene).slaves[0].phi @ corners)
    spin = 2 * np.pi * axis
    for i in range(1, 5):
        run.set({f"master[{i}].w": spin})
    steps = 37  # a revolution takes 1 s
    run.step(1 / steps, steps * TURNS)
    assert run["drift"] < 1e-12 * length
    np.testing.assert_allclose(run["slave[1].r"], scene["mesh"]["nodes"][4][1:], rtol=0, atol=1e-9)


def test_offset_of_the_optimized_tie_after_1000_revolutions():
    """Masters at given positions of a rigid rotation; the slave comes back to its place relative to them."""
    scene, corners = spinning_quad("optimized", position="input")
    axis = np.array([2.0, -1.0, 2.0]) / 3
    spin = 2 * np.pi * axis
    skew = np.cross(np.eye(3), axis)
    run, steps = Run(scene), 50
    length = np.linalg.norm(run["slave[1].r"] - corners.mean(axis=0))
    names = [name for what in "rv" for i in range(1, 5) for name in run.components[f"master[{i}].{what}"]]
    motions = []
    for angle in 2 * np.pi * np.arange(steps) / steps:
        turn = np.eye(3) - np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
        position = corners @ turn.T
        motions.append(np.concatenate([position, np.cross(spin, position)]).ravel())
    for k in range(TURNS * steps):
        run.simulation.set_values(names, motions[k % steps])
        run.step(1 / steps)
    assert run["drift"] < 1e-12 * length


def free_flight(formulation, inertia, seed=3):
    """A truss of four masters, an apex and a slave off their face, thrown with a spin; axial springs only."""
    rng = np.random.default_rng(seed)
    rotations = formulation == "default"
    x = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0.2], [-1, 1, 0], [0, 0, -1.2], [0.3, 0.2, 0.7]]) @ rotation(rng).T
    w, v = np.array([0.3, -0.2, 1.0]), np.array([0.1, 0.2, 0.3])
    pairs = [(1, 2), (2, 3), (3, 4), (4, 1), (1, 3), (2, 4), (1, 5), (2, 5), (3, 5), (4, 5)]
    scene = {
        "mesh": {"nodes": [[k + 1, *p.tolist()] for k, p in enumerate(x)], "segments": [[1, 1, 2, 3, 4]]},
        "node": [
            {"nodes": "all", "motion": "free", "mass": 1.0},
            {"nodes": [1, 2, 3, 4], "rotations": rotations, "inertia": 0.3 if rotations else 0.0},
            {"nodes": [6], "mass": 2.0, "inertia": 0.2},
        ],
        "tie": [{"name": "tie", "segments": "all", "slaves": [6], "formulation": formulation}],
        "spring": [{"nodes": list(p), "kind": "axial", "stiffness": 300.0} for p in pairs],
        "initial": [
            {"nodes": [k + 1], "v": (v + np.cross(w, p)).tolist()} | ({"w": w.tolist()} if rotations and k < 4 else {})
            for k, p in enumerate(x[:5])
        ],
        "model": {"inertia": inertia},
        "integrator": {"method": "rk4"},
    }
    return scene


@pytest.mark.parametrize("formulation", ["default", "optimized"])
@pytest.mark.parametrize("inertia", ["consistent", "lumped"])
def test_free_flight(formulation, inertia):
    """Linear momentum, to rounding where it is linear in the velocities; with consistent inertia angular momentum and
    energy, too (theory 8)."""
    scene = free_flight(formulation, inertia)
    problem, run = Problem(scene), Run(scene)
    added = problem.added()

    def momentum():
        linear, angular = np.zeros(3), np.zeros(3)
        mass, inertias = problem.mass.copy(), problem.inertia.copy()
        bodies = []
        if inertia == "lumped":
            mass, inertias = mass + added[:, 0], inertias + added[:, 1]
        else:
            bodies.append((2.0, 0.2, run.of(6, "r"), run.of(6, "v"), run.of(6, "w")))
        bodies += [
            (mass[k], inertias[k], run.of(i, "r"), run.of(i, "v"), run.of(i, "w")) for k, i in enumerate(problem.ids)
        ]
        for m, turning, x, v, w in bodies:
            linear, angular = linear + m * v, angular + m * np.cross(x, v) + turning * w
        return linear, angular

    linear, angular = momentum()
    energy = run["energy.kinetic"] + run["energy.strain"]
    run.step(0.005, 2000)
    later, turned = momentum()
    if inertia == "lumped":
        np.testing.assert_allclose(later, linear, rtol=0, atol=1e-12 * np.abs(linear).max())
    else:
        np.testing.assert_allclose(later, linear, rtol=0, atol=1e-7 * np.abs(linear).max())
        np.testing.assert_allclose(turned, angular, rtol=0, atol=1e-7 * np.abs(angular).max())
        assert abs(run["energy.kinetic"] + run["energy.strain"] - energy) < 1e-6 * energy
    assert run["drift"] < 1e-12
