"""A state as bytes: in the same process, in another one, and damaged."""

import struct
import subprocess
import sys
from ctypes import byref, c_char, c_double, c_size_t, c_void_p
from pathlib import Path

import numpy as np
import pytest
from fmu_calls import ERROR, OK, Fmu, Instance, set_derivatives
from fmu_scenes import MIXED, random_values, scene

MAGIC = b"tiefmu state\n"
HEADER = len(MAGIC) + 4 + 8 + 8


def serialised(instance, state) -> bytes:
    size = c_size_t(0)
    assert instance.call("SerializedFMUstateSize", state, byref(size)) == OK, instance.log
    data = (c_char * size.value)()
    assert instance.call("SerializeFMUstate", state, data, size) == OK, instance.log
    return bytes(data)


def restored(instance, data: bytes, state=None):
    """Status, and the state made of the bytes."""
    state = c_void_p() if state is None else state
    return instance.call("DeSerializeFMUstate", data, c_size_t(len(data)), byref(state)), state


def run(instance, time, steps, rng):
    """Outputs after each of some steps with random inputs."""
    fmu, rows = instance.fmu, []
    for k in range(steps):
        assert instance.set(random_values(fmu, rng, fmu.names("input"))) == OK, instance.log
        assert instance.step(time + 0.01 * k, 0.01) == OK, instance.log
        rows.append(instance.get(fmu.names("output")))
    return np.array(rows)


def test_a_state_continues_with_the_same_bits(any_fmu):
    one = Instance(any_fmu).start(time=1.0)
    run(one, 1.0, 3, np.random.default_rng(1))
    state = one.save()
    data = serialised(one, state)
    assert data.startswith(MAGIC) and serialised(one, state) == data
    expected = run(one, 1.03, 3, np.random.default_rng(2))

    other = Instance(any_fmu)
    status, state = restored(other, data)
    assert status == OK, other.log
    assert serialised(other, state) == data
    assert other.restore(state) == OK
    np.testing.assert_array_equal(run(other, 1.03, 3, np.random.default_rng(2)), expected)
    one.free(), other.free()


CONTINUE = """
import sys
from pathlib import Path
sys.path.insert(0, {tests!r})
import numpy as np
from fmu_calls import OK, Fmu, Instance
from test_fmu_serialisation import restored, run

fmu = Fmu(Path({fmu!r}), Path.cwd())
instance = Instance(fmu)
status, state = restored(instance, Path("state.bin").read_bytes())
assert status == OK and instance.restore(state) == OK, instance.log
np.save("rows.npy", run(instance, 0.03, 3, np.random.default_rng(4)))
"""


def test_another_process_continues_with_the_same_bits(any_fmu, tmp_path):
    instance = Instance(any_fmu).start()
    run(instance, 0.0, 3, np.random.default_rng(3))
    (tmp_path / "state.bin").write_bytes(serialised(instance, instance.save()))
    expected = run(instance, 0.03, 3, np.random.default_rng(4))
    code = CONTINUE.format(tests=str(Path(__file__).parent), fmu=str(any_fmu.path))
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)
    np.testing.assert_array_equal(np.load(tmp_path / "rows.npy"), expected)
    instance.free()


@pytest.mark.parametrize("stage", ["instantiated", "initializationMode", "stepComplete", "terminated"])
def test_every_stage_comes_back(any_fmu, stage):
    """Stage, stop time, parameters and inputs; then the same calls give the same bits."""
    rng = np.random.default_rng(5)
    values = random_values(any_fmu, rng, any_fmu.names("input") + any_fmu.names("parameter"))
    one = Instance(any_fmu)
    assert one.call("SetupExperiment", 0, c_double(0), c_double(2.0), 1, c_double(2.05)) == OK
    assert one.set(values) == OK
    for call in ("EnterInitializationMode", "ExitInitializationMode"):
        if stage != "instantiated" and not (stage == "initializationMode" and call.startswith("Exit")):
            assert one.call(call) == OK
    if stage == "terminated":
        assert one.call("Terminate") == OK
    other = Instance(any_fmu)
    status, state = restored(other, serialised(one, one.save()))
    assert status == OK and other.restore(state) == OK
    if stage == "terminated":
        assert other.step(2.0, 0.01) == ERROR and "terminated" in other.errors()[-1]
    else:
        for instance in (one, other):
            if stage == "instantiated":
                assert instance.call("EnterInitializationMode") == OK
            if stage != "stepComplete":
                assert instance.call("ExitInitializationMode") == OK
        names = list(any_fmu.reference)
        np.testing.assert_array_equal(one.get(names), other.get(names))
        np.testing.assert_array_equal(
            run(one, 2.0, 2, np.random.default_rng(6)), run(other, 2.0, 2, np.random.default_rng(6))
        )
        assert other.step(2.02, 0.1) == ERROR and "stop time" in other.errors()[-1]
    one.free(), other.free()


def test_inputs_that_move_travel_along(any_fmu):
    inputs, outputs = any_fmu.names("input"), any_fmu.names("output")
    one, other = Instance(any_fmu).start(), Instance(any_fmu)
    assert (
        set_derivatives(
            one, inputs + inputs, [1] * len(inputs) + [2] * len(inputs), np.linspace(-1, 1, 2 * len(inputs))
        )
        == OK
    )
    status, state = restored(other, serialised(one, one.save()))
    assert status == OK and other.restore(state) == OK
    for instance in (one, other):
        assert instance.step(0, 0.02) == OK
    np.testing.assert_array_equal(one.get(outputs), other.get(outputs))
    one.free(), other.free()


def test_a_known_state_is_overwritten_and_any_other_pointer_replaced(any_fmu):
    instance = Instance(any_fmu).start()
    first = instance.save()
    data = serialised(instance, first)
    assert instance.step(0, 0.01) == OK
    handle = first.value
    status, again = restored(instance, data, first)
    assert status == OK and again.value == handle
    status, wild = restored(instance, data, c_void_p(1))
    assert status == OK and wild.value not in (1, handle, None)
    for state in (first, wild):
        assert instance.restore(state) == OK
        assert instance.step(0, 0.01) == OK
        assert instance.call("FreeFMUstate", byref(state)) == OK and state.value is None
    instance.free()


# -------------------------------------------------------------------------------------------------------- damaged bytes


def checksum(body: bytes) -> int:
    """As the FMU computes it: four interleaved chains over little-endian words."""
    odd, mask = 0x9E3779B97F4A7C15, 2**64 - 1

    def mix(h, word):
        h ^= word
        return ((h << 29 | h >> 35) & mask) * odd & mask

    chain, whole = [1, 2, 3, 4], len(body) // 32 * 32
    for k, (word,) in enumerate(struct.iter_unpack("<Q", body[:whole])):
        chain[k % 4] = mix(chain[k % 4], word)
    for at in range(whole, len(body), 8):
        chain[0] = mix(chain[0], int.from_bytes(body[at : at + 8], "little"))
    value = len(body)
    for h in chain:
        value = mix(value, h)
    return value


def packed(body: bytes, version=4) -> bytes:
    return MAGIC + struct.pack("<IQQ", version, len(body), checksum(body)) + body


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An instance, its outputs, and its state as bytes."""
    fmu = Fmu(scene(np.random.default_rng(7), *MIXED), tmp_path_factory.mktemp("fmu"))
    instance = Instance(fmu).start()
    run(instance, 0.0, 2, np.random.default_rng(8))
    yield instance, serialised(instance, instance.save())
    instance.free()


def refusal(instance, data: bytes) -> str:
    """The message; the instance must be as before."""
    names = list(instance.fmu.reference)
    before = instance.get(names)
    status, state = restored(instance, data)
    assert status == ERROR and state.value is None
    np.testing.assert_array_equal(instance.get(names), before)
    message = instance.errors()[-1]
    assert message.startswith("fmi2DeSerializeFMUstate: ") and "\n" not in message
    return message


def test_the_checksum_of_the_tests_is_that_of_the_fmu(whole):
    assert packed(whole[1][HEADER:]) == whole[1]


def test_cut_short_anywhere(whole):
    instance, data = whole
    rng = np.random.default_rng(9)
    for length in [*range(HEADER + 60), *rng.integers(HEADER, len(data), 100).tolist(), len(data) - 1]:
        assert refusal(instance, data[:length])
    assert "bytes instead of" in refusal(instance, data + b"\0")
    assert "no state of a tiefmu FMU" in refusal(instance, b"")


def test_any_byte_altered(whole):
    instance, data = whole
    rng = np.random.default_rng(10)
    for at in [*range(HEADER + 60), *rng.integers(HEADER, len(data), 200).tolist()]:
        altered = bytearray(data)
        altered[at] ^= 1 << rng.integers(8)
        message = refusal(instance, bytes(altered))
        assert at < HEADER or "damaged" in message


def test_older_and_newer_versions(whole):
    instance, data = whole
    for version in (0, 1, 2, 3, 77):
        assert f"format version {version}, this FMU reads version 4" in refusal(
            instance, packed(data[HEADER:], version)
        )


def test_a_state_of_another_fmu(whole, tmp_path):
    instance, data = whole
    other = Fmu(scene(np.random.default_rng(17), *MIXED), tmp_path)  # of the same layout, with other positions
    stranger = Instance(other).start()
    message = refusal(stranger, data)
    assert "another FMU" in message and instance.fmu.description.guid in message
    stranger.free()


def test_forged_bytes_are_refused_or_harmless(whole):
    """Changed, with the checksum put right: what is accepted must be a state that can be set and stepped on, or that
    ends in an error, from which the old state leads back."""
    instance, data = whole
    names = list(instance.fmu.reference)
    keep, before = instance.save(), instance.get(names)
    rng = np.random.default_rng(12)
    accepted = 0
    for k in range(400):
        body = bytearray(data[HEADER:])
        for at in rng.integers(0, 120 if k % 2 else len(body), rng.integers(1, 4)):
            body[at] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.integers(256)])
        status, state = restored(instance, packed(bytes(body)))
        if status == OK:
            accepted += 1
            assert instance.restore(state) in (OK, ERROR)
            instance.get_references([0])
            assert instance.call("FreeFMUstate", byref(state)) == OK
            assert instance.restore(keep) == OK
        np.testing.assert_array_equal(instance.get(names), before)
    assert 0 < accepted < 400


def test_wrong_arguments(whole):
    instance, data = whole
    state, size, place = instance.save(), c_size_t(7), (c_char * len(data))()
    unknown = c_void_p(1)
    for function, arguments, words in (
        ("SerializedFMUstateSize", (unknown, byref(size)), "no state"),
        ("SerializedFMUstateSize", (None, byref(size)), "no state"),
        ("SerializedFMUstateSize", (state, None), "null pointer"),
        ("SerializeFMUstate", (unknown, place, c_size_t(len(data))), "no state"),
        ("SerializeFMUstate", (state, None, c_size_t(len(data))), "null pointer"),
        ("SerializeFMUstate", (state, place, c_size_t(len(data) - 1)), f"takes {len(data)} bytes"),
        ("DeSerializeFMUstate", (None, c_size_t(len(data)), byref(c_void_p())), "null pointer"),
        ("DeSerializeFMUstate", (data, c_size_t(len(data)), None), "null pointer"),
    ):
        assert instance.call(function, *arguments) == ERROR
        assert words in instance.errors()[-1]
    assert size.value == 7 and bytes(place) == bytes(len(data))
    roomy = (c_char * (len(data) + 9))()
    assert instance.call("SerializeFMUstate", state, roomy, c_size_t(len(data) + 9)) == OK
    assert bytes(roomy)[len(data) :] == bytes(9)
    instance.call("FreeFMUstate", byref(state))
