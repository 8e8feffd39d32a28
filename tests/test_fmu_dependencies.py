"""The declared dependencies against the FMU itself: every input is moved, and what follows is compared."""

import numpy as np
import pytest

from fmu_calls import OK, Fmu, Instance

SETTINGS = [
    # formulation, rotations, motion of the masters, inertia, reaction, geometry, position
    ("default", True, "driven", "lumped", "loads", "finite", "integrated"),
    ("default", True, "driven", "lumped", "full", "finite", "integrated"),
    ("default", True, "driven", "consistent", "full", "finite", "integrated"),
    ("default", True, "mixed", "consistent", "split", "finite", "integrated"),
    ("default", True, "mixed", "lumped", "full", "small", "input"),
    ("default", True, "free", "consistent", "loads", "finite", "integrated"),
    ("default", True, "mixed", "consistent", "full", "small", "integrated"),
    ("default", False, "driven", "consistent", "split", "finite", "integrated"),
    ("default", False, "mixed", "consistent", "full", "finite", "input"),
    ("default", False, "mixed", "lumped", "loads", "finite", "input"),
    ("optimized", False, "driven", "lumped", "loads", "finite", "integrated"),
    ("optimized", False, "driven", "lumped", "loads", "finite", "input"),
    ("optimized", True, "driven", "consistent", "full", "finite", "input"),
    ("optimized", False, "driven", "consistent", "split", "small", "input"),
    ("optimized", False, "mixed", "lumped", "full", "small", "integrated"),
    ("optimized", False, "mixed", "consistent", "split", "finite", "integrated"),
    ("optimized", True, "free", "lumped", "loads", "finite", "integrated"),
]


def scene(rng, formulation, rotations, motion, inertia, reaction, geometry, position) -> dict:
    """Two pairs of a quad and a triangle, apart from each other, with slaves off their surfaces, two of which hold
    dampers to a driven and to a free point."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    sheet = np.array([[0, 0, 0], [1, 0, 0.1], [1.1, 0.9, 0], [0, 1, 0.15], [2, 0.4, 0.1]])
    corners = np.vstack([sheet, sheet + [0, 0, 3]]) + 0.05 * rng.normal(size=(10, 3))
    slaves = np.array([[0.3, 0.4, 0.3], [0.7, 0.6, -0.2], [1.4, 0.5, 0.25], [0.4, 0.7, 3.4], [1.5, 0.45, 2.7]])
    points = np.array([[0.5, 0.5, 1.2], [0.6, 0.4, 2.2]])
    nodes = [[first + k, *(turn @ x)] for first, group in ((1, corners), (101, slaves), (201, points))
             for k, x in enumerate(group)]
    turns = rotations or formulation == "optimized"
    masters = list(range(1, 11))
    chosen = {"mixed": ["driven", "driven", "free", "fixed", "free", "driven", "free", "driven", "driven", "free"]}
    motions = chosen.get(motion, [motion] * 10)
    table = [{"nodes": [i], "motion": m, "rotations": rotations, "mass": rng.uniform(1, 2),
              "inertia": rng.uniform(0.2, 0.4) if rotations else 0.0} for i, m in zip(masters, motions)]
    table.append({"nodes": [201], "motion": "driven", "rotations": turns})
    table.append({"nodes": [202], "motion": "free", "rotations": turns, "mass": 1.5, "inertia": 0.3 if turns else 0.0})
    table += [{"nodes": [101 + j], "mass": rng.uniform(1, 2), "inertia": 0.3 if turns else 0.0} for j in range(5)]
    turning = {"rotational_stiffness": 2.0, "rotational_damping": [0.1, 0.2, 0.3]} if turns else {}
    return {
        "mesh": {"nodes": nodes, "segments": [[1, 1, 2, 3, 4], [2, 2, 5, 3], [3, 6, 7, 8, 9], [4, 7, 10, 8]]},
        "node": table,
        "tie": [{"name": "tie", "segments": "all", "slaves": [101, 102, 103, 104, 105], "formulation": formulation,
                 "search_distance": 2.0}],
        "spring": [{"nodes": [101, 201], "kind": "bushing", "stiffness": [3.0, 4.0, 5.0], "damping": [0.5, 0.7, 0.9],
                    **turning},
                   {"nodes": [104, 202], "kind": "axial", "stiffness": 2.0, "damping": 0.3},
                   {"nodes": [201, 5], "kind": "axial", "stiffness": 2.0, "damping": 0.3}],
        "initial": [{"nodes": [i for i, m in zip(masters, motions) if m == "free"] + [202],
                     "v": rng.normal(size=3).tolist()}],
        "model": {"inertia": inertia, "reaction": reaction, "geometry": geometry, "position": position,
                  "gravity": [0.3, 0.0, -9.81]},
        "interface": {"expose": ["slave.r", "slave.a", "master.r", "point.r", "energy", "drift", "power_residual",
                                 "slave.mass", "slave.inertia", "master.stiffness"]},
    }


DIAGNOSTICS = {"stable_time_step", "nodal_time_step", "power_residual", "energy.kinetic", "energy.strain",
               "energy.dissipated", "energy.external", "energy.residual"}


def declared(unknowns) -> dict[str, dict[str, str]]:
    """Name of an unknown -> name of a known -> kind. Diagnostics may leave the lists out; nothing else may."""
    found = {}
    for u in unknowns:
        if u.dependencies is None:
            assert u.variable.name in DIAGNOSTICS
        else:
            kinds = u.dependenciesKind or ["dependent"] * len(u.dependencies)
            found[u.variable.name] = dict(zip((v.name for v in u.dependencies), kinds))
    return found


def random_values(fmu, rng, knowns) -> dict[str, float]:
    """Inputs of size one about their start; parameters stay positive."""
    values = {}
    for name in knowns:
        start = float(fmu.variables[name].start)
        if name.startswith("integrator."):
            values[name] = rng.uniform(0.5, 1)
        elif name.endswith((".mass", ".inertia")):
            values[name] = start * rng.uniform(0.8, 1.2)
        else:
            values[name] = start + rng.normal() * (0.05 if ".r[" in name else 1.0)
    return values


def observed(instance, fmu, rng, knowns, unknowns, points=3):
    """Which unknowns answer to which known, and the answer per unit of it, at several points: (points, knowns,
    unknowns)."""
    slope = np.empty((points, len(knowns), len(unknowns)))
    for p in range(points):
        base = random_values(fmu, rng, knowns)
        assert instance.set(base) == OK, instance.log
        before = instance.get(unknowns)
        for k, name in enumerate(knowns):
            moved = random_values(fmu, rng, [name])[name]
            assert instance.set({name: moved}) == OK, instance.log
            slope[p, k] = (instance.get(unknowns) - before) / (moved - base[name])
            assert instance.set({name: base[name]}) == OK
        np.testing.assert_array_equal(instance.get(unknowns), before)
    return slope


def compare(slope, knowns, unknowns, lists):
    answer = np.abs(slope).max(axis=0)
    limit = 1e-11 * np.maximum(1, answer.max(axis=0))
    for u, unknown in enumerate(unknowns):
        depends = {name for k, name in enumerate(knowns) if answer[k, u] > limit[u]}
        assert depends == set(lists[unknown]), unknown
        for k, name in enumerate(knowns):
            if lists[unknown].get(name) == "constant":
                np.testing.assert_allclose(slope[:, k, u], slope[0, k, u], rtol=1e-6, atol=100 * limit[u],
                                           err_msg=f"{unknown} <- {name}")


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: "-".join(map(str, s)))
def test_outputs_depend_on_what_they_declare(tmp_path, settings):
    rng = np.random.default_rng(abs(hash_of(settings)))
    fmu = Fmu(scene(rng, *settings), tmp_path)
    lists = declared(fmu.description.outputs)
    inputs, outputs = fmu.names("input"), [name for name in fmu.names("output") if name in lists]
    instance = Instance(fmu).start(values=random_values(fmu, rng, inputs))
    for k in range(3):
        assert instance.step(0.01 * k, 0.01) == OK, instance.log
    compare(observed(instance, fmu, rng, inputs, outputs), inputs, outputs, lists)
    instance.free()


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: "-".join(map(str, s)))
def test_initial_unknowns_depend_on_what_they_declare(tmp_path, settings):
    rng = np.random.default_rng(abs(hash_of(settings)) + 1)
    fmu = Fmu(scene(rng, *settings), tmp_path)
    lists = declared(fmu.description.initialUnknowns)
    knowns = fmu.names("input") + fmu.names("parameter")
    unknowns = [name for name in fmu.names("calculatedParameter") + fmu.names("output") if name in lists]
    instance = Instance(fmu)
    assert instance.call("EnterInitializationMode") == OK
    compare(observed(instance, fmu, rng, knowns, unknowns, points=2), knowns, unknowns, lists)
    instance.free()


def hash_of(settings) -> int:
    """The same in every run, unlike hash()."""
    return sum(ord(c) * 31**k for k, c in enumerate("-".join(map(str, settings)))) % 2**32
