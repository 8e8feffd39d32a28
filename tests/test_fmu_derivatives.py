"""Directional derivatives, inputs that move inside a step, rates of outputs."""

import itertools
from ctypes import c_double, c_int, c_size_t, c_uint

import numpy as np
import pytest
from differences import check_derivatives, directional
from fmu_calls import ERROR, OK, Fmu, Instance, set_derivatives
from fmu_scenes import ALL_FREE, DRIVEN, LED, MIXED, random_values, scene

KINDS = [("default", True), ("default", False), ("optimized", True), ("optimized", False)]
INERTIAS = [
    ("lumped", "loads"),
    ("lumped", "full"),
    ("consistent", "loads"),
    ("consistent", "full"),
    ("consistent", "split"),
]
GEOMETRIES = [("finite", "integrated"), ("finite", "input"), ("small", "integrated"), ("small", "input")]


def settings():
    """Every kind of tie with every inertia and reaction, driven and mixed; geometries take turns, shifted by one from
    kind to kind so that each pair of the others meets them all somewhere."""
    cases = itertools.product(enumerate(KINDS), ["driven", "mixed"], enumerate(INERTIAS))
    for (k, kind), motion, (i, inertia) in cases:
        for shift in (0, 1):
            geometry = GEOMETRIES[(k + i + (motion == "mixed") + 2 * shift) % 4]
            if shift and kind[1] and kind[0] == "optimized":
                continue  # an optimized tie ignores rotations: the one with them is there once
            yield (*kind, motion, *inertia, *geometry)
    for kind, inertia, geometry in itertools.product(KINDS[:3], ["lumped", "consistent"], ["finite", "small"]):
        yield (*kind, "free", inertia, "loads", geometry, "integrated")
    yield LED
    yield (*MIXED, 1.0)


@pytest.mark.parametrize("case", list(settings()), ids=lambda case: "-".join(map(str, case)))
def test_every_output_by_every_input(case, tmp_path):
    rng = np.random.default_rng(11)
    fmu = Fmu(scene(rng, *case), tmp_path)
    inputs, outputs = fmu.names("input"), fmu.names("output")
    instance = Instance(fmu)
    assert instance.call("SetupExperiment", 0, c_double(0), c_double(0), 0, c_double(0)) == OK
    assert instance.call("EnterInitializationMode") == OK
    check_derivatives(instance, outputs, random_values(fmu, rng, inputs), rng)
    assert instance.call("ExitInitializationMode") == OK
    for k in range(3):
        assert instance.step(0.01 * k, 0.01) == OK, instance.log
        assert instance.set(random_values(fmu, rng, inputs)) == OK
    check_derivatives(instance, outputs, random_values(fmu, rng, inputs), rng)
    instance.free()


@pytest.fixture(scope="module", params=[MIXED, ALL_FREE, DRIVEN], ids=["mixed", "free", "driven"])
def fmu(request, tmp_path_factory):
    return Fmu(scene(np.random.default_rng(12), *request.param), tmp_path_factory.mktemp("fmu"))


def started(fmu, seed=13) -> Instance:
    rng = np.random.default_rng(seed)
    instance = Instance(fmu).start(values=random_values(fmu, rng, fmu.names("input")))
    assert instance.step(0, 0.01) == OK
    return instance


def test_a_derivative_changes_nothing_that_follows(fmu):
    outputs, inputs = fmu.names("output"), fmu.names("input")
    one, other = started(fmu), started(fmu)
    directional(one, outputs, inputs, np.ones(len(inputs)))
    for k in range(1, 4):
        for instance in (one, other):
            assert instance.step(0.01 * k, 0.01) == OK
        np.testing.assert_array_equal(one.get(outputs), other.get(outputs))
        directional(one, outputs[:1], inputs[:1], [1.0])
    one.free(), other.free()


def test_a_restored_state_has_the_derivatives_that_it_had(fmu):
    """The mass matrix, too, is again that of the restored geometry."""
    outputs, inputs = fmu.names("output"), fmu.names("input")
    instance = started(fmu)
    before = directional(instance, outputs, inputs, np.ones(len(inputs)))
    state = instance.save()
    for k in range(1, 11):
        assert instance.step(0.01 + 0.05 * (k - 1), 0.05) == OK
    assert abs(directional(instance, outputs, inputs, np.ones(len(inputs))) - before).max() > 1e-3
    assert instance.restore(state) == OK
    np.testing.assert_array_equal(directional(instance, outputs, inputs, np.ones(len(inputs))), before)
    instance.free()


def test_directions_add_up_where_an_input_is_named_twice(fmu):
    outputs, inputs = fmu.names("output"), fmu.names("input")
    instance = started(fmu)
    once = directional(instance, outputs, [inputs[0]], [0.75])
    np.testing.assert_array_equal(directional(instance, outputs, [inputs[0]] * 2, [0.25, 0.5]), once)
    np.testing.assert_array_equal(directional(instance, outputs, [], []), np.zeros(len(outputs)))
    assert len(directional(instance, [], inputs[:1], [1.0])) == 0
    instance.free()


def test_other_variables_are_refused(fmu):
    instance = started(fmu)
    output, parameter = fmu.reference["slave[1].v[1]"], fmu.reference["slave[1].mass"]
    calculated, known = fmu.reference["master[1].added_mass"], fmu.reference["slave[1].f[1]"]
    one, many = (c_double * 1)(1.0), len(fmu.reference)

    def ask(unknown, knowns, seed=one, change=one):
        return instance.call(
            "GetDirectionalDerivative",
            (c_uint * 1)(unknown),
            c_size_t(1),
            (c_uint * 1)(knowns),
            c_size_t(1),
            seed,
            change,
        )

    assert ask(output, known) == OK
    for unknown, knowns, words in (
        (known, known, "'slave[1].f[1]' is not an output"),
        (parameter, known, "'slave[1].mass' is not an output"),
        (calculated, known, "is not an output"),
        (output, output, "'slave[1].v[1]' is not an input"),
        (output, parameter, "is not an input"),
        (many, known, "unknown value reference"),
        (output, many, "unknown value reference"),
    ):
        one[0] = 1.0
        assert ask(unknown, knowns) == ERROR and words in instance.errors()[-1]
        assert one[0] == 1.0
    for bad in (np.nan, np.inf, -np.inf):
        assert ask(output, known, (c_double * 1)(bad)) == ERROR and "slave[1].f[1]" in instance.errors()[-1]
    for arguments in ((None, one), (one, None)):
        assert ask(output, known, *arguments) == ERROR and "null pointer" in instance.errors()[-1]
    assert instance.step(0.01, 0.01) == OK
    instance.free()


# --------------------------------------------------------------------------------------------- inputs inside a step

METHODS = ["central-difference", "symplectic-euler", "noh-bathe", "rk4"]
LINEAR = np.array([0.3, -0.2, 0.5])  # m/s
RATE = np.array([1.5, 0.7, -0.9])  # m/s2
CURVATURE = np.array([-4.0, 2.0, 3.0])  # m/s3


def carried(mixed: bool, method: str, rotations=False) -> dict:
    """A quad of driven masters with a slave; mixed: a free point hangs on the slave by a bushing."""
    made = {
        "mesh": {
            "nodes": [
                [1, 0, 0, 0],
                [2, 1, 0, 0],
                [3, 1, 1, 0],
                [4, 0, 1, 0],
                [101, 0.3, 0.6, 0.2],
                [201, 0.3, 0.6, 0.9],
            ],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "mass": 1.0, "rotations": rotations, "inertia": 0.1 if rotations else 0.0}],
        "tie": [{"name": "tie", "slaves": [101]}],
        "integrator": {"method": method},
        "interface": {"expose": ["slave.r", "master.r", "point.r"]},
    }
    if mixed:
        made["node"].append({"nodes": [201], "motion": "free"})
        made["spring"] = [{"nodes": [101, 201], "kind": "bushing", "stiffness": 4000.0}]
    return made


@pytest.mark.parametrize("mixed", [False, True], ids=["driven", "mixed"])
@pytest.mark.parametrize("method", METHODS)
def test_a_linear_velocity_is_integrated_exactly(mixed, method, tmp_path):
    fmu = Fmu(carried(mixed, method), tmp_path)
    names = [f"master[{i}].v[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)]
    places = [f"master[{i}].r[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)]
    instance = Instance(fmu).start(values=dict(zip(names, np.tile(LINEAR, 4))))
    start, slave = instance.get(places), instance.get([f"slave[1].r[{k}]" for k in (1, 2, 3)])
    time = 0.0
    for step in (0.1, 0.03, 0.2):
        velocity = LINEAR + time * RATE
        assert instance.set(dict(zip(names, np.tile(velocity, 4)))) == OK
        assert set_derivatives(instance, names, [1] * 12, np.tile(RATE, 4)) == OK
        assert instance.step(time, step) == OK, instance.log
        time += step
        moved = time * LINEAR + time**2 / 2 * RATE
        np.testing.assert_allclose(instance.get(places) - start, np.tile(moved, 4), rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(instance.get([f"slave[1].r[{k}]" for k in (1, 2, 3)]) - slave, moved, rtol=1e-12)
        np.testing.assert_allclose(instance.get(names), np.tile(LINEAR + time * RATE, 4), rtol=1e-14)
    instance.free()


@pytest.mark.parametrize("method", METHODS)
def test_a_quadratic_velocity_of_an_all_driven_scene_too(method, tmp_path):
    fmu = Fmu(carried(False, method), tmp_path)
    names = [f"master[{i}].v[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)]
    places = [f"slave[1].r[{k}]" for k in (1, 2, 3)]
    instance = Instance(fmu).start(values=dict(zip(names, np.tile(LINEAR, 4))))
    start, step = instance.get(places), 0.25
    assert (
        set_derivatives(
            instance, names + names, [1] * 12 + [2] * 12, np.concatenate([np.tile(RATE, 4), np.tile(CURVATURE, 4)])
        )
        == OK
    )
    assert instance.step(0, step) == OK
    np.testing.assert_allclose(
        instance.get(places) - start, step * LINEAR + step**2 / 2 * RATE + step**3 / 6 * CURVATURE, rtol=1e-13
    )
    np.testing.assert_allclose(
        instance.get(names), np.tile(LINEAR + step * RATE + step**2 / 2 * CURVATURE, 4), rtol=1e-14
    )
    # They held for that step only.
    before = instance.get(places)
    velocity = instance.get([f"slave[1].v[{k}]" for k in (1, 2, 3)])
    assert instance.step(step, step) == OK
    np.testing.assert_allclose(instance.get(places) - before, step * velocity, rtol=1e-13)
    instance.free()


@pytest.mark.parametrize("method", METHODS)
def test_a_load_that_grows_inside_the_step(method, tmp_path):
    """A free mass under F = c t: v = c t^2 / 2m, to the order of the method with the substeps it takes."""
    made = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.5, 0.5, 0]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "motion": "free", "mass": 1.0}],
        "tie": [{"name": "tie", "slaves": [101]}],
        "integrator": {"method": method, "time_step": 1e-3},
    }
    fmu = Fmu(made, tmp_path)
    instance = Instance(fmu).start()
    assert set_derivatives(instance, ["slave[1].f[1]"], [1], [10.0]) == OK
    assert instance.step(0, 0.5) == OK
    exact = 10.0 * 0.5**2 / 2 / 5  # four masters and the slave, 1 kg each
    tolerance = {"symplectic-euler": 5e-3, "noh-bathe": 1e-3}.get(method, 1e-6)
    np.testing.assert_allclose(instance.get(["slave[1].v[1]"])[0], exact, rtol=tolerance)
    assert instance.get(["slave[1].f[1]"])[0] == 5.0
    instance.free()


def test_derivatives_of_inputs_belong_to_the_state(fmu):
    outputs = fmu.names("output")
    inputs = fmu.names("input")
    instance = started(fmu)
    assert set_derivatives(instance, inputs, [1] * len(inputs), np.linspace(-1, 1, len(inputs))) == OK
    state = instance.save()
    assert instance.step(0.01, 0.02) == OK
    moved = instance.get(outputs)
    assert instance.restore(state) == OK
    assert instance.step(0.01, 0.02) == OK
    np.testing.assert_array_equal(instance.get(outputs), moved)
    # Without them it goes elsewhere, and a state saved before they were set knows nothing of them.
    assert instance.call("Reset") == OK
    fresh = started(fmu)
    plain = fresh.save()
    assert fresh.step(0.01, 0.02) == OK
    straight = fresh.get(outputs)
    assert (straight != moved).any()
    assert fresh.restore(plain) == OK
    assert set_derivatives(fresh, inputs, [1] * len(inputs), np.linspace(-1, 1, len(inputs))) == OK
    assert fresh.restore(plain) == OK
    assert fresh.step(0.01, 0.02) == OK
    np.testing.assert_array_equal(fresh.get(outputs), straight)
    instance.free(), fresh.free()


def test_derivatives_of_inputs_outlive_a_refused_step(fmu):
    outputs, inputs = fmu.names("output"), fmu.names("input")
    one, other = started(fmu), started(fmu)
    for instance in (one, other):
        assert set_derivatives(instance, inputs, [1] * len(inputs), np.linspace(-1, 1, len(inputs))) == OK
    for size in (0.0, 1e-30, np.nan) + ((1e15,) if "stable_time_step" in outputs else ()):
        assert one.step(0.01, size) == ERROR
    for instance in (one, other):
        assert instance.step(0.01, 0.02) == OK
    np.testing.assert_array_equal(one.get(outputs), other.get(outputs))
    one.free(), other.free()


def test_wrong_derivatives_of_inputs_change_nothing(fmu):
    outputs = fmu.names("output")
    instance, other = started(fmu), started(fmu)
    good = "slave[1].f[1]"
    for names, orders, values, words in (
        ([good], [0], [1.0], "order 1 or 2, not 0"),
        ([good], [3], [1.0], "order 1 or 2, not 3"),
        ([good, "slave[1].v[1]"], [1, 1], [1.0, 1.0], "'slave[1].v[1]' is not an input"),
        ([good, "slave[1].mass"], [1, 1], [1.0, 1.0], "is not an input"),
        ([good, good], [1, 2], [1.0, np.nan], good),
        ([good], [1], [np.inf], good),
    ):
        assert set_derivatives(instance, names, orders, values) == ERROR
        assert words in instance.errors()[-1]
    for arguments in (
        (None, (c_int * 1)(1), (c_double * 1)(1)),
        ((c_uint * 1)(0), None, (c_double * 1)(1)),
        ((c_uint * 1)(0), (c_int * 1)(1), None),
    ):
        assert instance.call("SetRealInputDerivatives", arguments[0], c_size_t(1), *arguments[1:]) == ERROR
        assert "null pointer" in instance.errors()[-1]
    for i in (instance, other):
        assert i.step(0.01, 0.01) == OK
    np.testing.assert_array_equal(instance.get(outputs), other.get(outputs))
    instance.free(), other.free()


# ----------------------------------------------------------------------------------------------------- rates of outputs


def rates(instance, names, order=1):
    n = len(names)
    values = (c_double * n)(*[np.nan] * n)
    status = instance.call(
        "GetRealOutputDerivatives",
        (c_uint * n)(*[instance.fmu.reference[name] for name in names]),
        c_size_t(n),
        (c_int * n)(*[order] * n),
        values,
    )
    return status, np.array(values[:])


def test_rates_of_outputs_follow_the_motion(fmu):
    """Against the outputs of short steps later, inputs being held, and without leaving a trace."""
    outputs = [name for name in fmu.names("output") if "time_step" not in name and name != "drift"]
    instance = started(fmu)
    inputs = [name for name in fmu.names("input") if name.split(".")[1][0] in "az"]
    assert instance.set(dict.fromkeys(inputs, 0.0)) == OK  # so that driven velocities are known to stand still
    before = instance.get(outputs)
    status, found = rates(instance, outputs)
    assert status == OK
    np.testing.assert_array_equal(instance.get(outputs), before)
    h, rows = 1e-4, []
    for k in range(4):
        assert instance.step(0.01 + k * h, h) == OK
        rows.append(instance.get(outputs))
    # At the start of the step, from the three differences after the first: dampers see the velocity of a half step.
    first, second, third = np.diff(rows, axis=0) / h
    expected = first - 1.5 * (second - first) + 1.875 * (third - 2 * second + first)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-4 * np.abs(expected).max())
    instance.free()


@pytest.mark.parametrize("method", METHODS)
def test_rates_of_a_spring_and_damper(method, tmp_path):
    """The master's reaction f = k (x - x_s) + c (v - v_s) of a free mass at x: f' = k (v - v_s) + c a."""
    made = carried(True, method)
    made["spring"][0] |= {"stiffness": 4000.0, "damping": 30.0}
    made["interface"]["expose"] = ["point.r", "slave.r"]
    made["initial"] = [{"nodes": [201], "v": [0.3, -0.2, 0.4]}]
    instance = Instance(Fmu(made, tmp_path)).start(values={f"master[{i}].v[1]": 0.7 for i in (1, 2, 3, 4)})
    assert instance.step(0, 0.003) == OK
    v, v_s, x, x_s = (
        instance.get([f"{name}[{k}]" for k in (1, 2, 3)])
        for name in ("point[1].v", "slave[1].v", "point[1].r", "slave[1].r")
    )
    a = -4000.0 * (x - x_s - [0, 0, 0.7]) - 30.0 * (v - v_s)
    names = [f"master[{i}].f[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)] + [f"point[1].v[{k}]" for k in (1, 2, 3)]
    status, found = rates(instance, names)
    assert status == OK
    np.testing.assert_allclose(found[12:], a, rtol=1e-4, atol=1e-4 * np.abs(a).max())
    exact = 4000.0 * (v - v_s) + 30.0 * a
    np.testing.assert_allclose(found[:12].reshape(4, 3).sum(axis=0), exact, rtol=1e-3, atol=1e-3 * np.abs(exact).max())
    instance.free()


def test_rates_of_driven_velocities_are_the_accelerations_given(tmp_path):
    fmu = Fmu(
        scene(np.random.default_rng(14), "default", False, "driven", "consistent", "full", "finite", "integrated"),
        tmp_path,
    )
    rng = np.random.default_rng(15)
    instance = Instance(fmu).start(values=random_values(fmu, rng, fmu.names("input")))
    names = [f"slave[{j}].{what}[{k}]" for j in (1, 2) for what in "va" for k in (1, 2, 3)]
    velocities = [name for name in names if ".v" in name]
    status, found = rates(instance, velocities)
    assert status == OK
    np.testing.assert_allclose(found, instance.get([name.replace(".v", ".a") for name in velocities]), rtol=1e-7)
    instance.free()


def test_wrong_rates_of_outputs(fmu):
    instance = started(fmu)
    for names, order, words in (
        (["slave[1].v[1]"], 0, "order 1, not 0"),
        (["slave[1].v[1]"], 2, "order 1, not 2"),
        (["slave[1].f[1]"], 1, "is not an output"),
    ):
        status, values = rates(instance, names, order)
        assert status == ERROR and np.isnan(values).all() and words in instance.errors()[-1]
    for arguments in (
        (None, (c_int * 1)(1), (c_double * 1)(1)),
        ((c_uint * 1)(0), None, (c_double * 1)(1)),
        ((c_uint * 1)(0), (c_int * 1)(1), None),
    ):
        assert instance.call("GetRealOutputDerivatives", arguments[0], c_size_t(1), *arguments[1:]) == ERROR
    assert rates(instance, [])[0] == OK
    assert instance.step(0.01, 0.01) == OK
    instance.free()
