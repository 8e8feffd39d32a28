"""`tiefmu accept`: verdicts against what NumPy makes of FMPy's results, exit statuses, files, wrong criteria."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
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

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "acceptance"
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
    text = (EXAMPLE.parents[1] / "docs" / "acceptance.md").read_text()
    for model in TABLES.values():
        for key, field in model.model_fields.items():
            assert f"`{key}`" in text, key
            for value in get_args(field.annotation):
                assert not isinstance(value, str) or f'`"{value}"`' in text, value


# --------------------------------------------------------------------------------------------------------- command line


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return tiefmu.build(tiefmu.load(EXAMPLE / "weld.toml"), tmp_path_factory.mktemp("built") / "weld.fmu")


@pytest.fixture
def example(tmp_path, monkeypatch):
    shutil.copytree(EXAMPLE, tmp_path / "weld")
    monkeypatch.chdir(tmp_path / "weld")
    return tmp_path / "weld"


def test_the_example_passes(example, capsys):
    assert main(["accept", "weld.toml", "criteria.toml", "--junit", "out.xml", "--pictures", "pictures"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith("weld.toml: Weld, half sine of 100 N: 200 steps to t = 0.01 s in ")
    assert out[-1] == "all 9 criteria passed"
    assert any(line.split()[:3] == ["passed", "whole", "reaction"] for line in out)
    suite = ElementTree.parse("out.xml").getroot().find("testsuite")
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("weld", "9", "0")
    assert next(suite.iter("testcase")).get("name") == "share of master 3"
    pictures = sorted((example / "pictures").iterdir())
    assert len(pictures) == 9
    assert all(path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for path in pictures)


def test_a_criterion_that_fails(example, capsys):
    text = Path("criteria.toml").read_text().replace("at_most = 101.0", "at_most = 99.5")
    Path("criteria.toml").write_text(text)
    assert main(["accept", "weld.toml", "criteria.toml", "--junit", "out.xml"]) == 1
    out = capsys.readouterr().out
    assert "FAILED  whole reaction" in out and out.endswith("9 criteria, 1 failed\n")
    [failure] = ElementTree.parse("out.xml").getroot().iter("failure")
    assert failure.get("message").startswith("100.0 N; asked: at least 99 and at most 99.5; master[*].f; peak at t = ")


def test_criteria_travel_in_the_fmu(example, capsys, tmp_path):
    assert main(["build", "weld.toml", "--criteria", "criteria.toml"]) == 0
    shutil.move("weld.fmu", tmp_path / "received.fmu")
    os.chdir(tmp_path)
    with zipfile.ZipFile("received.fmu") as archive:
        assert {f"extra/tiefmu/acceptance/{name}" for name in ("criteria.toml", "load.csv", "reference.csv")} <= set(
            archive.namelist()
        )
    assert fmpy.validation.validate_fmu("received.fmu") == []
    capsys.readouterr()
    assert main(["accept", "received.fmu"]) == 0
    assert "all 9 criteria passed" in capsys.readouterr().out


def test_the_example_of_ten_lines_with_fmpy_alone(example):
    """The test of the receiver does not import tiefmu, passes, and fails against another reference."""
    assert main(["build", "weld.toml", "--criteria", "criteria.toml"]) == 0
    blocked = "import sys, pytest; sys.modules['tiefmu'] = None; sys.exit(pytest.main(['-q', 'test_weld.py']))"
    command = [sys.executable, "-c", blocked]
    assert subprocess.run(command, capture_output=True).returncode == 0
    Path("reference.csv").write_text("time,force\n0,0\n10,1\n")
    assert subprocess.run(command, capture_output=True).returncode == 1


def test_a_run_that_stops_has_failed(example, capsys):
    """Divergence is no bad input: exit status 1, the table and a JUnit file in which nothing has passed."""
    Path("load.csv").write_text("time,slave[1].f[3]\n0,0\n0.005,1\n0.0051,1e300\n")
    Path("weld.toml").write_text(Path("weld.toml").read_text().replace("mass = 1.0", 'mass = 1.0\nmotion = "free"'))
    assert main(["accept", "weld.toml", "criteria.toml", "--junit", "out.xml", "--pictures", "pictures"]) == 1
    out = capsys.readouterr().out
    assert "weld.toml: stopped at t = 0.005" in out and out.endswith("10 criteria, 10 failed\n")
    suite = ElementTree.parse("out.xml").getroot().find("testsuite")
    assert suite.get("tests") == suite.get("failures") == "10"
    cases = suite.findall("testcase")
    assert [case.get("name") for case in cases][:2] == ["run", "share of master 3"]
    assert [case.get("name") for case in cases][-2:] == ["dropped slaves", "half the step"]
    assert all(case.find("failure") is not None for case in cases)


def test_the_table_is_printed_whatever_becomes_of_the_files(example, built, capsys):
    Path("taken/01-share_of_master_3.png").mkdir(parents=True)
    assert main(["accept", str(built), "criteria.toml", "--pictures", "taken"]) == 2
    out, error = capsys.readouterr()
    assert out.endswith("all 9 criteria passed\n")
    assert error == "error: taken/01-share_of_master_3.png: Is a directory\n"
    for option, path, kind in (
        ("--pictures", "weld.toml", "is a file; give a folder"),
        ("--junit", "taken", "is a folder; give a file"),
    ):
        assert main(["accept", str(built), "criteria.toml", option, path]) == 2
        assert capsys.readouterr() == ("", f"error: {path}: {kind}\n")


SIGNAL = 'signal = "master[1].f[3]"'
LIMIT = f"[[limit]]\n{SIGNAL}\n"
BAND = f'[[band]]\nname = "b"\n{SIGNAL}\nreference = "reference.csv"\n'
FORCE = f'{BAND}column = "force"\n'
RATING = f'[[rating]]\n{SIGNAL}\nreference = "reference.csv"\n'
WRONG = [
    ("", "holds no criterion; give [[band]], [[rating]], [[limit]] or [health]"),
    ("[limits]", "unknown key 'limits'; did you mean 'limit'?"),
    ("[limit]", "limit: expected tables written [[limit]], found a table"),
    (LIMIT, "limit 1: give at_least, at_most, or both"),
    (f"{LIMIT}at_least = 2\nat_most = 1", "limit 1: at_least 2 is more than at_most 1"),
    (f'{LIMIT}name = "x"\nat_mosst = 1', "limit 'x': unknown key 'at_mosst'; did you mean 'at_most'?"),
    (f"{LIMIT}at_most = nan", "limit 1: at_most: nan is not a finite number"),
    (f'{LIMIT}at_most = "1"', "limit 1: at_most: expected a number, found '1'"),
    (
        f'{LIMIT}at_most = 1\nmeasure = "top"',
        "limit 1: measure: 'top' is not one of 'peak', 'maximum', 'minimum', 'end', 'time_of_peak', 'impulse'",
    ),
    (
        f"{LIMIT}at_most = 1\nfilter = 100",
        "limit 1: filter: 100 is no channel frequency class; known: 60, 180, 600, 1000",
    ),
    (f"{LIMIT}at_most = 1\nwindow = [2, 1]", "limit 1: window: ends at 1 s, before it starts at 2 s"),
    (f"{LIMIT}at_most = 1\nwindow = 2", "limit 1: window: expected [from, to] in s, found 2"),
    ("[[limit]]\nat_most = 1", "limit 1: signal: is missing"),
    (
        '[[limit]]\nsignal = "master[1].g"\nat_most = 1',
        "criterion 'limit 1': signal 'master[1].g': no such output; did you mean 'master[1].t'?",
    ),
    (
        '[[limit]]\nsignal = "slaves[*].v"\nat_most = 1',
        "criterion 'limit 1': signal 'slaves[*].v': no such output; did you mean 'slave[*].v'?",
    ),
    (
        f"{LIMIT}at_most = 1\nwindow = [7, 8]",
        "criterion 'limit 1': window = [7, 8]: holds 0 of the values, which go from 0 to 0.01 s; give a window with at "
        "least two",
    ),
    (
        f"{LIMIT}at_most = 1\nwindow = [0, 0.02]",
        "criterion 'limit 1': window = [0, 0.02]: the values go from 0 to 0.01 s only; give a window that they fill",
    ),
    (
        f"[run]\nstep = 1e-3\n{LIMIT}at_most = 1\nfilter = 1000",
        "criterion 'limit 1': filter = 1000: needs values every 0.0001 s or closer, found 0.001 s; make the "
        "communication step shorter, or take a lower class",
    ),
    (f'{LIMIT}name = "x"\nat_most = 1\n{LIMIT}name = "x"\nat_most = 2', "criterion 'x': this name is repeated"),
    (BAND, "band 'b': give absolute, relative, or both: the half-width of the band"),
    (BAND.replace("reference.csv", "no.csv") + "absolute = 1", "no.csv: no such file beside it"),
    (f"{BAND}absolute = 1", "criterion 'b': reference.csv: has no column 'master[1].f[3]'; known: force"),
    (f"{FORCE}absolute = -1", "band 'b': absolute: -1 is negative; it must be 0 or more"),
    (
        f"{FORCE}absolute = 1\nwindow = [1, 10]",
        "criterion 'b': window = [1, 10]: holds 0 of the values, which go from 0 to 0.01 s; give a window with at "
        "least two",
    ),
    (
        f'{RATING}least = "fine"',
        "rating 1: least: expected a number from 0 to 1, or one of excellent, good, fair, found 'fine'",
    ),
    ('[run]\ninput = "no.csv"\n[health]\ndropped = 0', "no.csv: no such file beside it"),
    (
        "[health]\nenergy_residual = 1e-3",
        'health: energy_residual: the FMU does not show it; expose = ["energy"] in [interface] of its scene',
    ),
    ("[health]\ndropped = 0.5", "health: dropped: expected a whole number, found 0.5"),
    ("[health", "end of file: not TOML: Expected ']' at the end of a table declaration"),
]


@pytest.mark.parametrize("text, line", WRONG)
def test_wrong_criteria(example, built, capsys, text, line):
    whole = text in ("", "[health") or "[run]" in text
    Path("wrong.toml").write_text(text if whole else f'{text}\n[run]\ninput = "load.csv"')
    before = sorted(example.iterdir())
    assert main(["accept", str(built), "wrong.toml", "--junit", "out.xml"]) == 2
    out, error = capsys.readouterr()
    assert (out, error) == ("", f"error: wrong.toml: {line}\n")
    assert sorted(example.iterdir()) == before


@pytest.mark.parametrize(
    "arguments, line",
    [
        (["accept", "weld.fmu"], "weld.fmu: holds no criteria; give them as a file, or to `tiefmu build`"),
        (["accept", "weld.fmu", "no.toml"], "no.toml: no such file"),
        (["accept", "no.fmu", "criteria.toml"], "no.fmu: no such file"),
        (["accept", "weld.fmu", "criteria.toml", "--junit", "no/out.xml"], "no/out.xml: folder no does not exist"),
        (
            ["build", "weld.toml", "--criteria", "outside.toml"],
            "outside.toml: ../load.csv: must lie beside the criteria or below, to be packed with them",
        ),
    ],
)
def test_wrong_files(example, built, capsys, arguments, line):
    shutil.copy(built, "weld.fmu")
    shutil.copy("load.csv", "..")
    Path("outside.toml").write_text('[run]\ninput = "../load.csv"\n[health]\ndropped = 0\n')
    capsys.readouterr()
    assert main(arguments) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"error: {line}"


@pytest.mark.parametrize("package, extra", [("scipy", "accept"), ("objective_rating_metrics", "rating")])
def test_a_missing_package_is_named_with_its_extra(example, built, capsys, monkeypatch, package, extra):
    import importlib.util

    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else there(name))
    Path("rated.toml").write_text(
        '[run]\ninput = "load.csv"\nstep = 5e-5\n[[rating]]\nname = "r"\nsignal = "master[3].f[3]"\n'
        'reference = "reference.csv"\ncolumn = "force"\ntime_scale = 1e-3\nleast = 0.5\n'
        + ("filter = 180\nfilter_reference = false\n" if package == "scipy" else "")
    )
    assert main(["accept", str(built), "rated.toml"]) == 2
    assert f"needs the package {package}: pip install 'tiefmu[{extra}]'" in capsys.readouterr().err
