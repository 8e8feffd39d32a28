"""The FMU's C functions, call by call: where each is allowed, what it refuses, and what it leaves unchanged."""

import ctypes
import math
import os
import struct
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from urllib.parse import quote

import fmi3_calls
import numpy as np
import pytest
from fmu_calls import DISCARD, ERROR, MODEL_EXCHANGE, OK, Instance, diverged
from fmu_scenes import random_values

# ------------------------------------------------------------------------------------------- the library and its states

COMMON = [
    "GetTypesPlatform",
    "GetVersion",
    "SetDebugLogging",
    "Instantiate",
    "FreeInstance",
    "SetupExperiment",
    "EnterInitializationMode",
    "ExitInitializationMode",
    "Terminate",
    "Reset",
    "GetReal",
    "GetInteger",
    "GetBoolean",
    "GetString",
    "SetReal",
    "SetInteger",
    "SetBoolean",
    "SetString",
    "GetFMUstate",
    "SetFMUstate",
    "FreeFMUstate",
    "SerializedFMUstateSize",
    "SerializeFMUstate",
    "DeSerializeFMUstate",
    "GetDirectionalDerivative",
]
CO_SIMULATION = [
    "SetRealInputDerivatives",
    "GetRealOutputDerivatives",
    "DoStep",
    "CancelStep",
    "GetStatus",
    "GetRealStatus",
    "GetIntegerStatus",
    "GetBooleanStatus",
    "GetStringStatus",
]


def elf_exports(data: bytes) -> set[str]:
    """Defined symbols of an ELF64 file's dynamic symbol table."""
    offset, size, count = struct.unpack_from("<Q", data, 40)[0], *struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, offset + k * size) for k in range(count)]
    symbols = next(s for s in sections if s[1] == 11)
    names = sections[symbols[6]][4]
    found = set()
    for at in range(symbols[4], symbols[4] + symbols[5], 24):
        name, info, _, section = struct.unpack_from("<IBBH", data, at)
        if section and info >> 4:
            found.add(data[names + name : data.index(b"\0", names + name)].decode())
    return found


def test_the_library_shows_the_functions_of_the_standards_and_nothing_else(fmu):
    expected = {"fmi2" + name for name in COMMON + CO_SIMULATION + MODEL_EXCHANGE} | fmi3_calls.functions()
    data = fmu.binary.read_bytes()
    if data[:4] == b"\x7fELF":
        assert elf_exports(data) == expected
    for name in expected:
        assert hasattr(fmu.library, name)


def test_version_and_platform(fmu):
    for name, text in (("fmi2GetVersion", b"2.0"), ("fmi2GetTypesPlatform", b"default")):
        function = getattr(fmu.library, name)
        function.restype = c_char_p
        assert function() == text


# FMI 2.0, table in 4.2.4, for the states that this FMU can be in.
ALLOWED = {
    "SetDebugLogging": "instantiated initializationMode stepComplete terminated error",
    "SetupExperiment": "instantiated",
    "EnterInitializationMode": "instantiated",
    "ExitInitializationMode": "initializationMode",
    "Terminate": "stepComplete",
    "Reset": "instantiated initializationMode stepComplete terminated error",
    "GetReal": "initializationMode stepComplete terminated error",
    "GetInteger": "initializationMode stepComplete terminated error",
    "GetBoolean": "initializationMode stepComplete terminated error",
    "GetString": "initializationMode stepComplete terminated error",
    "SetReal": "instantiated initializationMode stepComplete",
    "SetInteger": "instantiated initializationMode stepComplete",
    "SetBoolean": "instantiated initializationMode stepComplete",
    "SetString": "instantiated initializationMode stepComplete",
    "GetFMUstate": "instantiated initializationMode stepComplete terminated error",
    "SetFMUstate": "instantiated initializationMode stepComplete terminated error",
    "FreeFMUstate": "instantiated initializationMode stepComplete terminated error",
    "SerializedFMUstateSize": "instantiated initializationMode stepComplete terminated error",
    "SerializeFMUstate": "instantiated initializationMode stepComplete terminated error",
    "DeSerializeFMUstate": "instantiated initializationMode stepComplete terminated error",
    "GetDirectionalDerivative": "initializationMode stepComplete terminated error",
    "SetRealInputDerivatives": "instantiated initializationMode stepComplete",
    "GetRealOutputDerivatives": "stepComplete terminated error",
    "DoStep": "stepComplete",
    "CancelStep": "",
    "GetStatus": "stepComplete terminated",
    "GetRealStatus": "stepComplete terminated",
    "GetIntegerStatus": "stepComplete terminated",
    "GetBooleanStatus": "stepComplete terminated",
    "GetStringStatus": "stepComplete terminated",
}


def instance_in(state, fmu) -> Instance:
    if state == "error":
        return diverged(fmu)
    instance = Instance(fmu)
    if state == "initializationMode":
        assert instance.call("EnterInitializationMode") == OK
    elif state != "instantiated":
        instance.start()
        if state == "terminated":
            assert instance.call("Terminate") == OK
    return instance


@pytest.mark.parametrize("state", ["instantiated", "initializationMode", "stepComplete", "terminated", "error"])
def test_calls_are_allowed_where_the_standard_says(loose, state):
    nothing, value = (None, c_size_t(0), None), (c_double * 1)()
    saved, size, data = c_void_p(), c_size_t(), ctypes.create_string_buffer(100000)
    arguments = {
        "SetDebugLogging": (1, c_size_t(0), None),
        "SetupExperiment": (0, c_double(0), c_double(0), 0, c_double(0)),
        "EnterInitializationMode": (),
        "ExitInitializationMode": (),
        "Terminate": (),
        "Reset": (),
        **{
            get_or_set + kind: nothing
            for get_or_set in ("Get", "Set")
            for kind in ("Real", "Integer", "Boolean", "String")
        },
        "GetFMUstate": (byref(c_void_p()),),
        "FreeFMUstate": (byref(c_void_p()),),
        "SerializedFMUstateSize": (saved, byref(size)),
        "SerializeFMUstate": (saved, data, c_size_t(len(data))),
        "DeSerializeFMUstate": (data, size, byref(c_void_p())),
        "SetFMUstate": (saved,),
        "GetDirectionalDerivative": (None, c_size_t(0), None, c_size_t(0), None, None),
        "SetRealInputDerivatives": (None, c_size_t(0), None, None),
        "GetRealOutputDerivatives": (None, c_size_t(0), None, None),
        "DoStep": (c_double(0), c_double(0.1), 0),
        "CancelStep": (),
        "GetStatus": (0, value),
        "GetRealStatus": (2, value),
        "GetIntegerStatus": (2, value),
        "GetBooleanStatus": (3, value),
        "GetStringStatus": (1, value),
    }
    assert set(arguments) == set(ALLOWED)
    for function, states in ALLOWED.items():
        instance = instance_in(state, loose)
        saved.value = instance.save().value
        assert instance.call("SerializedFMUstateSize", saved, byref(size)) == OK
        assert instance.call("SerializeFMUstate", saved, data, size) == OK
        said = len(instance.errors())
        status = instance.call(function, *arguments[function])
        if state in states.split():
            assert status in (OK, DISCARD) and len(instance.errors()) == said, function
        else:
            assert status == ERROR, function
            assert instance.errors()[said:] == [f"fmi2{function}: not allowed in state {state}"]
            if state != "error":  # a refused call changes nothing
                assert instance.call("GetReal" if state != "instantiated" else "SetReal", *nothing) == OK
        instance.free()


def test_no_instance_is_an_error_without_a_crash(fmu):
    for name in COMMON + CO_SIMULATION + MODEL_EXCHANGE:
        if name not in ("GetTypesPlatform", "GetVersion", "Instantiate", "FreeInstance"):
            assert getattr(fmu.library, "fmi2" + name)(None, *[None] * 7) == ERROR
    fmu.library.fmi2FreeInstance(None)


@pytest.mark.parametrize("name", MODEL_EXCHANGE)
def test_model_exchange_calls_are_refused_and_change_nothing(fmu, name):
    instance = Instance(fmu).start()
    assert instance.call(name, *([c_double(1.0)] if name == "SetTime" else [None] * 3)) == ERROR
    assert instance.errors() == [f"fmi2{name}: only co-simulation is supported"]
    assert instance.step(0, 0.01) == OK
    instance.free()


def test_status_of_a_step(fmu):
    instance = Instance(fmu).start(time=1.0)
    assert instance.step(1.0, 0.25) == OK
    time, over = c_double(-1), c_int(-1)
    assert instance.call("GetRealStatus", 2, byref(time)) == OK and time.value == 1.25
    assert instance.call("GetBooleanStatus", 3, byref(over)) == OK and over.value == 0
    assert instance.call("GetRealStatus", 0, byref(time)) == DISCARD and time.value == 1.25
    assert instance.call("GetStringStatus", 1, byref(c_char_p())) == DISCARD
    assert {instance.call(name, 0, byref(c_int())) for name in ("GetStatus", "GetIntegerStatus")} == {DISCARD}
    instance.free()


def test_variables_are_real_only(fmu):
    instance = Instance(fmu).start()
    for kind in ("Integer", "Boolean", "String"):
        for function in ("Get", "Set"):
            assert instance.call(function + kind, (c_uint * 1)(0), c_size_t(1), (c_void_p * 1)()) == ERROR
            assert instance.errors()[-1] == f"fmi2{function}{kind}: all variables are of type Real"
    instance.free()


# ------------------------------------------------------------------------------------------------------- instantiation


def refused(fmu, **arguments) -> str:
    instance = Instance(fmu, **arguments)
    assert instance.component is None
    assert [message[2:4] for message in instance.log] == [(ERROR, "logStatusError")]
    return instance.log[0][5]


def test_wrong_guid(fmu):
    message = refused(fmu, guid="{wrong %s%n}")
    assert fmu.description.guid in message and "{wrong %s%n}" in message


def test_model_exchange_is_refused(fmu):
    assert refused(fmu, kind=0) == "fmi2Instantiate: only co-simulation is supported"


def test_missing_resource(fmu, tmp_path):
    assert "cannot read" in refused(fmu, location=tmp_path.as_uri())
    assert "scene.bin" in refused(fmu, location=str(tmp_path))
    assert "http://" in refused(fmu, location="http://host/resources")
    assert "otherhost" in refused(fmu, location="file://otherhost/resources")


def test_null_arguments(fmu):
    callbacks = Instance(fmu).callbacks
    location = (fmu.folder / "resources").as_uri().encode()
    good = [b"tie", 1, fmu.description.guid.encode(), location, byref(callbacks), 0, 0]
    for place in (0, 2, 3, 4):
        assert fmu.library.fmi2Instantiate(*good[:place], None, *good[place + 1 :]) is None


def test_a_logger_may_be_missing(fmu):
    instance = Instance(fmu)
    silent = type(instance.callbacks)()
    location = (fmu.folder / "resources").as_uri().encode()
    component = fmu.library.fmi2Instantiate(b"tie", 1, fmu.description.guid.encode(), location, byref(silent), 0, 1)
    assert component
    assert fmu.library.fmi2Terminate(c_void_p(component)) == ERROR
    fmu.library.fmi2FreeInstance(c_void_p(component))
    assert fmu.library.fmi2Instantiate(b"tie", 1, b"wrong", location, byref(silent), 0, 1) is None
    instance.free()


def test_an_instance_has_a_name(fmu):
    """FMI 2.0, section 2.1.5: at least one character that is not white space."""
    for name in ("", " ", "\t \n"):
        assert refused(fmu, name=name) == "fmi2Instantiate: the instance name is empty or blank"
    Instance(fmu, name=" a ").start().free()


@pytest.mark.parametrize(
    "form", ["{uri}", "{uri}/", "{single}", "{local}", "{path}", "{path}/", "{capitals}", "{mixed}", "{encoded}"]
)
def test_forms_of_the_resource_location(fmu, tmp_path, form):
    folder = tmp_path / "a b%c ü"
    folder.mkdir()
    (folder / "scene.bin").write_bytes((fmu.folder / "resources" / "scene.bin").read_bytes())
    uri = folder.as_uri()
    location = form.format(
        uri=uri,
        single=uri.replace("file:///", "file:/"),
        path=folder,
        local=uri.replace("file:///", "file://localhost/"),
        capitals=uri.replace("file:", "FILE:"),
        mixed=uri.replace("file:", "File:"),
        encoded="file://" + quote(str(folder), safe=""),  # every slash as %2F
    )
    before = os.getcwd()
    instance = Instance(fmu, location=location)
    assert instance.component, instance.log
    assert os.getcwd() == before
    instance.free()


def checksum(body: bytes) -> int:
    value = 14695981039346656037
    for byte in body:
        value = (value ^ byte) * 1099511628211 % 2**64
    return value


def test_damaged_resources_end_in_a_message(loose, tmp_path):
    """Cut anywhere; any byte changed; and changed with the checksum put right, so that the reader must see it."""
    good = (loose.folder / "resources" / "scene.bin").read_bytes()
    header = len(b"tiefmu scene\n") + 4 + 8 + 8
    rng = np.random.default_rng(7)

    def attempt(data):
        (tmp_path / "scene.bin").write_bytes(data)
        return Instance(loose, location=str(tmp_path))

    for length in [*range(header + 2), *rng.integers(header, len(good), 50)]:
        assert attempt(good[:length]).component is None
    for at in [*range(header), *rng.integers(header, len(good), 50)]:
        assert attempt(good[:at] + bytes([good[at] ^ rng.integers(1, 256)]) + good[at + 1 :]).component is None
    accepted = 0
    for _ in range(400):
        body = bytearray(good[header:])
        for at in rng.integers(1, len(body), rng.integers(1, 4)):
            body[at] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.integers(256)])
        instance = attempt(good[: header - 8] + struct.pack("<Q", checksum(body)) + bytes(body))
        if instance.component:  # a changed number, say
            accepted += 1
            instance.free()
        else:
            assert len(instance.log) == 1 and "\n" not in instance.log[0][5]
    assert 0 < accepted < 400


# -------------------------------------------------------------------------------------------------------- get and set


def test_gets_in_any_order_give_the_same(any_fmu):
    rng = np.random.default_rng(8)
    instance = Instance(any_fmu).start(values=random_values(any_fmu, rng, any_fmu.names("input")))
    assert instance.step(0, 0.01) == OK
    count = len(any_fmu.reference)
    status, everything = instance.get_references(range(count))
    assert status == OK and np.isfinite(everything).all()
    for order in (rng.permutation(count), rng.integers(0, count, 3 * count), np.arange(count)[::-1]):
        np.testing.assert_array_equal(instance.get_references(order.tolist())[1], everything[order])
    assert instance.get_references([])[0] == OK
    instance.free()


def test_sets_in_any_order_arrive(any_fmu):
    rng = np.random.default_rng(9)
    instance = Instance(any_fmu).start()
    inputs = np.array([any_fmu.reference[name] for name in any_fmu.names("input")])
    for order in (np.sort(inputs), rng.permutation(inputs), inputs):
        values = rng.normal(size=len(order))
        assert instance.set_references(order.tolist(), values.tolist()) == OK
        np.testing.assert_array_equal(instance.get_references(order.tolist())[1], values)
    instance.free()


def test_outputs_follow_inputs_at_the_same_time(tmp_path, fmu):
    instance = Instance(fmu).start()
    before = instance.get(["master[1].f[1]", "slave[1].v[1]"])
    assert instance.set({"slave[1].f[1]": 5.0, "master[1].v[1]": 2.0, "master[2].v[1]": 2.0}) == OK
    assert (instance.get(["master[1].f[1]", "slave[1].v[1]"]) != before).all()
    instance.free()


def test_the_last_outputs_can_be_read_after_termination(any_fmu):
    read, unread = Instance(any_fmu).start(), Instance(any_fmu).start()
    for instance in (read, unread):
        assert instance.set(random_values(any_fmu, np.random.default_rng(21), any_fmu.names("input"))) == OK
        assert instance.step(0, 0.02) == OK
    expected = read.get(any_fmu.names("output"))
    assert unread.call("Terminate") == OK
    np.testing.assert_array_equal(unread.get(any_fmu.names("output")), expected)
    read.free()
    unread.free()


@pytest.mark.parametrize(
    "value, text", [(np.nan, "NaN"), (np.inf, "an infinite value"), (-np.inf, "an infinite value")]
)
def test_values_that_are_not_finite_change_nothing(fmu, value, text):
    instance = Instance(fmu).start(values={"slave[1].f[1]": 1.5})
    names = fmu.names("input")
    before = instance.get(names + fmu.names("output"))
    values = dict.fromkeys(names, 3.0) | {"slave[2].f[3]": value}
    assert instance.set(values) == ERROR
    assert instance.errors() == [f"fmi2SetReal: variable 'slave[2].f[3]' cannot be set to {text}"]
    np.testing.assert_array_equal(instance.get(names + fmu.names("output")), before)
    assert instance.step(0, 0.01) == OK
    instance.free()


def test_unknown_value_references(fmu):
    instance = Instance(fmu).start()
    count = len(fmu.reference)
    good = fmu.reference["slave[1].f[1]"]
    for wrong in (count, 2**32 - 1):
        assert instance.set_references([good, wrong], [9.0, 9.0]) == ERROR
        assert instance.errors()[-1] == f"fmi2SetReal: unknown value reference {wrong}; there are {count}"
        assert instance.get_references([good, wrong])[0] == ERROR
    assert instance.get(["slave[1].f[1]"])[0] == 0
    instance.free()


def test_null_arrays(fmu):
    instance = Instance(fmu).start()
    reference, value = (c_uint * 1)(0), (c_double * 1)()
    for function in ("GetReal", "SetReal"):
        assert instance.call(function, None, c_size_t(1), value) == ERROR
        assert instance.call(function, reference, c_size_t(1), None) == ERROR
        assert instance.call(function, None, c_size_t(0), None) == OK
    assert instance.call("GetFMUstate", None) == ERROR
    assert instance.call("GetRealStatus", 2, None) == ERROR
    instance.free()


def test_only_inputs_and_in_time_parameters_can_be_set(fmu):
    instance = Instance(fmu)
    for states, parameter in (("instantiated", OK), ("initialization", OK), ("step", ERROR)):
        if states == "initialization":
            assert instance.call("EnterInitializationMode") == OK
        if states == "step":
            assert instance.call("ExitInitializationMode") == OK
        assert instance.set({"slave[1].f[1]": 0.5}) == OK
        for name, why in (
            ("slave[1].v[1]", "is an output"),
            ("master[3].v[2]", "is an output"),
            ("master[1].added_mass", "is calculated"),
            ("stable_time_step", "is an output"),
        ):
            assert instance.set({"slave[1].f[1]": 0.7, name: 1.0}) == ERROR
            assert instance.errors()[-1] == f"fmi2SetReal: variable '{name}' {why} and cannot be set"
        assert instance.set({"slave[1].mass": 1.25 if parameter == OK else 1.5}) == parameter
    assert instance.errors()[-1] == (
        "fmi2SetReal: variable 'slave[1].mass' is fixed after the initialisation and cannot be set"
    )
    assert instance.get(["slave[1].f[1]", "slave[1].mass"]).tolist() == [0.5, 1.25]
    instance.free()


def test_a_fixed_parameter_may_be_set_again_to_what_it_is(fmu):
    """Some importers set all parameters before every run. Any change is refused, and with it the whole call."""
    names = ["integrator.safety", "slave[1].mass", "slave[2].mass"]
    instance = Instance(fmu).start(values={"slave[2].mass": 1.25})
    values = instance.get(names).tolist()
    for _ in range(2):
        assert instance.set(dict(zip(names, values)) | {"slave[1].f[1]": 0.5}) == OK
        assert instance.step(0.01 * _, 0.01) == OK
    before = instance.get(fmu.names("output"))
    for changed in (np.nextafter(1.25, 2), math.nan):
        assert instance.set(dict(zip(names[:2], values)) | {"slave[1].f[1]": 0.7, "slave[2].mass": changed}) == ERROR
        assert instance.errors()[-1] == (
            "fmi2SetReal: variable 'slave[2].mass' is fixed after the initialisation and cannot be set"
        )
    np.testing.assert_array_equal(instance.get(fmu.names("output")), before)
    assert instance.get(names).tolist() == values and instance.get(["slave[1].f[1]"]).tolist() == [0.5]
    instance.free()


def test_parameters_act_at_once_in_initialization_mode(loose):
    instance = Instance(loose)
    assert instance.set({"slave[1].mass": 2.0}) == OK
    assert instance.call("EnterInitializationMode") == OK
    first = instance.get(["master[1].added_mass", "master[2].added_mass"])
    assert instance.set({"slave[1].mass": 4.0}) == OK
    np.testing.assert_allclose(instance.get(["master[1].added_mass", "master[2].added_mass"]), 2 * first, rtol=1e-15)
    assert instance.call("ExitInitializationMode") == OK
    np.testing.assert_allclose(instance.get(["master[1].added_mass"]), 2 * first[:1], rtol=1e-15)
    instance.free()


def test_parameters_that_make_no_sense_are_an_error_and_reset_recovers(loose):
    instance = Instance(loose)
    assert instance.set({"slave[1].mass": -40.0}) == OK
    assert instance.call("EnterInitializationMode") == OK
    assert instance.call("ExitInitializationMode") == ERROR
    assert instance.errors()[-1].startswith("fmi2ExitInitializationMode: ")
    assert instance.call("Reset") == OK
    instance.start()
    assert instance.get(["slave[1].mass"])[0] == 1.0
    instance.free()
