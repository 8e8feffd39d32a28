"""`tiefmu run` against FMPy's simulate_fmu to the bit, and what it writes against what it read."""

import csv
import ctypes
import re

import fmpy
import h5py
import numpy as np
import pyarrow.parquet
import pytest
import tiefmu
from tiefmu import fmu_instance, key_figures, results
from tiefmu.cli import main
from tiefmu.fmu_instance import Fmu, Instance
from tiefmu.report import of_fmu
from tiefmu.run import experiment, run, simulate
from tiefmu.signals import Inputs, communication_points, read_inputs

CSV = {
    "linear": "time,slave[1].f[3],master[1].v[3],master[2].v[1]\n0,0,1,0.3\n0.3,100,1,-0.7\n1,3,2,0\n",
    # jumps on and between the communication points, one of three rows, one at each end
    "jumps": "time,slave[1].f[3]\n0,0\n0,5\n0.3,5\n0.3,100\n0.55,7\n0.55,8\n0.55,9\n0.9,1\n1,1\n1,2\n",
    "one row": "time,slave[1].f[2],master[3].v[2]\n0,5,0.1\n",
    "starts later, ends earlier": "time,slave[1].f[3]\n0.2,1\n0.6,2\n",
    "none": None,
}


def scene_of(names: str) -> dict:
    return {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0], [9, 0.03, 0.06, 0.04]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "rotations": True, "mass": 1.0, "inertia": 1e-3}, {"nodes": [4], "motion": "free"}],
        "tie": [{"segments": "all", "slaves": [9]}],
        "spring": [{"ground": [4], "kind": "bushing", "stiffness": 1e3, "rotational_stiffness": 10.0}],
        "interface": {"expose": ["energy", "drift"], "names": names},
    }


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return tiefmu.build(tiefmu.load(scene_of("structured")), tmp_path_factory.mktemp("run") / "tie.fmu")


def of_fmpy(fmu, signals, stop, step):
    return fmpy.simulate_fmu(
        str(fmu),
        validate=False,
        stop_time=stop,
        output_interval=step,
        input=signals,
        output=[v.name for v in fmpy.read_model_description(fmu).modelVariables if v.causality == "output"],
    )


@pytest.mark.parametrize("case", CSV)
@pytest.mark.parametrize("stop, step", [(1.0, 0.05), (1.0, 0.07), (0.77, 0.1), (1.0, 0.9), (1.0, 3.0)])
def test_the_same_bits_as_simulate_fmu(fmu, tmp_path, case, stop, step):
    path = None
    if CSV[case]:
        path = tmp_path / "in.csv"
        path.write_text(CSV[case])
    description = fmpy.read_model_description(fmu)
    expected = of_fmpy(
        fmu, read_inputs(path, {v.name: v for v in description.modelVariables}) if path else None, stop, step
    )
    found, _ = run(fmu, stop, step, path)
    assert set(found.names) == set(expected.dtype.names[1:])
    for name in ["time", *found.names]:
        assert found[name].tobytes() == np.ascontiguousarray(expected[name]).tobytes(), name
    if case in ("linear", "jumps") and step < 0.5:
        assert np.ptp(found["slave[1].v[3]"]) > 0


def random_signals(random) -> np.ndarray:
    times = np.sort(random.choice(np.round(np.arange(0, 1.01, 0.05), 2), random.integers(1, 25)))
    signals = np.zeros(len(times), dtype=[("time", float), ("a", float), ("b", float)])
    signals["time"], signals["a"], signals["b"] = times, random.normal(size=len(times)), random.normal(size=len(times))
    return signals


class Variable:
    causality, type, variability = "input", "Real", "continuous"

    def __init__(self, name):
        self.name, self.valueReference = name, 0


@pytest.mark.parametrize("seed", range(60))
def test_interpolation_and_events_are_those_of_fmpy(seed):
    """On times drawn from a coarse grid, so that rows coincide with each other and with communication points."""
    from fmpy.simulation import Input

    random = np.random.default_rng(seed)
    signals = random_signals(random)
    inputs = Inputs(signals, [Variable("a"), Variable("b")])
    table = np.stack([signals["a"], signals["b"]])
    times = np.concatenate([signals["time"], np.arange(-0.1, 1.2, 0.05), random.uniform(0, 1, 20)])
    times = np.concatenate([times, times * (1 + 1e-10), times * (1 - 1e-10)])  # within what counts as the same time
    for after in (False, True):
        expected = [Input.interpolate(t, signals["time"], table, after_event=after)[0].flatten() for t in times]
        assert inputs.at(times, after).tobytes() == np.array(expected).tobytes()
    description = type("Description", (), {"modelVariables": [Variable("a"), Variable("b")]})
    assert [*inputs.jumps, np.inf] == Input.findEvents(signals, description).tolist()


def test_points_of_a_slave_that_takes_one_step_only():
    assert list(communication_points(0, 1, 0.3, [0.5], variable=False)) == [0.3, 0.6, 0.3 * 3]
    assert list(communication_points(0, 1, 0.3, [0.5])) == [0.3, 0.5, 0.6, 0.3 * 3, 1]


def test_blocks_of_any_size_hold_the_same_rows(fmu, tmp_path, monkeypatch):
    path = tmp_path / "in.csv"
    path.write_text(CSV["jumps"])
    monkeypatch.setattr(fmu_instance, "INPUTS_AHEAD", 50)
    with Fmu(fmu) as unpacked:
        plan = experiment(unpacked, None, 0.03, path)
        names = unpacked.outputs()
        found = []
        for largest in (1, 3 * 8 * (1 + len(names)), 2**20):
            instance = Instance(unpacked, names)
            found.append(np.concatenate(list(instance.blocks(plan, largest=largest))))
            instance.free()
    assert len(found[0]) > 30
    assert found[0].tobytes() == found[1].tobytes() == found[2].tobytes()


def test_an_instance_that_is_reset_answers_the_same(fmu, tmp_path):
    path = tmp_path / "in.csv"
    path.write_text(CSV["linear"])
    with Fmu(fmu) as unpacked:
        plan = experiment(unpacked, None, 0.1, path)
        names = unpacked.outputs()
        instance = Instance(unpacked, names)
        first = simulate(instance, plan, names)
        instance.reset()
        second = simulate(instance, plan, names)
        instance.free()
    assert first.rows.tobytes() == second.rows.tobytes()


def test_start_values_hold_without_inputs(fmu):
    with Fmu(fmu) as unpacked:
        plan = experiment(unpacked, 0.1, 0.05, None)
        names = unpacked.outputs()
        instance = Instance(unpacked, names)
        found = simulate(instance, plan, names, start_values={"slave[1].f[3]": 10.0})
        instance.free()
    assert sum(found[f"master[{i}].f[3]"][-1] for i in range(1, 5)) == pytest.approx(10.0, rel=1e-12)


def test_every_format_holds_the_same_numbers(fmu, tmp_path, monkeypatch):
    path = tmp_path / "in.csv"
    path.write_text(CSV["jumps"])
    monkeypatch.setattr(fmu_instance, "LARGEST_BLOCK", 4096)
    tables = []
    for ending in ("csv", "parquet", "h5"):
        result, _ = run(fmu, None, 0.03, path, output=tmp_path / f"out.{ending}")
    with open(tmp_path / "out.csv", newline="") as file:
        header, *lines = csv.reader(file)
    tables.append((header[1:], np.array(lines, float)))
    table = pyarrow.parquet.read_table(tmp_path / "out.parquet")
    assert table.schema.field("slave[1].v[1]").metadata == {b"unit": b"m/s"}
    tables.append((table.column_names[1:], np.transpose([column.to_numpy() for column in table.columns])))
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["units"].asstr()[0] == result.units[result.names[0]]
        tables.append((file["names"].asstr()[:].tolist(), np.column_stack([file["time"], file["values"]])))
    for names, rows in tables:
        assert names == result.names
        assert rows.tobytes() == result.rows.tobytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.csv", "out.csv", "out.h5", "out.parquet"]


def test_a_run_that_does_not_fit_keeps_every_kth_row(fmu, tmp_path, monkeypatch):
    path = tmp_path / "in.csv"
    path.write_text(CSV["linear"])
    whole, _ = run(fmu, None, 0.01, path)
    monkeypatch.setattr(results, "MOST_KEPT", whole.rows.nbytes // 7)
    monkeypatch.setattr(fmu_instance, "LARGEST_BLOCK", 5000)
    thinned, _ = run(fmu, None, 0.01, path, output=tmp_path / "out.csv")
    assert thinned.every >= 7
    np.testing.assert_array_equal(thinned.rows, np.vstack([whole.rows[:: thinned.every], whole.rows[-1]]))
    for one, other in ((thinned.low, whole.low), (thinned.high, whole.high), (thinned.last, whole.last)):
        np.testing.assert_array_equal(one, other)
    assert (thinned.steps, whole.steps) == (100, 100)
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 102


def test_the_five_quantities(fmu, tmp_path):
    path = tmp_path / "in.csv"
    path.write_text(CSV["jumps"])
    result, lines = run(fmu, None, 0.05, path)
    force = {i: np.sqrt(sum(result[f"master[{i}].f[{k}]"] ** 2 for k in (1, 2, 3))) for i in range(1, 5)}
    i = max(force, key=lambda i: force[i].max())
    row = int(np.argmax(force[i]))
    assert lines[0] == (
        f"  largest reaction  {force[i].max():.6g} N at master[{i}].f (node {i}), t = {result['time'][row]:.6g} s"
    )
    energies = [np.abs(result[f"energy.{kind}"]).max() for kind in ("kinetic", "strain", "external")]
    residual = np.abs(result["energy.residual"]).max() / max(energies)
    assert lines[1] == f"  energy balance    residual {residual:.2g} of the largest energy"
    assert lines[2] == f"  drift             {np.abs(result['drift']).max():.2g} m"
    count = int(np.ceil(0.05 / (0.9 * of_fmu(fmu)["integrator_limit"])))
    assert lines[3] == f"  substeps          {count} a step, by the limit at the start"


def test_the_five_quantities_by_flat_names(fmu, tmp_path):
    flat = tiefmu.build(tiefmu.load(scene_of("flat")), tmp_path / "flat.fmu")
    lines = []
    for path, text in ((fmu, CSV["jumps"]), (flat, CSV["jumps"].replace("slave[1].f[3]", "slave_1_f_3"))):
        (tmp_path / "in.csv").write_text(text)
        lines.append(run(path, None, 0.05, tmp_path / "in.csv")[1][:4])
    assert re.sub(r"master\[(\d)\]\.f", r"master_\1_f", "\n".join(lines[0])) == "\n".join(lines[1])
    assert "master_" in lines[1][0] and "not shown" not in "".join(lines[1])


def test_a_missing_package_is_named_with_its_extra(fmu, tmp_path, monkeypatch, capsys):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["run", str(fmu), "--output", str(tmp_path / "out.h5")]) == 2
    assert capsys.readouterr().err == (
        f"error: {tmp_path}/out.h5: needs the package h5py: pip install 'tiefmu[hdf5]'\n"
    )


def test_nothing_is_left_of_a_run_that_stops(fmu, tmp_path, capsys):
    (tmp_path / "in.csv").write_text("time,slave[1].f[3]\n0,0\n1,1e300\n")
    for ending in ("csv", "parquet", "h5"):
        out = tmp_path / f"out.{ending}"
        assert main(["run", str(fmu), "--input", str(tmp_path / "in.csv"), "--output", str(out)]) == 2
        assert ": stopped at t = " in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["in.csv"]


def test_no_object_is_made_in_a_step():
    """The pointer into the rows moves in place."""
    rows = np.arange(6.0).reshape(3, 2)
    pointer, address = fmu_instance.moving_pointer()
    address.value = rows.ctypes.data
    assert pointer[0] == 0.0
    address.value += ctypes.sizeof(ctypes.c_double) * 2
    assert pointer[1] == 3.0


@pytest.mark.parametrize("scale", [0.0, 1e-200, 1e-6, 0.5, 1e6])
def test_the_largest_reaction_of_any_size(scale):
    reactions = key_figures.Reactions(["master[7].f[1]", "master[7].f[2]", "master[7].f[3]"])
    for time in (0.0, 1.0, 2.0):
        reactions.write(np.array([[time, 0.0, (time % 2) * scale, 0.0]]))
    assert reactions.where == "master[7].f" and reactions.time == (1.0 if scale > 1e-150 else 0.0)


@pytest.mark.parametrize("expected", [100, 7])
@pytest.mark.parametrize("most", [2**29, 8 * 3 * 25])
def test_rows_of_a_long_run(expected, most, monkeypatch):
    """All, or the k-th ones and the last where they are many; also where there are more than expected."""
    monkeypatch.setattr(results, "MOST_KEPT", most)
    rows = np.random.default_rng(1).normal(size=(100, 3))
    kept = results.Kept(["a", "b"], {"a": "m", "b": "m"}, expected)
    for first, last in ((0, 1), (1, 40), (40, 99), (99, 100)):
        kept.write(rows[first:last].copy())
    found = kept.result(0.0)
    every = max(1, int(np.ceil(expected * 24 / most)))
    wanted = rows[::every] if 99 % every == 0 else np.vstack([rows[::every], rows[-1:]])
    np.testing.assert_array_equal(found.rows, wanted)
    assert (found.steps, found.every) == (99, every)
    np.testing.assert_array_equal([found.low, found.high, found.last], [rows.min(axis=0), rows.max(axis=0), rows[-1]])
