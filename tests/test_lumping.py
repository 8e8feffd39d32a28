"""What the report says of lumped inertia, against the dense matrices of theory 4."""

import numpy as np
import pytest
from independent import Problem
from random_scenes import one_segment, structure
from scipy.linalg import eigh
from tiefmu import load, report
from tiefmu.report import lumping_line

FORMS = [("default", True), ("default", False), ("optimized", False), ("optimized", True)]


def dense_ratio(scene):
    """Largest lumped over true kinetic energy of the free motions that the tie lumps anything onto."""
    problem = Problem(scene)
    true = Problem(scene | {"model": {"inertia": "consistent"}})
    t, _ = problem.maps(problem.x0, problem.v0, problem.w0, np.array([s.d0 for s in problem.slaves]))
    moves = problem.free & (problem.added_masses() > 0)
    pick = np.ix_(moves, moves)
    return eigh(problem.mass_matrix(t)[pick], true.mass_matrix(t)[pick], eigvals_only=True)[-1]


@pytest.mark.parametrize("formulation, rotations", FORMS)
@pytest.mark.parametrize("corners", [3, 4])
@pytest.mark.parametrize("slaves", [1, 5])
def test_one_segment(slaves, corners, formulation, rotations):
    scene = one_segment(np.random.default_rng(3), corners, formulation, rotations, slaves, "free", offset=1.0)
    found = load(scene).model.report()["lumping"]
    assert found["ratio"] == pytest.approx(dense_ratio(scene), rel=1e-8)
    assert not found["connected"]
    assert f"up to {found['ratio']:.3g} times" in lumping_line(found)


@pytest.mark.parametrize("formulation, rotations", FORMS)
def test_a_surface_is_no_worse_than_its_worst_segment(formulation, rotations):
    scene = structure(np.random.default_rng(4), formulation, rotations, "lumped", slaves=9)
    found = load(scene).model.report()["lumping"]
    assert found["connected"]
    assert found["ratio"] >= dense_ratio(scene) * (1 - 1e-8)
    assert f"at most {found['ratio']:.3g} times" in lumping_line(found)


def test_where_it_says_nothing():
    scene = one_segment(np.random.default_rng(5))
    assert report(load(scene))["lumping"] is None  # all masters driven
    scene = one_segment(np.random.default_rng(5), motion="free")
    assert report(load(scene))["lumping"]["ratio"] > 1
    assert report(load(scene | {"model": {"inertia": "consistent"}}))["lumping"] is None


def test_masters_without_mass_of_their_own():
    scene = one_segment(np.random.default_rng(6), 4, "optimized", False, slaves=1, motion="free")
    for table in scene["node"]:
        if table["nodes"][0] in (1, 2, 3, 4):
            table["mass"] = table["inertia"] = 0.0
    found = report(load(scene))["lumping"]
    assert found["ratio"] is None
    assert "have no true energy" in lumping_line(found)


def test_slaves_without_mass():
    scene = one_segment(np.random.default_rng(7), 4, "default", True, slaves=2, motion="free")
    for table in scene["node"]:
        if table["nodes"][0] not in (1, 2, 3, 4):
            table["mass"] = table["inertia"] = 0.0
    assert load(scene).model.report()["lumping"] is None
