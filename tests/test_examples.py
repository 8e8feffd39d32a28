"""What `make demo` shows: every command's example can be typed, and the examples run."""

import argparse
import csv
import shlex
from pathlib import Path

import pytest
from tiefmu import cli
from tiefmu.cli import main

ROOT = Path(__file__).resolve().parents[1]


def parsers(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """All commands and their own commands."""
    found = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                found += [one, *parsers(one)]
    return found


COMMANDS = {one.prog: one for one in parsers(cli.parser())}


def test_commands_are_found():
    names = {prog.split()[1] for prog in COMMANDS}
    assert names == {*("build", "info", "run", "demo", "accept", "report", "sweep", "import", "study", "advise")}


@pytest.mark.parametrize("prog", COMMANDS)
def test_help_shows_one_example_that_can_be_typed(prog, monkeypatch):
    example = COMMANDS[prog].epilog
    assert example and example.startswith(f"example: {prog} ")
    for columns in ("50", "80", "130"):
        monkeypatch.setenv("COLUMNS", columns)
        assert example in " ".join(COMMANDS[prog].format_help().split())
    options = cli.parser().parse_args(shlex.split(example.removeprefix("example: "))[1:])
    assert callable(options.command)


def test_the_sweep_of_the_examples(tmp_path, capsys):
    """Both formulations carry the whole load; the optimized one spreads it over all four masters."""
    table = tmp_path / "results.csv"
    assert main(["sweep", str(ROOT / "examples/sweep/sweep.toml"), "-o", str(table), "--workers", "1"]) == 0
    rows = list(csv.DictReader(table.open(newline="")))
    assert len(rows) == 32 and not any(row["message"] for row in rows)
    for row in rows:
        assert float(row["whole reaction"]) == pytest.approx(100 * float(row["load"]), rel=1e-3)
        assert (row["passed"] == "True") == (
            float(row["whole reaction"]) <= 150 and float(row["hardest hit master"]) <= 60
        )
    largest = {row["formulation"]: float(row["hardest hit master"]) for row in rows if float(row["load"]) == 2.0}
    assert largest["default"] != pytest.approx(largest["optimized"], rel=0.05)
    assert {row["passed"] for row in rows} == {"True", "False"}


def test_make_demo_runs_what_there_is():
    """Each folder of examples but the one for other tools."""
    recipe = (ROOT / "Makefile").read_text().split("demo: ")[1].split("\n\n")[0]
    for folder in ("acceptance", "sweep"):
        assert f"examples/{folder}/" in recipe
    for command in ("demo", "accept", "report", "sweep", "advise", "info"):
        assert f"tiefmu {command} " in recipe
