"""Charts and page of the speed-accuracy study, drawn from its CSVs."""

from pathlib import Path

import numpy as np

from .. import figures
from . import page
from .speed_accuracy_runs import Row, read

# Colours that colour-blind readers tell apart (Okabe and Ito).
COLOURS = {
    "central-difference": "#0072B2",
    "symplectic-euler": "#E69F00",
    "noh-bathe": "#009E73",
    "rk4": "#D55E00",
    "held input": "#0072B2",
    "midpoint input": "#D55E00",
}
MARKERS = {
    "central-difference": "o",
    "symplectic-euler": "s",
    "noh-bathe": "^",
    "rk4": "D",
    "held input": "o",
    "midpoint input": "D",
}
# Curves that often lie on one another keep visible: the lower one is drawn broader.
SIZES = dict.fromkeys(MARKERS, 4.5) | {"symplectic-euler": 7.5, "central-difference": 4}
LINES = {"consistent": "-", "lumped": "--"}
HOW_TO_READ = [
    "Each point is one run. Down is more accurate, left is cheaper: of two curves the lower left one is the better "
    "method. Errors are relative L2 norms over the whole run, against a reference with consistent inertia that is "
    "exact to rounding: of the slaves' velocities, and of the load that the tie puts on its masters.",
    "A curve that turns flat has reached the error of its model - lumped inertia, frozen geometry, a spring in place "
    "of the tie - which no step cures. The discretisation error, against the same model solved exactly, goes on "
    "falling with the order of the method.",
    "Crosses stand where a step just beyond the stability limit diverged; they have no error and no cost. Inputs are "
    "constant over the same intervals in every run, so that sampling the input is no part of the error.",
]


def name_of(row: Row) -> str:
    """The model of a row, as legends call it."""
    if row.penalty:
        return f"penalty, {row.penalty:g} omega"
    text = row.inertia + (", small geometry" if row.geometry == "small" else "")
    return text + (", no rotations" if row.freedoms != "all" else "")


def curves(rows: list[Row]) -> dict:
    """{(model, method, reaction): its rows that did not diverge, by step}"""
    result = {}
    for row in rows:
        if row.status == "ok" and row.method != "exact":
            result.setdefault((name_of(row), row.method, row.reaction), []).append(row)
    return {key: sorted(value, key=lambda row: row.step) for key, value in result.items()}


def panel(axis, rows: list[Row], x: str, y: str):
    """One work-precision diagram; y: a column of errors."""
    for (_, method, reaction), points in curves(rows).items():
        if reaction == "full" and method in ("held input", "midpoint input"):
            continue  # the same load as "split", by definition
        penalty, lumped = points[0].penalty, points[0].inertia == "lumped"
        style = ":" if penalty else LINES[points[0].inertia]
        axis.plot(
            [getattr(row, x) for row in points],
            [max(getattr(row, y), 1e-16) for row in points],
            style,
            color=COLOURS[method],
            marker=MARKERS[method],
            markersize=SIZES[method] - (1.5 if penalty == 1 else 0),
            markerfacecolor="white" if lumped or penalty else COLOURS[method],
            linewidth=1.0 if penalty else SIZES[method] / 3,
            alpha=0.6 if penalty else 1.0,
            zorder=2 + 1 / SIZES[method],
        )
    axis.set(xscale="log", yscale="log")
    if axis.get_ylim()[1] < 1e-12:
        axis.set_ylim(1e-16, 1)
        axis.text(0.5, 0.5, "exact to rounding", transform=axis.transAxes, ha="center", color="#555")
    decades(axis.xaxis)
    axis.grid(alpha=0.25, which="major")


def decades(axis):
    """Labels at whole decades where there are two of them, else also at 2 and 5, so that labels never collide."""
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter

    low, high = sorted(axis.get_view_interval())
    few = high < 60 * low
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axis.set_major_formatter(LogFormatterSciNotation(labelOnlyBase=False, minor_thresholds=(np.inf, np.inf)))
    axis.set_minor_formatter(NullFormatter())


def crosses(axis, rows: list[Row]):
    """Where runs beyond the limit diverged, at the upper edge of a chart over step / limit."""
    for row in rows:
        if row.status == "diverged":
            axis.plot(
                row.step_over_limit,
                0.97,
                "x",
                transform=axis.get_xaxis_transform(),
                color=COLOURS[row.method],
                markersize=7,
                markeredgewidth=1.6,
                clip_on=False,
            )


def legend(figure, rows: list[Row]):
    from matplotlib.lines import Line2D

    methods = list(dict.fromkeys(row.method for row in rows if row.method in COLOURS))
    entries = [Line2D([], [], color=COLOURS[m], marker=MARKERS[m], markersize=5, label=m) for m in methods]
    entries += [
        Line2D(
            [],
            [],
            color="#444",
            linestyle=LINES[i],
            marker="o",
            markersize=5,
            markerfacecolor="white" if i == "lumped" else "#444",
            label=f"{i} inertia",
        )
        for i in LINES
        if any(row.inertia == i for row in rows)
    ]
    if any(row.penalty for row in rows):
        entries.append(
            Line2D(
                [],
                [],
                color="#444",
                linestyle=":",
                marker="o",
                markersize=5,
                markerfacecolor="white",
                alpha=0.6,
                label="penalty tie",
            )
        )
    if any(row.status == "diverged" for row in rows):
        entries.append(Line2D([], [], color="#444", linestyle="", marker="x", markersize=7, label="diverged"))
    figure.legend(handles=entries, loc="outside lower center", ncols=min(len(entries), 8), frameon=False, fontsize=9)


V, F = "error of slave velocities [-]", "error of loads on masters [-]"
LABELS = {"error_v": V, "error_f": F}
CPU, EVALUATIONS = "CPU time per simulated second [s/s]", "force evaluations per simulated second [1/s]"


def main_figure(rows: list[Row]):
    """The scene's own formulation in finite geometry: four panels."""
    own = [row for row in rows if (row.formulation, row.geometry, row.freedoms) == ("scene", "finite", "all")]
    driven = any(row.method == "held input" for row in own)
    figure, axes = figures.pyplot().subplots(2, 2, figsize=(11, 8.4), layout="constrained")
    evaluations = "communication steps per simulated second [1/s]" if driven else EVALUATIONS
    over = "step" if driven else "step_over_limit"
    first, second = ("error_f", "error_v") if driven else ("error_v", "error_f")  # given motions are hardly wrong
    for axis, x, y, xlabel, ylabel in [
        (axes[0, 0], "cpu_s_per_s", first, CPU, LABELS[first]),
        (axes[0, 1], "evaluations_per_s", first, evaluations, LABELS[first]),
        (axes[1, 0], "evaluations_per_s", second, evaluations, LABELS[second]),
        (
            axes[1, 1],
            over,
            "discretisation_f" if driven else "discretisation_v",
            "communication step [s]" if driven else "step / stability limit of the method [-]",
            "discretisation error alone, " + ("loads [-]" if driven else "velocities [-]"),
        ),
    ]:
        panel(axis, own, x, y)
        axis.set(xlabel=xlabel, ylabel=ylabel)
    if not driven:
        crosses(axes[1, 1], own)
    for axis in axes.flat[:3]:  # lumping: the level that no step goes below
        column = {"error_v": "model_v", "error_f": "model_f"}[second if axis is axes[1, 0] else first]
        level = next((getattr(row, column) for row in own if row.inertia == "lumped"), 0.0)
        if level > 1e-13:
            axis.axhline(level, color="#888", linewidth=0.8, zorder=0)
            axis.annotate(
                "lumping, at any step",
                (0.99, level),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                fontsize=8,
                color="#555",
            )
    legend(figure, own)
    return figure


def formulations_figure(rows: list[Row]):
    """Everything else: one panel per formulation and geometry, velocities over evaluations. None where there is
    nothing else."""
    kinds = list(dict.fromkeys((row.formulation, row.geometry) for row in rows))
    if len(kinds) < 2:
        return None
    columns = 2
    lines = (len(kinds) + 1) // columns
    figure, axes = figures.pyplot().subplots(
        lines, columns, figsize=(11, 0.8 + 3.3 * lines), layout="constrained", sharex=True, sharey=True, squeeze=False
    )
    driven = any(row.method == "held input" for row in rows)
    for axis, (formulation, geometry) in zip(axes.flat, kinds):
        panel(
            axis,
            [row for row in rows if (row.formulation, row.geometry) == (formulation, geometry) and not row.penalty],
            "evaluations_per_s",
            "error_f" if driven else "error_v",
        )
        title = "as in the scene" if formulation == "scene" else formulation
        axis.set_title(f"formulation: {title}; geometry: {geometry}", fontsize=10)
    for axis in axes.flat[len(kinds) :]:
        axis.set_axis_off()
    for axis in axes[-1]:
        axis.set_xlabel("communication steps per simulated second [1/s]" if driven else EVALUATIONS)
    for axis in axes[:, 0]:
        axis.set_ylabel(F if driven else V)
    legend(figure, [row for row in rows if not row.penalty])
    return figure


def model_figure(rows: list[Row]):
    """What each simplification costs at any step: bars of the model error."""
    bars = [
        (("" if row.formulation == "scene" else f"{row.formulation}: ") + name_of(row), row.model_v, row.model_f)
        for row in rows
        if row.method == "exact" and row.status == "ok"
    ]
    if not bars:
        return None
    figure, axis = figures.pyplot().subplots(figsize=(11, 1.2 + 0.42 * len(bars)), layout="constrained")
    for k, (_, v, f) in enumerate(bars):
        axis.barh(k + 0.18, max(v, 1e-12), 0.34, color="#0072B2", label="slave velocities" if k == 0 else None)
        axis.barh(k - 0.18, max(f, 1e-12), 0.34, color="#E69F00", label="loads on masters" if k == 0 else None)
    axis.set_yticks(range(len(bars)), [name for name, _, _ in bars])
    axis.set(
        xscale="log",
        xlabel="model error [-], against consistent inertia and finite geometry of the same formulation",
        xlim=(1e-12, 10 * max(1.0, *(max(v, f) for _, v, f in bars))),
    )
    axis.invert_yaxis()
    axis.grid(alpha=0.25, axis="x")
    figure.legend(fontsize=9, loc="outside lower center", ncols=2, frameon=False)
    return figure


FIGURES = [
    ("", main_figure, "Error against cost, own formulation, finite geometry."),
    (
        "-models",
        model_figure,
        "Model errors: what each simplification costs, whatever the step. 1e-12 stands for rounding and less.",
    ),
    ("-formulations", formulations_figure, "Every formulation and geometry, each against its own reference."),
]


def draw(table: Path) -> list[tuple[str, Path]]:
    """Draws the charts of a CSV beside it, as SVG and PNG; (caption, SVG) of each."""
    figures.pyplot().rcParams.update(
        {"svg.fonttype": "none", "font.size": 10, "axes.spines.top": False, "axes.spines.right": False}
    )
    rows, result = read(table), []
    for suffix, function, caption in FIGURES:
        figure = function(rows)
        if figure is None:
            continue
        figure.suptitle(f"{rows[0].scene}: {caption.split(':')[0].rstrip('.').lower()}")
        path = table.with_name(f"{table.stem}{suffix}.svg")
        figures.save(figure, path, path.with_suffix(".png"), dpi=90)
        result.append((caption, path))
    return result


COLUMNS = [
    "formulation",
    "geometry",
    "inertia",
    "freedoms",
    "penalty",
    "reaction",
    "method",
    "step",
    "step_over_limit",
    "error_v",
    "error_f",
    "error_v_end",
    "discretisation_v",
    "discretisation_f",
    "cpu_s_per_s",
    "evaluations_per_s",
    "energy_residual",
    "status",
]


def best(rows: list[Row]) -> list[str]:
    """One sentence a decade of accuracy: the cheapest run that reaches it."""
    ties = [
        row
        for row in rows
        if row.status == "ok"
        and row.method != "exact"
        and not row.penalty
        and (row.formulation, row.freedoms) == ("scene", "all")
    ]
    driven = any(row.method == "held input" for row in ties)
    result = []
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-6):
        good = [row for row in ties if max(row.error_v, row.error_f if driven else 0.0) <= tolerance]
        if not good:
            result.append(f"{tolerance:.0e}: no run reaches it.")
            continue
        row = min(good, key=lambda row: row.evaluations_per_s)
        limit = "" if driven else f" ({row.step_over_limit:.2f} of its limit)"
        result.append(
            f"{tolerance:.0e}: {row.method}, {name_of(row)}, step {row.step:.3g} s{limit}: "
            f"{row.evaluations_per_s:.3g} evaluations and {row.cpu_s_per_s:.2g} s CPU per simulated second."
        )
    return result


def write_page(folder: Path):
    """Draws every speed-accuracy CSV of the folder and writes the page of them all."""
    sections = []
    for table in sorted(folder.glob("speed-accuracy-*.csv")):
        figures, rows = draw(table), read(table)
        if rows:
            sections.append(
                page.Section(
                    rows[0].scene,
                    ["Least evaluations for an error of at most - " + " ".join(best(rows))],
                    figures,
                    COLUMNS,
                    [[getattr(row, name) for name in COLUMNS] for row in rows],
                )
            )
    note = folder / "machine.txt"
    measured = [f"Measured on: {note.read_text(encoding='utf-8').strip()}."] if note.is_file() else []
    page.write(folder / "speed-accuracy.html", "Speed against accuracy", HOW_TO_READ + measured, sections)
