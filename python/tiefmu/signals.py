"""Inputs over time: read from a CSV, and their values at communication points as FMPy's `simulate_fmu` gives them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from .csv_table import SECONDS, read_table
from .errors import RunError
from .schema import suggestion


def read_inputs(path: Path, variables: dict[str, Any]) -> np.ndarray:
    """The input CSV as FMPy takes it: a structured array with `time` first. variables: the FMU's, by name. Raises
    RunError."""
    inputs = [name for name, variable in variables.items() if variable.causality == "input"]

    def check(header):
        for name in header:
            if name == "time":
                continue
            if name not in variables:
                raise RunError(f"{path}: column '{name}': no such variable{suggestion(name, inputs)}")
            if variables[name].causality != "input":
                raise RunError(f"{path}: column '{name}' is no input but of causality {variables[name].causality}")
            if not is_continuous(variables[name]):
                raise RunError(f"{path}: column '{name}': only continuous inputs of type Real can be given")

    found = read_table(path, check)
    if SECONDS.get(found.unit, 1.0) != 1.0:
        raise RunError(f"{path}: times are in {found.unit}; inputs are over s")
    header, table = found.names, found.values
    order = ["time"] + [name for name in header if name != "time"]
    signals = np.empty(len(table), dtype=[(name, float) for name in order])
    for name in order:
        signals[name] = table[:, header.index(name)]
    return signals


def is_continuous(variable) -> bool:
    return variable.type == "Real" and variable.variability not in ("discrete", "tunable")


def inputs_beside(scene: str | Path) -> Path | None:
    """NAME.csv beside NAME.toml, if there."""
    path = Path(scene).with_suffix(".csv")
    return path if path.is_file() else None


class Inputs:
    """Inputs linear between the rows of a table; a time given twice is a jump, before the first and after the last row
    their values hold. All by the rules, and to the bit, of FMPy's `Input`."""

    def __init__(self, signals: np.ndarray | None, variables: Iterable[Any]):
        """signals: of `read_inputs`; variables: the FMU's, in its order."""
        if signals is None:
            signals = np.zeros(1, dtype=[("time", float)])
        columns = set(signals.dtype.names or ())
        given = [variable for variable in variables if variable.causality == "input" and variable.name in columns]
        self.names = [variable.name for variable in given]
        self.variables = given
        self.time = np.ascontiguousarray(signals["time"])
        self.table = np.empty((len(self.time), len(given)))
        for column, name in enumerate(self.names):
            self.table[:, column] = signals[name]
        t = self.time
        self.jumps = sorted(set(t[:-1][np.diff(t) == 0].tolist()))
        self.jumps_here = np.append(close(t[:-1], t[1:]), False)  # row i and the next are of one time
        self.after = np.arange(len(t))  # the last row of row i's time
        for i in np.flatnonzero(self.jumps_here)[::-1].tolist():
            self.after[i] = self.after[i + 1]

    def at(self, times: np.ndarray, after_jump: bool = True) -> np.ndarray:
        """Values (len(times), inputs); at a jump those after it, or before it."""
        t, last = self.time, len(self.time) - 1
        if last == 0:
            return np.repeat(self.table, len(times), axis=0)
        found = np.searchsorted(t, times)  # the first row that is not before
        right = np.clip(found, 1, last)
        left = right - 1
        with np.errstate(divide="ignore", invalid="ignore"):  # of rows at one time, replaced below
            w0 = ((t[right] - times) / (t[right] - t[left]))[:, None]
            values = w0 * self.table[left] + (1 - w0) * self.table[right]
        row = np.where(found == 0, 0, np.minimum(found, last))
        jump = (found > 0) & (found <= last) & close(times, t[row]) & self.jumps_here[row]
        taken = np.where(jump & after_jump, self.after[row], row)
        held = (found == 0) | (found > last) | jump
        values[held] = self.table[taken[held]]
        return values


@dataclass
class Experiment:
    """What a run does: start, stop, step in s, and the inputs."""

    start: float
    stop: float
    step: float
    inputs: Inputs

    @property
    def rows(self) -> float:
        return (self.stop - self.start) / self.step + 1 + len(self.inputs.jumps)

    def points(self, variable: bool) -> Iterator[float]:
        """Ends of the steps: communication_points."""
        return communication_points(self.start, self.stop, self.step, self.inputs.jumps, variable)


def close(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """math.isclose of arrays."""
    return np.abs(b - a) <= np.maximum(np.abs(1e-9 * a), np.abs(1e-9 * b))


def communication_points(
    start: float, stop: float, step: float, jumps: list[float], variable: bool = True
) -> Iterator[float]:
    """Ends of the steps, as `simulate_fmu` takes them: start + n step, the jumps of the inputs, and stop. variable: the
    FMU takes steps of any length; otherwise there are none but the regular ones before stop."""
    time, n, j = start, 0, 0
    jumps = jumps if variable else []
    while not (time > stop or isclose(time, stop)):
        regular = following = start + (n + 1) * step
        while j < len(jumps) and (jumps[j] <= time or isclose(jumps[j], time)):
            j += 1
        if j < len(jumps) and following > jumps[j] and not isclose(following, jumps[j]):
            following = jumps[j]
        if following > stop and not isclose(following, stop):
            if not variable:
                return
            following = stop
        yield following
        time = following
        if isclose(time, regular):
            n += 1
