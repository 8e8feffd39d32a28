"""The packaged FMU, driven by FMPy, against the solver in process (the same bits) and against independent.py."""

import fmpy
import numpy as np
import pytest
import tiefmu
from fmpy.fmi2 import FMU2Slave
from in_process import EXPOSED, Run
from independent import Problem, constant
from random_scenes import structure

END = 0.4
STEPS = [0.002, 0.006, 0.0001, 0.0119] * 20  # s, irregular on purpose


class Instance:
    """An FMU between instantiation and termination, by variable names."""

    def __init__(self, path, folder, inputs):
        description = fmpy.read_model_description(str(path))
        self.reference = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.time = 0.0
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.set(inputs)
        self.fmu.exitInitializationMode()

    def set(self, values):
        for name, vector in values.items():
            for k, value in enumerate(vector, start=1):
                self.fmu.setReal([self.reference[f"{name}[{k}]"]], [value])

    def __getitem__(self, name):
        scalar = name in self.reference
        names = [name] if scalar else [f"{name}[{k}]" for k in (1, 2, 3)]
        values = np.array(self.fmu.getReal([self.reference[n] for n in names]))
        return values[0] if scalar else values

    def step(self, duration):
        self.fmu.doStep(self.time, duration)
        self.time += duration


@pytest.mark.parametrize("method", ["central-difference", "rk4"])
@pytest.mark.parametrize("formulation, rotations", [("default", True), ("default", False), ("optimized", False)])
def test_fmu(tmp_path, formulation, rotations, method):
    scene = structure(np.random.default_rng(21), formulation, rotations, "consistent")
    scene |= {"integrator": {"method": method}, "interface": {"expose": EXPOSED}}
    loads = {101: [3.0, -2.0, 5.0], 5: [0.0, 1.0, 2.0], 301: [1.0, 1.0, 0.0]}  # N, by node id
    name_of = Run(scene).names
    inputs = {f"{name_of[i]}.{'f' if i == 101 else 'f_ext'}": load for i, load in loads.items()}
    path = tiefmu.build(tiefmu.load(scene), tmp_path / "structure.fmu")
    instance, run = Instance(path, tmp_path / "files", inputs), Run(scene, inputs=inputs)
    names = [name for name in run.components if not name.startswith("integrator.")]
    assert {n for name in names for n in run.components[name]} <= set(instance.reference)
    for duration in STEPS:
        instance.step(duration)
        run.step(duration)
        for name in names:
            assert np.array_equal(instance[name], run[name]), name

    problem = Problem(scene)
    forces = constant({("f", i): load for i, load in loads.items()})
    expected = problem.solve([0.0, END], forces)[-1]
    tolerance = {"central-difference": 2e-2, "rk4": 2e-4}[method] * np.abs(expected["x"] - problem.x0).max()
    for k, i in enumerate(problem.ids):
        np.testing.assert_allclose(instance[f"{name_of[i]}.r"], expected["x"][k], rtol=0, atol=tolerance)
    instance.fmu.terminate()
    instance.fmu.freeInstance()
