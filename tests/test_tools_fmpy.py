"""FMPy: validation, every option of simulate_fmu, and its cross-check against reference results."""

import itertools
import re
import shutil
import sys

import fmpy
import numpy as np
import pytest
from fmpy import fmi2
from fmpy.util import write_csv
from fmpy.validation import validate_fmu
from tool_cases import CALLBACKS, EXAMPLE, STEP, build, call, plain, same_bits, tie_case

STEPS = 120
OUTPUTS = [f"master[{i}].f[{k}]" for i in range(1, 5) for k in (1, 2, 3)] + ["slave[1].v[1]", "slave[1].v[3]"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmpy")


@pytest.fixture(scope="module")
def tie(folder) -> str:
    return build("tie", folder)


@pytest.fixture(scope="module")
def case(tie) -> dict:
    return {**tie_case(tie, STEPS), "outputs": {"tie": OUTPUTS}}


@pytest.fixture(scope="module")
def expected(case) -> np.ndarray:
    return plain(case)["tie"]


def signals(inputs: dict, start=0.0) -> np.ndarray:
    """The inputs as FMPy takes them; it uses the values at the start of a step."""
    table = np.empty(STEPS, dtype=[("time", float)] + [(name, float) for name in inputs])
    table["time"] = start + STEP * np.arange(STEPS)
    for name, values in inputs.items():
        table[name] = values[:STEPS]
    return table


def simulate(case, **options) -> np.ndarray:
    """Outputs at the start and after every step."""
    options = {
        "input": signals(case["inputs"]["tie"]),
        "output": OUTPUTS,
        "output_interval": STEP,
        "stop_time": STEPS * STEP,
        **options,
    }
    rows = fmpy.simulate_fmu(case["fmus"]["tie"], **options)
    return np.transpose([rows[name] for name in OUTPUTS])


def instantiated(tie) -> fmi2.FMU2Slave:
    description = fmpy.read_model_description(tie)
    instance = fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(tie),
        instanceName="tie",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    instance.instantiate(callbacks=CALLBACKS)
    return instance


@pytest.mark.parametrize("scene", sorted(EXAMPLE.glob("*.toml"), key=str), ids=lambda path: path.stem)
def test_its_validation_finds_nothing(scene, folder):
    assert validate_fmu(build(scene.stem, folder)) == []


# Options that leave the trajectory as it is: those of model exchange, of FMI 3, of platforms, and of talking.
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"validate": False},
        {"stop_time": str(STEPS * STEP)},
        {"solver": "Euler"},
        {"step_size": 1e-5},
        {"relative_tolerance": 1e-3},
        {"record_events": False},
        {"fmi_type": "CoSimulation"},
        {"apply_default_start_values": True},
        {"start_values": {"slave[1].f[3]": 0.0}},
        {"timeout": 100.0},
        {"visible": True},
        {"remote_platform": None},
        {"early_return_allowed": True},
        {"use_event_mode": True},
        {"terminate": False},
        {"set_stop_time": False},
    ],
    ids=str,
)
def test_options_that_change_no_bit(options, case, expected):
    same_bits({"tie": simulate(case, **options)[1:]}, {"tie": expected})


def test_a_later_start(case, expected):
    later = signals(case["inputs"]["tie"], start=0.5)
    same_bits({"tie": simulate(case, start_time=0.5, stop_time=0.5 + STEPS * STEP, input=later)[1:]}, {"tie": expected})


def test_start_values_of_inputs(case):
    values = {name: 0.1 * k for k, name in enumerate(case["inputs"]["tie"])}
    constant = plain({**case, "inputs": {"tie": {name: [value] * STEPS for name, value in values.items()}}})
    found = simulate(case, input=None, start_values=values)
    np.testing.assert_array_equal(found[1:], constant["tie"])


def test_every_output_by_default(case):
    rows = fmpy.simulate_fmu(case["fmus"]["tie"], stop_time=4 * STEP, output_interval=STEP)
    description = fmpy.read_model_description(case["fmus"]["tie"])
    assert set(rows.dtype.names[1:]) == {v.name for v in description.modelVariables if v.causality == "output"}


def test_a_coarser_output_interval(case):
    """Steps of four times the length, with every fourth value of the inputs."""
    inputs = {name: values[:STEPS:4] for name, values in case["inputs"]["tie"].items()}
    found = simulate(case, input=signals(case["inputs"]["tie"])[::4], output_interval=4 * STEP)
    coarse = plain({**case, "step": 4 * STEP, "steps": STEPS // 4, "inputs": {"tie": inputs}})
    same_bits({"tie": found[1:]}, coarse)


def test_what_it_logs(case, expected):
    said, called = [], []

    def logger(environment, instance, status, category, message):
        said.append((status, message))

    found = simulate(case, debug_logging=True, logger=logger, fmi_call_logger=called.append)
    same_bits({"tie": found[1:]}, {"tie": expected})
    assert all(status == fmi2.fmi2OK for status, _ in said)
    assert sum("fmi2DoStep" in line for line in called) == STEPS


def test_a_step_finished_stops_it(case, expected):
    found = simulate(case, step_finished=lambda time, recorder: time < 10 * STEP)
    np.testing.assert_array_equal(found[1:], expected[:10])


def test_an_instance_that_goes_on(case, expected):
    """fmu_instance, initialize, terminate, model_description: two runs of one instance, then one after a reset."""
    half = STEPS // 2
    instance = instantiated(case["fmus"]["tie"])
    given = {"fmu_instance": instance, "model_description": fmpy.read_model_description(case["fmus"]["tie"])}
    first = simulate(case, stop_time=half * STEP, terminate=False, set_stop_time=False, **given)
    second = simulate(case, start_time=half * STEP, initialize=False, **given)
    np.testing.assert_array_equal(np.vstack([first[1:], second[1:]]), expected)
    instance.reset()
    same_bits({"tie": simulate(case, **given)[1:]}, {"tie": expected})
    instance.freeInstance()


def test_a_state_to_start_from(case, expected):
    half = STEPS // 2
    instance = instantiated(case["fmus"]["tie"])
    simulate(case, stop_time=half * STEP, terminate=False, set_stop_time=False, fmu_instance=instance)
    state = instance.getFMUState()
    for _ in range(2):
        found = simulate(case, start_time=half * STEP, fmu_instance=instance, fmu_state=state, terminate=False)
        np.testing.assert_array_equal(found[1:], expected[half:])
    instance.freeFMUState(state)
    instance.freeInstance()


def test_input_derivatives(case):
    """FMPy gives the slope of the interval before, and has room for nine inputs."""
    inputs = {name: values[:STEPS] for name, values in list(case["inputs"]["tie"].items())[:9]}
    slopes = {name: [0.0] + [(b - a) / STEP for a, b in itertools.pairwise(values)] for name, values in inputs.items()}
    moved = {**case, "inputs": {"tie": inputs}, "derivatives": {"tie": slopes}}
    expected = plain(moved)
    same_bits({"tie": simulate(case, input=signals(inputs), set_input_derivatives=True)[1:]}, expected)
    held = plain({**moved, "derivatives": {}})["tie"]
    assert np.abs(expected["tie"] - held).max() > 1e-3 * np.abs(held).max()


def test_a_serialized_state_in_a_new_instance(case, expected):
    half = STEPS // 2
    instance = instantiated(case["fmus"]["tie"])
    simulate(case, stop_time=half * STEP, terminate=False, set_stop_time=False, fmu_instance=instance)
    state = instance.getFMUState()
    data = instance.serializeFMUState(state)
    instance.freeFMUState(state)
    instance.freeInstance()
    np.testing.assert_array_equal(simulate(case, start_time=half * STEP, fmu_state=data)[1:], expected[half:])


# --------------------------------------------------------------------------------------------------------- cross-check


def cross_check(case, sign: float, folder) -> list[str]:
    """What `python -m fmpy.cross_check` says of the tie, its inputs, and `sign` times the results of a plain sequence
    of calls: a word for description, options, inputs, reference, simulation and result."""
    description = fmpy.read_model_description(case["fmus"]["tie"])
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    inputs = {v.name: [0.0] * STEPS for v in description.modelVariables if v.causality == "input"}
    inputs |= case["inputs"]["tie"]
    reference = np.empty(STEPS, dtype=[("time", float)] + [(name, float) for name in outputs])
    reference["time"] = STEP * np.arange(1, STEPS + 1)
    values = plain({**case, "inputs": {"tie": inputs}, "outputs": {"tie": outputs}})["tie"]
    for name, column in zip(outputs, values.T):
        reference[name] = sign * column

    place = folder / "2.0" / "cs" / fmpy.platform / "tiefmu" / "1" / "tie"  # as in the FMI project's own collection
    place.mkdir(parents=True)
    shutil.copy(case["fmus"]["tie"], place / "tie.fmu")
    (place / "tie_ref.opt").write_text(f"StartTime, 0.0\nStopTime, {STEPS * STEP}\nStepSize, {STEP}\nRelTol, 1e-6\n")
    write_csv(place / "tie_in.csv", signals(inputs))
    write_csv(place / "tie_ref.csv", reference)
    report = folder / "report.html"
    call(sys.executable, "-m", "fmpy.cross_check", "--fmus_dir", folder, "--report", report, "--simulate", cwd=folder)
    cells = re.findall(r'label label-(\w+)"[^>]*>([^<]*)<', report.read_text())
    assert len(cells) == 7
    del cells[4]  # of the documentation
    return [word for word, _ in cells]


def test_cross_check(case, tmp_path):
    assert cross_check(case, 1.0, tmp_path) == ["success"] * 6


def test_cross_check_sees_other_results(case, tmp_path):
    assert cross_check(case, -1.0, tmp_path) == ["success"] * 5 + ["danger"]
