"""A picture per criterion: signal, corridor or limits, verdict."""

import re
from pathlib import Path

from .. import figures
from .verdict import Verdict

COLOURS = {"run": "#0b5394", "reference": "#444444"}
GOOD, BAD = "#2e7d32", "#b71c1c"


def draw(verdicts: list[Verdict], folder: Path) -> list[Path]:
    """Writes NUMBER-NAME.png to the folder, which is made where it is missing. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, verdict in enumerate(verdicts, 1):
        word = re.sub(r"[^\w.-]+", "_", verdict.name).strip("_") or "criterion"
        paths.append(folder / f"{number:02d}-{word[:60]}.png")
        draw_one(verdict, paths[-1])
    return paths


def draw_one(verdict: Verdict, path: Path) -> None:
    figure, axis = figures.pyplot().subplots(figsize=(8, 4.2), layout="constrained")
    if verdict.corridor is not None:
        time, low, high = verdict.corridor
        axis.fill_between(time, low, high, color=GOOD if verdict.passed else BAD, alpha=0.18, linewidth=0, label="band")
    for curve in verdict.curves:
        style = "--" if curve.label == "reference" else "-"
        axis.plot(curve.time, curve.values, style, color=COLOURS[curve.label], linewidth=1.3, label=curve.label)
    if verdict.bars:
        axis.bar([label for label, _ in verdict.bars], [value for _, value in verdict.bars], color=COLOURS["run"])
        axis.tick_params(axis="x", rotation=60 if len(verdict.bars) > 6 else 0, labelsize="small")
    else:
        axis.set_xlabel("time [s]")
    for k, line in enumerate(verdict.limits):
        axis.axhline(line, color=BAD, linewidth=1, linestyle=":", label="limit" if k == 0 else None)
    axis.set_ylabel(verdict.axis)
    axis.grid(alpha=0.3)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize="small")
    word, colour = ("passed", GOOD) if verdict.passed else ("FAILED", BAD)
    axis.set_title(f"{verdict.name}: {word}, {number(verdict)} ({verdict.asked})", color=colour, fontsize="medium")
    figures.save(figure, path, dpi=110)


def number(verdict: Verdict) -> str:
    return f"{verdict.value:.4g}" + (f" {verdict.unit}" if verdict.unit not in ("", "1") else "")
