"""The declared dependencies against the FMU itself: every input is moved, and what follows is compared."""

import numpy as np
import pytest
from fmu_calls import OK, Fmu, Instance
from fmu_scenes import SETTINGS, random_values, scene

DIAGNOSTICS = {
    "stable_time_step",
    "nodal_time_step",
    "power_residual",
    "energy.kinetic",
    "energy.strain",
    "energy.dissipated",
    "energy.external",
    "energy.residual",
}


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
                np.testing.assert_allclose(
                    slope[:, k, u], slope[0, k, u], rtol=1e-6, atol=100 * limit[u], err_msg=f"{unknown} <- {name}"
                )


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
