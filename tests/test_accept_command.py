"""`tiefmu accept` on the command line: exit statuses, files, criteria inside the FMU, wrong criteria."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import fmpy
import pytest
import tiefmu
from tiefmu.cli import main

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "acceptance"


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
