"""The coupling study: packaged FMU against the NumPy host."""

import argparse
import csv
import math
from dataclasses import asdict
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
import tiefmu
from conftest import toml
from independent import Problem
from scipy.integrate import solve_ivp
from tiefmu.study import coupling, coupling_reference, coupling_runs
from tiefmu.study.hosts import Coupling
from tiefmu.study.ties import InProcess, Packaged

SCENES = Path(__file__).parents[1] / "scenes"
ORDERS = {"held": 1, "linear": 2, "quadratic": 3}


def study(folder: Path, *arguments) -> list[dict]:
    """Rows of the CSV that `study coupling` writes."""
    parser = argparse.ArgumentParser()
    coupling.add_parser(parser.add_subparsers())
    options = parser.parse_args(["coupling", *map(str, arguments), "--out", str(folder)])
    assert options.command(options) == 0
    [file] = folder.glob("coupling_*.csv")
    kinds = get_type_hints(coupling_runs.Row)
    with open(file, newline="") as text:
        return [{key: kinds[key](value) for key, value in row.items()} for row in csv.DictReader(text)]


def rows_of(name: str, decades: float) -> list[dict]:
    """The same, with neither files nor charts."""
    return [asdict(row) for row in coupling_runs.Study(SCENES / name).rows(coupling.ladder(decades))]


def of(rows, reaction, extrapolation, status=None):
    return [
        row
        for row in rows
        if (row["reaction"], row["extrapolation"]) == (reaction, extrapolation) and status in (None, row["status"])
    ]


@pytest.fixture(scope="module")
def spotweld():
    return rows_of("spotweld.toml", 2.5)


@pytest.fixture(scope="module")
def heavy():
    return rows_of("heavy_slave.toml", 3)


@pytest.mark.parametrize("extrapolation", ORDERS)
@pytest.mark.parametrize("reaction", ["split", "spring-damper"])
def test_order_of_convergence(spotweld, reaction, extrapolation):
    """Held, linear and quadratic extrapolation converge with order 1, 2, 3, and so do loads and power residual. The tie
    turns offsets with second order, which begins to show in the finest steps of a spring at an offset."""
    allowed = 0.5 if (reaction, extrapolation) == ("spring-damper", "quadratic") else 0.2
    fine = [row for row in of(spotweld, reaction, extrapolation, "stable") if row["step_omega"] < 0.05]
    assert len(fine) >= 3
    for key in ("error_velocity", "error_force", "error_final", "power_residual"):
        slope = np.polyfit(np.log([row["step"] for row in fine]), np.log([row[key] for row in fine]), 1)[0]
        assert slope == pytest.approx(ORDERS[extrapolation], abs=allowed), key


def test_full_converges_held_and_diverges_extrapolated(spotweld):
    """Tied mass over host mass is 0.56: below 1, above 1/3 and 1/7, whatever the step."""
    held = of(spotweld, "full", "held")
    assert {row["status"] for row in held} == {"stable"}
    assert held[-1]["error_velocity"] < 0.2 * held[-3]["error_velocity"]
    for extrapolation in ("linear", "quadratic"):
        rows = of(spotweld, "full", extrapolation)
        assert "stable" not in {row["status"] for row in rows} and rows[-1]["status"] == "diverged"
        assert min(row["radius"] for row in rows) > 1.5


def test_loads_keep_the_error_of_lumping(spotweld):
    """The step cures the discretisation and no more: two extrapolations end at the same error."""
    ends = [of(spotweld, "loads", style)[-1] for style in ("linear", "quadratic")]
    assert ends[0]["error_velocity"] == pytest.approx(ends[1]["error_velocity"], rel=1e-2)
    assert ends[0]["error_velocity"] > 100 * of(spotweld, "split", "quadratic")[-1]["error_velocity"]
    assert ends[1]["power_residual"] < 1e-3 * of(spotweld, "loads", "quadratic")[2]["power_residual"]


def test_heavy_slave(heavy):
    """Ten times as heavy as its masters: `full` never, `loads` always, `split` from a small enough step on."""
    for style in ORDERS:
        assert "stable" not in {row["status"] for row in of(heavy, "full", style)}
        assert {row["status"] for row in of(heavy, "loads", style)} == {"stable"}
    for style in ("held", "linear"):
        status = [row["status"] for row in of(heavy, "split", style)]
        assert status[0] == "unstable" and status[-1] == "stable"
    diverged = [row for row in heavy if row["status"] == "diverged"]
    assert diverged and all(math.isnan(row["error_velocity"]) and math.isnan(row["cpu"]) for row in diverged)


def test_study_repeats_and_writes_everything(spotweld, tmp_path):
    """The CSV holds the rows of another run, here at the steps of the shorter one, but for the time column; a page, an
    SVG and a PNG stand beside it."""
    again = study(tmp_path, SCENES / "spotweld.toml", "--decades", 1)
    first = [row for row in spotweld if row["steps"] in coupling.ladder(1)]
    for a, b in zip(first, again, strict=True):
        assert {key for key in a if repr(a[key]) != repr(b[key])} <= set(coupling.TIMES)
    assert {path.name for path in tmp_path.iterdir()} == {
        "coupling.html",
        *(f"coupling_spotweld.{kind}" for kind in ("csv", "png", "svg")),
    }
    page = (tmp_path / "coupling.html").read_text()
    assert "<svg" in page and "spring-damper" in page and "src=" not in page


def test_what_couples_a_heavy_slave(heavy):
    """Stable where `split` is not, with the orders of theory (5.8) to (5.11). Where the masters are free, the host's
    damper sees the velocity of the half step before: an error of first order, but small."""
    at = {}
    for name, style, order in (
        ("split-lead-inside", "held", 1),
        ("full-closed", "held", 1),
        ("full-closed", "linear", 2),
        ("free", "held", 1),
    ):
        rows = of(heavy, name, style, "stable")[-3:]
        slope = np.polyfit(np.log([r["step"] for r in rows]), np.log([r["error_velocity"] for r in rows]), 1)[0]
        assert slope == pytest.approx(order, abs=0.2), name
        at[name, style] = max(row["step_omega"] for row in of(heavy, name, style, "stable"))
    held = max(row["step_omega"] for row in of(heavy, "split", "held", "stable"))
    assert at["split-lead-inside", "held"] > 5 * held
    free, closed = (of(heavy, name, "held")[-1]["error_velocity"] for name in ("free", "full-closed"))
    assert free < 0.02 * closed
    assert at["full-closed", "held"] == at["full-closed", "linear"] == at["free", "held"] == 1.0


def test_derivatives_of_the_fmu_are_differences_of_its_answers():
    one = coupling_runs.Study(SCENES / "heavy_slave.toml")
    with Packaged(one.scene("full")) as tie:
        asked = tie.derivatives()
    differences = InProcess(one.scene("full")).derivatives()
    np.testing.assert_allclose(asked, differences, rtol=1e-9, atol=1e-12 * np.abs(differences).max())


@pytest.mark.parametrize("mass, stiffness", [(0.0, 0.0), (3.0, 1.0)])
def test_exact_host(mass, stiffness):
    """One step of a sprung mass under a quadratic load, against DOP853."""
    one = np.ones(1)
    host = coupling_runs.Masses(2.0 * one, 300.0 * stiffness * one, 7.0 * mass * one)
    step, u, v, loads = 0.3, 0.4, -1.3, (5.0, 3.0, -2.0)  # loads now, one and two steps ago

    class Still:
        leads = False

    state = np.array([[u], [v], [0.0], [loads[1]], [loads[2]]])
    after, end = Coupling(Still(), host, step, 2).advance(state, np.array([loads[0]]))
    force = np.polynomial.Polynomial(np.polynomial.polynomial.polyfit([0, -step, -2 * step], loads, 2))
    exact = solve_ivp(
        lambda t, y: [y[1], (force(t) - host.stiffness[0] * y[0] - host.damping[0] * y[1]) / 2.0],
        (0, step),
        [u, v],
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    ).y[:, -1]
    np.testing.assert_allclose(after[:2, 0], exact, rtol=1e-11)
    np.testing.assert_allclose(end, force(step), rtol=1e-12)
    np.testing.assert_allclose([after[3, 0], after[4, 0]], loads[:2])


@pytest.mark.parametrize("reaction", ["split", "spring-damper"])
@pytest.mark.parametrize("scene", ["heavy_slave", "spotweld"])
def test_reference_against_dop853(scene, reaction):
    """The monolithic system integrated by the tests' own code: slave velocities at some instants."""
    one = coupling_runs.Study(SCENES / f"{scene}.toml")
    reference = coupling_reference.Reference(one, reaction)
    assert reference.error < 1e-11
    tables = reference.tables.model_dump(exclude_none=True)
    tables["mesh"].pop("file", None)
    for row in tables["tie"]:
        row["slaves"] = list(row["slaves"])
    problem = Problem(tables)
    inputs = {("f", i): lambda t: one.force * one.pulse(t) * one.direction[:3] for i in one.slaves}
    times = np.linspace(0, one.window, 6)
    exact = np.array([now["slave_v"].ravel() for now in problem.solve(times, inputs, rtol=1e-12, atol=1e-17)])
    found = reference.at(times, "velocity")
    assert coupling_reference.relative(found, exact) < 1e-9


def test_fmu_gives_the_bits_of_the_solver():
    """The same loop with the packaged FMU and with the solver in process."""
    one = coupling_runs.Study(SCENES / "spotweld.toml")
    for way in coupling_runs.WAYS:
        if way.reaction == "free":
            continue  # it runs in process only
        reaction, scene = way.reaction, one.scene(way.reaction, reaction_lead=way.reaction_lead)
        with Packaged(scene) as packaged:
            inside = InProcess(scene)
            runs = [
                one.simulate(tie, one.masses(reaction, tie.added), one.window / 40, 0, 40)
                for tie in (packaged, inside, packaged)
            ]
        for velocity, load, residual, _ in runs[1:]:
            np.testing.assert_array_equal(velocity, runs[0][0])
            np.testing.assert_array_equal(load, runs[0][1])
            np.testing.assert_array_equal(residual, runs[0][2])


def test_rigid_host_and_mass_ratio():
    """A host without springs ends where the monolithic system does; the ratio is what was asked for."""
    one = coupling_runs.Study(SCENES / "heavy_slave.toml", host="rigid", mass_ratio=0.5)
    assert one.ratio == pytest.approx(0.5)
    assert not one.masses("split", 0 * one.own).stiffness.any()
    with Packaged(one.scene("split")) as tie:
        velocity, _, _, _ = one.simulate(tie, one.masses("split", tie.added), one.window / 2000, 1, 2000)
    reference = coupling_reference.Reference(one, "split")
    assert coupling_reference.relative(velocity[-1], reference.values["velocity"][-1]) < 1e-5


def test_scenes_it_cannot_do(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    quad = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [5, 0.5, 0.5, 0]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "tie": [{"segments": "all", "slaves": [5]}],
    }
    for name, node, words in (
        ("free", {"nodes": "all", "motion": "free", "mass": 1.0}, "no driven masters"),
        ("light", {"nodes": [5], "mass": 1.0}, "no mass"),
    ):
        Path(f"{name}.toml").write_text(toml(quad | {"node": [node]}))
        with pytest.raises(tiefmu.SceneError, match=words) as caught:
            coupling_runs.Study(f"{name}.toml")
        assert str(caught.value).startswith(f"{name}.toml: ") and "\n" not in str(caught.value)
    with pytest.raises(tiefmu.SceneError, match="no such file"):
        coupling_runs.Study("gone.toml")
