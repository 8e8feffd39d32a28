"""fmi2DoStep: steps that are refused, that diverge or are too long, and what they leave unchanged."""

import re
from ctypes import byref, c_char_p, c_double, c_size_t

import numpy as np
import pytest
from fmu_calls import ERROR, OK, WARNING, Fmu, Instance


def test_refused_steps(fmu):
    instance = Instance(fmu).start(time=2.0, stop=3.0)
    for time, size in (
        (2.0, 0.0),
        (2.0, -0.1),
        (2.0, np.nan),
        (2.0, np.inf),
        (1.9, 0.1),
        (2.1, 0.1),
        (np.nan, 0.1),
        (2.0, 1.1),
    ):
        assert instance.step(time, size) == ERROR
        assert instance.errors()[-1].startswith("fmi2DoStep: the step ")
    assert len(instance.errors()) == 8
    assert instance.step(2.0, 0.5) == OK
    assert instance.step(2.0, 0.5) == ERROR  # that one is done
    assert instance.step(2.5 * (1 + 1e-15), 0.5) == OK  # another rounding of the same point
    assert instance.step(3.0, 1e-3) == ERROR
    instance.free()


def test_steps_that_do_not_move_the_time_or_never_end(tmp_path, fmu):
    """Refused with the reason, and nothing has changed."""
    names, instance = fmu.names("output"), Instance(fmu).start(time=1.0)
    assert instance.step(1.0, 0.01) == OK
    before = instance.get(names)
    for size, words in ((1e-20, "too small to move the time on"), (1e15, "would take"), (1e300, "would take")):
        assert instance.step(1.01, size) == ERROR
        assert words in instance.errors()[-1]
        np.testing.assert_array_equal(instance.get(names), before)
    assert instance.step(1.01, 0.01) == OK
    instance.free()


def test_divergence_names_variable_and_time_and_keeps_the_last_state(loose):
    instance = Instance(loose).start()
    assert instance.set({"slave[1].f[2]": 3.0}) == OK
    assert instance.step(0, 0.5) == OK
    assert instance.set({"slave[1].f[2]": 1e30}) == OK
    names, good = list(loose.reference), instance.save()
    before = instance.get(names)
    assert instance.step(0.5, 1.0) == ERROR
    message = instance.errors()[-1]
    assert re.search(r"diverged at t = 1.5 s: .*; variable 'master\[\d\]\.v\[2\]'", message), message
    np.testing.assert_array_equal(instance.get(names), before)
    time = c_double()
    assert instance.call("GetRealStatus", 2, byref(time)) == ERROR  # not in this state, says the standard's table
    assert instance.restore(good) == OK
    assert instance.call("GetRealStatus", 2, byref(time)) == OK and time.value == 0.5
    assert instance.set({"slave[1].f[2]": 3.0}) == OK and instance.step(0.5, 0.5) == OK
    instance.free()


@pytest.mark.parametrize("formulation", ["default", "optimized"])
def test_driven_nodes_carried_out_of_the_world(formulation, tmp_path):
    """Positions that overflow, and a segment whose nodes fall together, while the FMU integrates nothing else."""
    rotations = formulation == "default"
    driven = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.3, 0.6, 0.5]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "rotations": rotations}],
        "tie": [{"name": "tie", "slaves": [101], "formulation": formulation}],
        "interface": {"expose": ["master.r", "slave.r"]},
    }
    driven = Fmu(driven, tmp_path)
    instance = Instance(driven).start(values={"master[2].v[3]": 0.25, "master[4].v[1]": 0.125})
    assert instance.step(0, 0.5) == OK
    names = list(driven.reference)
    assert instance.set({"master[2].v[3]": 1e280}) == OK
    before = instance.get(names)
    assert instance.step(0.5, 1e30) == ERROR
    message = instance.errors()[-1]
    assert "diverged at t = 0.5 s: position of node 2" in message and message.endswith("; variable 'master[2].r[3]'")
    np.testing.assert_array_equal(instance.get(names), before)
    instance.free()
    if formulation == "default":
        return
    instance = Instance(driven).start()
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    fall = dict(
        zip([f"master[{i}].v[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)], ([0.5, 0.5, 0] - corners).ravel())
    )
    assert instance.set(fall) == OK
    assert instance.step(0, 0.5) == OK
    before = instance.get(names)
    assert instance.step(0.5, 0.5) == ERROR  # there they meet in one point
    assert "diverged at t = 0.5 s: the segment of nodes 1, 2, 3, 4 has collapsed" in instance.errors()[-1]
    np.testing.assert_array_equal(instance.get(names), before)
    instance.free()


def test_driven_nodes_put_into_one_point(tmp_path):
    """Positions as inputs: what the segment's motion would be is not defined, so that there is nothing to get."""
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.3, 0.6, 0.5]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "tie": [{"name": "tie", "slaves": [101], "formulation": "optimized"}],
        "model": {"position": "input"},
    }
    squashed = Fmu(scene, tmp_path)
    point = {f"master[{i}].r[{k}]": 0.5 for i in (1, 2, 3, 4) for k in (1, 2, 3)}
    output = [squashed.reference["slave[1].v[1]"]]
    for use in (lambda instance: instance.get_references(output)[0], lambda instance: instance.step(0, 0.1)):
        instance = Instance(squashed).start()
        state = instance.save()
        assert instance.set(point) == OK
        assert instance.get_references([2**31])[0] == ERROR  # refused before anything is computed
        assert instance.errors()[-1].startswith("fmi2GetReal: unknown value reference")
        assert use(instance) == ERROR and "segment of nodes 1, 2, 3, 4 has collapsed" in instance.errors()[-1]
        assert instance.restore(state) == OK and instance.get_references(output)[0] == OK
        assert instance.step(0, 0.1) == OK
        instance.free()
    instance = Instance(squashed)
    assert instance.set(point) == OK and instance.call("EnterInitializationMode") == OK
    assert instance.call("ExitInitializationMode") == ERROR and "has collapsed" in instance.errors()[-1]
    instance.free()


def test_cancelling_is_refused_because_no_step_is_ever_in_progress(fmu):
    instance = Instance(fmu).start()
    assert instance.call("CancelStep") == ERROR
    assert instance.errors() == ["fmi2CancelStep: not allowed in state stepComplete"]
    assert instance.step(0, 0.01) == OK
    instance.free()


# A driven shell quad with declared mass and stiffness: steps above sqrt(2 m/K) are too long for an explicit host.
STIFF = {
    "mesh": {
        "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.5, 0.5, 0]],
        "segments": [[1, 1, 2, 3, 4]],
    },
    "node": [
        {"nodes": "all", "mass": 2.0, "stiffness": 1e4},
        {"nodes": [3], "stiffness": 4e4},
        {"nodes": [101], "mass": 4.0, "stiffness": 8e4},
    ],
    "tie": [{"name": "tie", "slaves": [101]}],
}


def test_a_communication_step_too_long_for_the_masters_is_warned_of_once(tmp_path):
    limit = np.sqrt(2 * (2.0 + 4.0 / 4) / (4e4 + 8e4 / 4))  # theory (6.3), with the mass that the slave adds
    stiff = Fmu(STIFF, tmp_path)
    instance = Instance(stiff, logging=True).start()

    def warnings():
        return [(m[3], m[5]) for m in instance.log if m[2] == WARNING]

    time = 0.0
    for factor, count in ((0.5, 0), (0.999, 0), (1.001, 1), (3.0, 1), (0.5, 1)):
        assert instance.step(time, factor * limit) == OK
        time += factor * limit
        assert len(warnings()) == count
    category, text = warnings()[0]
    assert category == "logStability" and "driven master node 3" in text and f"{limit:.9g}" in text
    assert instance.call("Reset") == OK  # a new run, a new warning
    assert instance.start().step(0, 2 * limit) == OK
    assert len(warnings()) == 2
    instance.free()
    for categories, count in ((["logTie"], 0), (["logStability"], 1), (["logStatusError", "logAll"], 1)):
        instance = Instance(stiff)
        names = (c_char_p * len(categories))(*[c.encode() for c in categories])
        assert instance.call("SetDebugLogging", 1, c_size_t(len(categories)), names) == OK
        assert instance.start().step(0, 2 * limit) == OK
        assert len(warnings()) == count
        instance.free()


def test_no_warning_where_nothing_is_declared(tmp_path):
    for change in ({"mass": 0.0}, {"stiffness": 0.0}):
        scene = STIFF | {"node": [table | change for table in STIFF["node"]]}
        instance = Instance(Fmu(scene, tmp_path), logging=True).start()
        assert instance.step(0, 100.0) == OK
        assert not [m for m in instance.log if m[2] == WARNING]
        instance.free()


def test_experiments_that_make_no_sense(fmu):
    instance = Instance(fmu)
    for start, stop in ((np.nan, 1.0), (np.inf, np.inf), (1.0, 0.5), (0.0, np.nan)):
        assert instance.call("SetupExperiment", 0, c_double(0), c_double(start), 1, c_double(stop)) == ERROR
    assert instance.call("SetupExperiment", 0, c_double(0), c_double(-1.0), 0, c_double(0)) == OK
    instance.free()


def test_divergence_is_an_error_that_reset_and_a_saved_state_undo(loose):
    instance = Instance(loose).start()
    good = instance.save()
    names = loose.names("output")
    before = instance.get(names)
    assert instance.set({"slave[1].f[1]": 1e30}) == OK
    assert instance.step(0, 1.0) == ERROR
    assert instance.errors()[-1].startswith("fmi2DoStep: diverged at t = ")
    assert instance.step(0, 1.0) == ERROR
    assert instance.restore(good) == OK
    np.testing.assert_array_equal(instance.get(names), before)
    assert instance.step(0, 1.0) == OK

    assert instance.set({"slave[1].f[1]": 1e30}) == OK
    assert instance.step(1.0, 1.0) == ERROR
    assert instance.call("Reset") == OK
    instance.start()
    np.testing.assert_array_equal(instance.get(names), before)
    instance.free()
