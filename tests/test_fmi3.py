"""FMI 3.0: the same numbers as by FMI 2.0, in arrays; and what only FMI 3.0 has."""

import ctypes
from ctypes import byref, c_bool, c_double, c_size_t, c_uint32, c_void_p
from pathlib import Path

import fmi3_calls
import fmu_calls
import numpy as np
import pytest
import tiefmu
from fmi3_calls import ERROR, OK, Fmu, Instance
from fmpy.validation import validate_fmu
from fmu_scenes import ALL_FREE, DRIVEN, MIXED, SETTINGS, scene
from port_scenes import ported

SCENES = sorted((Path(__file__).parents[1] / "scenes").glob("*.toml"))
KINDS = [*SETTINGS, "ports"]


def made(kind, seed=1) -> dict:
    if kind == "ports":
        return ported(np.random.default_rng(seed), ("default", True, "consistent", "split", "finite"), motions="mixed")
    return scene(np.random.default_rng(seed), *kind)


def name_of(kind) -> str:
    return kind if isinstance(kind, str) else "-".join(map(str, kind))


@pytest.fixture(params=KINDS, ids=name_of)
def both(request, tmp_path) -> tuple[Fmu, fmu_calls.Fmu]:
    return Fmu(made(request.param), tmp_path), fmu_calls.Fmu(made(request.param), tmp_path)


@pytest.fixture
def mixed(tmp_path) -> Fmu:
    return Fmu(made(MIXED), tmp_path)


@pytest.fixture
def free(tmp_path) -> Fmu:
    return Fmu(made(ALL_FREE), tmp_path)


def scalars(fmu: Fmu, names) -> list[str]:
    """Names by FMI 2.0 of the elements of arrays."""
    return [e.name for name in names for e in fmu.elements if e.array.name == name]


def random_inputs(fmu: Fmu, rng) -> dict[str, np.ndarray]:
    size = {"r": 0.0, "v": 0.1, "w": 0.1}
    found = {}
    for name in fmu.names("input"):
        last = name.split(".")[1]
        start = np.array([float(x) for x in fmu.arrays[name].start.split()])
        found[name] = start + size.get(last, 1.0) * rng.standard_normal(fmu.size(name))
    return found


@pytest.mark.parametrize(
    "path", [p for p in SCENES if p.stem not in ("bracket", "mesh_transition")], ids=lambda p: p.stem
)
def test_example_scenes_are_valid(tmp_path, path):
    assert validate_fmu(str(tiefmu.build(tiefmu.load(path), tmp_path / "scene.fmu", fmi=3))) == []


def test_every_kind_of_scene_has_the_variables_of_its_other_fmu(both):
    three, two = both
    assert validate_fmu(str(three.path)) == []
    values = [e for e in three.elements if e.type == "Real"]
    assert {e.name for e in values} == set(two.variables)
    for e in values:
        other = two.variables[e.name]
        assert (e.causality, e.unit or e.declaredType.unit) == (other.causality, other.unit)
        assert e.start == other.start
        if e.array.shape:
            assert e.description.split(" (")[-1] == other.description.split(" (")[-1]  # the node


def test_same_bits_as_by_fmi_2(both):
    three, two = both
    rng = np.random.default_rng(5)
    a, b = Instance(three).start(), fmu_calls.Instance(two).start()
    inputs, outputs = three.names("input"), three.names("output")
    names, read = scalars(three, inputs), scalars(three, outputs)
    time = 0.0
    for _ in range(5):
        values = random_inputs(three, rng)
        assert a.set(values) == OK
        assert b.set(dict(zip(names, np.concatenate(list(values.values()))))) == OK
        assert (a.get(*outputs) == b.get(read)).all()
        assert a.step(time, 1e-4) == (OK, False, time + 1e-4)
        assert b.step(time, 1e-4) == OK
        time += 1e-4
        assert (a.get(*outputs) == b.get(read)).all()
    assert a.get("time") == [time]
    calculated = three.names("calculatedParameter")
    assert (a.get(*calculated) == b.get(scalars(three, calculated))).all()
    a.free(), b.free()


def test_ids_are_those_of_the_elements(both):
    three, _ = both
    instance = Instance(three).start()
    for name in three.names("local"):
        variable = three.arrays[name]
        if variable.type == "Int64":
            assert instance.ids(name) == [int(text) for text in variable.start.split()]
        else:
            assert set(instance.labels(name)) <= {port["name"] for port in made("ports")["interface"]["ports"]}
    instance.free()


# ------------------------------------------------------------------------------------ derivatives


def test_directional_derivatives_are_those_of_fmi_2(both):
    three, two = both
    a, b = Instance(three).start(), fmu_calls.Instance(two).start()
    values = random_inputs(three, np.random.default_rng(2))
    knowns, unknowns = three.names("input"), three.names("output")
    assert a.set(values) == OK
    assert b.set(dict(zip(scalars(three, knowns), np.concatenate(list(values.values()))))) == OK
    seed = np.random.default_rng(3).standard_normal(sum(map(three.size, knowns)))
    change = a.derivative("Directional", unknowns, knowns, seed)
    expected = (c_double * len(change))()
    known, unknown = ([two.reference[n] for n in scalars(three, names)] for names in (knowns, unknowns))
    status = b.call(
        "GetDirectionalDerivative",
        (c_uint32 * len(unknown))(*unknown),
        c_size_t(len(unknown)),
        (c_uint32 * len(known))(*known),
        c_size_t(len(known)),
        seed.ctypes,
        expected,
    )
    assert status == OK
    assert (change == np.array(expected[:])).all()
    a.free(), b.free()


def test_dependencies_of_elements_hold_every_influence(mixed):
    """What an element does not depend on does not change it; and the arrays are those of the description."""
    instance = Instance(mixed).start()
    assert instance.set(random_inputs(mixed, np.random.default_rng(4))) == OK
    inputs = mixed.names("input")
    by_reference = {v.valueReference: v.name for v in mixed.description.modelVariables}
    listed = {u.variable.name: u for u in mixed.description.outputs}
    for name in mixed.names("output"):
        found = instance.dependencies(name)
        arrays = {by_reference[reference] for _, reference, _, _ in found}
        stated = listed[name].dependencies
        if stated is not None:
            assert arrays == {v.name for v in stated}
            kinds = {v.name: kind for v, kind in zip(stated, listed[name].dependenciesKind or [])}
            words = {1: "constant", 2: "fixed", 5: "dependent"}
            strongest = {by_reference[r]: max(k for _, other, _, k in found if other == r) for _, r, _, _ in found}
            assert kinds == {known: words[kind] for known, kind in strongest.items()}
        allowed = {}
        for element, reference, independent, _ in found:
            allowed.setdefault(element, set()).add((by_reference[reference], independent))
        for known in inputs:
            for k in range(mixed.size(known)):
                seed = np.zeros(mixed.size(known))
                seed[k] = 1
                change = instance.derivative("Directional", [name], [known], seed)
                for element in np.flatnonzero(change) + 1:
                    assert {(known, 0), (known, k + 1)} & allowed.get(int(element), set()), (name, element, known, k)
    instance.free()


def test_output_derivatives(free):
    instance = Instance(free).start()
    name = "free_master.v" if "free_master.v" in free.arrays else "master.v"
    rates = np.full(free.size(name), np.nan)
    refs = instance.references([name])
    before = instance.get(name)
    assert instance.call("GetOutputDerivatives", *refs, (ctypes.c_int * 1)(1), rates.ctypes, c_size_t(len(rates))) == OK
    assert instance.step(0.0, 1e-7)[0] == OK
    np.testing.assert_allclose(instance.get(name), before + 1e-7 * rates, rtol=0, atol=1e-9 * np.abs(rates).max())
    assert (
        instance.call("GetOutputDerivatives", *refs, (ctypes.c_int * 1)(2), rates.ctypes, c_size_t(len(rates))) == ERROR
    )
    instance.free()


# ------------------------------------------------------------------------------------ states and substeps


def test_states_travel(mixed):
    rng = np.random.default_rng(6)
    first = Instance(mixed).start()
    assert first.set(random_inputs(mixed, rng)) == OK
    assert first.step(0.0, 1e-4)[0] == OK
    state, size = first.save(), c_size_t()
    assert first.call("SerializedFMUStateSize", state, byref(size)) == OK
    data = (ctypes.c_uint8 * size.value)()
    assert first.call("SerializeFMUState", state, data, size) == OK
    assert first.step(1e-4, 1e-4)[0] == OK
    expected = first.get(*mixed.names("output"))
    second, other = Instance(mixed).start(), c_void_p()
    assert second.call("DeserializeFMUState", data, size, byref(other)) == OK
    for instance, saved in ((first, state), (second, other)):
        assert instance.call("SetFMUState", saved) == OK
        assert instance.step(1e-4, 1e-4)[0] == OK
        assert (instance.get(*mixed.names("output")) == expected).all()
        assert instance.call("FreeFMUState", byref(saved)) == OK
        instance.free()


def test_inputs_may_follow_the_substeps(free):
    """Loads set after each substep are those of as many steps."""
    outputs, times = free.names("output"), []
    force = np.random.default_rng(7).standard_normal(free.size("slave.f"))

    def load(instance, time, _):
        times.append(time)
        assert instance.set({"slave.f": (1 + 0.1 * time) * force}) == OK
        instance.get(*outputs)
        assert instance.call("Terminate") == ERROR  # not in the middle of a step

    probe = Instance(free).start()
    step = 2.5 * probe.get("stable_time_step")[0]
    asked = Instance(free, update=load).start()
    assert asked.set({"slave.f": force}) == OK
    assert asked.step(0.0, step) == (OK, False, step)
    assert len(times) >= 2
    assert (np.diff([0.0, *times, step]) > 0).all()
    single = Instance(free).start()
    assert single.set({"slave.f": force}) == OK
    for begin, end in zip([0.0, *times], [*times, step]):
        if begin:
            assert single.set({"slave.f": (1 + 0.1 * begin) * force}) == OK
        assert single.step(begin, end - begin)[0] == OK
    np.testing.assert_allclose(asked.get(*outputs), single.get(*outputs), rtol=1e-12, atol=1e-12)
    for instance in (probe, asked, single):
        instance.free()


def test_a_step_may_end_early(free):
    ends = []

    def stop(_, time, allowed):
        assert allowed
        ends.append(time)
        return time if len(ends) == 3 else None

    instance = Instance(free, update=stop, early=True).start()
    step = 4 * instance.get("stable_time_step")[0]
    assert instance.step(0.0, step) == (OK, True, ends[2])
    assert instance.get("time") == [ends[2]]
    assert instance.step(ends[2], 1e-3 * step)[0] == OK
    instance.free()


def test_a_step_in_parts_that_must_be_refused_has_not_begun(free):
    asked = []
    instance = Instance(free, update=lambda *_: asked.append(1))
    assert instance.initialise(stop=1e-3) == OK
    assert instance.call("ExitInitializationMode") == OK
    step = 4 * instance.get("stable_time_step")[0]
    before = instance.get("time", *free.names("output"))
    for size in (step, 1e300):
        assert instance.step(0.0, size)[0] == ERROR
        assert "after the stop time" in instance.errors()[-1]
    assert not asked
    np.testing.assert_array_equal(instance.get("time", *free.names("output")), before)
    assert instance.step(0.0, 1e-3)[0] == OK
    instance.free()
    endless = Instance(free, update=lambda *_: asked.append(1)).start()
    assert endless.step(0.0, 1e15)[0] == ERROR
    assert "substeps" in endless.errors()[-1] and not asked
    assert endless.step(0.0, 1e-3)[0] == OK
    endless.free()


# ------------------------------------------------------------------------------------ what is refused


def test_what_is_refused_changes_nothing(mixed):
    instance = Instance(mixed).start()
    assert instance.set(random_inputs(mixed, np.random.default_rng(8))) == OK
    before, outputs = instance.get(*mixed.names("output")), mixed.names("output")
    one, n = instance.references(["slave.f"])
    values = np.zeros(mixed.size("slave.f") + 1)
    last = max(v.valueReference for v in mixed.description.modelVariables)
    unknown = (c_uint32 * 1)(last + 1)
    node = instance.references(["slave.node"])
    time = (c_uint32 * 1)(0)
    size = c_size_t(mixed.size("slave.f"))
    values[0] = np.nan
    calls = (
        (instance.call("SetFloat64", one, n, values.ctypes, c_size_t(len(values))), "values, not"),
        (instance.call("SetFloat64", one, n, None, size), "null pointer"),
        (instance.call("SetFloat64", None, n, values.ctypes, size), "null pointer"),
        (instance.call("SetFloat64", unknown, n, values.ctypes, size), f"unknown value reference {last + 1}"),
        (instance.call("SetFloat64", one, n, values.ctypes, size), "slave[1].f[1]' cannot be set to NaN"),
        (instance.call("SetFloat64", time, n, values.ctypes, c_size_t(1)), "independent"),
        (instance.call("SetFloat64", *node, values.ctypes, size), "not of type Float64"),
        (instance.set({outputs[0]: np.zeros(mixed.size(outputs[0]))}), "is an output"),
        (instance.call("GetFloat64", *node, values.ctypes, size), "not of type Float64"),
        (instance.call("GetInt64", one, n, values.ctypes, size), "not of type Int64"),
        (instance.call("GetFloat32", one, n, values.ctypes, size), "no such variable"),
        (instance.call("EnterEventMode"), "no events"),
        (instance.call("EnterConfigurationMode"), "no structural parameters"),
        (instance.call("SetTime", c_double(1)), "only co-simulation"),
        (instance.step(1.0, 1e-4)[0], "the step starts at"),
        (instance.step(0.0, -1.0)[0], "step size"),
        (instance.initialise(), "not allowed in state Step Mode"),
        (
            instance.call("GetVariableDependencies", c_uint32(last + 1), None, None, None, None, c_size_t(0)),
            "unknown value",
        ),
    )
    assert len(instance.errors()) == len(calls)
    for (status, message), error in zip(calls, instance.errors()):
        assert status == ERROR
        assert message in error
    assert (instance.get(*outputs) == before).all()
    assert instance.call("GetFloat32", None, c_size_t(0), None, c_size_t(0)) == OK
    instance.free()


ALWAYS = ["Instantiated", "Initialization Mode", "Step Mode", "Terminated"]
ALLOWED = {
    "EnterInitializationMode": ["Instantiated"],
    "ExitInitializationMode": ["Initialization Mode"],
    "Terminate": ["Step Mode"],
    "Reset": ALWAYS,
    "GetFloat64": ALWAYS[1:],
    "GetInt64": ALWAYS[1:],
    "GetString": ALWAYS[1:],
    "SetFloat64": ALWAYS[:3],
    "GetFMUState": ALWAYS,
    "GetNumberOfVariableDependencies": ALWAYS,
    "GetDirectionalDerivative": ALWAYS[1:],
    "GetAdjointDerivative": ALWAYS[1:],
    "GetOutputDerivatives": ALWAYS[2:],
    "DoStep": ["Step Mode"],
}


@pytest.mark.parametrize("function", ALLOWED)
def test_calls_are_allowed_where_the_standard_says(mixed, function):
    for state in ALWAYS:
        instance = Instance(mixed)
        for call in ("EnterInitializationMode", "ExitInitializationMode", "Terminate")[: ALWAYS.index(state)]:
            assert (instance.initialise() if call.startswith("Enter") else instance.call(call)) == OK
        nothing = None, c_size_t(0)
        flags = [byref(c_bool()) for _ in range(3)]
        arguments = {
            "EnterInitializationMode": (c_bool(False), c_double(0), c_double(0), c_bool(False), c_double(0)),
            "GetFMUState": (byref(c_void_p()),),
            "GetNumberOfVariableDependencies": (c_uint32(1), byref(c_size_t())),
            "GetDirectionalDerivative": nothing * 4,
            "GetAdjointDerivative": nothing * 4,
            "GetOutputDerivatives": (*nothing, None, *nothing),
            "DoStep": (c_double(0), c_double(1e-6), c_bool(True), *flags, byref(c_double())),
        }
        empty = () if function in ("ExitInitializationMode", "Terminate", "Reset") else nothing * 2
        status = instance.call(function, *arguments.get(function, empty))
        assert status == (OK if state in ALLOWED[function] else ERROR), state
        if status == ERROR:
            assert instance.errors() == [f"fmi3{function}: not allowed in state {state}"]
        instance.free()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"name": " "}, "empty or blank"),
        ({"token": "{other}"}, "GUID"),
        ({"path": "/nowhere/"}, "/nowhere/"),
        ({"events": True}, "no event mode"),
    ],
)
def test_what_is_not_instantiated(mixed, settings, message):
    instance = Instance(mixed, **settings)
    assert not instance.component
    assert message in instance.errors()[0]


def test_the_library_has_every_function_of_the_standard(mixed):
    assert len(fmi3_calls.functions()) > 70
    for name in fmi3_calls.functions():
        assert hasattr(mixed.library, name), name
    assert mixed.library.fmi3GetVersion() == b"3.0"
    for other in ("ModelExchange", "ScheduledExecution"):
        function = getattr(mixed.library, f"fmi3Instantiate{other}")
        function.restype = c_void_p
        assert function(b"x", b"", b"", c_bool(False), c_bool(False), None, None, None, None, None) is None


# ------------------------------------------------------------------------------------ other people's


def test_fmpy_runs_it(tmp_path):
    """Of inputs of one shape: FMPy takes no others."""
    from fmpy import simulate_fmu

    fmu = Fmu(made(DRIVEN), tmp_path)
    names = fmu.names("output")
    result = simulate_fmu(str(fmu.path), stop_time=1e-3, output_interval=1e-4, output=names)
    instance = Instance(fmu).start()
    for k in range(10):
        assert instance.step(k * 1e-4, (k + 1) * 1e-4 - k * 1e-4)[0] == OK
    for name in names:
        assert (np.ravel(result[name][-1]) == instance.get(name)).all()
    instance.free()


# ------------------------------------------------------------------------------------ the command line


def test_the_commands_take_both(tmp_path, command):
    scene_path = SCENES[[p.stem for p in SCENES].index("spotweld")]
    results = []
    for fmi in (2, 3):
        assert command("build", scene_path, "--fmi", fmi, "-o", f"{fmi}.fmu").returncode == 0
        done = command(
            "run",
            f"{fmi}.fmu",
            "--input",
            scene_path.with_suffix(".csv"),
            "--output",
            f"{fmi}.csv",
            "--stop-time",
            1e-4,
        )
        assert done.returncode == 0, done.stderr
        lines = (tmp_path / f"{fmi}.csv").read_text().splitlines()
        table = np.array([line.split(",") for line in lines[1:]])
        results.append(dict(zip(lines[0].split(","), table.T.tolist())))
        assert command("info", f"{fmi}.fmu").returncode == 0
    assert results[0] == results[1]
    assert "master.v" in command("info", "3.fmu", "--json").stdout
