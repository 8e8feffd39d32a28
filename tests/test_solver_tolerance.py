"""[model] solver_tolerance: accelerations of connected surfaces with consistent inertia (theory 4)."""

import numpy as np
import pytest
from fmu_calls import OK, Fmu, Instance
from in_process import Run
from independent import Problem, constant
from random_scenes import structure
from test_fmu_serialisation import restored, run, serialised
from test_inertia_islands import accelerations
from test_threads import panel

FORMS = [("default", True), ("optimized", False), ("optimized", True)]
forms = pytest.mark.parametrize("formulation, rotations", FORMS)


def surface(formulation, rotations, tolerance, heavy=1.0, side=6):
    """A panel that moves and turns, with loads; its slaves `heavy` times as heavy as a node and more."""
    scene = panel(formulation, rotations, "free", side, shuffled=True)
    rng = np.random.default_rng(8)
    scene["node"][1]["mass"] = heavy
    scene["model"] = {"inertia": "consistent", "solver_tolerance": tolerance}
    masters = scene["node"][0]["nodes"]
    where = {row[0]: np.array(row[1:]) for row in scene["mesh"]["nodes"]}
    turn = np.array([0.4, -0.3, 1.0])
    scene["initial"] = [
        {"nodes": [k], "v": (np.cross(turn, where[k]) + rng.normal(0, 0.1, 3)).tolist()}
        | ({"w": (turn + rng.normal(0, 0.1, 3)).tolist()} if rotations else {})
        for k in masters
    ]
    inputs = {("f", k): rng.normal(size=3) for k in [*masters, *scene["tie"][0]["slaves"]]}
    return scene, inputs


def started(scene, inputs):
    program = Run(scene)
    masters = set(scene["node"][0]["nodes"])
    for (_, k), value in inputs.items():
        program.set_of(k, "f_ext" if k in masters else "f", value)
    return program


@forms
@pytest.mark.parametrize("heavy", [0.3, 3.0])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8, 1e-12])
def test_error_of_the_accelerations(tolerance, heavy, formulation, rotations):
    """Residual over right side, both in the norm of the inverse of the mass matrix's diagonal blocks; the norm of the
    errors is that of the matrix itself. The two differ by what slaves couple: less than five times here."""
    scene, inputs = surface(formulation, rotations, tolerance, heavy)
    problem = Problem(scene)
    now = problem.evaluate(0.0, problem.start(), constant(inputs))
    error = (accelerations(started(scene, inputs), problem) - now["a"]).ravel()[problem.free]
    exact = now["a"].ravel()[problem.free]
    mass = problem.mass_matrix(now["T"])[np.ix_(problem.free, problem.free)]
    relative = np.sqrt(error @ mass @ error / (exact @ mass @ exact))
    assert relative < 5 * tolerance
    assert tolerance < 1e-9 or relative > 1e-3 * tolerance  # it is what ends the iteration


@forms
@pytest.mark.parametrize("light", [1.0, 1e-3, 1e-6])
def test_small_surfaces_are_solved_to_rounding(light, formulation, rotations):
    """Whatever the tolerance, and however much of the inertia is the slaves': the norm is that of the test above."""
    scene = structure(np.random.default_rng(11), formulation, rotations, slaves=12)
    scene["model"]["solver_tolerance"] = 1e-2
    scene["node"][0]["mass"] *= light
    scene["node"][0]["inertia"] *= light
    problem = Problem(scene)
    now = problem.evaluate(0.0, problem.start())
    error = (accelerations(Run(scene), problem) - now["a"]).ravel()[problem.free]
    exact = now["a"].ravel()[problem.free]
    mass = problem.mass_matrix(now["T"])[np.ix_(problem.free, problem.free)]
    assert np.sqrt(error @ mass @ error / (exact @ mass @ exact)) < 1e-12


@forms
def test_the_answer_does_not_depend_on_what_was_asked_before(formulation, rotations):
    """Other inputs that were tried, and outputs that were read, leave no bit behind."""
    scene, inputs = surface(formulation, rotations, 1e-4)
    plain, tried = started(scene, inputs), started(scene, inputs)
    slave = scene["tie"][0]["slaves"][0]
    plain.step(1e-2, 3)
    tried.step(1e-2, 3)
    for force in ([1e3, 0, 0], [0, -30, 2]):
        tried.set_of(slave, "f", force)
        assert np.isfinite(tried.simulation.get("acceleration")).all()
    tried.set_of(slave, "f", inputs["f", slave])
    for program in (plain, tried):
        program.step(1e-2, 3)
    for name in ("velocity", "position", "acceleration"):
        np.testing.assert_array_equal(plain.simulation.get(name), tried.simulation.get(name))


@pytest.mark.parametrize("method", ["central-difference", "symplectic-euler", "noh-bathe", "rk4"])
def test_a_state_continues_with_the_same_bits(method, tmp_path):
    scene, _ = surface("default", True, 1e-4)
    fmu = Fmu(scene | {"integrator": {"method": method}}, tmp_path)
    one, other = Instance(fmu).start(), Instance(fmu).start()
    run(one, 0.0, 3, np.random.default_rng(1))
    data = serialised(one, one.save())
    expected = run(one, 0.03, 3, np.random.default_rng(2))
    run(other, 0.0, 1, np.random.default_rng(3))
    status, state = restored(other, data)
    assert status == OK and other.restore(state) == OK
    np.testing.assert_array_equal(run(other, 0.03, 3, np.random.default_rng(2)), expected)
    one.free(), other.free()


@forms
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_a_bad_guess_does_no_harm(bad, formulation, rotations):
    scene, inputs = surface(formulation, rotations, 1e-8)
    plain, program = started(scene, inputs), started(scene, inputs)
    for each in (plain, program):
        each.step(1e-3)
    simulation = program.simulation
    simulation.set("acceleration_increment", np.full(simulation.fields["acceleration_increment"], bad))
    for each in (plain, program):
        each.step(1e-3)
    a, b = (each.simulation.get("acceleration") for each in (plain, program))
    assert np.abs(a - b).max() < 1e-6 * np.abs(a).max()


@forms
def test_energy_and_momentum(formulation, rotations):
    """No loads. Central difference keeps momentum and energy to its order: both drifts fall to a quarter with half the
    step. The iteration adds its error, as large as its tolerance or smaller."""

    def run(tolerance, steps):
        scene, _ = surface(formulation, rotations, tolerance)
        program, problem = started(scene, {}), Problem(scene)
        mass = np.concatenate([problem.mass, [s.mass for s in problem.slaves]])
        ids = [*problem.ids, *(s.id for s in problem.slaves)]

        def momentum():
            return mass @ np.array([program.of(k, "v") for k in ids])

        before, energy = momentum(), program["energy.kinetic"]
        program.step(1.5 / steps, steps)
        scale = mass.sum() * np.sqrt(2 * energy / mass.sum())
        return np.array([np.abs(momentum() - before).max() / scale, abs(program["energy.kinetic"] / energy - 1)])

    exact = run(1e-12, 50)
    assert (run(1e-12, 100) < 0.3 * exact).all()
    assert (np.abs(run(1e-4, 50) - exact) < 1e-5).all()
