"""The map of (mass ratio, H omega): unstable, or how accurate, for each way to couple a tie to its host."""

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import figures
from ..scene import Scene
from .hosts import Exchange
from .limits import GROWS, coupled, owned, plate

ZETA = 0.02  # of the host's masters on their springs
CLASSES = [1e-3, 1e-2, 1e-1]  # upper ends of the classes of error; beyond the last one, and unstable
MAX_STEPS = 12000  # of a run
EVERY = 4  # how many grid lines lie between the points that are also decided by a run


@dataclass(frozen=True)
class Mode:
    """A way to couple. reaction, reaction_lead: of the scene, None where the FMU owns the masters; order: of the host's
    extrapolation; lead, closed: see `Coupling`; asks: what of the host, for advice."""

    name: str
    title: str
    asks: str
    reaction: str | None
    order: int = 0
    lead: float = 0.0
    closed: bool = False
    reaction_lead: float = 0.0

    def exchange(self, ratio: float, step: float) -> Exchange:
        """A slave in the middle of four masters, each on a ground spring with omega = 1 rad/s."""
        if self.reaction is None:
            return owned(ratio, step, omega=1.0, zeta=ZETA)
        scene = driven(ratio, self.reaction, self.reaction_lead)
        return coupled(
            scene, self.reaction, step, self.order, omega=1.0, zeta=ZETA, lead=self.lead, closed=self.closed
        )  # fmt: skip


# in the order of what they ask of a host
MODES = [
    Mode("loads", "loads (lumped)", "carry M + D", "loads"),
    Mode("full", "full, force held", "hold the last load", "full"),
    Mode("split", "split, force held", "carry M + D, hold the last load", "split"),
    Mode("split-lead-inside", "split, lead inside the FMU, force held",
         "carry M + D, hold the last load (reaction_lead = 1 in the scene)", "split", reaction_lead=1.0),
    Mode("split-lead", "split, load and its last change held", "carry M + D, hold the last load plus its last change",
         "split", lead=1.0),
    Mode("split-linear", "split, force extrapolated linearly", "carry M + D, extrapolate the last two loads linearly",
         "split", order=1),
    Mode("full-closed", "full, closed by derivatives, force held",
         "solve for its accelerations with fmi2GetDirectionalDerivative, hold the load", "full", closed=True),
    Mode("full-closed-linear", "full, closed by derivatives, extrapolated",
         "solve for its accelerations with fmi2GetDirectionalDerivative, extrapolate the last two loads linearly",
         "full", order=1, closed=True),
    Mode("free", "free: the FMU owns the masters",
         "give up the masters' mass, send internal forces as f_ext, take velocities", None),
]  # fmt: skip
BY_NAME = {mode.name: mode for mode in MODES}


@functools.lru_cache(maxsize=8)
def driven(ratio: float, reaction: str, reaction_lead: float) -> Scene:
    return plate(4 * ratio, reaction, reaction_lead=reaction_lead)


@dataclass
class Point:
    mode: str
    ratio: float  # slave mass / mass of the four masters
    step: float  # H omega, omega of a master alone on its spring
    radius: float  # of the one-step map
    growth: float  # a step, measured by a run; NaN where none was made
    error: float  # of the worst mode's complex frequency, relative

    @property
    def stable(self) -> bool:
        return self.radius <= GROWS

    @property
    def green(self) -> bool:
        return self.stable and self.error < CLASSES[-1]


def point(name: str, ratio: float, step: float, run: bool = False) -> Point:
    exchange = BY_NAME[name].exchange(ratio, step)
    roots = exchange.roots()
    growth = grown(exchange, 2 * np.pi * np.sqrt(1 + ratio) / step) if run else float("nan")
    return Point(name, ratio, step, float(np.abs(roots).max()), growth, worst(roots, ratio, step))


@functools.lru_cache(maxsize=4096)
def known(name: str, ratio: float, step: float) -> Point:
    """The same, once: a scan for one error meets the points of the scan for another."""
    return point(name, ratio, step)


def worst(roots: np.ndarray, ratio: float, step: float, zeta: float = ZETA) -> float:
    """Error of the worst vibration's complex frequency. Those that move the slave (three, alike) and those that do not:
    (1 + tied) x'' + 2 zeta x' + x = 0."""
    found = np.log(roots[np.abs(roots) > 1e-12].astype(complex)) / step
    error = 0.0
    for tied in (0.0, ratio):
        exact = (-zeta + 1j * np.sqrt(1 + tied - zeta**2)) / (1 + tied)
        error = max(error, float(np.abs(found - exact).min() / abs(exact)))
    return error


def grown(exchange: Exchange, period: float) -> float:
    """Growth per step over 24 of the slowest periods (each so many steps); NaN where those are too many steps and
    the run has not made itself plain before."""
    wanted = int(np.ceil(24 * period))
    steps = min(wanted, MAX_STEPS)
    growth = exchange.growth(steps)
    return growth if steps == wanted or growth ** (steps / 2) > 1e3 else float("nan")


def axes(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.logspace(-2, 3, count), np.logspace(-3, np.log10(3), count)


def points(count: int, progress=lambda: None) -> list[Point]:
    ratios, steps = axes(count)
    found = []
    for mode in MODES:
        for i, ratio in enumerate(ratios):
            for j, step in enumerate(steps):
                run = i % EVERY == EVERY // 2 and j % EVERY == EVERY // 2
                found.append(point(mode.name, float(ratio), float(step), run))
                progress()
    return found


REACH = [0.1, 1.0, 10.0, 100.0, 1000.0]  # mass ratios of the table of steps


def reach(name: str, ratio: float, error: float, lowest: float = 1e-5, highest: float = 3.0) -> float:
    """The H omega up to which every step is stable and right to `error`, from `lowest` on: by a scan of eight steps a
    decade and bisection to 1 %. 0: not even `lowest` is; `highest`: all are."""

    def good(step: float) -> bool:
        found = known(name, ratio, step)
        return found.stable and found.error < error

    steps = np.geomspace(lowest, highest, int(np.ceil(8 * np.log10(highest / lowest))) + 1).tolist()
    bad = next((k for k, step in enumerate(steps) if not good(step)), None)
    if not bad:
        return highest if bad is None else 0.0
    low, high = steps[bad - 1], steps[bad]
    while high / low > 1.01:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def reaches(progress=lambda: None) -> list[list]:
    """A row a mode and ratio: the largest H omega for an error of each of CLASSES."""
    found = []
    for mode in MODES:
        for ratio in REACH:
            found.append([mode.name, ratio, *(reach(mode.name, ratio, error) for error in CLASSES)])
            progress()
    return found


def split_limit(ratio: np.ndarray) -> np.ndarray:
    """H omega up to which the host's damping outweighs what the held load feeds in; for small H omega."""
    return 2 * ZETA * (1 + ratio) / (ratio * (ratio + 0.5))


def free_limit() -> float:
    """H omega of central difference with the damper's velocity of the half step before: theory (6.5), beta = 0."""
    return 2 * (np.sqrt(1 + ZETA**2) - ZETA)


def draw(found: list[Point], folder: Path) -> Path:
    """Writes stability_map.png and .svg; returns the latter."""
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colours = ["#1a6b54", "#5fb08c", "#c9dfae", "#f2d98b", "#b3402e"]
    labels = ["error < 0.1 %", "< 1 %", "< 10 %", "stable, error > 10 %", "unstable"]
    size = {"figsize": (13.5, 12.3), "layout": "constrained"}
    figure, panels = figures.pyplot().subplots(3, 3, sharex=True, sharey=True, **size)
    for axis, mode in zip(panels.flat, MODES):
        own = [p for p in found if p.mode == mode.name]
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
        line = {"color": "black", "linestyle": "--", "linewidth": 1.2}
        if mode.name == "full":
            axis.axvline(1.0, **line)
        elif mode.name == "split":
            axis.plot(ratios, split_limit(np.array(ratios)), **line)
        elif mode.name == "free":
            axis.axhline(free_limit(), **line)
        axis.set(xscale="log", yscale="log", title=mode.title, xlim=(ratios[0], ratios[-1]), ylim=(steps[0], steps[-1]))
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
        "error of the worst vibration's complex frequency"
    )
    figures.save(figure, folder / "stability_map.png", folder / "stability_map.svg")
    return folder / "stability_map.svg"
