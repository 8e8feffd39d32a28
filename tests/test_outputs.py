"""No output is forgotten: each is computed from the rest of the array, whatever its own place held before."""

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
