"""Speed against accuracy: every method, inertia, geometry and formulation of a scene over a ladder of steps."""

import argparse
import csv
import datetime
import os
import platform
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from .._core import Diverged, SceneError

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


TIMES = ["cpu_s_per_s"]  # columns that differ between two runs of a study


def add_parser(studies):
    parser = studies.add_parser(
        "speed-accuracy",
        help="error against cost for every method and model of a scene",
        description="Runs the scene with every integrator, inertia, formulation and geometry that it allows, and with "
        "penalty ties, over a ladder of steps; writes DIR/speed-accuracy-NAME.csv, .svg and .png, and the page "
        "DIR/speed-accuracy.html of all scenes studied there. Ctrl-C leaves the rows finished so far.",
    )
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help="scene file (TOML)")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, default=Path("out/study"), help="folder to write to (default: out/study)"
    )
    parser.add_argument(
        "--input",
        metavar="CSV",
        type=Path,
        help="inputs over time, as for `tiefmu run` (default: NAME.csv beside NAME.toml, if there)",
    )
    parser.add_argument(
        "--ladder",
        metavar="N",
        type=rungs,
        default=STEPS,
        help=f"steps of a curve, each half the one before (default: {STEPS}; "
        "two fewer for small geometry, the other formulation and penalties)",
    )
    parser.set_defaults(command=command)


def rungs(text: str) -> int:
    if not text.isdigit() or not 2 <= int(text) <= 12:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 2 to 12")
    return int(text)


def command(options):
    from .variants import Source

    sources = [Source(path) for path in options.scenes]  # a bad one shows before the first runs
    options.out.mkdir(parents=True, exist_ok=True)
    for path, source in zip(options.scenes, sources):
        table = options.out / f"speed-accuracy-{source.name}.csv"
        rows, reference_error = study(source, options.input or inputs_beside(path), table, options.ladder)
        print(f"{path}: {len(rows)} runs, reference to {reference_error:.0e}, wrote {table}")
    from .charts import write_page

    write_page(options.out)
    print(f"wrote {options.out / 'speed-accuracy.html'}")


def inputs_beside(scene) -> Path | None:
    path = Path(scene).with_suffix(".csv")
    return path if path.is_file() else None


def machine() -> str:
    """Processor and date, for the files with measured times."""
    name = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, {datetime.date.today().isoformat()}"


def study(source, inputs: Path | None, table: Path, ladder: int = STEPS) -> tuple[list[Row], float]:
    """Runs the study and writes its rows to `table` as they come, machine and date to a text file beside it. Returns
    them and the reference's estimated error. Raises SceneError."""
    from tqdm import tqdm

    from .motion import Signals

    signals = Signals.read(source.scene, inputs)
    plan = (FreeStudy if source.any_free else DrivenStudy)(source, signals, ladder)
    (table.parent / "machine.txt").write_text(machine() + "\n", encoding="utf-8")
    rows = []
    with (
        open(table, "w", newline="", encoding="utf-8") as file,
        tqdm(total=plan.runs, unit="run", delay=1, disable=None, leave=False, desc=source.name) as bar,
    ):
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(Row)])
        for row in plan.rows():
            writer.writerow(astuple(row))
            file.flush()
            rows.append(row)
            bar.update()
    return rows, plan.reference_error


def read(table: Path) -> list[Row]:
    """The rows of a CSV of `study`."""
    with open(table, newline="", encoding="utf-8") as file:
        return [
            Row(*(field.type(value) for field, value in zip(fields(Row), line))) for line in list(csv.reader(file))[1:]
        ]


class Study:
    """What both kinds of scenes have in common. `reference_error` is the largest estimate over the formulations."""

    def __init__(self, source, signals, ladder: int):
        from .variants import variants

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

    def rows(self):
        for variant in self.variants:
            yield from self.of_variant(variant)

    def exact(self, variant):
        """The variant solved to rounding, and its row."""
        from . import reference

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
        from .variants import METHODS, Variant

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
        from .motion import FreeRun, Rows

        scene = self.source.build(variant, method, energy=energy, heavy=True)
        rows = Rows(scene, *self.looked_at()) if variant.penalty else None
        return FreeRun(scene, self.signals, self.edges, rows)

    def looked_at(self):
        from .motion import Rows

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
    from .variants import Variant

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
        from .driven import METHODS

        super().__init__(source, signals, ladder)
        if not signals.values:
            raise SceneError(
                f"{source.file}: every master is driven and there is no input to drive it; give --input CSV"
            )
        self.methods = METHODS
        self.runs = sum(
            1 + len(self.reactions(variant)) * len(METHODS) * self.rungs(variant) for variant in self.variants
        )

    @staticmethod
    def reactions(variant) -> list[str]:
        return ["loads"] if variant.inertia == "lumped" else ["split", "full"]

    def exact_run(self, variant):
        from .driven import HeavyRun

        return HeavyRun(self.source.build(variant, "rk4", heavy=True), self.signals)

    def of_variant(self, variant):
        from .driven import DrivenRun

        own, row, model = self.exact(variant)
        yield row
        for reaction in self.reactions(variant):
            scene = self.source.build(variant, reaction=reaction)
            for method in self.methods:
                run = DrivenRun(scene, self.signals, reaction, method)
                for k in range(self.rungs(variant)):
                    yield self.measured(variant, run, run, own, model, 2**k, method=method, reaction=reaction)
