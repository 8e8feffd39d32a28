"""Co-simulating an FMU: inputs from a CSV, outputs to memory and to a file."""

import contextlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import key_figures
from .errors import RunError, UsageError
from .fmu_instance import Fmu, Instance
from .report import of_folder, report
from .results import Kept, Result, writer
from .scene import Scene
from .signals import Experiment, Inputs, read_inputs
from .view.vtk import PvdFile

STEPS = 500  # at least, where the caller leaves the step open


def experiment(fmu: Fmu, stop_time: float | None, step: float | None, inputs: Path | None) -> Experiment:
    """What the caller leaves open filled in, as `run` says. Raises RunError."""
    signals = read_inputs(inputs, fmu.variables) if inputs is not None else None
    start = fmu.experiment("startTime", 0.0)
    if stop_time is None:
        stop_time = float(signals["time"][-1]) if signals is not None else fmu.experiment("stopTime", 1.0)
    if not stop_time > start:
        raise RunError(f"{inputs or fmu.name}: stop time {stop_time:g} s is not after start time {start:g} s")
    if step is None:
        step = min((stop_time - start) / STEPS, fmu.experiment("stepSize", np.inf))
    return Experiment(start, stop_time, step, Inputs(signals, fmu.variables.values()))


def run(
    path: Path,
    stop_time: float | None = None,
    step: float | None = None,
    inputs: Path | None = None,
    name: str | None = None,
    output: Path | None = None,
    pvd: tuple[Path, int] | None = None,
    scene: Scene | None = None,
) -> tuple[Result, list[str]]:
    """Runs the FMU; its outputs, and the lines of key_figures.py.

    stop_time, s: by default the end of the input CSV, else the FMU's default experiment. step: communication step, s,
    by default the FMU's, but so small that the run has at least STEPS. inputs: CSV with `time` and names of inputs,
    linear in between; a time given twice is a jump. name: how messages call the FMU. output: file to write all rows to
    while it runs (results.FORMATS); pvd: file and number of frames of the moving mesh (view/vtk.py); scene: of the FMU,
    where it is at hand.
    Row k holds what the FMU answers at the end of step k, the inputs being those of the start of the step. Raises
    RunError, UsageError, OSError.
    """
    fmu = Fmu(path, name)
    plan = experiment(fmu, stop_time, step, inputs)
    with fmu, contextlib.ExitStack() as stack:
        outputs = fmu.outputs()
        reactions = key_figures.Reactions(outputs)
        sinks: list[Any] = [reactions]
        if output:
            sinks.append(stack.enter_context(writer(output, outputs, {name: fmu.unit(name) for name in outputs})))
        moving = None
        if pvd:
            found = report(scene, positions=True) if scene else of_folder(fmu.folder)
            if found is None:
                raise UsageError(f"{pvd[0]}: {fmu.name} was not made by tiefmu, so it does not say where its nodes are")
            moving = PvdFile(pvd[0], scene, found, outputs, plan, pvd[1])
            sinks.append(moving)
        instance = Instance(fmu, outputs)
        try:
            result = simulate(instance, plan, outputs, sinks, stack.enter_context(progress(plan)))
        except BaseException:
            if moving:
                moving.discard()
            raise
        finally:
            instance.free()
        if moving:
            moving.close()
        return result, key_figures.lines(fmu, result, reactions, plan.step)


def simulate(
    instance: Instance,
    plan: Experiment,
    outputs: list[str],
    sinks: Sequence = (),
    bar: Any = None,
    start_values: dict[str, float] | None = None,
) -> Result:
    """Runs a new or reset instance. outputs: its outputs; sinks: further takers of blocks of rows, by `write`.
    Raises RunError, OSError."""
    kept = Kept(outputs, {name: instance.fmu.unit(name) for name in outputs}, plan.rows)
    reached = plan.start

    def finished(end):
        nonlocal reached
        bar.update(end - reached)
        reached = end

    began, writing = time.perf_counter(), 0.0
    for block in instance.blocks(plan, start_values, finished if bar is not None else None):
        paused = time.perf_counter()
        for sink in (kept, *sinks):
            sink.write(block)
        writing += time.perf_counter() - paused
    return kept.result(time.perf_counter() - began - writing)


def progress(plan: Experiment):
    from tqdm import tqdm

    return tqdm(
        total=plan.stop - plan.start,
        unit="s",
        delay=2,
        disable=None,
        leave=False,
        bar_format="{percentage:3.0f}% |{bar}| {n:.4g} of {total:.4g} s, {remaining} left",
    )
