"""Answers do not depend on the frame, on numbers, or on the order of the input; rigid and linear motions are kept."""

import copy

import numpy as np
import pytest
import tiefmu
from in_process import Run
from random_scenes import moved, one_segment, patch, renumbered, rotation, rows, slave_over, structure

FORMS = [("default", True), ("default", False), ("optimized", False)]
forms = pytest.mark.parametrize("formulation, rotations", FORMS)


def motion(run, scene, steps=40, load=None):
    """Node id -> position, velocity, reaction after some steps of a free structure; load: {id: force}."""
    for i, force in (load or {}).items():
        run.set_of(i, "f", force)
    run.step(0.02, steps)
    ids = [row[0] for row in scene["mesh"]["nodes"]]
    return {
        i: np.concatenate([run.of(i, "r"), run.of(i, "v"), run.of(i, "f") if i < 100 else np.zeros(3)]) for i in ids
    }


@forms
@pytest.mark.parametrize("inertia", ["lumped", "consistent"])
def test_turned_scene_gives_the_turned_answer(formulation, rotations, inertia):
    rng = np.random.default_rng(5)
    scene = structure(rng, formulation, rotations, inertia)
    turn, shift, force = rotation(rng), np.array([0.3, -0.2, 0.1]), np.array([3.0, -2.0, 5.0])
    here = motion(Run(scene), scene, load={101: force})
    there = motion(Run(moved(scene, turn, shift)), scene, load={101: turn @ force})
    for i, values in here.items():
        position, velocity, reaction = values.reshape(3, 3)
        expected = np.concatenate([turn @ position + shift, turn @ velocity, turn @ reaction])
        np.testing.assert_allclose(there[i], expected, rtol=0, atol=2e-11)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("n", [4, 3])
def test_added_mass_of_a_turned_segment_is_the_same(seed, n):
    """Theory 9: 0.415 to 1.148 g elsewhere."""
    rng = np.random.default_rng(seed)
    scene = one_segment(rng, n, "optimized", False)
    added = []
    for turn in (np.eye(3), rotation(rng), rotation(rng)):
        report = tiefmu.report(tiefmu.load(moved(scene, turn, rng.normal(size=3))))
        added.append([row["added_mass"] for row in report["masters"]])
    np.testing.assert_allclose(added[1:], [added[0]] * 2, rtol=1e-10)


@forms
@pytest.mark.parametrize("inertia", ["lumped", "consistent"])
def test_renumbered_scene_gives_the_same_answer(formulation, rotations, inertia):
    rng = np.random.default_rng(6)
    scene = structure(rng, formulation, rotations, inertia)
    ids = [row[0] for row in scene["mesh"]["nodes"]]
    groups = [[i for i in ids if i < 100], [i for i in ids if i >= 100]]
    new = {old: int(k) for group in groups for old, k in zip(group, rng.permutation(group))}
    force = np.array([3.0, -2.0, 5.0])
    here = motion(Run(scene), scene, load={101: force})
    there = motion(Run(renumbered(scene, new)), scene, load={new[101]: force})
    for i, values in here.items():
        np.testing.assert_allclose(there[new[i]][:6], values[:6], rtol=0, atol=2e-11)
        if i < 100:
            np.testing.assert_allclose(there[new[i]][6:], values[6:], rtol=0, atol=2e-9)


@pytest.mark.parametrize("formulation", ["default", "optimized"])
@pytest.mark.parametrize("n", [4, 3])
@pytest.mark.parametrize("seed", range(10))
def test_renumbered_corners_give_the_same_weights(seed, n, formulation):
    """A segment that starts at another corner: other xi and eta, the same tie."""
    scene = one_segment(np.random.default_rng(seed), n, formulation)
    turned = copy.deepcopy(scene)
    turned["mesh"]["segments"] = [[1, *np.roll(range(1, n + 1), 1).tolist()]]
    here, there = (tiefmu.report(tiefmu.load(s)) for s in (scene, turned))
    for a, b in zip(here["slaves"], there["slaves"]):
        weights = dict(zip(b["nodes"], b["weights"]))
        np.testing.assert_allclose([weights[i] for i in a["nodes"]], a["weights"], rtol=0, atol=1e-12)
    for a, b in zip(here["masters"], there["masters"]):
        np.testing.assert_allclose(b["added_mass"], a["added_mass"], rtol=1e-11)


def patch_scene(rng, formulation, rotations, gap):
    position, segments = patch(rng, 3, 3, warp=0.0 if gap == 0 else 0.1)
    points = [slave_over(rng, position[np.array(s[1:]) - 1], outside=0.9, offset=gap) for s in segments]
    return {
        "mesh": {"nodes": rows(1, position) + rows(101, points), "segments": segments},
        "node": [{"nodes": "all", "rotations": rotations}],
        "tie": [
            {
                "name": "tie",
                "segments": "all",
                "slaves": list(range(101, 101 + len(points))),
                "formulation": formulation,
                "search_distance": 10.0,
            }
        ],
    }


def drive(run, scene, velocity, spin):
    place = {row[0]: np.array(row[1:]) for row in scene["mesh"]["nodes"]}
    for i, x in place.items():
        if i < 100:
            run.set_of(i, "v", velocity(x))
            if f"{run.names[i]}.w" in run:
                run.set_of(i, "w", spin)
    return {i: x for i, x in place.items() if i > 100}


@pytest.mark.parametrize(
    "formulation, rotations, gap", [("default", True, 1.0), ("default", False, 0.0), ("optimized", False, 1.0)]
)
@pytest.mark.parametrize("seed", range(5))
def test_rigid_motion_of_the_masters_moves_every_slave_rigidly(seed, formulation, rotations, gap):
    rng = np.random.default_rng(seed)
    scene = patch_scene(rng, formulation, rotations, gap)
    run, v0, w = Run(scene), rng.normal(size=3), rng.normal(size=3)
    for i, x in drive(run, scene, lambda x: v0 + np.cross(w, x), w).items():
        np.testing.assert_allclose(run.of(i, "v"), v0 + np.cross(w, x), rtol=0, atol=1e-13 * 20)
        if f"{run.names[i]}.w" in run:
            np.testing.assert_allclose(run.of(i, "w"), w, rtol=0, atol=1e-13 * 20)


@pytest.mark.parametrize("rotations", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_linear_velocity_field_is_reproduced_without_offset(seed, rotations):
    rng = np.random.default_rng(seed)
    scene = patch_scene(rng, "default", rotations, 0.0)
    run, v0, gradient = Run(scene), rng.normal(size=3), rng.normal(size=(3, 3))
    for i, x in drive(run, scene, lambda x: v0 + gradient @ x, rng.normal(size=3)).items():
        np.testing.assert_allclose(run.of(i, "v"), v0 + gradient @ x, rtol=0, atol=1e-13 * 20)
