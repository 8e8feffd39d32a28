"""Ports where nodes are looked at one by one: advice, studies, and the moving mesh of a run."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import meshio
import numpy as np
import pytest
import tiefmu
from conftest import toml
from port_scenes import ported, single
from scipy.spatial.transform import Rotation
from tiefmu import advise
from tiefmu.cli import main
from tiefmu.study import host_modes, ports
from tiefmu.study.motion import Signals
from tiefmu.study.variants import Source

CORNERS = np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]])


def flange(**model) -> dict:
    """Four driven nodes in a port, three slaves in another."""
    slaves = [[101, 0.05, 0.03, 0.0], [102, 0.15, 0.03, 0.02], [103, 0.1, 0.08, 0.0]]
    return {
        "mesh": {
            "nodes": [[1 + k, *x] for k, x in enumerate(CORNERS.tolist())] + slaves,
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [
            {"nodes": "all", "mass": 2.0, "inertia": 0.01, "rotations": True},
            {"nodes": [101, 102, 103], "mass": 0.5},
        ],
        "tie": [{"segments": "all", "slaves": [101, 102, 103]}],
        "model": model,
        "interface": {
            "ports": [
                {"name": "flange", "nodes": [1, 2, 3, 4], "at": [0.3, 0.0, 0.1]},
                {"name": "glue", "nodes": [101, 102, 103], "at": [0.0, 0.2, 0.1]},
            ]
        },
    }


def written(scene: dict, csv: str) -> Source:
    with open("scene.toml", "w") as file:
        file.write(toml(scene))
    with open("scene.csv", "w") as file:
        file.write(csv)
    return Source("scene.toml")


def test_nodes_move_as_their_port_does(tmp_path, monkeypatch):
    """Against the solver, stepped with a thousandth of the turn."""
    monkeypatch.chdir(tmp_path)
    source = written(
        flange(), "time,port[flange].v[1],port[flange].w[2],port[flange].w[3]\n0,1,0,5\n0.1,3,8,-2\n0.3,0,1,4\n"
    )
    found = Signals.read(source.own, "scene.csv")
    simulation = source.own.simulation()
    simulation.initialise(0.0)
    names = [f"port[flange].{quantity}" for quantity in ("v[1]", "w[2]", "w[3]")]
    rows = np.array([[0, 1, 0, 5], [0.1, 3, 8, -2], [0.3, 0, 1, 4]], float)
    steps, order = 3000, np.argsort(source.own.model.report()["nodes"]["id"])

    def given(t):
        return np.array([np.interp(t, rows[:, 0], column) for column in rows.T[1:]])

    for k in range(steps):
        simulation.set_values(names, given(0.3 * (k + 0.5) / steps))
        simulation.step(0.3 / steps)
        if k % 500 == 499:
            t = 0.3 * (k + 1) / steps
            simulation.set_values(names, given(t))
            velocity = simulation.get("velocity")[order]
            expected = np.array([found.at((node, "v"), t) for node in (1, 2, 3, 4)])
            np.testing.assert_allclose(velocity, expected, atol=1e-4)  # ports.TURN^2 / 8 of 5 m/s
            np.testing.assert_allclose(simulation.get("spin")[order], [found.at((n, "w"), t) for n in (1, 2, 3, 4)])


@pytest.mark.parametrize("settings", [("default", True), ("optimized", False)])
def test_loads_of_ports_of_slaves(settings):
    """Spread over the slaves, or one slave's alone, they do to the masters what the port's load does."""
    made = ported(np.random.default_rng(4), (*settings, "lumped", "loads", "finite"))
    own, nodes = tiefmu.load(made), tiefmu.load(single(made))
    rng, reactions = np.random.default_rng(5), []
    load = {(name, key): rng.normal(size=(1, 3)) for name in ("load", "tip") for key in "ft"}
    _, spread = ports.expand(own, np.zeros(1), load)
    slave = {int(i): k for k, i in enumerate(nodes.model.report()["slaves"]["id"])}
    fields = {"f": np.zeros((len(slave), 3)), "t": np.zeros((nodes.start.fields["slave_moment"] // 3, 3))}
    for (node, key), value in spread.items():
        fields[key][slave[node]] += value[0]
    for scene, values in (
        (own, {f"port[{name}].{key}[{k}]": x[0, k - 1] for (name, key), x in load.items() for k in (1, 2, 3)}),
        (nodes, {}),
    ):
        simulation = scene.simulation()
        simulation.initialise(0.0)
        if values:
            simulation.set_values(list(values), np.array(list(values.values())))
        else:
            simulation.set("slave_force", fields["f"])
            simulation.set("slave_moment", fields["t"])
        reactions.append(simulation.get("reaction_force"))
    assert np.abs(reactions[0]).max() > 0.1
    np.testing.assert_allclose(reactions[0], reactions[1], rtol=0, atol=1e-12 * np.abs(reactions[0]).max())


def test_slaves_on_a_line_share_a_moment_by_their_rotations():
    made = flange()
    made["interface"]["ports"][1] |= {"nodes": [101, 102]}
    made["node"].append({"nodes": [101, 102], "inertia": 0.1})
    scene = tiefmu.load(made)
    load, moment = np.array([1.0, -2.0, 3.0]), np.array([0.4, 0.5, -0.6])
    _, spread = ports.expand(scene, np.zeros(1), {("glue", "f"): load[None], ("glue", "t"): moment[None]})
    place = {101: np.array([0.05, 0.03, 0.0]), 102: np.array([0.15, 0.03, 0.02])}
    np.testing.assert_allclose(sum(spread[node, "f"][0] for node in place), load)
    total = sum(np.cross(x - [0.0, 0.2, 0.1], spread[node, "f"][0]) + spread[node, "t"][0] for node, x in place.items())
    np.testing.assert_allclose(total, moment, atol=1e-12)


def test_mass_ratio_of_a_body(tmp_path, monkeypatch):
    """A port's host is one rigid body, with the slave on an arm from its centre: not the ratio of the nodes."""
    monkeypatch.chdir(tmp_path)
    made = flange()
    del made["interface"]["ports"][1]
    made["node"] = [{"nodes": "all", "mass": 2.0}, {"nodes": [101], "mass": 6.0}]
    made["tie"][0]["slaves"] = [101]
    arms = CORNERS - CORNERS.mean(axis=0)
    inertia = 2.0 * ((arms**2).sum() * np.eye(3) - arms.T @ arms)
    x = np.array([0.05, 0.03, 0.0]) - CORNERS.mean(axis=0)
    across = np.cross(x, np.eye(3))  # rows: x cross each direction
    body = 6.0 * np.linalg.eigvalsh(np.eye(3) / 8.0 + across @ np.linalg.inv(inertia) @ across.T).max()
    assert host_modes.ratios(written(made, "time\n0\n")).full == pytest.approx(body, rel=1e-9)
    made["interface"]["ports"] = []
    phi = tiefmu._core.kernels.shape(4, -0.5, -0.4)
    assert host_modes.ratios(written(made, "time\n0\n")).full == pytest.approx(6 / 2 * np.sum(phi**2), rel=1e-9)


def test_advice_on_ports_is_that_on_their_nodes(tmp_path, monkeypatch, capsys):
    """A port that does not turn moves its nodes as one: errors of all models are the same."""
    monkeypatch.chdir(tmp_path)
    made = flange()
    del made["interface"]["ports"][1]
    models = []
    for scene, masters in ((made, ["port[flange]"]), (single(made), [f"master[{k}]" for k in (1, 2, 3, 4)])):
        rows = [f"{t}" + f",{v}" * len(masters) + f",{f}" for t, v, f in ((0, 0, 0), (0.01, 1, 5), (0.02, -1, 50))]
        header = ",".join(["time", *(f"{master}.v[3]" for master in masters), "slave[1].f[1]"])
        source = written(scene, "\n".join([header, *rows]) + "\n")
        models.append(advise.advise(source, Path("scene.csv"), 1e-2).models)
    assert [variant for variant, _ in models[0]] == [variant for variant, _ in models[1]]
    np.testing.assert_allclose([x for _, x in models[0]], [x for _, x in models[1]], rtol=1e-6, atol=1e-10)
    written(made, "time,port[flange].v[3],slave[1].f[1]\n0,0,1\n0.01,1,5\n")
    assert main(["advise", "scene.toml", "--tolerance", "1e-2", "--write", "new.toml"]) == 0
    assert "reaction: " in capsys.readouterr().out
    assert [port["name"] for port in tiefmu.load("new.toml").model.report()["ports"]] == ["flange"]


def test_a_port_that_turns_too_far(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(flange(), "time,port[flange].w[1]\n0,1\n1,1e6\n")
    assert main(["advise", "scene.toml"]) == 2
    assert capsys.readouterr().err == "error: scene.toml: a port turns too far for a study; give a shorter input\n"


@pytest.mark.parametrize("geometry", ["finite", "small"])
def test_a_moving_mesh_of_ports(geometry, tmp_path, monkeypatch, capsys):
    """Nodes behind ports stand where the turn about the reference point puts them, slaves on them; an FMU alone cannot
    say where."""
    monkeypatch.chdir(tmp_path)
    written(flange(geometry=geometry), "time,port[flange].v[1],port[flange].w[3],port[glue].f[1]\n0,1,2,3\n0.1,1,2,3\n")
    assert main(["run", "scene.toml", "--input", "scene.csv", "--pvd", "run.pvd", "--frames", "3"]) == 0
    frames = ElementTree.parse("run.pvd").getroot().findall("Collection/DataSet")
    assert len(frames) == 3
    for frame in frames:
        t, mesh = float(frame.get("timestep")), meshio.read(frame.get("file"))
        x0 = np.array([*CORNERS.tolist(), [0.05, 0.03, 0.0], [0.15, 0.03, 0.02], [0.1, 0.08, 0.0]])
        arms, at = x0 - [0.3, 0, 0.1], np.array([0.3, 0, 0.1])
        turned = (
            Rotation.from_rotvec([0, 0, 2 * t]).apply(arms)
            if geometry == "finite"
            else arms + t * np.cross([0, 0, 2], arms)
        )
        np.testing.assert_allclose(mesh.points[:7], at + [t, 0, 0] + turned, atol=1e-9)
        velocity = [1, 0, 0] + np.cross([0, 0, 2], turned if geometry == "finite" else arms)
        np.testing.assert_allclose(mesh.point_data["velocity"][:7], velocity, atol=1e-9)
        np.testing.assert_allclose(mesh.point_data["reaction"][:4].sum(axis=0)[0], 3.0, atol=1e-9)
    assert main(["build", "scene.toml"]) == 0
    assert main(["run", "scene.fmu", "--pvd", "two.pvd"]) == 2
    assert capsys.readouterr().err == "error: two.pvd: nodes behind ports show no positions in an FMU; give its scene\n"
    assert not list(tmp_path.glob("two*"))
