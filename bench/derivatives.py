"""Price of derivatives by FMI 3.0: python bench/derivatives.py [SLAVES]

One row a scene: a step with all inputs set and all outputs got, fmi3GetDirectionalDerivative and
fmi3GetAdjointDerivative of all outputs by all inputs, ms of processor time, in turn in one process, the least of a few;
and both derivatives as multiples of the step.
"""

import ctypes
import sys
import tempfile
import time
from pathlib import Path

import fmpy
import numpy as np
import tiefmu
from fmi_versions import surface
from fmpy.fmi3 import FMU3Slave

REPEATS = 9
SCENES = {  # formulation, motion of the masters, model
    "default, driven, loads": ("default", "driven", {}),
    "optimized, driven, loads": ("optimized", "driven", {}),
    "optimized, driven, full, consistent, places": (
        "optimized",
        "driven",
        {"inertia": "consistent", "reaction": "full", "position": "input"},
    ),
    "default, free, lumped": ("default", "free", {}),
    "default, free, consistent": ("default", "free", {"inertia": "consistent"}),
    "optimized, free, consistent": ("optimized", "free", {"inertia": "consistent"}),
}


def made(slaves: int, formulation: str, motion: str, model: dict) -> dict:
    scene = surface(slaves)
    scene["node"][0] |= {"motion": motion, "mass": 1.0}
    scene["tie"][0]["formulation"] = formulation
    return scene | {"model": model, "integrator": {"time_step": 1e-5}}


def pointer(values: np.ndarray) -> tuple:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), len(values)


class Calls:
    def __init__(self, path: Path):
        description = fmpy.read_model_description(str(path), validate=False)
        self.fmu = FMU3Slave(
            guid=description.instantiationToken,
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="bench",
        )
        self.fmu.instantiate()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.time = 0.0
        self.numbers, self.result, self.seed, self.references = {}, {}, {}, {}
        for causality in ("input", "output"):
            arrays = [v for v in description.modelVariables if v.causality == causality]
            count = sum(int(np.prod(v.shape or ())) for v in arrays)
            self.numbers[causality], self.result[causality] = np.zeros(count), np.zeros(count)
            self.seed[causality] = np.random.default_rng(1).standard_normal(count)
            self.references[causality] = (ctypes.c_uint32 * len(arrays))(*(v.valueReference for v in arrays))
        self.fmu.fmi3GetFloat64(self.fmu.component, *self.arguments("input"))

    def arguments(self, causality: str) -> tuple:
        references = self.references[causality]
        return references, len(references), *pointer(self.numbers[causality])

    def step(self) -> None:
        self.numbers["input"] += 1e-3
        self.fmu.fmi3SetFloat64(self.fmu.component, *self.arguments("input"))
        self.fmu.doStep(self.time, 1e-5)
        self.time += 1e-5
        self.fmu.fmi3GetFloat64(self.fmu.component, *self.arguments("output"))

    def derivative(self, kind: str) -> None:
        seed, result = ("input", "output") if kind == "Directional" else ("output", "input")
        variables = [*self.arguments("output")[:2], *self.arguments("input")[:2]]
        call = getattr(self.fmu, f"fmi3Get{kind}Derivative")
        call(self.fmu.component, *variables, *pointer(self.seed[seed]), *pointer(self.result[result]))


def spent(what, *arguments) -> float:
    began = time.process_time()
    what(*arguments)
    return 1e3 * (time.process_time() - began)


def main() -> None:
    slaves = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    print("scene", "step", "directional", "adjoint", "of the step", sep=" | ")
    for name, case in SCENES.items():
        with tempfile.TemporaryDirectory() as folder:
            calls = Calls(tiefmu.build(tiefmu.load(made(slaves, *case)), Path(folder) / "bench.fmu", fmi=3))
        times = []
        for _ in range(REPEATS):
            times.append(
                [spent(calls.step), spent(calls.derivative, "Directional"), spent(calls.derivative, "Adjoint")]
            )
        step, directional, adjoint = np.min(times, axis=0)
        print(
            name,
            *(f"{t:.3g}" for t in (step, directional, adjoint)),
            f"{directional / step:.2f}, {adjoint / step:.2f}",
            sep=" | ",
            flush=True,
        )


if __name__ == "__main__":
    main()
