"""What `tiefmu run` costs beside a bare loop of fmi2SetReal, fmi2DoStep and fmi2GetReal: python bench/importer.py

Per scene, ms of wall time, best of repeats taken in turns: the bare loop on FMPy's FMU2Slave with inputs computed
beforehand; the loop of `tiefmu run`, its inputs and its row a step included; FMPy's simulate_fmu; and last the ratio
of the second to the first.
"""

import tempfile
import time
from pathlib import Path

import fmpy
import numpy as np
import tiefmu
from tiefmu.fmi_access import moving_pointer, references
from tiefmu.fmu_instance import Fmu, Instance
from tiefmu.run import experiment, simulate
from tiefmu.signals import read_inputs

SCENES = Path(__file__).resolve().parents[1] / "scenes"
REPEATS = 15
STEPS = 2000


def bare(fmu, plan, outputs) -> float:
    loaded = Instance(fmu, outputs)
    instance = loaded.instance
    loaded._initialise(plan, {})
    rows = np.empty((STEPS + 1, len(outputs)))
    given = plan.inputs.at(plan.start + plan.step * np.arange(STEPS))
    n, m = len(outputs), len(plan.inputs.variables)
    row, row_at = moving_pointer()
    control, control_at = moving_pointer()
    row_at.value, control_at.value = rows.ctypes.data, given.ctypes.data
    controls, wanted = references(plan.inputs.variables), references(loaded.outputs)
    began = time.perf_counter()
    instance.fmi2GetReal(instance.component, wanted, n, row)
    for k in range(STEPS):
        instance.fmi2SetReal(instance.component, controls, m, control)
        instance.fmi2DoStep(instance.component, plan.start + k * plan.step, plan.step, 1)
        row_at.value += 8 * n
        control_at.value += 8 * m
        instance.fmi2GetReal(instance.component, wanted, n, row)
    seconds = time.perf_counter() - began
    instance.terminate()
    loaded.free()
    return seconds


def own(fmu, plan, outputs) -> float:
    loaded = Instance(fmu, outputs)
    seconds = simulate(loaded, plan, outputs).seconds
    loaded.free()
    return seconds


def recorder(fmu, plan, outputs, signals) -> float:
    names = frozenset(outputs)
    began = time.perf_counter()
    fmpy.simulate_fmu(
        str(fmu.folder),
        validate=False,
        model_description=fmu.description,
        fmi_type="CoSimulation",
        start_time=plan.start,
        stop_time=plan.stop,
        output_interval=plan.step,
        input=signals,
        output=names,
    )
    return time.perf_counter() - began


def main() -> None:
    print(f"{'scene':<18} {'outputs':>7} {'bare':>9} {'tiefmu':>9} {'FMPy':>9} {'ratio':>6}   ms for {STEPS} steps")
    with tempfile.TemporaryDirectory() as folder:
        for name in ("spotweld", "rivet", "mesh_transition", "bracket"):
            path = tiefmu.build(tiefmu.load(SCENES / f"{name}.toml"), Path(folder) / f"{name}.fmu")
            with Fmu(path) as fmu:
                inputs = SCENES / f"{name}.csv"
                signals = read_inputs(inputs, fmu.variables)
                step = float(signals["time"][-1]) / STEPS
                plan = experiment(fmu, None, step, inputs)
                outputs = fmu.outputs()
                times = [(bare(fmu, plan, outputs), own(fmu, plan, outputs)) for _ in range(REPEATS)]
                loop, run = map(min, zip(*times))
                slow = recorder(fmu, plan, outputs, signals)
            cells = f"{1e3 * loop:>9.2f} {1e3 * run:>9.2f} {1e3 * slow:>9.0f} {run / loop:>6.2f}"
            print(f"{name:<18} {len(outputs):>7} {cells}", flush=True)


if __name__ == "__main__":
    main()
