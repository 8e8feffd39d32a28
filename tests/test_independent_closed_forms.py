"""The closed forms of theory 8."""

import numpy as np
import pytest
import tiefmu
from in_process import Run
from random_scenes import one_segment

S, T = 0.3, -0.6
UNIT = [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0]]


def quad(corners, slave, **tie):
    return {
        "mesh": {"nodes": [*corners, [5, *slave]], "segments": [[1, 1, 2, 3, 4]]},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "search_distance": 10.0} | tie],
    }


def test_added_mass_on_the_unit_square():
    """Phi_i m_s at (s, t)."""
    scene = quad(UNIT, [(1 + S) / 2, (1 + T) / 2, 0])
    scene["node"].append({"nodes": [5], "mass": 3.0})
    report = tiefmu.report(tiefmu.load(scene))
    phi = np.array([(1 - S) * (1 - T), (1 + S) * (1 - T), (1 + S) * (1 + T), (1 - S) * (1 + T)]) / 4
    np.testing.assert_allclose(report["slaves"][0]["weights"], phi, rtol=0, atol=1e-15)
    np.testing.assert_allclose([row["added_mass"] for row in report["masters"]], 3.0 * phi, rtol=1e-14)


@pytest.mark.parametrize("a, b", [(1.0, 1.0), (3.0, 1.0), (20.0, 0.5)])
def test_lambda_of_a_rectangle(a, b):
    """lambda = 1/b^2; with d = b and I_s = 0 each master gets m_s/4 + m_s, 1 + 4 times its share."""
    scene = quad([[1, 0, 0, 0], [2, a, 0, 0], [3, a, b, 0], [4, 0, b, 0]], [a / 2, b / 2, b], formulation="optimized")
    scene["node"].append({"nodes": [5], "mass": 2.0})
    report = tiefmu.report(tiefmu.load(scene))
    assert report["slaves"][0]["lambda"] == pytest.approx(1 / b**2, rel=1e-12)
    np.testing.assert_allclose([row["added_mass"] for row in report["masters"]], 5 * 2.0 / 4, rtol=1e-12)


M, MS, K = 1.0, 3.0, 400.0


def on_springs(inertia, pattern):
    """Four free masters on ground springs, a slave at the centre; masters start with v_z = pattern."""
    scene = quad(UNIT, [0.5, 0.5, 0.0])
    scene["node"] = [{"nodes": "all", "motion": "free", "mass": M}, {"nodes": [5], "mass": MS}]
    scene["spring"] = [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": K}]
    scene["initial"] = [{"nodes": [i + 1], "v": [0, 0, v]} for i, v in enumerate(pattern)]
    return scene | {"model": {"inertia": inertia}, "integrator": {"method": "rk4"}}


@pytest.mark.parametrize(
    "inertia, pattern, omega2",
    [
        ("consistent", [1, 1, 1, 1], 4 * K / (4 * M + MS)),
        ("lumped", [1, 1, 1, 1], 4 * K / (4 * M + MS)),
        ("consistent", [1, 1, -1, -1], K / M),
        ("lumped", [1, 1, -1, -1], K / (M + MS / 4)),
        ("consistent", [1, -1, -1, 1], K / M),
        ("lumped", [1, -1, -1, 1], K / (M + MS / 4)),
    ],
)
def test_heave_and_roll(inertia, pattern, omega2):
    run = Run(on_springs(inertia, pattern))
    omega = np.sqrt(omega2)
    for k in range(1, 11):
        run.step(0.002, 25)
        for i, v in enumerate(pattern, start=1):
            assert run[f"master[{i}].r"][2] == pytest.approx(v * np.sin(omega * 0.05 * k) / omega, abs=1e-6 / omega)


@pytest.mark.parametrize("inertia, limit", [("consistent", np.sqrt(K / M)), ("lumped", np.sqrt(K / (M + MS / 4)))])
def test_highest_frequency(inertia, limit):
    assert Run(on_springs(inertia, [0, 0, 0, 0]))["stable_time_step"] == pytest.approx(2 / limit, rel=1e-3)


def test_lumped_inertia_never_holds_less_energy():
    """Theory 4: lambda bounds the slave's kinetic energy for every motion; 1000 random segments."""
    rng = np.random.default_rng(0)
    closest = np.inf
    for k in range(1000):
        n = 3 + k % 2
        scene = one_segment(rng, n, "optimized", False, motion="free", slaves=1)
        velocity = rng.normal(size=(n, 3))
        scene["initial"] = [{"nodes": [i + 1], "v": v.tolist()} for i, v in enumerate(velocity)]
        run = Run(scene)
        own = sum(0.5 * table["mass"] * v @ v for table, v in zip(scene["node"][1:], velocity))
        added = sum(0.5 * run[f"master[{i + 1}].added_mass"] * v @ v for i, v in enumerate(velocity))
        slave = run["energy.kinetic"] - own  # the true energy counts the slave's own
        assert 0 < slave <= added * (1 + 1e-12)
        closest = min(closest, added / slave)
    assert closest < 2  # and it is not far above


def host(reaction, inertia, ratio, step, cycles):
    """A host of four masses M that uses the last known force; largest velocity at the end over that at the start."""
    mass = 1.0
    scene = quad(UNIT, [0.5, 0.5, 0.0])
    scene["node"] = [{"nodes": [5], "mass": 4 * ratio * mass}]
    scene["model"] = {"inertia": inertia, "reaction": reaction}
    run = Run(scene)
    added = 0.0 if reaction == "full" else np.array([run[f"master[{i}].added_mass"] for i in range(1, 5)])
    v, stiffness, x = np.full(4, 1.0), 30.0, np.zeros(4)
    f = np.zeros(4)
    for _ in range(cycles):
        a = (f - stiffness * x) / (mass + added)
        v = v + step * a
        x = x + step * v
        for i in range(4):
            run.set({f"master[{i + 1}].v": [0, 0, v[i]]})
            if reaction != "loads":
                run.set({f"master[{i + 1}].a": [0, 0, a[i]]})
        run.step(step)
        f = np.array([run[f"master[{i}].f"][2] for i in range(1, 5)])
    return np.abs(v).max()


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
def test_full_reaction_diverges_above_mass_ratio_one(step):
    assert host("full", "consistent", 1.2, step, 400) > 1e3
    assert host("full", "consistent", 0.8, step, 400) < 10


@pytest.mark.parametrize("reaction, inertia", [("loads", "lumped"), ("split", "consistent")])
@pytest.mark.parametrize("ratio", [0.5, 10.0])
def test_loads_and_split_stay_stable(reaction, inertia, ratio):
    assert host(reaction, inertia, ratio, 1e-3, 3000) < 3


def growth(stiffness, damping, step, cycles):
    """A host of mass 1 that moves all masters and holds the force it got from the tie over each step."""
    scene = quad(UNIT, [0.5, 0.5, 0.0])
    scene["spring"] = [{"ground": [5], "kind": "bushing", "stiffness": stiffness, "damping": damping}]
    run = Run(scene | {"model": {"position": "input"}})
    x, v, sizes = 1e-3, 0.0, []
    start = np.array([row[1:] for row in UNIT], float)
    for _ in range(cycles):
        for i in range(4):
            run.set({f"master[{i + 1}].r": start[i] + [0, 0, x], f"master[{i + 1}].v": [0, 0, v]})
        f = sum(run[f"master[{i}].f"][2] for i in range(1, 5))
        assert f == pytest.approx(-stiffness * x - damping * v, rel=1e-9, abs=1e-12 * stiffness)
        x, v = x + step * v + step**2 / 2 * f, v + step * f
        sizes.append(np.hypot(x * np.sqrt(stiffness), v))
    return np.array(sizes)


def test_held_force_without_damping_grows_at_every_step():
    """By sqrt(1 + k H^2 / 2m) a step, so by k H^2 / 2m in the determinant of a step."""
    stiffness, step = 100.0, 0.01
    sizes = growth(stiffness, 0.0, step, 2000)
    assert (sizes[-1] / sizes[0]) ** (1 / 1999) == pytest.approx(np.sqrt(1 + stiffness * step**2 / 2), rel=1e-4)


@pytest.mark.parametrize("zeta", [0.1, 0.3, 0.5, 0.8, 2.0])
def test_held_force_with_damping(zeta):
    """Stable if and only if H omega < min(4 zeta, 1 / zeta)."""
    omega, limit = 10.0, min(4 * zeta, 1 / zeta)
    for factor, stable in ((0.97, True), (1.03, False)):
        sizes = growth(omega**2, 2 * zeta * omega, factor * limit / omega, 1500)
        assert (sizes[-1] < sizes[0]) == stable
