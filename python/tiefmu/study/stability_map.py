"""The map of (mass ratio, H omega): unstable, or how accurate, for each reaction mode."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import figures
from .limits import GROWS, coupled, plate

ZETA = 0.02  # of the host's masters on their springs
MODES = [("loads", 0), ("full", 0), ("split", 0), ("split", 1)]  # reaction, order of the extrapolation
CLASSES = [1e-3, 1e-2, 1e-1]  # upper ends of the classes of error; beyond the last one, and unstable
MAX_STEPS = 12000  # of a run
EVERY = 4  # how many grid lines lie between the points that are also decided by a run


@dataclass
class Point:
    reaction: str
    order: int
    ratio: float  # slave mass / mass of the four masters
    step: float  # H omega, omega of a master alone on its spring
    radius: float  # of the one-step map
    growth: float  # a step, measured by a run; NaN where none was made
    error: float  # of the worst mode's complex frequency, relative

    @property
    def stable(self) -> bool:
        return self.radius <= GROWS


def point(reaction: str, order: int, ratio: float, step: float, run: bool) -> Point:
    """A slave in the middle of four masters, each on a ground spring with omega = 1 rad/s."""
    scene = plate(4 * ratio, reaction)
    coupling = coupled(scene, reaction, step, order, omega=1.0, zeta=ZETA)
    units = np.repeat(coupling.units(), len(coupling.host.mass))
    roots = np.linalg.eigvals(coupling.matrix() * units[:, None] / units)
    found = np.log(roots[np.abs(roots) > 1e-12].astype(complex)) / step
    # Modes that move the slave (three, alike) and those that do not: (1 + tied) x'' + 2 zeta x' + x = 0
    error = 0.0
    for tied in (0.0, ratio):
        exact = (-ZETA + 1j * np.sqrt(1 + tied - ZETA**2)) / (1 + tied)
        error = max(error, float(np.abs(found - exact).min() / abs(exact)))
    growth = grown(coupling, 2 * np.pi * np.sqrt(1 + ratio) / step) if run else float("nan")
    return Point(reaction, order, ratio, step, float(np.abs(roots).max()), growth, error)


def grown(coupling, period: float) -> float:
    """Growth per step over 24 of the slowest periods (each so many steps); NaN where those are too many steps and
    the run has not made itself plain before."""
    wanted = int(np.ceil(24 * period))
    steps = min(wanted, MAX_STEPS)
    growth = coupling.growth(steps)
    return growth if steps == wanted or growth ** (steps / 2) > 1e3 else float("nan")


def axes(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.logspace(-2, 3, count), np.logspace(-3, np.log10(3), count)


def points(count: int, progress=lambda: None) -> list[Point]:
    ratios, steps = axes(count)
    found = []
    for reaction, order in MODES:
        for i, ratio in enumerate(ratios):
            for j, step in enumerate(steps):
                run = i % EVERY == EVERY // 2 and j % EVERY == EVERY // 2
                found.append(point(reaction, order, float(ratio), float(step), run))
                progress()
    return found


def split_limit(ratio: np.ndarray) -> np.ndarray:
    """H omega up to which the host's damping outweighs what the held load feeds in; for small H omega."""
    return 2 * ZETA * (1 + ratio) / (ratio * (ratio + 0.5))


def draw(found: list[Point], folder: Path) -> Path:
    """Writes stability_map.png and .svg; returns the latter."""
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colours = ["#1a6b54", "#5fb08c", "#c9dfae", "#f2d98b", "#b3402e"]
    labels = ["error < 0.1 %", "< 1 %", "< 10 %", "stable, error > 10 %", "unstable"]
    titles = {
        ("loads", 0): "loads (lumped, the host carries M + D)",
        ("full", 0): "full, force held",
        ("split", 0): "split, force held",
        ("split", 1): "split, force extrapolated linearly",
    }
    figure, panels = figures.pyplot().subplots(2, 2, figsize=(10, 8.2), sharex=True, sharey=True, layout="constrained")
    for axis, (reaction, order) in zip(panels.flat, MODES):
        own = [p for p in found if (p.reaction, p.order) == (reaction, order)]
        ratios, steps = sorted({p.ratio for p in own}), sorted({p.step for p in own})
        level = np.array([len(CLASSES) + 1 if not p.stable else np.searchsorted(CLASSES, p.error) for p in own])
        axis.pcolormesh(
            ratios,
            steps,
            level.reshape(len(ratios), len(steps)).T,
            cmap=ListedColormap(colours),
            vmin=-0.5,
            vmax=4.5,
            shading="nearest",
            rasterized=True,
        )
        for p in own:
            if p.growth == p.growth:
                axis.plot(
                    p.ratio,
                    p.step,
                    "x" if p.growth > GROWS else "o",
                    color="black",
                    markersize=4,
                    fillstyle="none",
                    markeredgewidth=0.9,
                )
        if reaction == "full":
            axis.axvline(1.0, color="black", linestyle="--", linewidth=1.2)
        if (reaction, order) == ("split", 0):
            axis.plot(ratios, split_limit(np.array(ratios)), color="black", linestyle="--", linewidth=1.2)
        axis.set(
            xscale="log",
            yscale="log",
            title=titles[reaction, order],
            xlim=(ratios[0], ratios[-1]),
            ylim=(steps[0], steps[-1]),
        )
    for axis in panels[-1]:
        axis.set_xlabel("mass ratio  r = slave mass / host mass  [1]")
    for axis in panels[:, 0]:
        axis.set_ylabel(r"communication step  $H\,\omega$  [rad]")
    marks = [
        Line2D([], [], color="black", marker=m, linestyle="", markersize=5, fillstyle="none", label=text)
        for m, text in (("o", "run: does not grow"), ("x", "run: grows"))
    ]
    marks.append(Line2D([], [], color="black", linestyle="--", label="closed form"))
    figure.legend(
        handles=[Patch(color=c, label=t) for c, t in zip(colours, labels)] + marks,
        ncol=4,
        loc="outside lower center",
        frameon=False,
    )
    figure.suptitle(
        f"Host of four masters on springs (omega, zeta = {ZETA:g}), slave tied in their middle:\n"
        "error of the worst mode's complex frequency"
    )
    figures.save(figure, folder / "stability_map.png", folder / "stability_map.svg")
    return folder / "stability_map.svg"
