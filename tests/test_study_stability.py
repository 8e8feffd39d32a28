"""The stability study: every limit bracketed within 2 %, the check beyond the limit as its own control."""

import argparse
import csv
import math

import numpy as np
import pytest
from tiefmu.study import limits, stability, stability_cases, stability_geometry, stability_map

LIMITS = stability_cases.limits()
VALUES = [value for cases in stability_cases.VALUES for value in cases()]


def test_every_item_is_there():
    assert {row.item for row in LIMITS + VALUES} == set(stability_cases.ITEMS) == set("123456789")


@pytest.mark.parametrize(
    "limit, way",
    [(limit, way) for limit in LIMITS for way in limit.tests()],
    ids=lambda value: value if isinstance(value, str) else f"{value.item}: {value.case}",
)
def test_limit_is_bracketed(limit, way):
    fails = limit.tests()[way]
    assert not fails(0.98 * limit.closed)
    assert fails(1.02 * limit.closed)  # the control: the same check just beyond


@pytest.mark.parametrize("limit", [limit for limit in LIMITS if limit.stated], ids=lambda limit: limit.case)
def test_the_program_states_the_limit(limit):
    assert limit.stated == pytest.approx(limit.closed, rel=0.02)


@pytest.mark.parametrize("method, closed", stability_cases.METHODS.items())
def test_integrator_at_99_and_101_percent(method, closed):
    run = stability_cases.free_plate(3.0, method)
    assert not run.grows(0.99 * run.limit)
    assert run.grows(1.01 * run.limit)


@pytest.mark.parametrize("value", VALUES, ids=lambda value: f"{value.item}: {value.case}")
def test_value(value):
    assert abs(value.measured - value.closed) <= value.tolerance * (abs(value.closed) or 1)


@pytest.mark.parametrize("step", [1.0, 0.1, 0.01])
@pytest.mark.parametrize("ratio", [1.0, 10.0, 1000.0])
def test_split_and_loads_are_stable_for_every_mass_ratio(ratio, step):
    """A host of free masses; `full` is the control."""
    for reaction, stable in (("loads", True), ("split", True), ("full", False)):
        scene = limits.plate(4.1 * ratio, reaction)  # 4 would be the very limit of `full` at r = 1
        coupling = limits.coupled(scene, reaction, step)
        assert (coupling.growth(400) < 1) == stable
        assert (coupling.radius() <= limits.GROWS) == stable


@pytest.mark.parametrize("ratio", [1.0, 10.0])
def test_split_on_an_undamped_sprung_host_grows(ratio):
    """By (H omega)^2 r (r + 1/2) / (2 (1 + r)) a step to leading order; extrapolated linearly, by less than a hundredth
    of that."""
    step = 0.01 / ratio
    held = limits.coupled(limits.plate(4 * ratio, "split"), "split", step, omega=1.0).radius() - 1
    linear = limits.coupled(limits.plate(4 * ratio, "split"), "split", step, order=1, omega=1.0).radius() - 1
    assert held == pytest.approx(step**2 * ratio * (ratio + 0.5) / (2 * (1 + ratio)), rel=0.02)
    assert linear < 0.01 * held


def test_row_sum_rule_fails_where_lambda_does_not():
    """The control of item 6: as the segment turns, the row-sum rule spreads and falls below what it should bound."""
    corners = np.array([[-2.5, -0.5, 0], [2.5, -0.5, 0], [2.5, 0.5, 0], [-2.5, 0.5, 0]])
    rule, lam = [], []
    for turn in stability_geometry.frames(100):
        found = limits._core.kernels.node_inertia(corners @ turn.T)
        rule.append(stability_geometry.row_sum(found["ibar"]))
        lam.append(found["lambda"])
    assert np.ptp(lam) < 1e-12 * np.mean(lam)
    assert np.ptp(rule) > np.mean(lam)
    assert min(rule) < 0.2 * np.mean(lam)


def test_drift_of_integrated_velocities_fails_the_check():
    """The control of item 7: what this program passes, velocity-integrated positions do not, tiny steps or not."""
    assert stability_geometry.program_drift(2 * np.pi / 2000, 1) < 1e-12
    assert stability_geometry.spin_drift(2 * np.pi / 2000, 0.0, 1) > 1e-3
    assert stability_geometry.spin_drift(2 * np.pi / 2000, 0.5, 1) > 1e-9


def test_edge_of_what_has_no_limit_there():
    assert math.isnan(limits.edge(lambda x: False, 1.0))
    assert math.isnan(limits.edge(lambda x: True, 1.0))
    assert limits.edge(lambda x: x > 1.01, 1.0) == pytest.approx(1.01, rel=1e-3)


def test_a_wrong_limit_is_off():
    wrong = limits.Limit("1", "wrong", "x", 1.0, lambda x: x > 1.05)
    assert stability.limit_row(wrong)[-1] == "off"
    assert stability.value_row(limits.Value("1", "wrong", "x", 1.0, 1.1, 0.05))[-1] == "off"


def test_map_agrees_with_runs():
    for mode in stability_map.MODES:
        for ratio, step in ((0.1, 0.3), (30.0, 0.3), (0.3, 0.05), (30.0, 2.1)):
            point = stability_map.point(mode.name, ratio, step, run=True)
            assert (point.growth > limits.GROWS) != point.stable, mode.name
    full = [stability_map.point("full", ratio, 0.1) for ratio in (0.98, 1.02)]
    assert full[0].stable and not full[1].stable


@pytest.mark.parametrize("ratio", [3.0, 30.0, 300.0])
def test_what_works_at_heavy_tied_mass(ratio):
    """At H omega = 0.1, where no mode is green in which a load is held or the host extrapolates alone."""
    found = {mode.name: stability_map.point(mode.name, ratio, 0.1) for mode in stability_map.MODES}
    green = {name for name, point in found.items() if point.green}
    assert {"full-closed-linear", "free"} <= green
    assert not green & {"loads", "full", "split"}
    if ratio > 10:
        assert not green & {"split-lead-inside", "split-lead", "split-linear"}


@pytest.mark.parametrize("ratio", [2.0, 50.0])
@pytest.mark.parametrize("step", [0.01, 0.5])
def test_a_host_that_closes_the_loop_and_one_without_masters_give_the_monolithic_step(ratio, step):
    """By an independent way: eigenvalues of central difference of both vibrations, and of a held load that is the
    exact function of the displacements."""
    c, free, closed = 2 * stability_map.ZETA, [], []
    for tied in (0.0, ratio):
        w = step**2 / (1 + tied)
        free += np.roots([1, w + c * step / (1 + tied) - 2, 1 - c * step / (1 + tied)]).tolist()
        # the host alone, exact over a step, under the load tied (u + c u')/(1 + tied) of its start
        a = np.array([[0, 1], [-1, -c]])
        values, vectors = np.linalg.eig(a)
        exact = (vectors @ np.diag(np.exp(values * step)) @ np.linalg.inv(vectors)).real
        pushed = np.linalg.solve(a, exact - np.eye(2)) @ np.array([[0, 0], [tied / (1 + tied), c * tied / (1 + tied)]])
        closed += np.linalg.eigvals(exact + pushed).tolist()
    for name, expected in (("free", free), ("full-closed", closed)):
        roots = stability_map.BY_NAME[name].exchange(ratio, step).roots()
        for root in roots[np.abs(roots) > 1e-9]:
            assert np.abs(np.array(expected) - root).min() < 1e-6
        assert np.abs(roots).max() == pytest.approx(np.abs(expected).max(), rel=1e-6)


def test_one_derivative_along_the_gap_closes_a_slave_without_an_offset():
    """Theory (5.7), without a matrix: s = 1/(1 + r) of r = m sum Phi^2 / M."""
    tie = limits.InProcess(limits.plate(40.0, "full", place=(0.3, 0.6, 0.0)))
    rng, rest, jacobian = np.random.default_rng(3), np.zeros(12), tie.derivatives()
    host = rng.normal(size=12)
    used = tie.move(rest, rest, rng.normal(size=12))  # the load of some earlier acceleration
    first = (host + used) / tie.own
    gap = tie.move(rest, rest, first) - used
    along = gap / tie.own
    share = along @ gap / (along @ (gap - jacobian @ along))
    phi = limits._core.kernels.shape(4, -0.4, 0.2)
    assert share == pytest.approx(1 / (1 + 40 * np.sum(phi**2)), rel=1e-12)
    found = first + share * along
    np.testing.assert_allclose(tie.own * found, host + tie.move(rest, rest, found), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found, np.linalg.solve(np.diag(tie.own) - jacobian, host), rtol=1e-9)


def test_lead_shifts_the_delay_of_split():
    """Theory (5.9): an undamped host is damped with theta = 1, neither with (r + 1/2)/(r + 1), and driven with 0."""
    r, step = 10.0, 1e-3

    def rate(lead):  # logarithmic decrement a radian, of the vibrations that the slave does not move
        roots = limits.coupled(limits.plate(4 * r, "split"), "split", step, omega=1.0, lead=lead).roots()
        found = np.log(roots[np.abs(roots) > 1e-12].astype(complex)) / step
        return float(found[np.abs(found - 1j).argmin()].real)

    for lead in (0.0, 0.5, 1.0):
        late = r * (1 - lead) + 0.5 - lead
        assert rate(lead) == pytest.approx(step * late * r / (2 * (1 + r)), rel=0.02)
    assert abs(rate((r + 0.5) / (r + 1))) < 1e-3 * rate(0.0)


def test_displacements_from_the_fmu_are_those_of_a_held_load():
    """The control of `free`: a host that takes the FMU's positions grows, at any step."""
    masters = limits.owned(10.0, 0.1, 1.0, 0.0)
    roots = []
    for tied in (0.0, 10.0):
        w = 0.1**2 / (1 + tied)
        roots += np.linalg.eigvals([[1 - w / 2, 1], [-w, 1]]).tolist()
    assert masters.radius() <= limits.GROWS < max(np.abs(roots))
    assert max(np.abs(roots)) == pytest.approx(np.sqrt(1 + 0.1**2 / 2), rel=1e-9)


def test_reach():
    """The step that the table gives is green, one a twentieth longer is not."""
    step = stability_map.reach("split", 10.0, 0.1)
    assert stability_map.point("split", 10.0, step).green
    assert not stability_map.point("split", 10.0, 1.05 * step).green
    assert stability_map.reach("full", 2.0, 0.1) == 0.0
    assert stability_map.reach("loads", 0.01, 0.1) == 3.0


def test_study_writes_everything_and_repeats(tmp_path, capsys, monkeypatch):
    """On every sixth limit and fourth mode, which is quicker; limits and modes themselves are tested above."""
    some = LIMITS[::6] + LIMITS[-1:]
    monkeypatch.setattr(stability_cases, "limits", lambda: some)
    monkeypatch.setattr(stability_cases, "VALUES", [stability_cases.split_values, stability_cases.clamp_values])
    monkeypatch.setattr(stability_map, "MODES", stability_map.MODES[::4])
    monkeypatch.setattr(stability_map, "REACH", [10.0])
    written = []
    for name in ("a", "b"):
        options = argparse.ArgumentParser()
        stability.add_parser(options.add_subparsers())
        options = options.parse_args(["stability", "--out", str(tmp_path / name), "--grid", "4"])
        assert options.command(options) == 0
        written.append(
            {path.name: path.read_bytes() for path in (tmp_path / name).iterdir() if path.suffix in (".csv", ".html")}
        )
    assert written[0] == written[1]
    names = {path.name for path in (tmp_path / "a").iterdir()}
    assert names == {
        "stability_limits.csv",
        "stability_values.csv",
        "stability_map.csv",
        "stability_reach.csv",
        "stability.html",
        *(f"stability_{chart}.{kind}" for chart in ("limits", "map") for kind in ("png", "svg")),
    }
    rows = list(csv.DictReader(written[0]["stability_limits.csv"].decode().splitlines()))
    assert len(rows) == len(some) and {row["status"] for row in rows} == {"ok"}
    assert "8. outside the segment" in capsys.readouterr().out
