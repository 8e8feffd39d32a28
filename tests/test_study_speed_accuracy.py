"""The study of speed against accuracy: its CSV, its orders of convergence, its reference against SciPy."""

import csv
import itertools
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from conftest import toml
from independent import Problem
from independent_kernels import cross
from scipy.integrate import solve_ivp
from tiefmu import SceneError
from tiefmu.cli import main
from tiefmu.study import motion, reference, speed_accuracy, speed_accuracy_runs
from tiefmu.study.driven import DrivenRun, HeavyRun
from tiefmu.study.motion import FreeRun, Signals
from tiefmu.study.variants import METHODS, Source, Variant

# One free quad on ground springs, a heavy slave off its plane, nothing that damps.
FREE = {
    "mesh": {
        "nodes": [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0.01], [101, 0.03, 0.06, 0.04]],
        "segments": [[1, 1, 2, 3, 4]],
    },
    "node": [{"nodes": "all", "motion": "free", "mass": 1.0}, {"nodes": [101], "mass": 0.7}],
    "tie": [{"segments": "all", "slaves": [101], "formulation": "optimized"}],
    "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": [2e4, 3e4, 4e4]}],
    "initial": [{"nodes": [1], "v": [0.0, 0.3, 0.5]}, {"nodes": [3], "v": [0.2, 0.0, -0.4]}],
    "model": {"inertia": "consistent"},
}
DRIVEN = {
    "mesh": FREE["mesh"],
    "node": [
        {"nodes": "all", "mass": 1.0, "rotations": True, "inertia": 1e-3},
        {"nodes": [101], "mass": 0.7, "inertia": 2e-4},
    ],
    "tie": [{"segments": "all", "slaves": [101]}],
    "model": {"gravity": [0, 0, -9.81]},
}
ORDER = {"central-difference": 2, "symplectic-euler": 1, "noh-bathe": 2, "rk4": 4, "held input": 1, "midpoint input": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Times are measured once and short: nothing here looks at them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motion, "REPEATS", 1)
        patch.setattr(motion, "SHORTEST", 0.0)
        patch.setattr(speed_accuracy_runs, "HORIZON", 4)
        yield tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def free(folder) -> Path:
    """A small study of the free scene; the path of its CSV."""
    (folder / "free.toml").write_text(toml(FREE))
    assert (
        main(["study", "speed-accuracy", str(folder / "free.toml"), "--out", str(folder / "out"), "--ladder", "8"]) == 0
    )
    return folder / "out" / "speed-accuracy-free.csv"


@pytest.fixture(scope="module")
def driven(folder) -> Path:
    """The same of the driven scene under smooth motions, sampled so densely that their kinks do not show."""
    (folder / "driven.toml").write_text(toml(DRIVEN))
    t = np.linspace(0, 0.5, 2001)
    columns = {"time": t, "slave[1].f[1]": 3 * np.sin(9 * t)}
    for i in (1, 2, 3, 4):
        columns |= {
            f"master[{i}].v[3]": np.sin(7 * t + i),
            f"master[{i}].w[1]": 4 * np.cos(5 * t),
            f"master[{i}].w[2]": 3 * np.sin(3 * t + i),
        }
    rows = [",".join(columns), *(",".join(map(repr, row)) for row in np.array(list(columns.values())).T.tolist())]
    (folder / "driven.csv").write_text("\n".join(rows) + "\n")
    assert (
        main(["study", "speed-accuracy", str(folder / "driven.toml"), "--out", str(folder / "out"), "--ladder", "5"])
        == 0
    )
    return folder / "out" / "speed-accuracy-driven.csv"


def records(table: Path) -> list[dict]:
    with open(table, newline="") as file:
        return list(csv.DictReader(file))


MODEL = ("formulation", "geometry", "inertia", "freedoms", "penalty", "reaction")


def curves(table: Path) -> dict:
    """{(model, method): (steps, discretisation errors)} from the CSV, by falling step."""
    result = {}
    for row in records(table):
        if row["status"] == "ok" and row["method"] != "exact":
            key = (*(row[name] for name in MODEL), row["method"])
            result.setdefault(key, []).append((float(row["step"]), float(row["discretisation_v"])))
    return {key: np.array(sorted(points, reverse=True)).T for key, points in result.items()}


def order_of(steps, errors) -> float:
    """From the two finest steps whose errors stand clear of rounding."""
    clear = np.flatnonzero(errors > 1e-9)[-2:]
    return np.diff(np.log(errors[clear]))[0] / np.diff(np.log(steps[clear]))[0]


def test_every_curve_of_a_free_scene_falls_with_the_order_of_its_method(free):
    found = curves(free)
    ties = {key: points for key, points in found.items() if float(key[4]) == 0}
    assert {key[-1] for key in ties} == set(METHODS)
    assert len(ties) == 4 * 8  # methods x inertia, geometry, formulation
    for key, points in ties.items():
        assert order_of(*points) == pytest.approx(ORDER[key[-1]], abs=0.25), key


def test_the_order_is_told_apart(free):
    """Control: no curve would pass as one of another order."""
    for key, points in curves(free).items():
        for other in {1, 2, 4} - {ORDER[key[-1]]}:
            assert abs(order_of(*points) - other) > 0.25 or float(key[4]) > 0


def test_every_curve_of_a_driven_scene_falls_with_its_order(driven):
    found = curves(driven)
    finite = {key: points for key, points in found.items() if key[1] == "finite" and key[3] == "all"}
    assert {key[-1] for key in finite} == {"held input", "midpoint input"}
    for key, points in finite.items():
        assert order_of(*points) == pytest.approx(ORDER[key[-1]], abs=0.1), key


def test_model_error_is_what_total_error_ends_in(free):
    """Lumping: total error of the finest run = model error, which its own discretisation error is far below."""
    rows = [
        row for row in records(free) if row["inertia"] == "lumped" and row["method"] == "rk4" and row["status"] == "ok"
    ]
    for key in {(row["formulation"], row["geometry"]) for row in rows}:
        finest = min(
            (row for row in rows if (row["formulation"], row["geometry"]) == key), key=lambda row: float(row["step"])
        )
        assert float(finest["error_v"]) == pytest.approx(float(finest["model_v"]), rel=1e-3)
        assert float(finest["discretisation_v"]) < 1e-3 * float(finest["model_v"])


def test_runs_beyond_the_limit_diverge_and_have_neither_error_nor_cost(free):
    runs = [row for row in records(free) if row["method"] != "exact"]
    for row in runs:
        ratio, diverged = float(row["step_over_limit"]), row["status"] == "diverged"
        assert ratio > 1 if diverged else ratio < 1.2, row  # just beyond, growth takes longer than this short run
        assert (row["cpu_s_per_s"] == "nan") == (row["error_v"] == "nan") == diverged
    assert {row["method"] for row in runs if row["status"] == "diverged"} == set(METHODS)


def test_two_runs_differ_only_in_the_time_columns(free, folder):
    source = Source(folder / "free.toml")
    rows, _ = speed_accuracy.study(source, None, folder / "again.csv", 8)
    again = records(folder / "again.csv")
    assert len(again) == len(rows) == len(records(free))
    for row, other in zip(records(free), again):
        for name in row.keys() - set(speed_accuracy.TIMES):
            assert row[name] == other[name], (name, row)
    assert any(row["cpu_s_per_s"] != other["cpu_s_per_s"] for row, other in zip(records(free), again))


def test_the_csv_reads_back(free):
    rows = speed_accuracy_runs.read(free)
    for row, text in zip(rows, records(free)):
        assert {name: str(value) for name, value in asdict(row).items()} == text


# ---- the reference against SciPy


def test_reference_of_a_free_scene_is_dop853_of_the_independent_equations(folder, free):
    source = Source(folder / "free.toml")
    signals = Signals.read(source.scene, None)
    edges = speed_accuracy_runs.intervals(source, signals)
    ours, error = reference.solve(FreeRun(source.build(Variant(), "rk4", heavy=True), signals, edges), 1e-11)
    assert error[0] <= 1e-11
    exact = Problem(FREE).solve(edges, rtol=1e-13)[1:]
    v, f = np.array([now["slave_v"] for now in exact]), np.array([now["reaction"]["full"][:, :3] for now in exact])
    assert np.linalg.norm(v - ours.v) < 3e-11 * np.linalg.norm(v)
    assert np.linalg.norm(f - ours.f[:, :4]) < 3e-9 * np.linalg.norm(f)
    # control: a run that is only good to 1e-6 would not pass
    coarse = FreeRun(source.build(Variant(), "rk4", heavy=True), signals, edges).trajectory(24)
    assert np.linalg.norm(v - coarse.v) > 3e-11 * np.linalg.norm(v)


def test_reference_of_a_driven_scene_is_its_inverse_dynamics(folder, driven):
    """Offset turned by a DOP853 written here, f = -Phi_i m_s (a_s - g) and the given loads."""
    source = Source(folder / "driven.toml")
    signals = Signals.read(source.scene, folder / "driven.csv")
    ours, _ = reference.solve(HeavyRun(source.build(Variant(), "rk4", heavy=True), signals), 1e-11)
    found = source.scene.model.report()["slaves"]
    phi, d0 = found["weights"][0], found["offset"][0]

    def spin(t):
        return sum(p * signals.at((i, "w"), t) for p, i in zip(phi, (1, 2, 3, 4)))

    def slope(kind, t):
        """Of the interval that ends at t."""
        return sum(
            p * (signals.at((i, kind), t) - signals.at((i, kind), t - 1e-6)) / 1e-6 for p, i in zip(phi, (1, 2, 3, 4))
        )

    d, last = d0, 0.0
    rows = signals.time
    for sample, t in enumerate(np.linspace(0, 0.5, 41)[1:]):
        knots = np.concatenate([[last], rows[(rows > last + 1e-9) & (rows < t - 1e-9)], [t]])
        for a, b in itertools.pairwise(knots):  # smooth between the kinks of the input
            turned = solve_ivp(lambda s, x: cross(spin(s), x), (a, b), d, method="DOP853", rtol=1e-13, atol=1e-16)
            d = turned.y[:, -1]
        last = t
        w = spin(t)
        v = sum(p * signals.at((i, "v"), t) for p, i in zip(phi, (1, 2, 3, 4)))
        assert ours.v[sample, 0] == pytest.approx(v + np.cross(w, d), abs=1e-10)
        a_s = slope("v", t) + np.cross(slope("w", t), d) + np.cross(w, np.cross(w, d))
        load = signals.at((101, "f"), t) - 0.7 * (a_s - [0, 0, -9.81])
        assert ours.f[sample] == pytest.approx(np.outer(phi, load), abs=1e-6)


def test_full_and_split_with_what_the_host_carries_are_the_same_load(folder, driven):
    source = Source(folder / "driven.toml")
    signals = Signals.read(source.scene, folder / "driven.csv")
    runs = [
        DrivenRun(source.build(Variant(), reaction=reaction), signals, reaction, "held input").trajectory(2)
        for reaction in ("full", "split")
    ]
    assert runs[0].difference(runs[1])[1] < 1e-13


# ---- page, interruption, bad input


def test_the_page_stands_alone(free, driven):
    text = (free.parent / "speed-accuracy.html").read_text()
    assert text.count("<svg") >= 4 and text.count("<h2") == 2
    assert not re.search(r'(src|href)="(?!#)', text) and "<script" not in text
    ids = re.findall(r'\bid="([^"]*)"', text)
    assert len(ids) == len(set(ids))
    for table in (free, driven):
        assert table.with_suffix(".png").stat().st_size > 10000 and table.with_suffix(".svg").is_file()


def test_interruption_leaves_the_finished_rows(folder, free, monkeypatch):
    source, table, count = Source(folder / "free.toml"), folder / "stopped.csv", 0
    original = speed_accuracy_runs.Study.measured

    def measured(*arguments, **values):
        nonlocal count
        count += 1
        if count == 4:
            raise KeyboardInterrupt
        return original(*arguments, **values)

    monkeypatch.setattr(speed_accuracy_runs.Study, "measured", measured)
    with pytest.raises(KeyboardInterrupt):
        speed_accuracy.study(source, None, table, 3)
    assert len(records(table)) == 4  # the exact solution and three runs


def test_bad_input_is_one_line(folder, capsys, driven):
    unsprung = FREE | {"spring": []}
    (folder / "unsprung.toml").write_text(toml({key: item for key, item in unsprung.items() if item != []}))
    (folder / "unmoved.toml").write_text(toml(DRIVEN))
    for scene, said in [
        ("nosuch.toml", "nosuch.toml: no such file"),
        ("unsprung.toml", "unsprung.toml: no free node is held by a spring"),
        ("unmoved.toml", "unmoved.toml: every master is driven and there is no input"),
    ]:
        assert main(["study", "speed-accuracy", str(folder / scene), "--out", str(folder / "bad")]) == 2
        error = capsys.readouterr().err
        assert said in error and error.startswith("error: ") and error.count("\n") == 1
    with pytest.raises(SystemExit) as stop:
        main(["study", "speed-accuracy", str(folder / "free.toml"), "--ladder", "0"])
    assert stop.value.code == 2


def test_a_penalty_needs_mass():
    source = Source(Path(__file__).parents[1] / "scenes" / "heavy_slave.toml")
    with pytest.raises(SceneError, match="no free node is held by a spring"):
        source.build(Variant(penalty=1.0))
