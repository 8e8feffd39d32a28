"""Several instances, saved states, messages, and FMPy: what an FMU does over a run."""

import itertools
from ctypes import byref, c_char_p, c_size_t, c_void_p

import fmpy
import numpy as np
import pytest
from fmu_calls import ERROR, OK, Fmu, Instance
from fmu_scenes import random_values

# ----------------------------------------------------------------------------------- saved states, instances and reset


def run(instances, fmu, rng, steps=40, time=0.0):
    """The same irregular run in every instance, step by step; the last outputs and the time."""
    inputs = fmu.names("input")
    for _ in range(steps):
        size = rng.choice([0.001, 0.0037, 0.02])
        values = random_values(fmu, rng, inputs) if rng.uniform() < 0.5 else {}
        for instance in instances:
            assert instance.set(values) == OK
            assert instance.step(time, size) == OK, instance.errors()
        time += size
    return [instance.get_references(range(len(fmu.reference)))[1] for instance in instances], time


def test_a_restored_state_continues_with_the_same_bits(any_fmu):
    instance = Instance(any_fmu).start()
    _, time = run([instance], any_fmu, np.random.default_rng(10))
    state = instance.save()
    (first,), _ = run([instance], any_fmu, np.random.default_rng(11), time=time)
    for _ in range(2):
        assert instance.restore(state) == OK
        (again,), _ = run([instance], any_fmu, np.random.default_rng(11), time=time)
        np.testing.assert_array_equal(again, first)
    assert instance.call("FreeFMUstate", byref(state)) == OK and not state
    instance.free()


def test_a_state_is_saved_with_inputs_that_outputs_do_not_show_yet(any_fmu):
    instance = Instance(any_fmu).start()
    assert instance.set(random_values(any_fmu, np.random.default_rng(12), any_fmu.names("input"))) == OK
    state = instance.save()
    names = any_fmu.names("output")
    expected = instance.get(names)
    run([instance], any_fmu, np.random.default_rng(13))
    assert instance.restore(state) == OK
    np.testing.assert_array_equal(instance.get(names), expected)
    instance.free()


def test_a_state_holds_the_state_of_the_machine(fmu):
    instance = Instance(fmu)
    fresh = instance.save()
    assert instance.call("EnterInitializationMode") == OK
    assert instance.set({"slave[1].mass": 2.0}) == OK
    entered = instance.save()
    assert instance.call("ExitInitializationMode") == OK
    assert instance.step(0, 0.01) == OK
    assert instance.restore(entered) == OK
    assert instance.step(0, 0.01) == ERROR
    assert instance.set({"slave[1].mass": 3.0}) == OK
    assert instance.get(["slave[1].mass"])[0] == 3.0
    assert instance.restore(fresh) == OK
    (first,), _ = run([instance.start()], fmu, np.random.default_rng(14))
    other = Instance(fmu)
    (second,), _ = run([other.start()], fmu, np.random.default_rng(14))
    np.testing.assert_array_equal(first, second)
    instance.free()
    other.free()


def test_handles_of_states(fmu):
    instance, other = Instance(fmu).start(), Instance(fmu).start()
    state = instance.save()
    handle = state.value
    assert instance.save(state).value == handle  # written over
    for wrong in (other.save(), c_void_p(1), c_void_p(None)):
        assert instance.restore(wrong) == ERROR
    assert instance.call("FreeFMUstate", byref(c_void_p(1))) == ERROR
    assert instance.call("FreeFMUstate", byref(state)) == OK
    assert instance.call("FreeFMUstate", byref(state)) == OK  # now null: ignored
    assert instance.call("FreeFMUstate", None) == OK
    assert instance.restore(c_void_p(handle)) == ERROR
    instance.free()
    other.free()


def test_interleaved_instances_do_not_disturb_one_another(any_fmu):
    alone = [Instance(any_fmu).start(), Instance(any_fmu).start()]
    single = [run([instance], any_fmu, np.random.default_rng(15 + k))[0][0] for k, instance in enumerate(alone)]
    pair = [Instance(any_fmu).start(), Instance(any_fmu).start()]
    rngs, times = [np.random.default_rng(15), np.random.default_rng(16)], [0.0, 0.0]
    for _ in range(40):
        for k in range(2):
            (last,), times[k] = run([pair[k]], any_fmu, rngs[k], steps=1, time=times[k])
            if k == 0:
                first = last
    np.testing.assert_array_equal(first, single[0])
    np.testing.assert_array_equal(last, single[1])
    for instance in alone + pair:
        instance.free()


def test_reset_repeats_the_first_run(any_fmu):
    instance = Instance(any_fmu, logging=True).start(time=0.0)
    (first,), _ = run([instance], any_fmu, np.random.default_rng(17))
    assert instance.call("Reset") == OK
    assert instance.step(0, 0.01) == ERROR
    (second,), _ = run([instance.start()], any_fmu, np.random.default_rng(17))
    np.testing.assert_array_equal(first, second)
    instance.free()


def test_many_instances_in_any_order_of_death(fmu):
    instances = [Instance(fmu, name=f"tie {k}").start() for k in range(20)]
    results, _ = run(instances, fmu, np.random.default_rng(18), steps=5)
    for result in results:
        np.testing.assert_array_equal(result, results[0])
    for k in np.random.default_rng(19).permutation(20):
        instances[k].free()


# ------------------------------------------------------------------------------------------------------------ messages


def test_messages_are_finished_and_reach_their_owner(fmu):
    """Not every importer reads the arguments of a format: a message has none, and its % are doubled."""
    instance = Instance(fmu, name="a %s%n%d", environment=0x1234)
    assert instance.call("Terminate") == ERROR
    assert instance.log == [
        (0x1234, "a %s%n%d", ERROR, "logStatusError", text, text)
        for text in ["fmi2Terminate: not allowed in state instantiated"]
    ]
    for name in ("100%", "%n%s%%", "%" * 3000):  # a long one is cut, never inside a pair
        instance.log.clear()
        assert instance.call("SetDebugLogging", 1, c_size_t(1), (c_char_p * 1)(name.encode())) == ERROR
        *_, form, text = instance.log[0]
        assert text == form.replace("%%", "%") and form.count("%") == 2 * text.count("%")
        assert text == f"fmi2SetDebugLogging: unknown log category '{name}'"[: len(text)]
        assert len(text) > 1900 or text.endswith("'")
    instance.free()


def test_logging_is_off_until_asked_for_but_errors_come_always(fmu):
    quiet, loud = Instance(fmu, logging=False).start(), Instance(fmu, logging=True).start()
    assert quiet.log == []
    assert {message[3] for message in loud.log} >= {"logStability"}
    assert quiet.call("EnterInitializationMode") == ERROR
    assert len(quiet.errors()) == 1
    quiet.free()
    loud.free()


def test_categories_choose_what_is_logged(fmu):
    def categories(*names, on=True):
        instance = Instance(fmu)
        array = (c_char_p * len(names))(*(name.encode() for name in names))
        assert instance.call("SetDebugLogging", int(on), c_size_t(len(names)), array) == OK
        instance.start()
        found = {message[3] for message in instance.log}
        instance.free()
        return found

    assert categories("logStability") == {"logStability"}
    assert categories("logStatusError", "logTie") <= {"logTie"}
    assert categories() == categories("logAll") >= {"logStability"}
    assert categories("logAll", on=False) == set()
    declared = {category.name for category in fmu.description.logCategories}
    assert declared == {"logStatusError", "logStatusWarning", "logTie", "logStability", "logAll"}


def test_findings_about_the_tie_are_logged(tmp_path):
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.3, 0.6, 0.4]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "tie": [{"name": "tie", "slaves": [101]}],
    }
    instance = Instance(Fmu(scene, tmp_path), logging=True).start()
    messages = [message for message in instance.log if message[3] == "logTie"]
    assert any("slave 101" in message[5] or "offset" in message[5] for message in messages)
    instance.free()


def test_unknown_categories_are_refused(fmu):
    instance = Instance(fmu)
    assert instance.call("SetDebugLogging", 1, c_size_t(1), (c_char_p * 1)(b"logEvents")) == ERROR
    assert instance.errors() == ["fmi2SetDebugLogging: unknown log category 'logEvents'"]
    assert instance.call("SetDebugLogging", 1, c_size_t(1), None) == ERROR
    assert instance.call("SetDebugLogging", 1, c_size_t(1), (c_char_p * 1)(None)) == ERROR
    instance.start()
    assert {message[3] for message in instance.log} == {"logStatusError"}
    instance.free()


# ---------------------------------------------------------------------------------------------------------------- FMPy


@pytest.mark.parametrize("irregular", [False, True])
def test_fmpy_simulates_it_as_the_calls_do(any_fmu, irregular):
    rng = np.random.default_rng(20)
    names = any_fmu.names("output")
    start = random_values(any_fmu, rng, any_fmu.names("input"))
    times = np.concatenate([[0], np.cumsum(rng.choice([1, 2, 5], 40))]) * 1e-3 if irregular else np.arange(41) * 5e-3
    instance = Instance(any_fmu).start(values=start)
    rows = [instance.get(names)]
    for a, b in itertools.pairwise(times):
        assert instance.step(a, b - a) == OK
        rows.append(instance.get(names))
    if irregular:
        result = []
        slave = fmpy.fmi2.FMU2Slave(
            guid=any_fmu.description.guid,
            unzipDirectory=str(any_fmu.folder),
            modelIdentifier=any_fmu.description.coSimulation.modelIdentifier,
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.setReal([any_fmu.reference[name] for name in start], list(start.values()))
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        references = [any_fmu.reference[name] for name in names]
        result.append(slave.getReal(references))
        for a, b in itertools.pairwise(times):
            slave.doStep(currentCommunicationPoint=a, communicationStepSize=b - a)
            result.append(slave.getReal(references))
        slave.terminate()
        slave.fmi2FreeInstance(slave.component)
    else:
        table = fmpy.simulate_fmu(
            str(any_fmu.path), start_values=start, output=names, stop_time=0.2, output_interval=5e-3
        )
        np.testing.assert_allclose(table["time"], times, rtol=1e-12)
        result = [[row[name] for name in names] for row in table]
    np.testing.assert_allclose(result, rows, rtol=0 if irregular else 1e-9, atol=0 if irregular else 1e-9)
    instance.free()
