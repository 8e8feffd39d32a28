"""`tiefmu accept`: verdicts against what NumPy makes of FMPy's results."""

import os
import subprocess
import sys
from pathlib import Path
from typing import get_args

import fmpy
import numpy as np
import pytest
import scipy.signal
import tiefmu
from tiefmu.acceptance.criteria import TABLES, read
from tiefmu.acceptance.judge import Judge
from tiefmu.acceptance.quantities import filtered
from tiefmu.cli import main
from tiefmu.fmu_instance import Fmu, Instance

END, STEP = 0.02, 1e-4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A free plate on springs with two slaves, as scene and FMU, its inputs, and FMPy's results as a reference."""
    folder = tmp_path_factory.mktemp("accept")
    scene = {
        "mesh": {
            "nodes": [
                [1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0],
                [8, 0.03, 0.06, 0.04], [9, 0.07, 0.02, 0.01],
            ],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [
            {"nodes": "all", "motion": "free", "rotations": True, "mass": 1.0, "inertia": 1e-3},
            {"nodes": [8, 9], "mass": 0.3},
        ],
        "tie": [{"segments": "all", "slaves": [8, 9]}],
        "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 1e5, "rotational_stiffness": 10.0}],
        "interface": {"expose": ["energy", "drift", "power_residual"]},
    }  # fmt: skip
    tiefmu.build(tiefmu.load(scene), folder / "plate.fmu")
    time = np.linspace(0, END, 41)
    with open(folder / "in.csv", "w") as file:
        file.write("time,slave[1].f[3],slave[2].f[1]\n")
        for t in time:
            file.write(f"{t},{100 * np.sin(400 * t)},{30 * np.cos(900 * t)}\n")
    return folder


@pytest.fixture(scope="module")
def result(folder):
    signals = np.genfromtxt(folder / "in.csv", delimiter=",", names=True, deletechars="")
    rows = fmpy.simulate_fmu(
        str(folder / "plate.fmu"), input=signals, stop_time=END, output_interval=STEP, validate=False
    )
    with open(folder / "reference.csv", "w") as file:
        file.write("time,v\n")
        for t, v in zip(rows["time"], rows["slave[1].v[3]"]):
            file.write(f"{1e3 * t},{1e-3 * v}\n")  # ms and km/s
    return rows


def verdicts(folder, text) -> dict:
    """Name -> verdict."""
    path = folder / "criteria.toml"
    path.write_text(f'[run]\ninput = "in.csv"\nstep = {STEP!r}\n{text}')
    with Fmu(folder / "plate.fmu") as fmu:
        judge = Judge(fmu, read(path), folder, str(path))
        instance = Instance(fmu, judge.outputs)
        found = judge.judge(instance, judge.plan(None, None, None)).verdicts
        instance.free()
    return {verdict.name: verdict for verdict in found}


def one(folder, text):
    [verdict] = verdicts(folder, text).values()
    return verdict


# --------------------------------------------------------------------------------------------------------------- limits


def norm(result, stems):
    return np.sqrt(sum(result[f"{stem}[{k}]"] ** 2 for stem in stems for k in (1, 2, 3)))


SLAVES = ["slave[1].v", "slave[2].v"]
REDUCED = {
    'signal = "slave[1].v[3]"': lambda r: np.abs(r["slave[1].v[3]"]),
    'signal = "slave[1].v"': lambda r: norm(r, SLAVES[:1]),
    'signal = "slave[*].v"': lambda r: norm(r, SLAVES),
    'signal = "slave[*].v"\ncombine = "largest"': lambda r: np.maximum(norm(r, SLAVES[:1]), norm(r, SLAVES[1:])),
    'signal = "slave[*].v"\ncombine = "sum"': lambda r: np.sqrt(
        sum((r[f"slave[1].v[{k}]"] + r[f"slave[2].v[{k}]"]) ** 2 for k in (1, 2, 3))
    ),
    'signal = "slave[*].v[1]"': lambda r: np.hypot(r["slave[1].v[1]"], r["slave[2].v[1]"]),
    'signal = "slave[*].v[1]"\ncombine = "sum"': lambda r: np.abs(r["slave[1].v[1]"] + r["slave[2].v[1]"]),
}


@pytest.mark.parametrize("signal", REDUCED)
def test_signals(folder, result, signal):
    peak = REDUCED[signal](result).max()
    found = one(folder, f"[[limit]]\n{signal}\nat_most = {peak * 1.0001}")
    assert found.value == pytest.approx(peak, rel=1e-13)
    assert found.passed
    assert not one(folder, f"[[limit]]\n{signal}\nat_most = {peak * 0.9999}").passed


def test_measures(folder, result):
    t, v = result["time"], result["slave[1].v[3]"]
    inside = (t >= 0.003) & (t <= 0.0171)
    expected = {
        "peak": np.abs(v[inside]).max(),
        "maximum": v[inside].max(),
        "minimum": v[inside].min(),
        "end": v[inside][-1],
        "time_of_peak": t[inside][np.argmax(np.abs(v[inside]))],
        "impulse": np.trapezoid(v[inside], t[inside]),
    }
    assert expected["minimum"] < 0
    common = '[[limit]]\nsignal = "slave[1].v[3]"\nwindow = [0.003, 0.0171]\nat_least = 1e9\n'
    text = "".join(f'{common}name = "{measure}"\nmeasure = "{measure}"\n' for measure in expected)
    found = verdicts(folder, text)
    for measure, value in expected.items():
        assert found[measure].value == pytest.approx(float(value), rel=1e-12), measure
    assert not any(verdict.passed for verdict in found.values())
    assert (found["time_of_peak"].unit, found["impulse"].unit) == ("s", "m/s.s")


# ----------------------------------------------------------------------------------------------------------- references

AGAINST = 'signal = "slave[1].v[3]"\nreference = "reference.csv"\ncolumn = "v"\nscale = 1e3\ntime_scale = 1e-3\n'


@pytest.mark.parametrize("at", ["run", "reference"])
def test_a_band(folder, result, at):
    v = result["slave[1].v[3]"]
    good = one(folder, f'[[band]]\n{AGAINST}at = "{at}"\nrelative = 1e-9')
    assert good.passed and good.value < 1e-9 * np.abs(v).max()
    shifted = one(folder, f'[[band]]\n{AGAINST.replace("1e3", "1.1e3")}at = "{at}"\nabsolute = 1e-3\nrelative = 0.05')
    assert not shifted.passed
    assert shifted.value == pytest.approx(0.1 * np.abs(v).max(), rel=1e-9)
    width = 1e-3 + 0.05 * 1.1 * np.abs(v).max()
    _, low, high = shifted.corridor
    np.testing.assert_allclose(high - low, 2 * width, rtol=1e-9)


def test_a_band_at_the_times_of_either(folder, result):
    """A reference of three rows: at its own times the run is right, in between it is not the straight line."""
    rows = [0, 77, 200]
    (folder / "coarse.csv").write_text(
        "time,slave[1].v[3]\n" + "".join(f"{result['time'][k]},{result['slave[1].v[3]'][k]}\n" for k in rows)
    )
    text = '[[band]]\nsignal = "slave[1].v[3]"\nreference = "coarse.csv"\nabsolute = 1e-9\n'
    assert one(folder, text + 'at = "reference"').passed
    found = one(folder, text)
    line = np.interp(result["time"], result["time"][rows], result["slave[1].v[3]"][rows])
    assert found.value == pytest.approx(np.abs(line - result["slave[1].v[3]"]).max(), rel=1e-9)


# -------------------------------------------------------------------------------------------------------------- filters


def test_a_filtered_limit(folder, result):
    _, v = filtered(result["time"], result["slave[1].v[3]"], 180)
    found = one(folder, '[[limit]]\nsignal = "slave[1].v[3]"\nfilter = 180\nat_most = 1e9')
    assert found.value == pytest.approx(np.abs(v).max(), rel=1e-12)
    assert abs(found.value - np.abs(result["slave[1].v[3]"]).max()) > 1e-4 * found.value


@pytest.mark.parametrize(
    "signal, stems, combine",
    [
        ("slave[2].v", [["slave[2].v"]], None),
        ("slave[*].v", [["slave[1].v", "slave[2].v"]], "norm"),
        ("slave[*].v", [["slave[1].v"], ["slave[2].v"]], "largest"),
    ],
)
def test_components_are_filtered_before_their_length_is_taken(folder, result, signal, stems, combine):
    """SAE J211-1: before all that is not linear. Against SciPy's Butterworth filter of 2.0775 times the class."""
    b, a = scipy.signal.butter(2, 2.0775 * 180, fs=1 / STEP)
    length = int(np.ceil(3 / (180 * STEP)))

    def smooth(values):
        return scipy.signal.filtfilt(b, a, values, padlen=length)

    first = max(norm({name: smooth(result[name]) for name in result.dtype.names}, of).max() for of in stems)
    text = f'[[limit]]\nsignal = "{signal}"\nfilter = 180\nat_most = 1e9\n'
    found = one(folder, text + (f'combine = "{combine}"' if combine else ""))
    assert found.value == pytest.approx(first, rel=1e-9)
    assert found.value != pytest.approx(max(np.abs(smooth(norm(result, of))).max() for of in stems), rel=1e-7)


def test_both_sides_are_filtered(folder, result):
    text = f"[[band]]\n{AGAINST}filter = 180\nrelative = 1e-6\n"
    assert one(folder, text).passed
    assert not one(folder, text + "filter_reference = false").passed


# --------------------------------------------------------------------------------------------------------------- health


def test_health_of_a_run(folder, result):
    text = (
        "[health]\nenergy_residual = 1.0\ndrift = 1e-9\npower_residual = 1e-9\nstability_margin = 0.05\n"
        "added_mass = 1.0\ndropped = 0\n"
    )
    found = verdicts(folder, text)
    largest = {key: np.abs(result[f"energy.{key}"]).max() for key in ("kinetic", "strain", "external", "residual")}
    residual = largest.pop("residual")
    assert found["energy residual"].value == pytest.approx(residual / max(largest.values()), rel=1e-12)
    assert found["drift"].value == np.abs(result["drift"]).max()
    names = result.dtype.names
    force, speed = (max(np.abs(result[n]).max() for n in names if key in n) for key in (".f[", ".v["))
    assert found["power residual"].value == pytest.approx(np.abs(result["power_residual"]).max() / force / speed)
    report = tiefmu.report.__globals__["of_fmu"](folder / "plate.fmu")
    assert found["added mass"].value == max(row["added_mass"] / row["mass"] for row in report["masters"])
    limit = report["integrator_limit"]
    count = np.ceil(STEP / (0.9 * limit))
    low = (result["stable_time_step"] / report["stable_time_step"]).min()
    assert found["stability margin"].value == pytest.approx(1 - STEP / count / (limit * low), rel=1e-9)
    assert all(verdict.passed for verdict in found.values())
    for key in ("energy_residual", "power_residual", "added_mass", "drift"):
        assert not one(folder, f"[health]\n{key} = 0").passed, key
    assert not one(folder, "[health]\nstability_margin = 0.999").passed


def test_agreement_with_half_the_step(folder, result):
    signals = np.genfromtxt(folder / "in.csv", delimiter=",", names=True, deletechars="")
    fine = fmpy.simulate_fmu(
        str(folder / "plate.fmu"), input=signals, stop_time=END, output_interval=STEP / 2, validate=False
    )[::2]
    errors = []
    for kind in ("slave[1].v", "slave[1].w", "master[1].v", "master[1].w", "master[1].f", "master[1].t"):
        prefix, quantity = kind.split("[1]")
        names = [n for n in result.dtype.names if n.startswith(prefix) and f"{quantity}[" in n]
        a, b = (np.array([rows[name] for name in names]) for rows in (result, fine))
        errors.append(np.linalg.norm(a - b) / np.linalg.norm(b))
    found = one(folder, "[health]\nhalf_step = 1")
    assert found.value == pytest.approx(max(errors), rel=1e-9)
    assert found.value > 1e-5 and found.passed
    assert not one(folder, f"[health]\nhalf_step = {0.99 * found.value}").passed


def test_rounding_is_no_difference_from_half_the_step(tmp_path, capsys):
    """A symmetric part of which nothing turns: its spins are rounding, and differ by all of their size."""
    corners = [[1, 61.2345, -23.777], [2, 61.3345, -23.777], [3, 61.3345, -23.677], [4, 61.2345, -23.677]]
    scene = {
        "mesh": {
            "nodes": [[*corner, 1.131] for corner in corners] + [[9, 61.2845, -23.727, 1.171]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "motion": "free", "mass": 1.0}],
        "tie": [{"segments": "all", "slaves": [9], "formulation": "optimized"}],
        "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 1e5}],
    }
    tiefmu.build(tiefmu.load(scene), tmp_path / "plate.fmu")
    (tmp_path / "in.csv").write_text("time,slave[1].f[3]\n0,0\n0.005,100\n0.02,0\n")
    [found] = verdicts(tmp_path, "[health]\nhalf_step = 0.02").values()
    assert 1e-4 < found.value < 0.02 and found.where.startswith(("master.v", "slave.v", "master.f"))
    rows = fmpy.simulate_fmu(
        str(tmp_path / "plate.fmu"),
        input=np.genfromtxt(tmp_path / "in.csv", delimiter=",", names=True, deletechars=""),
        stop_time=END,
        output_interval=STEP,
        validate=False,
    )
    spins = norm(rows, ["slave[1].w"])
    assert 0 < spins.max() < 1e-9 * norm(rows, ["slave[1].v"]).max()


def test_dropped_slaves_are_counted(weld, tmp_path):
    weld["mesh"]["nodes"].append([102, 9, 9, 9])
    weld["tie"][0] |= {"slaves": [101, 102], "unresolved": "drop"}
    tiefmu.build(tiefmu.load(weld), tmp_path / "weld.fmu")
    (tmp_path / "criteria.toml").write_text("[health]\ndropped = 0\n")
    assert main(["accept", str(tmp_path / "weld.fmu"), str(tmp_path / "criteria.toml")]) == 1
    (tmp_path / "criteria.toml").write_text("[health]\ndropped = 1\n")
    assert main(["accept", str(tmp_path / "weld.fmu"), str(tmp_path / "criteria.toml")]) == 0


# -------------------------------------------------------------------------------------------------------------- ratings

RATINGS = """
import numpy as np
from tiefmu.acceptance.iso18571 import ratings
t = np.arange(160) * 1e-4
ramp = np.where((t > 2e-3) & (t < 12e-3), np.sin((t - 2e-3) * np.pi / 10e-3), 0.0)
print(*ratings(t, ramp, ramp, "x").values())
print(*ratings(t, ramp, ramp + 0.2, "x").values())
print(*ratings(t, ramp, np.roll(ramp, 8), "x").values())
"""


def test_ratings_are_those_of_the_specification():
    """ISO/TS 18571: equal curves; an offset of 0.2 of the largest value, where a point of the corridor counts
    ((0.5 - 0.2)/(0.5 - 0.05))^2; a shift by 8 of 160 points, of which a fifth is allowed: (32 - 8)/32."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}  # compiling takes longer than the rating
    done = subprocess.run([sys.executable, "-c", RATINGS], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    equal, offset, shifted = (list(map(float, line.split())) for line in done.stdout.splitlines())
    assert equal == [1] * 5
    top = np.sin((np.arange(20, 120) * 1e-4 - 2e-3) * np.pi / 10e-3).max()
    assert offset[0] == pytest.approx(((0.5 * top - 0.2) / (0.45 * top)) ** 2, rel=1e-9)
    assert offset[1] == 1.0 and offset[3] == pytest.approx(1.0, abs=1e-9)  # no shift, the same slopes
    assert shifted[1] == pytest.approx(0.75, rel=1e-9)
    assert shifted[2] == pytest.approx(1.0, abs=1e-9)  # magnitude and slope without the shift
    for grades in (offset, shifted):
        assert grades[4] == pytest.approx(np.dot([0.4, 0.2, 0.2, 0.2], grades[:4]), rel=1e-12)


def test_a_rating_judges(folder, result, monkeypatch):
    from tiefmu.acceptance import iso18571

    seen = []

    def ratings(time, reference, values, what):
        seen.append((time, reference, values))
        return {"corridor": 0.9, "phase": 1.0, "magnitude": 0.8, "slope": 0.7, "overall": 0.85}

    monkeypatch.setattr(iso18571, "ratings", ratings)
    assert one(folder, f'[[rating]]\n{AGAINST}least = "good"').passed
    assert not one(folder, f'[[rating]]\n{AGAINST}least = "excellent"').passed
    assert not one(folder, f'[[rating]]\n{AGAINST}of = "slope"\nleast = 0.71').passed
    time, reference, values = seen[0]
    assert np.diff(time) == pytest.approx(np.full(len(time) - 1, 1e-4))
    assert reference == pytest.approx(values, abs=1e-12)


def test_the_page_names_every_key():
    text = (Path(__file__).parents[1] / "docs" / "acceptance.md").read_text()
    for model in TABLES.values():
        for key, field in model.model_fields.items():
            assert f"`{key}`" in text, key
            for value in get_args(field.annotation):
                assert not isinstance(value, str) or f'`"{value}"`' in text, value
