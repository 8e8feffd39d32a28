"""`tiefmu study coupling SCENE`: the packaged FMU under FMPy against a host in NumPy, over the communication step."""

import csv
from dataclasses import asdict
from pathlib import Path

from ..arguments import positive
from ..errors import UsageError
from . import page
from .coupling_charts import INTRO, draw, section
from .coupling_runs import WAYS, WINDOW, Row, Study

TIMES = ["cpu"]  # columns that differ from run to run


def add_parser(studies):
    study = studies.add_parser(
        "coupling",
        help="the packaged FMU against a host, over the communication step",
        description="Couples the FMU of a scene with driven masters to a host that carries them, for each reaction "
        "mode and extrapolation, and compares with the monolithic system.",
        epilog="example: tiefmu study coupling scenes/heavy_slave.toml --decades 3",
    )
    study.add_argument("scene", metavar="SCENE", nargs="+", help="scene file (TOML) with driven masters")
    study.add_argument(
        "--out", metavar="DIR", type=Path, default=Path("out/study"), help="folder to write to (default: out/study)"
    )
    study.add_argument(
        "--decades",
        metavar="N",
        type=float,
        default=5.0,
        help="decades of the communication step, down from one radian of the host (default: 5)",
    )
    study.add_argument(
        "--host",
        choices=["sprung", "rigid"],
        default="sprung",
        help="masters on ground springs, or rigid masses without (default: sprung)",
    )
    study.add_argument(
        "--mass-ratio",
        metavar="R",
        type=positive,
        help="scale the masters' masses until the slaves weigh R times as much (default: masses of the scene)",
    )
    study.set_defaults(command=run)


def run(options) -> int:
    from tqdm import tqdm

    if not 0.5 <= options.decades <= 6:
        raise UsageError(f"--decades: expected 0.5 to 6, found {options.decades:g}")
    studies = [Study(path, options.host, options.mass_ratio) for path in options.scene]
    options.out.mkdir(parents=True, exist_ok=True)
    steps, sections, interrupted = ladder(options.decades), [], False
    total = len(studies) * sum(len(way.extrapolations) for way in WAYS) * sum(steps)
    with tqdm(
        total=total,
        delay=2,
        disable=None,
        leave=False,
        bar_format="{percentage:3.0f}% |{bar}| {elapsed}, {remaining} left",
    ) as bar:
        for study in studies:
            rows = []
            try:
                for row in study.rows(steps):
                    rows.append(row)
                    bar.update(row.steps)
            except KeyboardInterrupt:  # the rows finished so far are worth having
                interrupted = True
            name = f"coupling_{study.source.name}"
            write(options.out / f"{name}.csv", rows)
            if rows:
                sections.append(section(study, rows, draw(rows, options.out, name)))
            if interrupted:
                break
    if sections:
        page.write(options.out / "coupling.html", "Coupling to a host", INTRO, sections)
    for one in sections:
        print(f"{one.title}: {one.text[-1]}")
    print(f"wrote CSV, charts and coupling.html to {options.out}")
    return 130 if interrupted else 0


def ladder(decades: float) -> list[int]:
    """Numbers of steps in the window: from H omega = 1 down, two a decade, below three decades one a decade."""
    down = [k / 2 for k in range(int(2 * decades) + 1) if k <= 6 or k % 2 == 0]
    return [round(WINDOW * 10**k) for k in down]


def write(path: Path, rows: list[Row]):
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(Row.__dataclass_fields__), lineterminator="\n")
        table.writeheader()
        table.writerows(map(asdict, rows))
