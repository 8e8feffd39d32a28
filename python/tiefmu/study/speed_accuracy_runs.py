"""The runs of the study of speed against accuracy: every model and method of a scene over a ladder of steps."""

import csv
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import get_type_hints

import numpy as np

from .._core import Diverged, SceneError
from . import reference
from .driven import METHODS as SAMPLINGS
from .driven import DrivenRun, HeavyRun
from .motion import FreeRun, Rows
from .variants import METHODS, Variant, variants

EXACT = 1e-11  # estimated error of the reference
CONVERGED = 1e-9  # of a variant's own solution, from which its model error is read
STIFF = 1e-6  # the same of a penalty tie, whose fast oscillations cost more than they tell
STEPS = 6  # rungs of a ladder, each half the step of the one before
PENALTIES = [1.0, 10.0]
HORIZON = 50  # stability limits that a run lasts at least; without an input to say how long, five times that


@dataclass
class Row:
    """One run. Errors are relative L2 over the whole trajectory against the reference, of slave velocities (v) and of
    the tie's loads on the masters (f); v_end: of the velocities at the end. discretisation: against the same model
    solved exactly; model: of that model solved exactly. method "exact" is that solution itself."""

    scene: str
    formulation: str
    geometry: str
    inertia: str
    freedoms: str
    penalty: float
    reaction: str
    method: str
    step: float
    step_over_limit: float
    error_v: float
    error_f: float
    error_v_end: float
    discretisation_v: float
    discretisation_f: float
    model_v: float
    model_f: float
    cpu_s_per_s: float
    evaluations_per_s: float
    energy_residual: float
    status: str  # ok, diverged, reference


def read(table: Path) -> list[Row]:
    """The rows of a CSV of `study`."""
    kinds = list(get_type_hints(Row).values())
    with open(table, newline="", encoding="utf-8") as file:
        return [Row(*(kind(value) for kind, value in zip(kinds, line))) for line in list(csv.reader(file))[1:]]


class Study(ABC):
    """What both kinds of scenes have in common. `reference_error` is the largest estimate over the formulations."""

    def __init__(self, source, signals, ladder: int):
        self.source, self.signals, self.ladder = source, signals, ladder
        self.variants = variants(source)
        if self.variants[0] != self.variants[0].reference:
            raise SceneError(
                f"{source.file}: model: inertia: the reference needs 'consistent', which this scene cannot have"
            )
        self.reference_error = 0.0
        self.references = {}

    def row(self, variant, **values) -> Row:
        known = {
            "scene": self.source.name,
            "formulation": variant.formulation,
            "geometry": variant.geometry,
            "inertia": variant.inertia,
            "freedoms": variant.freedoms,
            "penalty": variant.penalty,
            "reaction": "full",
            "status": "ok",
        }
        missing = {field.name: np.nan for field in fields(Row) if field.type is float} | {"method": ""}
        return Row(
            **(missing | known | {key: float(x) if isinstance(x, np.floating) else x for key, x in values.items()})
        )

    def rungs(self, variant) -> int:
        """Two fewer for what is not the scene's own formulation in finite geometry, and for penalties."""
        own = (variant.formulation, variant.geometry, variant.penalty) == ("scene", "finite", 0)
        return max(2, self.ladder - (0 if own else 2))

    @abstractmethod
    def exact_run(self, variant: Variant) -> FreeRun | HeavyRun:
        """The run that is solved to rounding."""

    @abstractmethod
    def of_variant(self, variant: Variant) -> Iterator[Row]: ...

    def rows(self) -> Iterator[Row]:
        for variant in self.variants:
            yield from self.of_variant(variant)

    def exact(self, variant):
        """The variant solved to rounding, and its row."""
        run = self.exact_run(variant)
        is_reference = variant == variant.reference
        own, error = reference.solve(run, EXACT if is_reference else STIFF if variant.penalty else CONVERGED)
        if is_reference:
            self.references[variant.formulation] = own
            self.reference_error = max(self.reference_error, error[0])
        model = own.difference(self.references[variant.formulation])
        scene = self.references["scene"]
        # how far the reference of another formulation is from the scene's own
        against = own.difference(scene) if is_reference else model
        return (
            own,
            self.row(
                variant,
                method="exact",
                model_v=against[0],
                model_f=against[1],
                error_v=against[0],
                error_f=against[1],
                error_v_end=against[2],
                discretisation_v=error[0],
                discretisation_f=error[1],
                status="reference" if is_reference else "ok",
            ),
            model,
        )

    def measured(self, variant, run, energy_run, own, model, steps, **values):
        """The row of one run at `steps` steps an interval."""
        values |= {"step": run.interval / steps, "model_v": model[0], "model_f": model[1]}
        try:
            now = energy_run.trajectory(steps)
            errors = now.difference(self.references[variant.formulation])
            if not errors[0] < 10:
                raise Diverged
        except (Diverged, SceneError):  # the second where the mass matrix of a run gone astray has no inverse
            return self.row(variant, **values | {"status": "diverged"})
        cpu, evaluations = run.cost(steps)
        apart = now.difference(own)
        return self.row(
            variant,
            **values,
            error_v=errors[0],
            error_f=errors[1],
            error_v_end=errors[2],
            discretisation_v=apart[0],
            discretisation_f=apart[1],
            cpu_s_per_s=cpu,
            evaluations_per_s=evaluations,
            energy_residual=now.energy_residual,
        )


class FreeStudy(Study):
    """Nodes that the program integrates: integrators over steps."""

    def __init__(self, source, signals, ladder: int):
        super().__init__(source, signals, ladder)
        self.methods = METHODS
        found = source.scene.model.report()["slaves"]
        if found["mass"].all() and not source.any_driven and source.scene.start.get("stable_time_step")[0] < 1e29:
            self.variants += [Variant(penalty=x) for x in PENALTIES]
        self.edges = intervals(source, signals)
        self.runs = sum(1 + len(self.methods) * (self.rungs(variant) + 1) for variant in self.variants)

    def exact_run(self, variant):
        return self.free_run(variant, "rk4")

    def free_run(self, variant, method, energy=False):
        scene = self.source.build(variant, method, energy=energy, heavy=True)
        rows = Rows(scene, *self.looked_at()) if variant.penalty else None
        return FreeRun(scene, self.signals, self.edges, rows)

    def looked_at(self):
        rows = Rows(self.source.scene)
        return rows.master_ids, rows.slave_ids

    def of_variant(self, variant):
        own, row, model = self.exact(variant)
        yield row
        for method in self.methods:
            run, energy = self.free_run(variant, method), self.free_run(variant, method, energy=True)
            for steps in ladder_of(run.interval, run.limit, self.rungs(variant)):
                yield self.measured(
                    variant,
                    run,
                    energy,
                    own,
                    model,
                    steps,
                    method=method,
                    step_over_limit=run.interval / steps / run.limit,
                )


def intervals(source, signals) -> np.ndarray:
    """Edges of the intervals in which inputs are held: as long as twice the largest step of any method, so that every
    method can show a step near its limit and one beyond."""
    limits = [
        source.build(Variant(), method, heavy=True).start.integrator_limit
        for method in ("central-difference", "noh-bathe")
    ]
    if not limits[0] < 1e5:
        raise SceneError(
            f"{source.file}: no free node is held by a spring, so nothing limits the step and there is "
            "no ladder to climb"
        )
    end = max(signals.end, HORIZON * limits[0]) if signals.end else 5 * HORIZON * limits[0]
    return np.linspace(0, end, int(np.ceil(end / (1.96 * limits[1]))) + 1)


def ladder_of(interval: float, limit: float, count: int) -> list[int]:
    """Steps in an interval: just beyond the limit (where one is), then from just below it each twice the last."""
    first = max(1, int(np.ceil(interval / limit * (1 + 1e-6))))
    beyond = [k for k in [int(interval / (1.005 * limit))] if k >= 1]
    return beyond + [first * 2**k for k in range(count)]


class DrivenStudy(Study):
    """Nodes that the host moves: how the host samples its motion, over communication steps."""

    def __init__(self, source, signals, ladder: int):
        super().__init__(source, signals, ladder)
        if not signals.values:
            raise SceneError(
                f"{source.file}: every master is driven and there is no input to drive it; give --input CSV"
            )
        self.methods = SAMPLINGS
        self.runs = sum(
            1 + len(self.reactions(variant)) * len(SAMPLINGS) * self.rungs(variant) for variant in self.variants
        )

    @staticmethod
    def reactions(variant) -> list[str]:
        return ["loads"] if variant.inertia == "lumped" else ["split", "full"]

    def exact_run(self, variant):
        return HeavyRun(self.source.build(variant, "rk4", heavy=True), self.signals)

    def of_variant(self, variant):
        own, row, model = self.exact(variant)
        yield row
        for reaction in self.reactions(variant):
            scene = self.source.build(variant, reaction=reaction)
            for method in self.methods:
                run = DrivenRun(scene, self.signals, reaction, method)
                for k in range(self.rungs(variant)):
                    yield self.measured(variant, run, run, own, model, 2**k, method=method, reaction=reaction)
