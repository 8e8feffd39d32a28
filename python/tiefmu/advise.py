"""What a scene needs and no more: the cheapest model, method and step whose error stays under a tolerance, measured."""

import os
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .arguments import check_folder_of, positive
from .errors import Diverged, SceneError, UsageError
from .scene_file import toml_text
from .signals import inputs_beside
from .study import host_modes, reference
from .study.driven import METHODS as SAMPLINGS
from .study.driven import SAMPLES, DrivenRun, HeavyRun
from .study.motion import FreeRun, Signals
from .study.speed_accuracy_runs import intervals
from .study.stability_map import BY_NAME
from .study.variants import METHODS, Source, Variant, compiles

SAFETY = 0.9  # of the stability limit: no step above it is advised
HALVINGS = 12  # of the first step, before a method is given up
ALIKE = 1.1  # costs closer than this factor count as equal; then the simpler choice wins


def add_parser(commands):
    parser = commands.add_parser(
        "advise",
        help="say what a scene needs and no more",
        description="Measures error and cost of every model and method that the scene allows, and names the cheapest "
        "whose error stays under the tolerance: relative L2 over the whole run, of the slaves' velocities; of the "
        "reactions too where every master is driven. With --host-step also: which way of coupling is stable and right "
        "for a host with the masses of the scene.",
        epilog="example: tiefmu advise weld.toml --tolerance 1e-3 --host-step 1e-6 --host-stiffness 3e7",
    )
    parser.add_argument("scene", metavar="SCENE", help="scene file (TOML) or deck")
    parser.add_argument("--tolerance", metavar="E", type=positive, default=1e-3, help="relative error (default: 1e-3)")
    parser.add_argument(
        "--input",
        metavar="CSV",
        type=Path,
        help="inputs over time, as for `tiefmu run` (default: NAME.csv beside NAME.toml, if there)",
    )
    parser.add_argument(
        "--host-step", metavar="H", type=positive, help="communication step of the host that moves the masters, s"
    )
    parser.add_argument(
        "--host-stiffness",
        metavar="K",
        type=positive,
        help="of a master on what holds it in the host, N/m (default: stiffness of the scene's nodes)",
    )
    parser.add_argument("--write", metavar="NEW", type=Path, help="write the scene as advised")
    parser.set_defaults(command=command)


def command(options):
    if options.write:
        check_folder_of(options.write)
    if options.host_stiffness and not options.host_step:
        raise UsageError("--host-stiffness: needs --host-step, the step of that host")
    source = Source(options.scene)
    if options.write and source.imported:
        raise UsageError(f"{options.write}: a deck is no scene to change; import it first: tiefmu import {source.file}")
    host = options.host_step and host_modes.judge(source, options.host_step, options.host_stiffness, options.tolerance)
    inputs = options.input or inputs_beside(options.scene)
    if host and not inputs and not source.any_free and not options.write:
        print(
            "\n".join(
                [f"{source.file}: no input, so models and steps are not measured", *host.lines(options.tolerance)]
            )
        )
        return
    advice = advise(source, inputs, options.tolerance)
    advice.host = host
    print("\n".join(advice.lines(source)))
    if options.write:
        options.write.write_text(written(source, advice, options), encoding="utf-8")
        print(f"wrote {options.write}")


@dataclass
class Choice:
    """One model, method and step with what was measured. step: s, of the integrator, or of the communication where
    nothing is integrated."""

    variant: Variant
    method: str
    reaction: str
    step: float
    error_v: float
    error_f: float
    cost: float  # s of CPU time per simulated second
    coarser: tuple[float, float]  # next larger step that was tried, and its error (inf: unstable); nan: none

    @property
    def error(self) -> float:
        """Of the velocities, and of the loads where motions are given."""
        return max(self.error_v, self.error_f) if self.driven else self.error_v

    @property
    def driven(self) -> bool:
        return self.method.endswith("input")


@dataclass
class Advice:
    tolerance: float
    choice: Choice
    others: list[Choice]  # what else stays under the tolerance, cheapest first
    models: list[tuple[Variant, float]]  # (variant, model error) of every model, cheapest first
    mass_ratio: float  # r of the driven masters, nan: none
    limit: float  # stability limit of the chosen method, s
    host: host_modes.Verdict | None = None

    def lines(self, source) -> list[str]:
        c = self.choice
        errors = dict(self.models)

        def instead(variant):
            return f"{error_text(errors[variant])} at any step" if variant in errors else "which this scene cannot have"

        lines = [
            f"{source.file}: error {error_text(c.error)} of {error_text(self.tolerance)} allowed, "
            f"{c.cost:.3g} s CPU per simulated second"
        ]
        dropped = replace(c.variant, freedoms="translations")
        if c.variant.freedoms != "all":
            lines.append(f"freedoms: translations only; model error {error_text(errors[c.variant])}")
        elif len(source.scene.rotations):
            without = (
                f"the error is {instead(dropped)}"
                if dropped in errors
                else "the springs and slaves that need them have no model"
            )
            lines.append(f"freedoms: all; without the rotations of the masters {without}")
        else:
            lines.append("freedoms: all (translations only; there are no rotations to leave out)")
        for key, cheap, costly, cheaper in (
            ("inertia", "lumped", "consistent", replace(c.variant, inertia="lumped")),
            ("geometry", "small", "finite", replace(c.variant, geometry="small")),
        ):
            if cheaper == c.variant:
                lines.append(f"{key}: {cheap}; error of this model {error_text(errors[c.variant])} at any step")
            else:
                lines.append(f"{key}: {costly}; {cheap} would cost {instead(cheaper)}")
        if c.driven:
            lines.append(
                f"integrator: none, every master is driven; communication step {c.step:.4g} s with the "
                f"velocity of the {'start' if c.method == 'held input' else 'middle'} of the step held in it"
            )
        else:
            lines.append(f"integrator: {c.method}, step {c.step:.4g} s, {c.step / self.limit:.2f} of its limit")
        if not np.isnan(c.coarser[0]):
            lines.append(f"  next larger step tried: {c.coarser[0]:.4g} s, error {error_text(c.coarser[1])}")
        lines += [
            f"  instead: {describe(other)}: error {error_text(other.error)}, {other.cost / c.cost:.2f} times the "
            "CPU time"
            for other in self.others[:4]
        ]
        if self.host:
            lines += self.host.lines(self.tolerance)
        elif not np.isnan(self.mass_ratio):
            lines.append(self.reaction_line(c))
        return lines

    def reaction_line(self, c: Choice) -> str:
        r = self.mass_ratio
        ratio = "without bound (a driven master has no mass)" if np.isinf(r) else f"{r:.3g}"
        full = (
            f"full is refused: the tied mass over the host's is r = {ratio}, and a host that uses the last known "
            "force diverges at r >= 1 for every step"
            if not r < 1
            else f"full would be stable for a held force (r = {ratio} < 1), but not at r >= 1/2 with BDF2 velocities"
        )
        stable = (
            "for any host" if c.reaction == "loads" else "for a host without springs; --host-step says for which others"
        )
        return f"reaction: {c.reaction}, stable {stable}; {full}"


def describe(c: Choice) -> str:
    what = f"{c.variant.name}, {c.method}, step {c.step:.4g} s"
    return f"{what}, {c.reaction}" if c.driven else what


def error_text(error: float) -> str:
    return "unbounded (unstable)" if not np.isfinite(error) else f"{error:.2g}" if error >= 1e-13 else "none"


def advise(source, inputs: Path | None, tolerance: float) -> Advice:
    """Raises SceneError, and UsageError where nothing reaches the tolerance."""
    signals = Signals.read(source.own, inputs)
    ratio = host_modes.ratios(source).full if source.any_driven else np.nan
    search = (FreeSearch if source.any_free else DrivenSearch)(source, signals, tolerance, ratio)
    good, tried = [], []
    for variant, error in search.models:
        if error > tolerance:
            continue
        for method, reaction in search.methods(variant):
            choice = search.largest_step(variant, method, reaction)
            tried.append(choice)
            if choice.error <= tolerance:
                good.append(choice)
    if not good:
        least = min([choice.error for choice in tried] + [error for _, error in search.models if error > tolerance])
        raise UsageError(
            f"{source.file}: tolerance {tolerance:g} is out of reach; the least error found is {least:.2g}"
        )
    good.sort(key=lambda choice: choice.cost)
    # among the cheapest the simplest, in the order they were tried
    best = next(choice for choice in tried if choice in good and choice.cost <= ALIKE * good[0].cost)
    return Advice(
        tolerance, best, [choice for choice in good if choice is not best], search.models, ratio, search.limit(best)
    )


class Search(ABC):
    """models: (variant, model error), the cheapest first."""

    def __init__(self, source, signals, tolerance: float, ratio: float):
        self.source, self.signals, self.tolerance, self.ratio = source, signals, tolerance, ratio
        self.prepare()
        small = max(1e-11, 1e-4 * tolerance)
        self.reference, error = reference.solve(self.exact_run(Variant()), small)
        if error[0] > 0.1 * tolerance:
            raise UsageError(
                f"{source.file}: tolerance {tolerance:g} is out of reach; the reference itself is "
                f"only good to {error[0]:.2g}"
            )
        self.models = []
        rotations = ["translations", "all"] if len(source.scene.rotations) else ["all"]
        for variant in [
            Variant(inertia, geometry, freedoms=freedoms)
            for freedoms in rotations
            for geometry in ("small", "finite")
            for inertia in ("lumped", "consistent")
        ]:
            if compiles(source, variant):
                own = reference.solve(self.exact_run(variant), max(1e-10, 1e-2 * tolerance))[0]
                v, f, _ = own.difference(self.reference)
                self.models.append((variant, max(v, f) if not source.any_free else v))

    intervals: int  # of a run

    @abstractmethod
    def prepare(self) -> None: ...

    @abstractmethod
    def exact_run(self, variant: Variant) -> FreeRun | HeavyRun:
        """The run that is solved to rounding."""

    @abstractmethod
    def methods(self, variant: Variant) -> list[tuple[str, str]]:
        """(method, reaction) of what is tried."""

    @abstractmethod
    def largest_step(self, variant: Variant, method: str, reaction: str) -> Choice: ...

    @abstractmethod
    def total(self, errors: tuple[float, float]) -> float:
        """What the tolerance is for, of the errors of velocities and loads."""

    def limit(self, choice: Choice) -> float:
        return np.inf

    def refined(self, run, first: int, make) -> Choice:
        """The fewest steps an interval, from `first` on, whose error is within the tolerance: doubled until it is,
        then bisected."""
        bad, bad_error, steps = 0, np.nan, first
        for _ in range(HALVINGS):
            errors = self.errors(run, steps)
            if self.total(errors) <= self.tolerance or steps * self.intervals > 1e6:
                break
            bad, bad_error, steps = steps, self.total(errors), 2 * steps
        good, good_errors = steps, errors
        while bad and good - bad > max(1, good // 8) and self.total(good_errors) <= self.tolerance:
            middle = (good + bad) // 2
            errors = self.errors(run, middle)
            if self.total(errors) <= self.tolerance:
                good, good_errors = middle, errors
            else:
                bad, bad_error = middle, self.total(errors)
        passed = self.total(good_errors) <= self.tolerance
        return make(
            step=run.interval / good,
            error_v=good_errors[0],
            error_f=good_errors[1],
            cost=run.cost(good)[0] if passed else np.inf,
            coarser=(run.interval / bad, bad_error) if bad else (np.nan, np.nan),
        )

    def errors(self, run, steps: int) -> tuple[float, float]:
        try:
            return run.trajectory(steps).difference(self.reference)[:2]
        except (Diverged, SceneError):
            return np.inf, np.inf


class FreeSearch(Search):
    def prepare(self):
        self.edges = intervals(self.source, self.signals)
        self.intervals = len(self.edges) - 1

    def run(self, variant, method):
        return FreeRun(self.source.build(variant, method, heavy=True), self.signals, self.edges)

    def exact_run(self, variant):
        return self.run(variant, "rk4")

    def methods(self, variant):
        reaction = "full" if np.isnan(self.ratio) else "loads" if variant.inertia == "lumped" else "split"
        return [(method, reaction) for method in METHODS]

    def total(self, errors) -> float:
        return errors[0]

    def limit(self, choice: Choice) -> float:
        return self.run(choice.variant, choice.method).limit

    def largest_step(self, variant, method, reaction) -> Choice:
        run = self.run(variant, method)
        first = max(1, int(np.ceil(run.interval / (SAFETY * run.limit))))
        return self.refined(run, first, lambda **found: Choice(variant, method, reaction, **found))


class DrivenSearch(Search):
    def prepare(self):
        if not self.signals.values:
            raise SceneError(
                f"{self.source.file}: every master is driven and there is no input to drive it; give --input CSV"
            )
        self.intervals = SAMPLES

    def exact_run(self, variant):
        return HeavyRun(self.source.build(variant, "rk4", heavy=True), self.signals)

    def methods(self, variant):
        reactions = ["loads"] if variant.inertia == "lumped" else ["split"]
        return [(method, reaction) for reaction in reactions for method in SAMPLINGS]

    def total(self, errors) -> float:
        return max(errors)

    def largest_step(self, variant, method, reaction) -> Choice:
        run = DrivenRun(self.source.build(variant, reaction=reaction), self.signals, reaction, method)
        return self.refined(run, 1, lambda **found: Choice(variant, method, reaction, **found))


def written(source, advice: Advice, options) -> str:
    """The scene file with what was advised in place of what it had."""
    c = advice.choice
    tables = source.changed(c.variant)
    raw = tables.model_dump(exclude_unset=True, exclude_none=True)
    raw.setdefault("model", {}).update(inertia=c.variant.inertia, geometry=c.variant.geometry)
    if source.any_driven:
        raw["model"].pop("reaction_lead", None)
        raw["model"]["reaction"] = c.reaction
        mode = BY_NAME[advice.host.chosen.mode] if advice.host and advice.host.chosen else None
        if mode and mode.reaction:
            raw["model"].update(reaction=mode.reaction, inertia="lumped" if mode.reaction == "loads" else "consistent")
            if mode.reaction_lead:
                raw["model"]["reaction_lead"] = mode.reaction_lead
    if not c.driven:
        per = source.units.si("time_step", 1.0)
        raw.setdefault("integrator", {}).update(method=c.method, time_step=float(c.step / per), safety=SAFETY)
    for key in {"file", "properties"} & raw["mesh"].keys():
        path = (source.folder / raw["mesh"][key]).resolve()
        raw["mesh"][key] = Path(os.path.relpath(path, options.write.resolve().parent)).as_posix()
    head = f"# {Path(options.scene).name} as advised for an error of {options.tolerance:g}"
    return "\n".join([head, *(f"# {line}" for line in advice.lines(source)[1:]), toml_text(raw)])
