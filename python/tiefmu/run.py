"""Co-simulating an FMU with FMPy: inputs from a CSV, outputs to a CSV."""

import contextlib
import csv
import io
import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from fmpy.simulation import SimulationResult

from .errors import RunError
from .schema import suggestion

STEPS = 500  # at least, where the caller leaves the step open


def run(
    fmu: Path,
    stop_time: float | None = None,
    step: float | None = None,
    inputs: Path | None = None,
    name: str | None = None,
) -> "SimulationResult":
    """Runs the FMU and returns its outputs: a structured array with `time` (s) and one column an output, and FMPy's
    description of the FMU as `.modelDescription`.

    stop_time, s: by default the end of the input CSV, else the FMU's default experiment. step: communication step, s,
    by default the FMU's, but so small that the run has at least STEPS. inputs: CSV with `time` and names of inputs,
    linear in between; a time given twice is a jump. name: how messages call the FMU. Row k holds what the FMU answers
    at the end of step k, the inputs being those of the start of the step. Raises RunError.
    """
    import fmpy  # here, because importing it takes half a second
    import fmpy.fmi2
    from tqdm import tqdm

    name = name or str(fmu)
    try:
        description = fmpy.read_model_description(str(fmu), validate=False)
    except Exception as error:
        raise RunError(f"{name}: not an FMU that FMPy can read: {one_line(error)}") from None
    signals = read_inputs(inputs, description) if inputs is not None else None
    experiment = description.defaultExperiment
    start = number(experiment and experiment.startTime, 0.0)
    if stop_time is None:
        stop_time = float(signals["time"][-1]) if signals is not None else number(experiment and experiment.stopTime, 1)
    if not stop_time > start:
        raise RunError(f"{inputs or name}: stop time {stop_time:g} s is not after start time {start:g} s")
    if step is None:
        step = min((stop_time - start) / STEPS, number(experiment and experiment.stepSize, np.inf))

    # A set, because FMPy asks for each variable whether it is among them.
    outputs = frozenset(variable.name for variable in description.modelVariables if variable.causality == "output")
    said = []

    def log(environment, instance, status, category, message):
        if status >= fmpy.fmi2.fmi2Error:
            said.append(message.decode(errors="replace") if isinstance(message, bytes) else str(message))

    reached = start
    with (
        tempfile.TemporaryDirectory(prefix="tiefmu-") as folder,
        tqdm(
            total=stop_time - start,
            unit="s",
            delay=2,
            disable=None,
            leave=False,
            bar_format="{percentage:3.0f}% |{bar}| {n:.4g} of {total:.4g} s, {remaining} left",
        ) as bar,
    ):

        def step_finished(time, recorder):
            nonlocal reached
            bar.update(time - reached)
            reached = time
            return True

        try:
            fmpy.extract(str(fmu), folder)
        except Exception as error:
            raise RunError(f"{name}: cannot be unpacked: {one_line(error)}") from None
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # FMPy prints a line for each input that gets no column
                return fmpy.simulate_fmu(
                    folder,
                    validate=False,
                    model_description=description,
                    fmi_type="CoSimulation",
                    start_time=start,
                    stop_time=stop_time,
                    output_interval=step,
                    input=signals,
                    output=outputs,
                    logger=log,
                    step_finished=step_finished,
                )
        except Exception as error:
            raise RunError(f"{name}: stopped at t = {reached:g} s: {one_line(said[-1] if said else error)}") from None


def number(text, default: float) -> float:
    return default if text is None else float(text)


def one_line(error) -> str:
    return " ".join(str(error).split())


def read_inputs(path: Path, description: Any) -> Any:
    """The input CSV as FMPy takes it: a structured array with `time` first. Raises RunError."""
    causality = {variable.name: variable.causality for variable in description.modelVariables}
    inputs = [name for name, kind in causality.items() if kind == "input"]
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [(reader.line_num, row) for reader in [csv.reader(file)] for row in reader if row]
    except FileNotFoundError:
        raise RunError(f"{path}: no such file") from None
    except OSError as error:
        raise RunError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{path}: not a CSV file: {one_line(error)}") from None
    if not rows:
        raise RunError(f"{path}: is empty; expected a header with 'time' and names of inputs")
    header = [name.strip() for name in rows[0][1]]
    if "time" not in header:
        raise RunError(f"{path}: has no column 'time'; found {', '.join(header[:6])}")
    for name in header:
        if header.count(name) > 1:
            raise RunError(f"{path}: column '{name}' is repeated")
        if name != "time" and name not in causality:
            raise RunError(f"{path}: column '{name}': no such variable{suggestion(name, inputs)}")
        if name != "time" and causality[name] != "input":
            raise RunError(f"{path}: column '{name}' is no input but of causality {causality[name]}")
    if len(rows) < 2:
        raise RunError(f"{path}: has no values below its header")

    table = np.empty((len(rows) - 1, len(header)))
    for k, (line, row) in enumerate(rows[1:]):
        if len(row) != len(header):
            raise RunError(f"{path}: line {line}: expected {len(header)} values, found {len(row)}")
        for column, value in enumerate(row):
            try:
                table[k, column] = float(value)
            except ValueError:
                raise RunError(f"{path}: line {line}: {header[column]}: expected a number, found '{value}'") from None
            if not math.isfinite(table[k, column]):
                raise RunError(f"{path}: line {line}: {header[column]}: {value} is not a finite number")
    time = table[:, header.index("time")]
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        raise RunError(
            f"{path}: line {rows[back[0] + 2][0]}: time goes back from {time[back[0]]:g} to "
            f"{time[back[0] + 1]:g} s; times must not decrease"
        )
    order = ["time"] + [name for name in header if name != "time"]
    signals = np.empty(len(table), dtype=[(name, float) for name in order])
    for name in order:
        signals[name] = table[:, header.index(name)]
    return signals


def write_outputs(result: "SimulationResult", path: Path) -> None:
    """Writes `time` and the outputs as CSV; every number reads back to the same double. Raises OSError."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        file.write(",".join(result.dtype.names) + "\n")
        for row in result.tolist():
            file.write(",".join(map(repr, row)) + "\n")


def inputs_beside(scene: str | Path) -> Path | None:
    """NAME.csv beside NAME.toml, if there."""
    path = Path(scene).with_suffix(".csv")
    return path if path.is_file() else None
