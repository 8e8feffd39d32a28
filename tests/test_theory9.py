"""Theory 9, one test per row: where existing codes fail, and what this program does instead."""

import numpy as np
import pytest
import tiefmu
from fmu_calls import ERROR, OK, Fmu, Instance
from in_process import Run
from independent import Problem
from independent_kernels import no_area, smallest_lambda
from random_scenes import rotation, rows

QUAD = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def one_quad(corners=QUAD, slave=(0.3, 0.6, 0.4), mass=0.7, **tie):
    return {
        "mesh": {"nodes": rows(1, corners) + rows(5, [slave]), "segments": [[1, 1, 2, 3, 4]]},
        "node": [{"nodes": "all", "mass": 1.0}, {"nodes": [5], "mass": mass}],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "search_distance": 10.0} | tie],
    }


def refusal(scene) -> str:
    with pytest.raises(tiefmu.SceneError) as caught:
        tiefmu.load(scene)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_optimized_without_rotational_freedom_is_optimized():
    """The loads are those of theory 3 for the optimized formulation, not those of the default one."""
    force = np.array([1.0, -2.0, 3.0])

    def loads(formulation):
        run = Run(one_quad(formulation=formulation))
        run.set_of(5, "f", force)
        return np.array([run.of(i, "f") for i in (1, 2, 3, 4)])

    r = QUAD - QUAD.mean(axis=0)
    d = np.array([0.3, 0.6, 0.4]) - QUAD.mean(axis=0)
    ibar = sum(x @ x * np.eye(3) - np.outer(x, x) for x in r)
    expected = force / 4 + np.cross(np.linalg.solve(ibar, np.cross(d, force)), r)
    np.testing.assert_allclose(loads("optimized"), expected, rtol=0, atol=1e-14)
    assert np.abs(loads("default") - expected).max() > 0.1


def test_optimized_on_collinear_nodes_is_refused_by_name():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    text = refusal(one_quad(corners, (1.5, 0.0, 0.0), formulation="optimized", unresolved="error"))
    assert "tie 'tie'" in text and ("segment 1" in text or "slave 5" in text)
    # nearly collinear, of some area: the condition is what refuses it
    corners = np.array([[0.0, 0, 0], [2e6, 0, 0], [2e6, 1, 0], [0, 1, 0]])
    text = refusal(one_quad(corners, (1e6, 0.5, 0.0), formulation="optimized"))
    assert "tie 'tie'" in text and "cond" in text and "segment 1" in text
    tiefmu.load(one_quad(corners * [0.25, 1, 1], (0.25e6, 0.5, 0.0), formulation="optimized"))


@pytest.mark.parametrize("inertia", ["lumped", "consistent"])
def test_a_turned_segment_is_the_same_segment(inertia):
    corners = np.array([[-2.5, -0.5, 0], [2.5, -0.5, 0], [2.5, 0.5, 0.1], [-2.5, 0.5, 0]])
    slave, rng = np.array([0.7, 0.2, 0.5]), np.random.default_rng(1)
    masses, limits = [], []
    for _ in range(50):
        turn = rotation(rng)
        scene = one_quad(corners @ turn.T, turn @ slave, formulation="optimized") | {"model": {"inertia": inertia}}
        scene["node"][0]["motion"] = "free"
        scene["spring"] = [{"ground": [1, 2, 3, 4, 5], "kind": "bushing", "stiffness": 50.0}]
        found = tiefmu.report(tiefmu.load(scene))
        masses.append([row["added_mass"] for row in found["masters"]])
        limits.append(found["stable_time_step"])
    d = slave - corners.mean(axis=0)
    np.testing.assert_allclose(masses, 0.7 / 4 + 0.7 * (d @ d) * smallest_lambda(corners), rtol=1e-12)
    assert np.ptp(limits) < 1e-8 * limits[0]


def rivet_outside():
    """A bushing between slaves that lie outside their segments."""
    lower, upper = QUAD, QUAD + [0, 0, 1]
    return {
        "mesh": {
            "nodes": rows(1, lower) + rows(11, upper) + [[5, 1.2, 1.2, 0.3], [15, 1.2, 1.2, 0.8]],
            "segments": [[1, 1, 2, 3, 4], [2, 11, 12, 13, 14]],
        },
        "node": [
            {"nodes": "all", "motion": "free", "rotations": True, "mass": 0.1, "inertia": 0.01},
            {"nodes": [5, 15], "mass": 1.0, "inertia": 0.1},
        ],
        "tie": [{"name": "a", "segments": [1], "slaves": [5]}, {"name": "b", "segments": [2], "slaves": [15]}],
        "spring": [{"nodes": [5, 15], "kind": "bushing", "stiffness": 1e5, "rotational_stiffness": 1e4}],
        "initial": [{"nodes": [1, 2], "v": [0.01, 0, 0.01]}],
        "interface": {"expose": ["energy"]},
    }


def test_rivet_outside_its_segments(tmp_path):
    """0.9 of its own limit is safe; a run that diverges all the same ends in fmi2Error with a message."""
    scene = rivet_outside()
    problem = Problem(scene)
    instance = Instance(Fmu(scene, tmp_path))
    instance.start()
    stable, energy = instance.get(["stable_time_step", "energy.kinetic"])
    assert stable <= 2 / problem.omega_max() * (1 + 1e-9)
    for k in range(100):
        assert instance.step(k * 50 * stable, 50 * stable) == OK
        assert 0 < instance.get(["energy.kinetic"])[0] < 3 * energy
    instance.free()

    # No step of its own diverges; a load that no model survives does.
    instance = Instance(Fmu(scene, tmp_path))
    instance.start(values={"slave[1].f[1]": 1e300})
    assert instance.step(0.0, 1000 * stable) == ERROR
    assert "diverged" in instance.errors()[-1] and "node" in instance.errors()[-1]
    instance.free()


def test_default_offset_on_masters_without_rotations_is_warned():
    """How large, which slave, and the cure; nothing is said where there is nothing to lose."""
    warnings = tiefmu.report(tiefmu.load(one_quad()))["warnings"]
    assert any("5" in line and "0.4" in line and "optimized" in line for line in warnings)
    for scene in (one_quad(formulation="optimized"), one_quad(slave=(0.3, 0.6, 0.0))):
        assert not any("optimized" in line for line in tiefmu.report(tiefmu.load(scene))["warnings"])


def test_offset_of_a_spinning_optimized_tie_is_constant():
    scene = one_quad(formulation="optimized") | {"model": {"position": "input"}}
    run, spin, size = Run(scene), np.array([0.0, 0.0, 2 * np.pi]), 0.01
    start = np.linalg.norm(run["slave[1].r"] - QUAD.mean(axis=0))

    def move(angle):
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        for i, x in enumerate(QUAD @ turn.T, start=1):
            run.set({f"master[{i}].r": x, f"master[{i}].v": np.cross(spin, x)})

    for k in range(1000):  # ten revolutions
        move(2 * np.pi * k * size)
        run.step(size)
    assert run["drift"] < 1e-12 * start
    move(0.0)
    of_centre = np.cross(spin, QUAD.mean(axis=0))
    turning = np.linalg.norm(run["slave[1].v"] - of_centre)  # |w x d|, whatever way d points
    assert turning == pytest.approx(2 * np.pi * np.linalg.norm([0.3 - 0.5, 0.6 - 0.5]), rel=1e-9)


def test_segment_of_zero_area_never_wins():
    corners = np.vstack([QUAD, [0.3, 0.6, 0.39]])  # the slave sits on a segment of no area
    scene = one_quad(slave=(0.3, 0.6, 0.4))
    scene["mesh"] = {
        "nodes": [*rows(1, QUAD), [5, 0.3, 0.6, 0.4], [6, 0.3, 0.6, 0.4], [7, 0.4, 0.6, 0.4], [8, 0.5, 0.6, 0.4]],
        "segments": [[1, 1, 2, 3, 4], [9, 6, 7, 8]],
    }
    assert no_area(np.array([[0.3, 0.6, 0.4], [0.4, 0.6, 0.4], [0.5, 0.6, 0.4]])) and not no_area(corners[:4])
    found = tiefmu.report(tiefmu.load(scene))
    assert found["slaves"][0]["segment"] == 1 and found["slaves"][0]["distance"] == pytest.approx(0.4)
    assert any("segment 9" in line and "area" in line for line in found["warnings"] + found["notes"])


def test_slave_that_is_a_master_and_slave_that_is_lost():
    scene = one_quad()
    scene["tie"][0]["slaves"] = [5, 3]
    text = refusal(scene)
    assert "tie 'tie'" in text and "slave 3" in text and "master" in text
    text = refusal(one_quad(slave=(0.3, 0.6, 0.4), search_distance=0.1))
    assert "tie 'tie'" in text and "slave 5" in text and "0.1" in text


def test_slave_that_is_also_constrained():
    scene = one_quad()
    scene["node"].append({"nodes": [5], "motion": "fixed"})
    text = refusal(scene)
    assert "tie 'tie'" in text and "slave 5" in text and "fixed" in text
    scene = one_quad()
    scene["tie"].append({"name": "second", "segments": "all", "slaves": [5], "search_distance": 10.0})
    text = refusal(scene)
    assert "tie 'tie'" in text and "'second'" in text and "5" in text
