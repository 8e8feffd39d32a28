"""`tiefmu advise` on every example scene: what it says is run from the scene it wrote, and its error found anew."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import tiefmu
import tomllib
from conftest import toml
from tiefmu import advise as advising
from tiefmu.cli import main
from tiefmu.signals import inputs_beside
from tiefmu.study import host_modes, motion, speed_accuracy_runs, stability_map
from tiefmu.study.motion import Signals
from tiefmu.study.variants import Source

SCENES = sorted((Path(__file__).parents[1] / "scenes").glob("*.toml"))
TOLERANCE = 3e-3
FINER = 16  # how much finer than its stability limit the fresh reference of a free scene steps


@pytest.fixture(autouse=True)
def short_times(monkeypatch):
    monkeypatch.setattr(motion, "REPEATS", 1)
    monkeypatch.setattr(motion, "SHORTEST", 0.0)
    monkeypatch.setattr(speed_accuracy_runs, "HORIZON", 20)


def relative(x, exact):
    return np.linalg.norm(x - exact) / np.linalg.norm(exact)


class Given:
    """The input CSV by columns, read here."""

    def __init__(self, path):
        lines = path.read_text().splitlines() if path and path.is_file() else ["time", "0"]
        self.names = lines[0].split(",")[1:]
        table = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
        self.time, self.columns = table[:, 0], table[:, 1:]

    def at(self, t):
        return np.array([np.interp(t, self.time, column) for column in self.columns.T])

    def mean(self, a, b):
        knots = np.concatenate([[a], self.time[(self.time > a) & (self.time < b)], [b]])
        values = np.array([self.at(t) for t in knots])
        return (
            np.trapezoid(values, knots, axis=0) / (b - a)
            if hasattr(np, "trapezoid")
            else np.trapz(values, knots, axis=0) / (b - a)
        )


def written(path, new, **changes):
    """The advised scene with more changes, as a dict that finds its mesh."""
    raw = tomllib.loads(new.read_text())
    if "file" in raw["mesh"]:
        raw["mesh"]["file"] = str((new.parent / raw["mesh"]["file"]).resolve())
    for key, value in changes.items():
        table, name = key.split("__")
        raw.setdefault(table, {})[name] = value
    return tiefmu.load(raw)


def slave_velocities(scene, given, edges):
    """At the end of each interval of constant mean inputs."""
    simulation = scene.simulation()
    simulation.initialise(0.0)
    result = []
    for a, b in itertools.pairwise(edges):
        if given.names:
            simulation.set_values(given.names, given.mean(a, b))
        simulation.step(b - a)
        result.append(simulation.get("slave_velocity"))
    return np.array(result)


def check_free(path, new, advice):
    source = Source(path)
    edges = speed_accuracy_runs.intervals(source, Signals.read(source.scene, inputs_beside(path)))
    given, scene = Given(path.with_suffix(".csv")), written(path, new)
    assert advice.choice.step <= advising.SAFETY * scene.start.integrator_limit * (1 + 1e-9)
    limit = scene.start.get("stable_time_step")[0]
    exact = slave_velocities(
        written(
            path,
            new,
            model__inertia="consistent",
            model__geometry="finite",
            integrator__method="rk4",
            integrator__time_step=limit / FINER / scene_time(new),
        ),
        given,
        edges,
    )
    error = relative(slave_velocities(scene, given, edges), exact)
    assert error <= 1.02 * TOLERANCE
    assert error == pytest.approx(advice.choice.error_v, rel=0.05)


def scene_time(new) -> float:
    return {"s": 1.0, "ms": 1e-3}[tomllib.loads(new.read_text()).get("units", {}).get("time", "s")]


def play_host(scene, given, end, steps, middle, reaction):
    """Steps of equal length; at 40 times the slaves' velocities and all of the tie's load on the masters."""
    simulation = scene.simulation()
    simulation.initialise(0.0)
    speeds = [k for k, name in enumerate(given.names) if name.split(".")[1][0] in "vw"]
    loads = [k for k, name in enumerate(given.names) if name.split(".")[1][0] in "ft"]
    names = [given.names[k] for k in speeds]
    rates = [name.replace(".v[", ".a[").replace(".w[", ".z[") for name in names]
    other, h = [given.names[k] for k in loads], end / steps
    added = scene.start.get("added_mass")[:, None]
    nodes = {int(i): k for k, i in enumerate(scene.model.report()["nodes"]["id"])}
    ids = {
        f"master[{n}]": int(i)
        for block in simulation.variables
        if block["name"] == "master.f"
        for n, i in zip(block["numbers"], block["ids"])
    }
    v, f = [], []
    for k in range(steps):
        simulation.set_values(names, given.at((k + (0.5 if middle else 0)) * h)[speeds])
        simulation.step(h)
        if (k + 1) % (steps // 40):
            continue
        t = (k + 1) * h
        row = int(np.searchsorted(given.time, t * (1 - 1e-12)))  # the slope before t
        slope = (given.columns[row] - given.columns[row - 1]) / (given.time[row] - given.time[row - 1])
        simulation.set_values(names, given.at(t)[speeds])
        simulation.set_values(other, given.at(t)[loads])
        if reaction != "loads":
            simulation.set_values(rates, slope[speeds])
        a = np.zeros((len(nodes), 3))
        for name, rate in zip(names, slope[speeds]):
            if ".v[" in name:
                a[nodes[ids[name.split(".")[0]]], int(name[-2]) - 1] = rate
        v.append(simulation.get("slave_velocity"))
        f.append(simulation.get("reaction_force") - (0 if reaction == "full" else added * a))
    return np.array(v), np.array(f)


def check_driven(path, new, advice):
    given, scene = Given(path.with_suffix(".csv")), written(path, new)
    given.columns = given.columns[
        :, keep := [k for k, name in enumerate(given.names) if name.split(".")[1][0] not in "az"]
    ]
    given.names = [given.names[k] for k in keep]
    end, steps = given.time[-1], round(given.time[-1] / advice.choice.step)
    reaction = tomllib.loads(new.read_text())["model"]["reaction"]
    assert reaction == advice.choice.reaction and reaction != "full"
    exact = play_host(
        written(path, new, model__inertia="consistent", model__geometry="finite", model__reaction="full"),
        given,
        end,
        8 * len(given.time) // 40 * 40,
        True,
        "full",
    )
    now = play_host(scene, given, end, steps, advice.choice.method == "midpoint input", reaction)
    errors = [relative(x, y) for x, y in zip(now, exact)]
    assert max(errors) <= 1.02 * TOLERANCE
    assert max(errors) == pytest.approx(advice.choice.error, rel=0.05, abs=1e-6)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_advised_scene_keeps_the_tolerance(path, tmp_path, capsys, monkeypatch):
    found = []
    original = advising.advise
    monkeypatch.setattr(advising, "advise", lambda *arguments: found.append(original(*arguments)) or found[0])
    new = tmp_path / "new.toml"
    assert main(["advise", str(path), "--tolerance", str(TOLERANCE), "--write", str(new)]) == 0
    said = capsys.readouterr().out
    for line in ("freedoms: ", "inertia: ", "geometry: ", "integrator: "):
        assert said.count(f"\n{line}") == 1
    assert ("\nreaction: " in said) == Source(path).any_driven
    (check_free if Source(path).any_free else check_driven)(path, new, found[0])


def test_full_is_refused_for_the_heavy_slave(capsys):
    path = next(path for path in SCENES if path.stem == "heavy_slave")
    assert main(["advise", str(path)]) == 0
    said = capsys.readouterr().out
    assert "full is refused" in said and "r = 24.7" in said and "reaction: split" in said


def test_mass_ratio_is_that_of_theory(tmp_path):
    """One slave m at the centre of four masters M, no offset: T^T m T / M has the eigenvalue m/(4 M)."""
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.5, 0.5, 0]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "mass": 2.0}, {"nodes": [101], "mass": 6.0}],
        "tie": [{"segments": "all", "slaves": [101]}],
    }
    (tmp_path / "a.toml").write_text(toml(scene))
    assert host_modes.ratios(Source(tmp_path / "a.toml")).full == pytest.approx(6 / 8, rel=1e-12)
    scene["node"][0]["mass"] = 0.0
    (tmp_path / "a.toml").write_text(toml(scene))
    assert host_modes.ratios(Source(tmp_path / "a.toml")).full == np.inf


def test_a_larger_step_than_advised_breaks_the_tolerance():
    """Control: the next larger step that was tried is not good enough, or is past the safety of the limit."""
    path = next(path for path in SCENES if path.stem == "spinning")
    advice = advising.advise(Source(path), None, 1e-4)
    step, error = advice.choice.coarser
    assert step > advice.choice.step and error > 1e-4 >= advice.choice.error


def test_bad_input_is_one_line(tmp_path, capsys):
    spinning = next(path for path in SCENES if path.stem == "spinning")
    undriven = tmp_path / "undriven.toml"
    undriven.write_text(next(path for path in SCENES if path.stem == "heavy_slave").read_text())
    for arguments, said in [
        (["nosuch.toml"], "nosuch.toml: no such file"),
        ([spinning, "--tolerance", "1e-15"], "out of reach"),
        ([undriven], "every master is driven and there is no input"),
        ([spinning, "--write", tmp_path / "no" / "new.toml"], "does not exist"),
    ]:
        assert main(["advise", *map(str, arguments)]) == 2
        error = capsys.readouterr().err
        assert said in error and error.startswith("error: ") and error.count("\n") == 1
    with pytest.raises(SystemExit) as stop:
        main(["advise", str(spinning), "--tolerance", "-1"])
    assert stop.value.code == 2


def driven(tmp_path, mass=6.0, host=2.0, **node) -> Path:
    """A slave in the middle of four masters of the host."""
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.5, 0.5, 0]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "mass": host} | node, {"nodes": [101], "mass": mass}],
        "tie": [{"segments": "all", "slaves": [101]}],
    }
    (tmp_path / "a.toml").write_text(toml(scene))
    return tmp_path / "a.toml"


@pytest.mark.parametrize("stiffness", ["option", "scene"])
def test_a_host_gets_the_mode_whose_point_is_green(stiffness, tmp_path, capsys):
    """r = 30 at H omega = 0.1, omega^2 = K/M: what is said is the point of the map there."""
    path = driven(tmp_path, 240.0, **({} if stiffness == "option" else {"stiffness": 5e5}))
    given = ["--host-stiffness", "5e5"] if stiffness == "option" else []
    assert main(["advise", str(path), "--host-step", "2e-4", *given, "--tolerance", "1e-2"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[1] == "host: step 0.0002 s, H omega = 0.1, tied mass over the host's r = 30"
    for line, mode in zip(said[2:], stability_map.MODES):
        point = stability_map.point(mode.name, 30.0, 0.1)
        assert line.split()[0] == mode.name and line.endswith("green") == point.green
        assert ("unstable" in line) == (not point.stable)
    green = [mode.name for mode in stability_map.MODES if stability_map.point(mode.name, 30.0, 0.1).error < 1e-2]
    assert said[-1].startswith(f"reaction: {green[0]}, ") and green[0] == "full-closed-linear"


def test_no_mode_for_a_step_that_is_too_long(tmp_path, capsys):
    path = driven(tmp_path, 240.0)
    assert main(["advise", str(path), "--host-step", "2e-2", "--host-stiffness", "5e5"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-2] == "reaction: none is stable and right to 10 % at this step"
    step = float(re.search(r"at ([\d.e-]+) s$", said[-1])[1])
    assert step < 2e-2 and stability_map.point(said[-1].split()[4], 30.0, 500 * step).green


@pytest.mark.parametrize(
    "mass, step, tolerance, mode, model",
    [
        (24.0, "2e-6", "5e-3", "split", {"reaction": "split"}),
        (240.0, "4e-5", "5e-2", "split-lead-inside", {"reaction": "split", "reaction_lead": 1.0}),
    ],
)
def test_the_mode_is_written(mass, step, tolerance, mode, model, tmp_path, capsys):
    path = driven(tmp_path, mass)
    (tmp_path / "a.csv").write_text("time,master[1].v[3],slave[1].f[3]\n0,0,0\n0.01,1,5\n")
    new = tmp_path / "new.toml"
    arguments = ["advise", str(path), "--host-step", step, "--host-stiffness", "5e5", "--write", str(new)]
    assert main([*arguments, "--tolerance", tolerance]) == 0
    assert f"reaction: {mode}, " in capsys.readouterr().out
    written = tomllib.loads(new.read_text())["model"]
    assert written == model | {"inertia": "consistent", "geometry": written["geometry"]}


def test_a_deck_gets_advice(capsys):
    deck = SCENES[0].parent / "pin_weld.rad"
    assert main(["advise", str(deck), "--host-step", "1e-6"]) == 0
    said = capsys.readouterr().out
    assert "host: step 1e-06 s" in said and "freedoms: " in said
    assert main(["advise", str(deck), "--write", "new.toml"]) == 2
    assert "import it first" in capsys.readouterr().err


def test_hosts_that_nothing_can_be_said_of(tmp_path, capsys):
    spinning = next(path for path in SCENES if path.stem == "spinning")
    heavy = next(path for path in SCENES if path.stem == "heavy_slave")
    for arguments, said in [
        ([spinning, "--host-step", "1e-5"], "no master is driven"),
        ([heavy, "--host-step", "1e-5"], "no stiffness of the host is known"),
        ([heavy, "--host-stiffness", "1e5"], "needs --host-step"),
        ([driven(tmp_path, host=0.0), "--host-step", "1", "--host-stiffness", "1"], "has no mass"),
    ]:
        assert main(["advise", *map(str, arguments)]) == 2
        error = capsys.readouterr().err
        assert said in error and error.startswith("error: ") and error.count("\n") == 1
