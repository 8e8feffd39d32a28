"""`tiefmu study stability`: measured limits against closed forms, as tables, a chart, a map and a page."""

import csv
import math
from dataclasses import asdict
from pathlib import Path

from .. import figures
from ..errors import UsageError
from . import page, stability_cases, stability_map
from .limits import GROWS, Limit, Value, edge

LIMIT_COLUMNS = ["item", "case", "parameter", "closed", "run", "radius", "stated", "deviation", "status"]
VALUE_COLUMNS = ["item", "case", "parameter", "closed", "measured", "tolerance", "status"]
REACH_COLUMNS = ["mode", "ratio", *(f"step_error_{error:g}" for error in stability_map.CLASSES)]
BRACKET = 0.02  # how far a measured limit may lie from its closed form


def add_parser(studies):
    study = studies.add_parser(
        "stability",
        help="measured against closed-form limits",
        description="Finds where methods, reactions and rules of thumb fail, and compares with "
        "their closed forms. Exit status 1 if one is off.",
        epilog="example: tiefmu study stability --grid 16 --out out/study",
    )
    study.add_argument(
        "--out", metavar="DIR", type=Path, default=Path("out/study"), help="folder to write to (default: out/study)"
    )
    study.add_argument(
        "--grid", metavar="N", type=int, default=32, help="points per axis of the map, 4 to 200 (default: 32)"
    )
    study.set_defaults(command=run)


def run(options) -> int:
    from tqdm import tqdm

    if not 4 <= options.grid <= 200:
        raise UsageError(f"--grid: expected 4 to 200 points, found {options.grid}")
    options.out.mkdir(parents=True, exist_ok=True)
    limits, values, points = stability_cases.limits(), [], []
    limit_table, value_table, reach_table = [], [], []
    total = len(limits) + len(stability_cases.VALUES) + len(stability_map.MODES) * options.grid**2
    total += len(stability_map.MODES) * len(stability_map.REACH)
    interrupted = False
    with tqdm(total=total, delay=2, disable=None, leave=False) as bar:
        try:
            for limit in limits:
                limit_table.append(limit_row(limit))
                bar.update()
            for cases in stability_cases.VALUES:
                values = cases()
                value_table += map(value_row, values)
                bar.update()
            points = stability_map.points(options.grid, bar.update)
            reach_table = stability_map.reaches(bar.update)
        except KeyboardInterrupt:  # the rows finished so far are worth having
            interrupted = True
    write(options.out / "stability_limits.csv", LIMIT_COLUMNS, limit_table)
    write(options.out / "stability_values.csv", VALUE_COLUMNS, value_table)
    if interrupted:
        return 130
    write(options.out / "stability_map.csv", list(asdict(points[0])), [list(asdict(p).values()) for p in points])
    write(options.out / "stability_reach.csv", REACH_COLUMNS, reach_table)
    figures = [draw(limit_table, options.out), stability_map.draw(points, options.out)]
    write_page(options.out / "stability.html", limit_table, value_table, points, reach_table, figures)
    show(limit_table, value_table, points, reach_table)
    print(f"wrote CSVs, charts and stability.html to {options.out}")
    return int(any(row[-1] != "ok" for row in limit_table + value_table))


def limit_row(limit: Limit) -> list:
    """Measured by every way there is; 'ok' where all lie within BRACKET of the closed form."""
    measured = {name: edge(fails, limit.closed) for name, fails in limit.tests().items()}
    ways = [*measured.values()] + ([limit.stated] if limit.stated else [])
    off = max((abs(way / limit.closed - 1) for way in ways), default=math.nan)
    off = math.nan if any(map(math.isnan, ways)) else off
    return [
        limit.item,
        limit.case,
        limit.parameter,
        float(limit.closed),
        measured.get("run", math.nan),
        measured.get("radius", math.nan),
        limit.stated or math.nan,
        off,
        "ok" if off < BRACKET else "off",
    ]


def value_row(value: Value) -> list:
    off = abs(value.measured - value.closed) / (abs(value.closed) or 1)
    return [
        value.item,
        value.case,
        value.parameter,
        float(value.closed),
        value.measured,
        value.tolerance,
        "ok" if off <= value.tolerance else "off",
    ]


def write(path: Path, header: list, rows: list):
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def show(limit_table: list, value_table: list, points: list, reach_table: list):
    """Prints the tables."""
    for item, title in stability_cases.ITEMS.items():
        print(f"\n{item}. {title}")
        for row in limit_table:
            if row[0] == item:
                measured = "  ".join(
                    f"{name} {value:.5g}" for name, value in zip(LIMIT_COLUMNS[4:7], row[4:7]) if not math.isnan(value)
                )
                print(f"  {row[-1]:<4}{row[1]:<56} {row[2]:<24} limit {row[3]:<10.5g} measured: {measured}")
        for row in value_table:
            if row[0] == item:
                print(f"  {row[-1]:<4}{row[1]:<56} {row[2]:<24} closed {row[3]:<9.5g} measured: {row[4]:.5g}")
    both = [p for p in points if p.growth == p.growth]
    print(f"\nmap: {len(points)} points by spectral radius; of {len(both)} also decided by runs {agreeing(both)} agree")
    print("\nLargest H omega for an error of 10 %, by the mass ratio r")
    print(f"  {'mode':<20}" + "".join(f"{ratio:>9g}" for ratio in stability_map.REACH))
    for mode in stability_map.MODES:
        cells = [f"{row[-1]:>9.2g}" if row[-1] else f"{'none':>9}" for row in reach_table if row[0] == mode.name]
        print(f"  {mode.name:<20}" + "".join(cells))


def agreeing(points: list) -> int:
    return sum((p.growth > GROWS) != p.stable for p in points)


def draw(limit_table: list, folder: Path) -> Path:
    """Measured over closed-form limits, writes stability_limits.png and .svg; returns the latter."""
    rows = limit_table[::-1]
    figure, axis = figures.pyplot().subplots(figsize=(10, 1.6 + 0.24 * len(rows)), layout="constrained")
    axis.axvspan(1 - BRACKET, 1 + BRACKET, color="#e8eef2", label="2 % bracket")
    for column, marker, colour in ((4, "o", "#1f5fa8"), (5, "x", "#b3402e"), (6, "|", "#222222")):
        name = {4: "found by runs", 5: "spectral radius of one step", 6: "stated by the program"}[column]
        axis.plot(
            [row[column] / row[3] for row in rows],
            range(len(rows)),
            marker,
            color=colour,
            label=name,
            fillstyle="none",
            markersize=7,
        )
    axis.set_yticks(range(len(rows)), [f"{row[0]}: {row[1]} ({row[2]})" for row in rows], fontsize=8)
    axis.set(xlim=(0.97, 1.03), ylim=(-0.7, len(rows) - 0.3), xlabel="measured limit / closed form  [1]")
    axis.grid(axis="x", alpha=0.3)
    figure.legend(loc="outside upper right", ncol=4, frameon=False)
    figures.save(figure, folder / "stability_limits.png", folder / "stability_limits.svg")
    return folder / "stability_limits.svg"


def write_page(
    path: Path, limit_table: list, value_table: list, points: list, reach_table: list, figures: list[Path]
) -> None:
    both = [p for p in points if p.growth == p.growth]
    page.write(
        path,
        "Where each method fails",
        [
            "Each limit is found by bisection: by the growth of a run and, where the step is a linear map, by its "
            "spectral radius; where the program states the limit itself, that is shown as well."
        ],
        [
            page.Section(
                "Limits",
                ["A limit is right if all the ways to find it end within 2 % of the closed form."],
                [("Measured limits over their closed forms.", figures[0])],
                LIMIT_COLUMNS,
                limit_table,
            ),
            page.Section(
                "Values", ["Rates, drifts and errors that a closed form predicts."], [], VALUE_COLUMNS, value_table
            ),
            page.Section(
                "Map",
                [
                    "Colours come from the eigenvalues of the one-step map: red where one is larger than 1, else the "
                    "error of the worst vibration's complex frequency against the monolithic system. Circles and "
                    f"crosses are runs: of {len(both)}, {agreeing(both)} agree with the eigenvalues.",
                    "'loads' is always stable, and as wrong as its lumping. 'full' ends at r = 1 whatever the step. "
                    "'split' survives every ratio as the step goes to zero; at finite steps the held load lags behind "
                    "the host's springs, which feeds energy in, and the host's damping has to outweigh it: "
                    "H omega < 2 zeta (1 + r)/(r (r + 1/2)). Linear extrapolation and leads, also the one inside "
                    "the FMU, move that limit far up. What stays "
                    "at any ratio is 'full' closed by the tie's derivatives and extrapolated, and an FMU that owns the "
                    "masters.",
                ],
                [("Stability and accuracy over mass ratio and communication step.", figures[1])],
            ),
            page.Section(
                "Steps",
                [
                    "Largest H omega up to which a mode is stable and its error below 0.1, 1 and 10 %; 0: none "
                    "from 1e-5 on; 3: all."
                ],
                [],
                REACH_COLUMNS,
                reach_table,
            ),
        ],
    )
