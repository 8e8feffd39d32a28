"""Ports in a scene: saved states, the size of the interface, initial velocities, sets, units and what is refused."""

import numpy as np
import pytest
import tiefmu
from port_scenes import PORTS, line_of_slaves, names, ported, vector


def test_saved_states_hold_the_ports():
    rng = np.random.default_rng(11)
    made = ported(rng, ("default", True, "consistent", "split", "finite"), motions="mixed")
    scene = tiefmu.load(made)
    one, other = scene.simulation(), scene.simulation()
    one.initialise(0.0), other.initialise(0.0)
    outputs = [name for block in one.variables if block["causality"] == "output" for name in names(block)]
    vector(one, "port[base].w", [1.0, 2.0, -0.5]), vector(one, "port[arm].v", [0.1, 0.0, 0.3])
    vector(one, "port[load].f", [0.1, 2.0, 0.3]), vector(one, "port[load].t", [0.5, 0.0, 0.3])
    one.step(0.1)
    vector(one, "port[base].v", [1.0, 0.0, 0.5])
    state = one.save()
    one.step(0.1)
    expected = one.get_values(outputs)
    for simulation in (one, other):
        simulation.restore(state)
        simulation.step(0.1)
        np.testing.assert_array_equal(simulation.get_values(outputs), expected)


def test_the_interface_of_a_large_tie_has_24_variables():
    """10^4 slaves over 100 x 100 quads."""
    side = 100
    y, x = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0), indexing="ij")
    low = np.column_stack([1 + np.arange(x.size), x.ravel(), y.ravel(), np.zeros(x.size)])
    first = 20001
    high = np.column_stack(
        [
            first + np.arange(side * side),
            x[:-1, :-1].ravel() + 0.4,
            y[:-1, :-1].ravel() + 0.3,
            np.full(side * side, 0.1),
        ]
    )
    corner = (1 + np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.column_stack([1 + np.arange(side * side), corner, corner + 1, corner + side + 2, corner + side + 1])
    scene = tiefmu.load(
        {
            "mesh": {
                "nodes": [[int(row[0]), *row[1:]] for row in np.vstack([low, high]).tolist()],
                "segments": quads.tolist(),
            },
            "node": [{"nodes": "all", "mass": 0.1}],
            "tie": [{"name": "glue", "slaves": high[:, 0].astype(int).tolist(), "formulation": "optimized"}],
            "interface": {
                "ports": [
                    {"name": "lower", "nodes": low[:, 0].astype(int).tolist()},
                    {"name": "upper", "nodes": high[:, 0].astype(int).tolist()},
                ]
            },
        }
    )
    listed = [name for block in scene.start.variables for name in names(block)]
    assert sorted(listed) == sorted(
        f"port[{port}].{key}[{k}]" for port in ("lower", "upper") for key in "vwft" for k in (1, 2, 3)
    )
    simulation = scene.simulation()
    simulation.initialise(0.0)
    rng = np.random.default_rng(12)
    force, moment, v, w = rng.normal(size=(4, 3))
    vector(simulation, "port[upper].f", force), vector(simulation, "port[upper].t", moment)
    vector(simulation, "port[lower].v", v), vector(simulation, "port[lower].w", w)
    at = {row["name"]: np.array(row["at"]) for row in tiefmu.report(scene)["ports"]}
    arm = at["upper"] - at["lower"]
    np.testing.assert_allclose(vector(simulation, "port[lower].f"), force, atol=1e-10)
    np.testing.assert_allclose(vector(simulation, "port[lower].t"), moment + np.cross(arm, force), atol=1e-8)
    np.testing.assert_allclose(vector(simulation, "port[upper].v"), v + np.cross(w, arm), atol=1e-10)
    np.testing.assert_allclose(vector(simulation, "port[upper].w"), w, atol=1e-10)


def test_initial_velocities_become_the_ports():
    made = ported(np.random.default_rng(13), ("default", True, "lumped", "loads", "finite"))
    v, w = np.array([3.0, 1.0, -2.0]), np.array([0.5, -1.0, 2.0])
    position = {row[0]: np.array(row[1:]) for row in made["mesh"]["nodes"]}
    made["initial"] = [
        {"nodes": [i], "v": (v + np.cross(w, position[i] - PORTS[0]["at"])).tolist(), "w": w.tolist()}
        for i in PORTS[0]["nodes"]
    ]
    simulation = tiefmu.load(made).simulation()
    np.testing.assert_allclose(vector(simulation, "port[base].v"), v, atol=1e-12)
    np.testing.assert_array_equal(vector(simulation, "port[base].w"), w)
    made["initial"][2]["v"][0] += 0.1
    line = r"^scene: interface: port 'base': node \d+: its \[\[initial\]\] velocity does not fit "
    with pytest.raises(tiefmu.SceneError, match=line + "a rigid motion of the port's nodes$"):
        tiefmu.load(made)


def test_set_members_outside_every_tie_are_passed_over(tmp_path):
    """A set of a mesh file may hold more than the tie uses; ids given one by one may not."""
    (tmp_path / "panel.inp").write_text(
        "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,2,0,0\n6,2,1,0\n"
        "101,0.3,0.4,0.1\n102,0.6,0.7,0.1\n103,0.2,0.8,0.1\n"
        "*ELEMENT, TYPE=S4\n1,1,2,3,4\n2,2,5,6,3\n*NSET, NSET=lower\n1,2,3,4,5,6\n*NSET, NSET=upper\n101,102,103\n"
        "*NSET, NSET=mixed\n1,101\n*NSET, NSET=far\n5,6\n"
    )
    made = {
        "mesh": {"file": str(tmp_path / "panel.inp")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "tie", "slaves": "upper", "formulation": "optimized"}],
        "interface": {"ports": ["lower", "upper"]},
    }
    report = tiefmu.report(tiefmu.load(made))
    held = {row["name"]: row["nodes"] for row in report["ports"]}
    assert held == {"lower": [1, 2, 3, 4], "upper": [101, 102, 103]}
    np.testing.assert_allclose(report["ports"][0]["at"], [0.5, 0.5, 0], atol=1e-15)
    assert report["notes"] == ["interface: port 'lower': 2 of 6 nodes left out: no tie and no spring uses them"]
    for ports, line in (
        (
            ["lower", {"name": "b", "nodes": "mixed"}],
            "port 'b': node 1: is already in port 'lower'; a node can be in one port only",
        ),
        (["mixed"], "port 'mixed': holds slaves (node 101) and nodes that are none (node 1); make two ports of them"),
        (["far"], "port 'far': no tie and no spring uses any of its nodes"),
        (["uper"], "port 'uper': the mesh has no set 'uper'; did you mean 'upper'?"),
    ):
        made["interface"]["ports"] = ports
        with pytest.raises(tiefmu.SceneError) as error:
            tiefmu.load(made)
        assert str(error.value) == f"scene: interface: {line}"


def test_slaves_on_a_line_without_rotations_are_refused():
    for nodes, what in (([101, 102, 103], "its slaves are collinear and"), ([102], "its only slave")):
        with pytest.raises(tiefmu.SceneError) as error:
            tiefmu.load(line_of_slaves(False, None, nodes))
        assert str(error.value) == (
            f"scene: interface: port 'rod': {what} cannot turn, which leaves its rotation "
            'open; use formulation = "optimized" or rotations = true'
        )


def test_units_and_hidden_variables():
    made = line_of_slaves(True, [1000.0, 500.0, 200.0])
    for row in made["mesh"]["nodes"]:
        row[1:] = [1000 * x for x in row[1:]]
    made["tie"][0]["search_distance"] = 1000.0
    made["units"] = {"length": "mm"}
    made["interface"]["hide"] = ["port.w", "slave.v"]
    scene = tiefmu.load(made)
    assert tiefmu.report(scene)["ports"][0]["at"] == [1.0, 0.5, 0.2]
    listed = {name for block in scene.start.variables for name in names(block)}
    assert "port[rod].v[1]" in listed and "port[rod].w[1]" not in listed


def test_ports_of_what_they_cannot_move(weld):
    weld["node"].append({"nodes": [3], "motion": "free"})
    weld["node"].append({"nodes": [4], "motion": "fixed"})
    weld["mesh"]["nodes"].append([9, 1.0, 0.0, 0.0])
    for node, line in (
        (3, "is free; a port moves driven nodes or loads slaves"),
        (4, "is fixed; a port moves driven nodes or loads slaves"),
        (9, "no tie and no spring uses it"),
    ):
        weld["interface"] = {"ports": [{"name": "a", "nodes": [1, node]}]}
        with pytest.raises(tiefmu.SceneError) as error:
            tiefmu.load(weld)
        assert str(error.value) == f"scene: interface: port 'a': node {node}: {line}"


def test_ports_need_integrated_positions(weld):
    weld |= {"interface": {"ports": [{"name": "a", "nodes": [1]}]}, "model": {"position": "input"}}
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(weld)
    assert str(error.value) == (
        "scene: interface: ports: need position = 'integrated' in [model]: a port's nodes move with the port"
    )
