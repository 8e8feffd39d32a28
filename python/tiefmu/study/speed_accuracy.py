"""Speed against accuracy: every method, inertia, geometry and formulation of a scene over a ladder of steps."""

import argparse
import csv
import datetime
import os
import platform
from dataclasses import astuple, fields
from pathlib import Path

from ..signals import inputs_beside
from .motion import Signals
from .speed_accuracy_charts import write_page
from .speed_accuracy_runs import STEPS, DrivenStudy, FreeStudy, Row
from .variants import Source

TIMES = ["cpu_s_per_s"]  # columns that differ between two runs of a study


def add_parser(studies):
    parser = studies.add_parser(
        "speed-accuracy",
        help="error against cost for every method and model of a scene",
        description="Runs the scene with every integrator, inertia, formulation and geometry that it allows, and with "
        "penalty ties, over a ladder of steps; writes DIR/speed-accuracy-NAME.csv, .svg and .png, and the page "
        "DIR/speed-accuracy.html of all scenes studied there. Ctrl-C leaves the rows finished so far.",
        epilog="example: tiefmu study speed-accuracy scenes/rivet.toml --ladder 4 --out out/study",
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
    sources = [Source(path) for path in options.scenes]  # a bad one shows before the first runs
    options.out.mkdir(parents=True, exist_ok=True)
    for path, source in zip(options.scenes, sources):
        table = options.out / f"speed-accuracy-{source.name}.csv"
        rows, reference_error = study(source, options.input or inputs_beside(path), table, options.ladder)
        print(f"{path}: {len(rows)} runs, reference to {reference_error:.0e}, wrote {table}")
    write_page(options.out)
    print(f"wrote {options.out / 'speed-accuracy.html'}")


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

    signals = Signals.read(source.own, inputs)
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
