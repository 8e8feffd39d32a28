"""Consistent inertia of more nodes than are factored at every geometry: the iteration against a dense solution."""

import numpy as np
import pytest
import tiefmu
from independent import Problem
from random_scenes import patch, rows

FIRST_SLAVE = 1001


def surface(rng, rotations, ties, slaves=120):
    """Free nodes in motion under loads of gravity; `ties`: (formulation, with offset?) of each run of segments."""
    position, segments = patch(rng, 11, 11)
    picked = np.sort(rng.choice(len(segments), slaves))
    parts = np.array_split(np.arange(len(segments)), len(ties))
    points, tables = [], []
    for number, ((formulation, gap), part) in enumerate(zip(ties, parts), 1):
        own = picked[np.isin(picked, part)]
        for e in own:
            corners = position[np.array(segments[e][1:]) - 1]
            phi = rng.dirichlet(np.full(len(corners), 3.0))
            points.append(phi @ corners + gap * np.array([0, 0, 1.0]) * rng.uniform(0.5, 1))
        last = FIRST_SLAVE + len(points)
        tables.append(
            {
                "name": str(number),
                "segments": [segments[e][0] for e in part],
                "formulation": formulation,
                "slaves": list(range(last - len(own), last)),
            }
        )
    turn = all(formulation == "optimized" for formulation, _ in ties) or rotations
    slave_ids = [FIRST_SLAVE + k for k in range(len(points))]
    initial = []
    for i in range(1, len(position) + 1):
        v, w = rng.uniform(-1, 1, (2, 3)).tolist()
        initial.append({"nodes": [i], "v": v} | ({"w": w} if rotations else {}))
    return {
        "mesh": {"nodes": rows(1, position) + rows(FIRST_SLAVE, points), "segments": segments},
        "node": [
            {
                "nodes": "all",
                "motion": "free",
                "rotations": rotations,
                "mass": 0.3,
                "inertia": 0.02 if rotations else 0.0,
            },
            {"nodes": [5, 6, 17], "motion": "fixed"},
            {"nodes": slave_ids, "mass": 0.5, "inertia": 0.05 if turn else 0.0},
        ],
        "tie": tables,
        "initial": [table for table in initial if table["nodes"][0] not in (5, 6, 17)],
        "model": {"inertia": "consistent", "solver_tolerance": 1e-13, "gravity": [1.0, -2.0, 3.0]},
    }


@pytest.mark.parametrize(
    "rotations, ties",
    [
        (True, [("default", 0.3)]),
        (False, [("optimized", 0.3)]),
        (False, [("optimized", 0.0), ("default", 0.0)]),
        (True, [("default", 0.3), ("optimized", 0.3)]),
        (False, [("default", 0.0)]),
    ],
    ids=["default", "optimized", "translation", "mixed", "factored"],
)
@pytest.mark.parametrize("geometry", ["finite", "small"])
def test_accelerations_solve_the_constrained_equations(rotations, ties, geometry):
    scene = surface(np.random.default_rng(31), rotations, ties)
    scene["model"]["geometry"] = geometry
    problem, loaded = Problem(scene), tiefmu.load(scene)
    expected = problem.evaluate(0.0, problem.start())["a"]
    simulation = loaded.simulation()
    simulation.initialise(0.0)
    simulation.update_outputs()
    found = np.zeros_like(expected)
    nodes = loaded.model.report()["nodes"]
    place = [problem.ids.index(i) for i in nodes["id"].tolist()]
    found[place, :3] = simulation.get("acceleration")
    if rotations:
        found[place[: nodes["rotating"]], 3:] = simulation.get("angular_acceleration")
    assert np.abs(expected).max() > 1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
