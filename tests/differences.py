"""Derivatives of an FMU's outputs: as the FMU gives them, and by central differences."""

from ctypes import c_double, c_size_t, c_uint

import numpy as np
from fmu_calls import OK


def directional(instance, unknowns, knowns, seed) -> np.ndarray:
    """fmi2GetDirectionalDerivative for variables by name."""
    references = [instance.fmu.reference[name] for name in unknowns], [instance.fmu.reference[name] for name in knowns]
    n, m = len(unknowns), len(knowns)
    change = (c_double * n)(*[np.nan] * n)
    status = instance.call(
        "GetDirectionalDerivative",
        (c_uint * n)(*references[0]),
        c_size_t(n),
        (c_uint * m)(*references[1]),
        c_size_t(m),
        (c_double * m)(*seed),
        change,
    )
    assert status == OK, instance.log
    return np.array(change[:])


def differences(instance, unknowns, values: dict, seed: dict, h=2.5e-4) -> np.ndarray:
    """d unknowns / d s of the inputs `values` + s `seed` at s = 0, by central differences of fourth order."""

    def at(s):
        assert instance.set({name: values[name] + s * seed[name] for name in seed}) == OK, instance.log
        return instance.get(unknowns)

    slope = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    assert instance.set({name: values[name] for name in seed}) == OK
    return slope


def check_derivatives(instance, unknowns, values: dict, rng, tolerance=1e-8):
    """Every unknown with respect to each of the inputs `values` alone, and along three directions that mix them. The
    error is measured against the largest derivative of the unknown, and its size for those that are nearly nothing."""
    assert instance.set(values) == OK, instance.log
    before = instance.get(unknowns)
    names = list(values)
    seeds = [{name: 1.0} for name in names] + [dict(zip(names, rng.normal(size=len(names)))) for _ in range(3)]
    exact = np.array([directional(instance, unknowns, list(seed), list(seed.values())) for seed in seeds])
    np.testing.assert_array_equal(instance.get(unknowns), before)  # asking changes nothing
    found = np.array([differences(instance, unknowns, values, seed) for seed in seeds])
    scale = np.abs(found).max(axis=0) + 1e-3 * np.abs(before) + 1e-2
    wrong = np.abs(exact - found) > tolerance * scale
    assert not wrong.any(), [
        (unknowns[u], list(seeds[s])[:3], exact[s, u], found[s, u]) for s, u in np.argwhere(wrong)[:12].tolist()
    ] + [wrong.sum()]
    assert np.abs(exact).max() > 0
