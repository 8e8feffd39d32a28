"""The same tie by FMI 2.0 and 3.0: python bench/fmi_versions.py [SLAVES]

One row a version, each in a process of its own: build, reading the description by FMPy, instantiation up to the first
communication point, and a step with all inputs set and all outputs got, ms; size of the FMU and peak of the memory of
what came after the build, MB. Processor time of the process.
"""

import ctypes
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import tiefmu
from tiefmu.fmu_instance import Fmu, Instance
from tiefmu.run import experiment

SLAVES = 100_000
STEPS = 20


def surface(slaves: int) -> dict:
    """A wavy panel of quads with driven nodes, one slave off each."""
    side = round(slaves**0.5)
    i, j = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    x = np.stack([i, j, 0.2 * np.sin(i + 2 * j)], axis=-1).reshape(-1, 3)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.stack([corner, corner + 1, corner + side + 2, corner + side + 1], axis=-1)
    places = np.concatenate([x, x[quads].mean(axis=1) + [0.2, 0.1, 0.1]])
    ids = np.arange(1, len(places) + 1)
    return {
        "mesh": {
            "nodes": [[int(k), *map(float, p)] for k, p in zip(ids, places)],
            "segments": [[e + 1, *(int(k) + 1 for k in quad)] for e, quad in enumerate(quads)],
        },
        "node": [{"nodes": ids[: len(x)].tolist(), "motion": "driven"}, {"nodes": ids[len(x) :].tolist(), "mass": 0.1}],
        "tie": [{"name": "surface", "segments": "all", "slaves": ids[len(x) :].tolist(), "search_distance": 1.0}],
    }


def build(path: str, fmi: int, slaves: int) -> dict:
    scene = tiefmu.load(surface(slaves))
    began = time.process_time()
    tiefmu.build(scene, path, fmi=fmi)
    return {"build": 1e3 * (time.process_time() - began), "MB": Path(path).stat().st_size / 1e6}


def run(path: str) -> dict:
    times = {}
    began = time.process_time()
    fmu = Fmu(Path(path))
    times["read"] = 1e3 * (time.process_time() - began)
    with fmu:
        began = time.process_time()
        instance = Instance(fmu, fmu.outputs())
        plan = experiment(fmu, None, None, None)
        instance._initialise(plan, {})
        times["instantiate"] = 1e3 * (time.process_time() - began)
        inputs = [v for v in fmu.variables.values() if v.causality == "input"]
        outputs = [fmu.variables[name] for name in fmu.outputs()]
        put, get, step = (instance.access.writer(inputs), instance.access.reader(outputs), instance.access.stepper())
        values, answers = (np.zeros(len(each)) for each in (inputs, outputs))
        pointers = [each.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for each in (values, answers)]
        began = time.process_time()
        for k in range(STEPS):
            values[:] = 1e-3 * k
            put(pointers[0])
            step(k * plan.step, plan.step)
            get(pointers[1])
        times["step"] = 1e3 * (time.process_time() - began) / STEPS
        times["variables"] = len(fmu.description.modelVariables)
    times["peak MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return times


def main() -> None:
    if len(sys.argv) > 2:
        what, *rest = sys.argv[1:]
        print(json.dumps(build(rest[0], int(rest[1]), int(rest[2])) if what == "build" else run(rest[0])))
        return
    slaves = sys.argv[1] if len(sys.argv) > 1 else str(SLAVES)

    def child(*arguments) -> dict:
        done = subprocess.run([sys.executable, __file__, *arguments], check=True, stdout=subprocess.PIPE, text=True)
        return json.loads(done.stdout)

    keys = ["variables", "build", "MB", "read", "instantiate", "step", "peak MB"]
    print("FMI", *keys, sep=" | ")
    for fmi in (2, 3):
        with tempfile.TemporaryDirectory() as folder:
            path = f"{folder}/surface.fmu"
            row = child("build", path, str(fmi), slaves) | child("run", path)
        print(f"{fmi}.0", *(f"{row[key]:.4g}" for key in keys), sep=" | ", flush=True)


if __name__ == "__main__":
    main()
