"""Beams between two nodes: theory (3.15) to (3.19). Textbook stiffness, rigid rotation, whole motions and energy."""

import numpy as np
import pytest
import tiefmu
from in_process import Run
from independent import Problem, constant
from scipy.linalg import eigh
from tiefmu.report import report

ENDS = np.array([[0.2, -0.1, 0.3], [0.5, 0.4, 0.9]])
STIFFNESS = {"stiffness": [900.0, 300.0, 150.0], "rotational_stiffness": [20.0, 40.0, 10.0]}
SIDE = [0.3, -0.2, 1.0]


def pair(motions=("free", "free"), ends=ENDS, mass=1.3, inertia=0.07, **beam):
    return {
        "mesh": {"nodes": [[i, *x] for i, x in enumerate(np.asarray(ends, float).tolist(), 1)]},
        "node": [
            {"nodes": [i], "motion": motion, "rotations": True, "mass": mass, "inertia": inertia}
            for i, motion in enumerate(motions, 1)
        ],
        "spring": [{"nodes": [1, 2], "kind": "beam"} | beam],
    }


def axes(ends=ENDS, side=SIDE):
    """Columns: along the beam, its second and third axis."""
    x = (ends[0] - ends[1]) / np.linalg.norm(ends[0] - ends[1])
    y = np.array(side) - (np.array(side) @ x) * x
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def textbook(e, g, area, iy, iz, j, length, shear_area):
    """12 x 12 stiffness of the Timoshenko beam from node 1 at x = 0 to node 2 at x = length, freedoms u, v, w and
    rotations about x, y, z."""
    k = np.zeros((12, 12))
    axial, twist = np.array([[1, -1], [-1, 1]]) * e * area / length, np.array([[1, -1], [-1, 1]]) * g * j / length
    k[np.ix_([0, 6], [0, 6])], k[np.ix_([3, 9], [3, 9])] = axial, twist
    for i, places, sign in ((iz, [1, 5, 7, 11], 1), (iy, [2, 4, 8, 10], -1)):
        p = 12 * e * i / (g * shear_area * length**2)
        a, b = 12 / length**3, 6 * sign / length**2
        c, d = (4 + p) / length, (2 - p) / length
        block = np.array([[a, b, -a, b], [b, c, -b, d], [-a, -b, a, -b], [b, d, -b, c]]) * e * i / (1 + p)
        k[np.ix_(places, places)] = block
    return k


def test_is_the_textbook_beam():
    """The highest frequency of both ends free, oblique, with six different stiffnesses."""
    e, g, area, iy, iz, j, shear_area = 7e4, 2.7e4, 0.02, 3e-3, 8e-3, 5e-3, 0.015
    length = np.linalg.norm(ENDS[0] - ENDS[1])
    aside = [1 / (length**3 / (12 * e * i) + length / (g * shear_area)) for i in (iz, iy)]
    scene = pair(
        stiffness=[e * area / length, *aside],
        rotational_stiffness=[g * j / length, e * iy / length, e * iz / length],
        orientation=SIDE,
    )
    turn = np.kron(np.eye(4), axes(ENDS[::-1]))  # from node 1 to node 2
    stiffness = turn @ textbook(e, g, area, iy, iz, j, length, shear_area) @ turn.T
    omega = np.sqrt(eigh(stiffness, np.diag(([1.3] * 3 + [0.07] * 3) * 2), eigvals_only=True)[-1])
    assert report(tiefmu.load(scene))["stable_time_step"] == pytest.approx(2 / omega, rel=1e-9)


def test_rigid_rotation_gives_no_force():
    """A port turns both ends by several turns: nothing is strained, whatever the stiffnesses."""
    scene = pair(("driven", "driven"), orientation=SIDE, **STIFFNESS)
    scene["interface"] = {"expose": ["energy"], "ports": [{"name": "body", "nodes": [1, 2], "at": [0.3, 0.0, 1.0]}]}
    simulation = tiefmu.load(scene).simulation()
    names = [f"port[body].{kind}[{k}]" for kind in "vw" for k in (1, 2, 3)]
    simulation.set_values(names, np.array([0.1, 2, -0.3, 3, -1, 2.0]))
    simulation.initialise(0.0)
    for _ in range(400):
        simulation.step(0.01)
    assert simulation.get_values(["energy.strain"])[0] < 1e-20 * 900.0


@pytest.mark.parametrize("damping", [0.0, 3.0])
@pytest.mark.parametrize("geometry", ["finite", "small"])
def test_whole_motion(damping, geometry):
    """Ends that turn by more than a radian against each other, against loads that are differences of the energy."""
    scene = pair(orientation=SIDE, **STIFFNESS)
    if damping:
        scene["spring"][0] |= {"damping": [damping, 1.0, 2.0], "rotational_damping": [0.1, 0.2, 0.05]}
    scene["initial"] = [
        {"nodes": [1], "v": [1.0, 0.5, -0.4], "w": [19.0, -3.0, 5.0]},
        {"nodes": [2], "w": [-18.0, 6.0, 2]},
    ]
    scene["model"] = {"geometry": geometry}
    scene["integrator"] = {"method": "rk4", "time_step": 5e-5}
    problem = Problem(scene)
    (expected,) = problem.solve([0.0, 0.04], constant({}))[-1:]
    run = Run(scene)
    start = run["energy.kinetic"] + run["energy.strain"]
    run.step(0.04)
    for i in (1, 2):
        np.testing.assert_allclose(run.of(i, "v"), expected["v"][i - 1], atol=2e-8)
        np.testing.assert_allclose(run.of(i, "w"), expected["w"][i - 1], atol=2e-7)
    if not damping:  # the stiffnesses differ, and still there is a potential
        assert run["energy.kinetic"] + run["energy.strain"] == pytest.approx(start, rel=1e-8)


def test_balance():
    """Momentum and angular momentum of two free ends stay."""
    scene = pair(orientation=SIDE, **STIFFNESS)
    scene["initial"] = [{"nodes": [1], "v": [1.0, 0.5, -0.4], "w": [9.0, -3.0, 5.0]}]
    scene["integrator"] = {"method": "rk4", "time_step": 2e-4}
    run = Run(scene)

    def momenta():
        x, v, w = ([run.of(i, what) for i in (1, 2)] for what in "rvw")
        turn = sum(1.3 * np.cross(*pair_of) for pair_of in zip(x, v)) + 0.07 * (w[0] + w[1])
        return np.concatenate([1.3 * (v[0] + v[1]), turn])

    before = momenta()
    run.step(0.3)
    np.testing.assert_allclose(momenta(), before, atol=1e-9)


def test_default_orientation():
    """The side of y; of a beam along y that of z."""
    for ends, side in ((ENDS, [0, 1, 0]), ([[0, 0, 0], [0, 2.0, 0]], [0, 0, 1])):
        scenes = [pair(ends=ends, **STIFFNESS, **given) for given in ({}, {"orientation": side})]
        resources = [tiefmu.load(scene).model.resource("") for scene in scenes]
        assert resources[0] == resources[1]


def test_ends_must_turn():
    scene = pair(stiffness=1.0)
    scene["node"][1] |= {"rotations": False, "inertia": 0.0}
    with pytest.raises(tiefmu.SceneError, match="spring 1: node 2 has no rotations"):
        tiefmu.load(scene)


def test_nodal_step():
    """Both ends carry the moment of the shear force: (6.3). A beam between two masters, whose slave weighs nothing."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1.0, 0]])
    scene = pair(("free",) * 4, corners, **STIFFNESS)
    scene["mesh"]["nodes"].append([5, 0.5, 0.5, 0.0])
    scene["mesh"]["segments"] = [[1, 1, 2, 3, 4]]
    scene["tie"] = [{"name": "tie", "slaves": [5]}]
    expected = min(np.sqrt(2 * 1.3 / 900), np.sqrt(2 * 0.07 / (40 + 300 * 1.0)))
    assert report(tiefmu.load(scene))["nodal_time_step"] == pytest.approx(expected, rel=1e-12)
