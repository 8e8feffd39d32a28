"""Runs an FMU and judges it: a verdict per criterion."""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RunError, RunStopped, UsageError
from ..fmu_instance import Fmu, Instance
from ..results import Result
from ..run import experiment, simulate
from ..signals import Experiment
from . import health, iso18571
from .criteria import Against, Band, Criteria, Criterion, Limit, Rating
from .quantities import Collected, Points, Quantity, cut, prepared, reference
from .verdict import Curve, Verdict


@dataclass
class Judgement:
    """result: None of a run that stopped."""

    verdicts: list[Verdict]
    result: Result | None

    @property
    def passed(self) -> bool:
        return all(verdict.passed for verdict in self.verdicts)


class Judge:
    """Criteria made ready for an FMU: may judge many runs of it.

    folder: of the references; name: how messages call the criteria. Raises UsageError, RunError.
    """

    def __init__(self, fmu: Fmu, criteria: Criteria, folder: Path, name: str):
        self.fmu, self.criteria, self.folder, self.name = fmu, criteria, folder, name
        outputs = fmu.outputs()
        self.rows: list[tuple[str, Criterion, Quantity]] = []
        self.references: dict[str, Points | None] = {}
        for label, row in criteria.named:
            with self._of(label):
                self.rows.append((label, row, Quantity(row.signal, row.combine, outputs)))
                self.references[label] = reference(row, folder) if isinstance(row, Against) else None
        wanted = {name for _, _, quantity in self.rows for name in quantity.names}
        try:
            wanted |= health.outputs(criteria.health, outputs)
        except UsageError as error:
            raise UsageError(f"{name}: health: {error}") from None
        self.outputs = [output for output in outputs if output in wanted]

    @contextlib.contextmanager
    def _of(self, label: str) -> Iterator[None]:
        """Errors with the file and the criterion."""
        try:
            yield
        except (UsageError, RunError) as error:
            raise type(error)(f"{self.name}: criterion '{label}': {error}") from None

    def plan(self, stop_time: float | None, step: float | None, inputs: Path | None) -> Experiment:
        """How to run: what the caller says goes before [run] of the criteria."""
        run = self.criteria.run
        inputs = inputs or (self.folder / run.input if run.input else None)
        return experiment(self.fmu, stop_time or run.stop_time, step or run.step, inputs)

    def judge(
        self, instance: Instance, plan: Experiment, bar: Any = None, start_values: dict[str, float] | None = None
    ) -> Judgement:
        """Runs the instance, which has the outputs of this judge; a second time, reset, for `half_step`. Raises
        UsageError, RunError; RunStopped where the run does not reach its end or leaves no numbers."""
        in_parts = [row.filter is not None for _, row, _ in self.rows]
        collected = Collected([quantity for _, _, quantity in self.rows], in_parts, self.outputs)
        result = simulate(instance, plan, self.outputs, [collected], bar, start_values)
        time, signals = collected.signals()
        verdicts = []
        for (label, row, quantity), values in zip(self.rows, signals):
            with self._of(label):
                verdicts.append(self._one(label, row, quantity, time, values))
        again = None
        if self.criteria.health.half_step is not None:
            instance.reset()
            half = Experiment(plan.start, plan.stop, plan.step / 2, plan.inputs)
            again = simulate(instance, half, self.outputs, start_values=start_values)
        try:
            verdicts += health.verdicts(self.criteria.health, self.fmu, plan, result, again)
        except UsageError as error:
            raise UsageError(f"{self.name}: health: {error}") from None
        return Judgement(verdicts, result)

    def stopped(self, message: str) -> Judgement:
        """Of a run that RunStopped: all has failed."""
        verdicts = [Verdict("run", "run", math.nan, False, "reaches its end", "", message)]
        kinds = {label: type(row).__name__.lower() for label, row, _ in self.rows}
        verdicts += [
            Verdict(label, kinds.get(label, "health"), math.nan, False, "not judged") for label in self.criteria.labels
        ]
        return Judgement(verdicts, None)

    def _one(self, label: str, row: Criterion, quantity: Quantity, time: np.ndarray, values: np.ndarray) -> Verdict:
        unit = self.fmu.unit(quantity.names[0])
        if not np.isfinite(values).all():
            raise RunStopped(f"signal '{row.signal}': holds values that are not finite")
        points, given = prepared(row, quantity, time, values), self.references[label]
        if isinstance(row, Limit):
            verdict = limit(label, row, unit, *points)
        else:
            assert isinstance(row, (Band, Rating)) and given is not None
            given = cut(*given, row.window)
            if isinstance(row, Band):
                verdict = band(label, row, unit, *points, given)
            else:
                verdict = rating(label, row, unit, *points, given)
        verdict.axis = f"{row.signal} [{unit}]"
        return verdict


def named(row: Criterion) -> str:
    return row.signal + (f", CFC {row.filter}" if row.filter else "")


def band(label: str, row: Band, unit: str, t: np.ndarray, x: np.ndarray, given: Points) -> Verdict:
    """The largest distance from the reference in parts of the half-width absolute + relative max|reference|."""
    rt, rx = given
    if row.at == "run":
        inside = (t >= rt[0]) & (t <= rt[-1])
        times, measured = t[inside], x[inside]
        expected, said = np.interp(times, rt, rx), "reference linear between its rows"
    else:
        inside = (rt >= t[0]) & (rt <= t[-1])
        times, expected = rt[inside], rx[inside]
        measured, said = np.interp(times, t, x), "run linear between its steps"
    if len(times) < 2:
        raise UsageError(
            f"{row.reference}: its times, {rt[0]:g} to {rt[-1]:g} s, do not meet those of the run, {t[0]:g} to "
            f"{t[-1]:g} s"
        )
    width = row.absolute + row.relative * float(np.abs(rx).max())
    distance = np.abs(measured - expected)
    worst = int(np.argmax(distance))
    return Verdict(
        label,
        "band",
        float(distance[worst]),
        bool(distance[worst] <= width),
        f"at most {width:.4g} from the reference",
        unit,
        f"{named(row)}; worst at t = {times[worst]:.6g} s; {len(times)} times of the {row.at} from "
        f"{times[0]:g} to {times[-1]:g} s, {said}",
        curves=[Curve("run", t, x), Curve("reference", rt, rx)],
        corridor=(times, expected - width, expected + width),
    )


def rating(label: str, row: Rating, unit: str, t: np.ndarray, x: np.ndarray, given: Points) -> Verdict:
    """By ISO/TS 18571, at 10 kHz, both linear between their rows."""
    rt, rx = given
    start, end = max(t[0], rt[0]), min(t[-1], rt[-1])
    count = int(np.floor((end - start) * iso18571.RATE * (1 + 1e-12))) + 1 if end > start else 0
    if count < 20:
        raise UsageError(f"{row.reference}: shares {max(end - start, 0):g} s with the run; a rating needs 2 ms or more")
    times = start + np.arange(count) / iso18571.RATE
    grades = iso18571.ratings(times, np.interp(times, rt, rx), np.interp(times, t, x), row.name or label)
    return Verdict(
        label,
        "rating",
        grades[row.of],
        bool(grades[row.of] >= row.least),
        f"{row.of} rating at least {row.least:g}",
        "1",
        f"{named(row)}; ISO/TS 18571 at 10 kHz from {start:g} to {end:g} s: "
        + ", ".join(f"{key} {value:.3g}" for key, value in grades.items()),
        curves=[Curve("run", t, x), Curve("reference", rt, rx)],
    )


def limit(label: str, row: Limit, unit: str, t: np.ndarray, x: np.ndarray) -> Verdict:
    peak = int(np.argmax(np.abs(x)))
    place, value = {
        "peak": lambda: (peak, abs(x[peak])),
        "maximum": lambda: (int(np.argmax(x)), x.max()),
        "minimum": lambda: (int(np.argmin(x)), x.min()),
        "end": lambda: (len(x) - 1, x[-1]),
        "time_of_peak": lambda: (peak, t[peak]),
        "impulse": lambda: (len(x) - 1, float(np.sum(0.5 * (x[1:] + x[:-1]) * np.diff(t)))),
    }[row.measure]()
    unit = {"time_of_peak": "s", "impulse": f"{unit}.s"}.get(row.measure, unit)
    bounds = [
        (word, bound) for word, bound in (("at least", row.at_least), ("at most", row.at_most)) if bound is not None
    ]
    ok = all(value >= bound if word == "at least" else value <= bound for word, bound in bounds)
    lines = [bound for _, bound in bounds] if row.measure in ("peak", "maximum", "minimum", "end") else []
    if row.measure == "peak":
        lines = sorted({sign * bound for bound in lines for sign in ((1,) if x.min() >= 0 else (1, -1))})
    where = f"{named(row)}; {row.measure.replace('_', ' ')}"
    return Verdict(
        label,
        "limit",
        float(value),
        bool(ok),
        " and ".join(f"{word} {bound:g}" for word, bound in bounds),
        unit,
        where + ("" if row.measure in ("impulse", "end") else f" at t = {t[place]:.6g} s"),
        curves=[Curve("run", t, x)],
        limits=lines,
    )
