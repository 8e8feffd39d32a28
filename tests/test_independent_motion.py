"""Whole motions of free, mixed and damped structures against a tight DOP853 solution of independent.py."""

from functools import cache

import numpy as np
import pytest
from in_process import Run
from independent import Problem, constant
from random_scenes import structure
from scipy.integrate import simpson
from tiefmu.study.variants import METHODS

END = 0.4
FORMS = [("default", True), ("default", False), ("optimized", False), ("optimized", True)]
forms = pytest.mark.parametrize("formulation, rotations", FORMS)

LOADS = {("f", 101): [3.0, -2.0, 5.0], ("f", 2): [0.0, 1.0, 2.0], ("f", 301): [1.0, 1.0, 0.0]}


def damped(scene):
    for spring in scene["spring"]:
        if spring["kind"] == "bushing":
            spring["stiffness"] = [180.0, 200.0, 240.0]
            spring["damping"] = [1.0, 2.0, 3.0]
            if "rotational_stiffness" in spring:
                spring["rotational_damping"] = 0.5
        else:
            spring["damping"] = 2.0


def half_driven(scene):
    """Nodes 1, 2 and 4 are driven with the constant velocities of their start, node 7 is fixed."""
    rotations = scene["node"][0]["rotations"]
    scene["node"] += [{"nodes": [1, 2, 4], "motion": "driven"}, {"nodes": [7], "motion": "fixed"}]
    scene["spring"][0]["ground"] = [3, 5, 6, 8, 9]
    scene["initial"] = [t for t in scene["initial"] if t["nodes"] != [7]]
    inputs = {}
    for table in scene["initial"]:
        if table["nodes"][0] in (1, 2, 4):
            inputs["v", table["nodes"][0]] = table["v"]
            if rotations:
                inputs["w", table["nodes"][0]] = table["w"]
    return inputs


@cache
def case(kind, formulation, rotations, inertia, geometry="finite"):
    """(scene, inputs by node id, solution at END)."""
    scene = structure(np.random.default_rng(11), formulation, rotations, inertia)
    scene["model"]["geometry"] = geometry
    inputs = {}
    if kind == "loaded":
        damped(scene)
        scene["model"]["gravity"] = [0.5, 0.0, -9.81]
        inputs = dict(LOADS)
        if formulation == "optimized" or rotations:
            inputs["t", 102] = [1.0, 0.5, -0.7]
    if kind == "mixed":
        inputs = half_driven(scene) | {("f", 101): [3.0, -2.0, 5.0]}
        scene["model"] |= {"reaction": "full"}
    problem = Problem(scene)
    return scene, inputs, problem, problem.solve([0.0, END], constant(inputs))


def energy(program) -> float:
    return program["energy.kinetic"] + program["energy.strain"]


def run(scene, inputs, method, steps):
    """Run at END, and the largest |H - H(0)| of the mechanical energy on the way."""
    name = {"f": lambda i: "f" if 100 < i < 300 else "f_ext", "t": lambda i: "t" if 100 < i < 300 else "t_ext"}
    program = Run(scene | {"integrator": {"method": method}})
    for (kind, i), value in inputs.items():
        program.set_of(i, name[kind](i) if kind in name else kind, value)
    start, change = energy(program), 0.0
    for _ in range(steps):
        program.step(END / steps)
        change = max(change, abs(energy(program) - start))
    return program, change


def difference(program, problem, expected):
    """Largest difference of a position, a velocity and a spin."""
    worst = 0.0
    for k, i in enumerate(problem.ids):
        pairs = [("r", expected["x"][k]), ("v", expected["v"][k]), ("w", expected["w"][k])]
        worst = max(
            [worst]
            + [np.abs(program.of(i, n) - value).max() for n, value in pairs if f"{program.names[i]}.{n}" in program]
        )
    for k, s in enumerate(problem.slaves):
        worst = max(
            worst,
            np.abs(program.of(s.id, "r") - expected["slave_x"][k]).max(),
            np.abs(program.of(s.id, "v") - expected["slave_v"][k]).max(),
        )
    return worst


@forms
@pytest.mark.parametrize("inertia", ["lumped", "consistent"])
@pytest.mark.parametrize("kind", ["swinging", "loaded", "mixed"])
def test_motion(kind, inertia, formulation, rotations):
    scene, inputs, problem, solution = case(kind, formulation, rotations, inertia)
    program, _ = run(scene, inputs, "rk4", 800)
    expected = solution[-1]
    assert np.abs(expected["x"] - problem.x0).max() > 0.02
    assert difference(program, problem, expected) < 1e-8
    assert abs(program["energy.kinetic"] - expected["kinetic"]) < 1e-7
    assert abs(program["energy.strain"] - expected["strain"]) < 1e-7
    reaction = expected["reaction"][scene["model"].get("reaction", "loads")]
    for k, i in enumerate(problem.ids):
        if scene["model"].get("reaction") == "full" and problem.motion[k] == "driven":
            np.testing.assert_allclose(program.of(i, "f"), reaction[k, :3], rtol=0, atol=1e-6)
            if f"{program.names[i]}.t" in program:
                np.testing.assert_allclose(program.of(i, "t"), reaction[k, 3:], rtol=0, atol=1e-6)


@forms
def test_energy_balance(formulation, rotations):
    """Work of loads and gravity, what the dampers took and what is left over, against integrals of the independent
    powers. Left over is only the work of bushings that are stiffer one way than another: theirs is no potential."""
    scene, inputs, problem, _ = case("loaded", formulation, rotations, "consistent")
    times = np.linspace(0, END, 201)
    solution = problem.solve(times, constant(inputs))
    program, _ = run(scene, inputs, "rk4", 800)
    balance = np.diff([solution[k]["kinetic"] + solution[k]["strain"] for k in (0, -1)])[0]
    for name, power, sign in (("external", "external", -1), ("dissipated", "dissipation", 1)):
        expected = simpson([now[power] for now in solution], x=times)
        balance += sign * expected
        assert abs(expected) > 0.1
        assert program[f"energy.{name}"] == pytest.approx(expected, abs=1e-5)
    assert program["energy.residual"] == pytest.approx(balance, abs=1e-5)


@forms
@pytest.mark.parametrize("inertia", ["lumped", "consistent"])
def test_small_geometry(inertia, formulation, rotations):
    scene, inputs, problem, solution = case("swinging", formulation, rotations, inertia, "small")
    program, _ = run(scene, inputs, "rk4", 800)
    assert difference(program, problem, solution[-1]) < 1e-8


ORDERS = {"central-difference": 2, "symplectic-euler": 1, "noh-bathe": 2, "rk4": 4}


def test_every_method_has_an_order():
    assert set(ORDERS) == set(METHODS)


@forms
@pytest.mark.parametrize("method, order", ORDERS.items())
def test_order(method, order, formulation, rotations):
    """Three halvings divide the error of the motion by 2^order each; consistent inertia, finite rotation."""
    scene, inputs, problem, solution = case("swinging", formulation, rotations, "consistent")
    errors = [difference(run(scene, inputs, method, steps)[0], problem, solution[-1]) for steps in (100, 200, 400, 800)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - order) < 0.3), errors


@forms
@pytest.mark.parametrize("inertia", ["lumped", "consistent"])
@pytest.mark.parametrize("method, order", [("central-difference", 2), ("symplectic-euler", 1), ("noh-bathe", 2)])
def test_order_with_dampers(method, order, inertia, formulation, rotations):
    """Loads, gravity and dampers, not proportional, that take a tenth of the energy and more; finite rotation."""
    scene, inputs, problem, solution = case("loaded", formulation, rotations, inertia)
    errors = [difference(run(scene, inputs, method, steps)[0], problem, solution[-1]) for steps in (200, 400, 800)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - order) < 0.3), errors


def test_damped_oscillator():
    """x = exp(-zeta omega t) (a cos wd t + b sin wd t): half the step, a quarter of the error of central difference."""
    mass, stiffness, damping, speed, end = 2.0, 800.0, 8.0, 0.6, 0.5
    omega, decay = np.sqrt(stiffness / mass), damping / (2 * mass)
    wd = np.sqrt(omega**2 - decay**2)
    exact = speed / wd * np.exp(-decay * end) * np.sin(wd * end)
    scene = {
        "mesh": {"nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, 0.5, 0.5, 0.0]]}
        | {"segments": [[1, 1, 2, 3, 4]]},
        "node": [{"nodes": "all", "motion": "free", "mass": mass / 2}, {"nodes": [5], "mass": 2 * mass}],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5]}],
        "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": stiffness, "damping": damping}],
        "initial": [{"nodes": [1, 2, 3, 4], "v": [0, 0, speed]}],
    }
    errors = []
    for steps in (100, 200, 400, 800):
        program = Run(scene)
        program.step(end / steps, steps)
        errors.append(abs(program.of(1, "r")[2] - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 2) < 0.15) and errors[0] < 1e-3 * speed / wd, errors


@forms
@pytest.mark.parametrize("method, order", ORDERS.items())
def test_energy_of_consistent_inertia_is_constant_to_the_order(method, order, formulation, rotations):
    scene, inputs, *_ = case("swinging", formulation, rotations, "consistent")
    changes = [run(scene, inputs, method, steps)[1] for steps in (100, 200, 400, 800)]
    orders = np.log2(np.array(changes[:-1]) / changes[1:])
    assert np.all(orders > order - 0.3), changes


@pytest.mark.parametrize("formulation", ["default", "optimized"])
def test_true_energy_drifts_with_lumped_inertia_only(formulation):
    """Theory 4: with m_s/m_i = 0.7 and an offset of 0.4 edges by per cents, whatever the step."""
    rotations = formulation == "default"
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, 0.7, 0.4, 0.4]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [
            {
                "nodes": "all",
                "motion": "free",
                "rotations": rotations,
                "mass": 1.0,
                "inertia": 0.1 if rotations else 0.0,
            },
            {"nodes": [5], "mass": 0.7, "inertia": 0.0},
        ],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "formulation": formulation}],
        "spring": [
            {"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 100.0}
            | ({"rotational_stiffness": 10.0} if rotations else {})
        ],
        "initial": [{"nodes": [1], "v": [0.1, 0, 0.3]}, {"nodes": [3], "v": [0, 0.2, -0.2]}],
        "integrator": {"method": "rk4"},
    }
    drift = {}
    for inertia in ("lumped", "consistent"):
        program = Run(scene | {"model": {"inertia": inertia}})
        start, drift[inertia] = energy(program), 0.0
        for _ in range(500):
            program.step(0.002)
            drift[inertia] = max(drift[inertia], abs(energy(program) / start - 1))
    assert 0.01 < drift["lumped"] < 0.5
    assert drift["consistent"] < 1e-8
