"""Signals of criteria: reduced from the outputs row by row, windowed, filtered, read from references."""

import re
from pathlib import Path

import numpy as np

from ..csv_table import SECONDS, read_table
from ..errors import RunError, UsageError
from ..results import needed
from ..schema import suggestion
from .criteria import Against, Criterion

Points = tuple[np.ndarray, np.ndarray]  # times and values


class Quantity:
    """A number a row: one output with its sign; the length of the vector NAME[1], NAME[2], NAME[3]; or, of all that
    NAME[*] means, by `combine`: the norm of all components, the length (for components the value) of the sum, or the
    largest length."""

    def __init__(self, signal: str, combine: str, names: list[str]):
        """names: of the outputs. Raises UsageError where there is none."""
        self.combine = combine
        self.items: list[list[str]] = []
        known = set(names)
        if "[*]" in signal:
            pattern = re.compile(r"\[[^\]]*\]".join(map(re.escape, signal.split("[*]"))))
            self.items += [[name] for name in names if pattern.fullmatch(name)]
            if not self.items:
                found = [name[:-3] for name in names if name.endswith("[1]") and pattern.fullmatch(name[:-3])]
                self.items += [vector(stem) for stem in found if known >= set(vector(stem))]
        elif signal in known:
            self.items.append([signal])
        elif known >= set(vector(signal)):
            self.items.append(vector(signal))
        if not self.items:
            stems = {re.sub(r"\[[123]\]$", "", name) for name in names}
            stars = {re.sub(r"^(\w+)\[[^\]]*\]", r"\1[*]", stem) for stem in stems}
            raise UsageError(f"signal '{signal}': no such output{suggestion(signal, known | stems | stars)}")
        self.names = [name for item in self.items for name in item]
        self.signed = len(self.items[0]) == 1 and (len(self.items) == 1 or combine == "sum")

    def parts(self, rows: np.ndarray, columns: dict[str, int]) -> np.ndarray:
        """What is linear in the outputs: their components, or the sum of them, (rows, items, components)."""
        values = rows[:, [[columns[name] for name in item] for item in self.items]]
        return values.sum(axis=1, keepdims=True) if self.combine == "sum" else values

    def whole(self, parts: np.ndarray) -> np.ndarray:
        """The quantity of such parts, (rows,)."""
        if self.signed:
            return parts[:, 0, 0]
        if self.combine == "norm" or parts.shape[1] == 1:
            return np.sqrt((parts**2).sum(axis=(1, 2)))
        return np.sqrt((parts**2).sum(axis=2).max(axis=1))


def vector(stem: str) -> list[str]:
    return [f"{stem}[{k}]" for k in (1, 2, 3)]


class Collected:
    """Takes the rows of a run block by block and keeps the time and one number a row of each quantity, or its parts
    where they will be filtered."""

    def __init__(self, quantities: list[Quantity], in_parts: list[bool], names: list[str]):
        self.quantities, self.in_parts = quantities, in_parts
        self.columns = {name: 1 + k for k, name in enumerate(names)}
        self.parts: list[list[np.ndarray]] = [[] for _ in range(1 + len(quantities))]

    def write(self, block: np.ndarray) -> None:
        self.parts[0].append(block[:, 0].copy())
        for kept, quantity, in_parts in zip(self.parts[1:], self.quantities, self.in_parts):
            found = quantity.parts(block, self.columns)
            kept.append(found if in_parts else quantity.whole(found))

    def signals(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Times, and values or parts of each quantity."""
        time, *values = (np.concatenate(kept) for kept in self.parts)
        return time, values


def filtered(time: np.ndarray, values: np.ndarray, frequency_class: int) -> Points:
    """Times and values (rows, ...) behind a filter of SAE J211-1 (appendix C: Butterworth of second order, forwards and
    backwards, no phase), at equal steps: the mean step where those given are not. Ends are continued by their point
    reflection. Raises UsageError where the steps are too long for the class or scipy is missing."""
    needed("scipy", "accept", f"filter = {frequency_class}")
    from scipy.signal import filtfilt

    step = (time[-1] - time[0]) / (len(time) - 1)
    longest = 1 / (10 * frequency_class)
    if step > longest * (1 + 1e-9):
        raise UsageError(
            f"filter = {frequency_class}: needs values every {longest:.3g} s or closer, found {step:.3g} s; "
            "make the communication step shorter, or take a lower class"
        )
    equal = time[0] + step * np.arange(len(time))
    if not np.allclose(time, equal, rtol=0, atol=1e-6 * step):
        flat = values.reshape(len(time), -1)
        even = np.stack([np.interp(equal, time, column) for column in flat.T], axis=1)
        values, time = even.reshape(values.shape), equal
    forward, back = coefficients(frequency_class, step)
    reflected = min(len(values) - 1, int(np.ceil(3 / (frequency_class * step))))
    return time, filtfilt(forward, back, values, axis=0, padtype="odd", padlen=reflected)


def coefficients(frequency_class: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """(b, a) of one pass, as SciPy writes them: SAE J211-1, appendix C."""
    wa = np.tan(2 * np.pi * frequency_class * 2.0775 * step / 2)
    scale = 1 + np.sqrt(2) * wa + wa**2
    a0 = wa**2 / scale
    b1, b2 = -2 * (wa**2 - 1) / scale, (-1 + np.sqrt(2) * wa - wa**2) / scale
    return np.array([a0, 2 * a0, a0]), np.array([1.0, -b1, -b2])


def cut(time: np.ndarray, values: np.ndarray, window: tuple[float, float] | None) -> Points:
    """What lies in the window. Raises UsageError where that is less than two rows, or a part of the window has none."""
    if window is None:
        return time, values
    inside = (time >= window[0]) & (time <= window[1])
    if inside.sum() < 2:
        raise UsageError(
            f"window = [{window[0]:g}, {window[1]:g}]: holds {inside.sum()} of the values, which go from {time[0]:g} "
            f"to {time[-1]:g} s; give a window with at least two"
        )
    step = (time[-1] - time[0]) / (len(time) - 1)
    if window[0] < time[0] - step or window[1] > time[-1] + step:
        raise UsageError(
            f"window = [{window[0]:g}, {window[1]:g}]: the values go from {time[0]:g} to {time[-1]:g} s only; give a "
            "window that they fill"
        )
    return time[inside], values[inside]


def prepared(row: Criterion, quantity: Quantity, time: np.ndarray, values: np.ndarray) -> Points:
    """The signal of the run as the criterion looks at it: its parts filtered, as SAE J211-1 wants it before all that is
    not linear, then one number a row, then cut."""
    if row.filter is not None:
        time, parts = filtered(time, values, row.filter)
        values = quantity.whole(parts)
    return cut(time, values, row.window)


def reference(row: Against, folder: Path) -> Points:
    """Times and values of the reference, filtered where asked. Raises UsageError, RunError."""
    path = folder / row.reference
    column = row.column or row.signal

    def check(header):
        if column not in header:
            others = [name for name in header if name not in ("", row.time_column)]
            raise RunError(f"{path}: has no column '{column}'{suggestion(column, others)}")

    table = read_table(path, check, [column], row.time_column, "; time_column says which holds the times")
    seconds = SECONDS.get(table.unit, row.time_scale)
    if abs(seconds - row.time_scale) > 1e-6 * seconds:
        raise UsageError(f"{path}: its times are in {table.unit}: time_scale = {seconds:g}, found {row.time_scale:g}")
    time = table.values[:, table.names.index(row.time_column)] * row.time_scale
    values = table.values[:, table.names.index(column)] * row.scale
    if len(time) < 2:
        raise UsageError(f"{path}: holds one row only; a reference needs two")
    if row.filter is not None and row.filter_reference:
        return filtered(time, values, row.filter)
    return time, values
