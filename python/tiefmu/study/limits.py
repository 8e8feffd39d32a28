"""Small scenes with known limits, and the means to find where a run starts to grow."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _core
from ..loading import load
from ..scene import Scene
from .hosts import Coupling, FreeMasters, Masses
from .ties import InProcess

GROWS = 1 + 1e-7  # growth a step that counts: above the rounding of an eigenvalue, below what 2 % off a limit makes


@dataclass
class Limit:
    """A parameter below which something holds and above which it fails.

    closed: the closed form; fails(value): does it, by a run or by asking the program; radius(value): spectral radius of
    the one-step map there, where it can be had; stated: the limit that the program itself gives, where it does.
    """

    item: str
    case: str
    parameter: str
    closed: float
    fails: Callable[[float], bool] | None
    radius: Callable[[float], float] | None = None
    stated: float | None = None

    def tests(self) -> dict[str, Callable[[float], bool]]:
        """The ways to tell failing, by name."""
        found, radius = {"run": self.fails} if self.fails else {}, self.radius
        return found | ({"radius": lambda value: radius(value) > GROWS} if radius else {})


@dataclass
class Value:
    """A number that a closed form predicts."""

    item: str
    case: str
    parameter: str
    closed: float
    measured: float
    tolerance: float  # relative; where closed is zero, absolute


def edge(fails: Callable[[float], bool], closed: float, reach: float = 1.2, precision: float = 1e-3) -> float:
    """Where `fails` changes, by bisection within a factor `reach` of the closed form; NaN if it does not change."""
    low, high = closed / reach, closed * reach
    if fails(low) or not fails(high):
        return float("nan")
    while high / low > 1 + precision:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return float(np.sqrt(low * high))


# ---------------------------------------------------------------------------------------------------- a driven plate

SQUARE = [[1, 0.0, 0.0, 0.0], [2, 1.0, 0.0, 0.0], [3, 1.0, 1.0, 0.0], [4, 0.0, 1.0, 0.0]]


def plate(
    slave_mass: float,
    reaction: str,
    spring=(0.0, 0.0),
    place=(0.5, 0.5, 0.0),
    motion="driven",
    reaction_lead=0.0,
    **tie,
) -> Scene:
    """Four masters of 1 kg on a square of 1 m with a slave on it; spring: stiffness (N/m) and damping (N s/m) of the
    slave to ground. Driven masters leave the tie without a state of its own; free ones have exact inertia."""
    scene = {
        "mesh": {"nodes": [*SQUARE, [5, *place]], "segments": [[1, 1, 2, 3, 4]]},
        "node": [{"nodes": "all", "mass": 1.0, "motion": motion}, {"nodes": [5], "mass": slave_mass}],
        "tie": [{"name": "tie", "segments": "all", "slaves": [5], "search_distance": 10.0, **tie}],
        "model": {
            "reaction": reaction,
            "reaction_lead": reaction_lead,
            "inertia": "lumped" if reaction == "loads" and motion == "driven" else "consistent",
            "geometry": "small",
            "position": "input" if motion == "driven" else "integrated",
        },
    }
    if any(spring):
        scene["spring"] = [{"ground": [5], "kind": "bushing", "stiffness": spring[0], "damping": spring[1]}]
    return load(scene)


def coupled(
    scene: Scene,
    reaction: str,
    step: float,
    order: int = 0,
    differenced: bool = False,
    omega: float = 0.0,
    zeta: float = 0.0,
    share: float = 1.0,
    **closing,
) -> Coupling:
    """The scene's host at this step. omega, zeta: of each master alone on its ground spring (rad/s, 1); share: the part
    of D that the host carries where the reaction asks for D (theory 5); closing: lead and closed of `Coupling`."""
    tie = InProcess(scene)
    carried = 0.0 if reaction == "full" else share
    return Coupling(
        tie,
        Masses(tie.own + carried * tie.added, tie.own * omega**2, tie.own * 2 * zeta * omega),
        step,
        order,
        differenced,
        **closing,
    )


def owned(ratio: float, step: float, omega: float, zeta: float) -> FreeMasters:
    """The plate with free masters and a slave of `ratio` times their mass; the host has their springs."""
    return FreeMasters(plate(4 * ratio, "loads", motion="free"), omega**2, 2 * zeta * omega, step)


# ---------------------------------------------------------------------------------------------------- free structures


class FreeRun:
    """A scene with free nodes, stepped at any step, also beyond the limit."""

    def __init__(self, scene: Scene):
        self.simulation = scene.simulation()
        self.simulation.initialise(0.0)
        self.start = self.simulation.save()
        self.limit = self.simulation.integrator_limit
        self.nodal = float(self.simulation.get("nodal_time_step")[0])

    def at(self, step: float) -> _core.Simulation:
        """Back at the start, with substeps of `step` s."""
        self.simulation.restore(self.start)
        self.simulation.set("safety", np.array([4.0]))
        self.simulation.set("time_step", np.array([step]))
        self.simulation.update_outputs()
        return self.simulation

    def grows(self, step: float, steps: int = 2000) -> bool:
        """Are the velocities larger in the last quarter of the run than in the second?"""
        simulation = self.at(step)
        peaks = np.zeros(4)
        try:
            for k in range(steps):
                simulation.step(step)
                peaks[4 * k // steps] = max(peaks[4 * k // steps], np.abs(simulation.get("velocity")).max())
        except _core.Diverged:
            return True
        return bool(peaks[3] > 1.02 * peaks[1])

    def radius(self, step: float) -> float:
        """Of the one-step map on (x, v), column by column. For undamped systems without offsets that turn."""
        simulation = self.at(step)
        position, velocity = simulation.get("position"), simulation.get("velocity")
        columns = []
        for field, other, scale in (("position", "velocity", 1.0), ("velocity", "position", 1 / step)):
            for k in range(position.size):
                self.at(step)
                rest = {"position": position, "velocity": 0 * velocity}
                moved = rest[field].copy()
                moved.flat[k] += scale
                simulation.set(field, moved)
                simulation.set(other, rest[other])
                simulation.step(step)
                columns.append(
                    np.concatenate(
                        [(simulation.get("position") - position).ravel(), step * simulation.get("velocity").ravel()]
                    )
                )
        return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())
