"""Simulation in Python: each output is computed from the rest of the array, whatever its own place held before; calls
that make no sense change nothing."""

import numpy as np
import pytest
import tiefmu
from fmu_scenes import ALL_FREE, DRIVEN, MIXED
from fmu_scenes import scene as many_sided
from port_scenes import ported

BY_THE_STEP = {"stable_time_step", "nodal_time_step"}  # what the next substep may be, known before it
SCENES = {
    "mixed": lambda rng: many_sided(rng, *MIXED),
    "free": lambda rng: many_sided(rng, *ALL_FREE),
    "driven": lambda rng: many_sided(rng, *DRIVEN),
    "ports": lambda rng: ported(rng, ("default", True, "consistent", "split", "finite")),
}


@pytest.mark.parametrize("kind", SCENES)
def test_every_output_is_computed_anew(kind):
    simulation = tiefmu.load(SCENES[kind](np.random.default_rng(3))).simulation()
    simulation.initialise(0.0)
    simulation.step(1e-4)
    fields = {block["field"] for block in simulation.variables if block["computed"]}
    assert len(fields) > 5
    for field in fields - BY_THE_STEP:
        before = simulation.get(field)
        assert np.isfinite(before).all(), field
        simulation.set(field, np.full(before.shape, np.nan))
        np.testing.assert_array_equal(simulation.get(field), before, err_msg=field)


def test_calls_that_make_no_sense_change_nothing():
    simulation, other = (
        tiefmu.load(SCENES[kind](np.random.default_rng(3))).simulation() for kind in ("driven", "ports")
    )
    with pytest.raises(ValueError, match="start time"):
        simulation.initialise(np.nan)
    for each in (simulation, other):
        each.initialise(0.0)
    before = {field: simulation.get(field) for field in simulation.fields}
    for duration in (0.0, -1e-3, np.inf, np.nan):
        with pytest.raises(ValueError, match="duration"):
            simulation.step(duration)
    with pytest.raises(ValueError, match="another model"):
        simulation.restore(other.save())
    assert simulation.time == 0
    for field, values in before.items():
        np.testing.assert_array_equal(simulation.get(field), values, err_msg=field)
