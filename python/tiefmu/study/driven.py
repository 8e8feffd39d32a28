"""Runs of a scene whose nodes are all driven: the host gives motions and loads, the tie answers with its reactions.

Nothing is integrated but positions and rotations, so a run has no integrator; its step is the communication step, its
method when in the step the host samples the velocity that it holds: at the start, or in the middle.
"""

import numpy as np

from ..scene import Scene
from .motion import Rows, Signals, Trajectory, measured

SAMPLES = 40  # times at which a run is compared
METHODS = ["held input", "midpoint input"]


class DrivenRun:
    """Runs of one compiled scene, at any number of steps in each of SAMPLES equal intervals."""

    def __init__(self, scene: Scene, signals: Signals, reaction: str, method: str):
        self.scene, self.signals, self.reaction, self.method = scene, signals, reaction, method
        self.rows = Rows(scene)
        self.interval = signals.end / SAMPLES
        self.simulation = scene.simulation()
        self.added = scene.start.get("added_mass")[:, None]

    def inputs(self, times: np.ndarray, slopes: bool = False) -> dict:
        """{field: (times, rows, 3)}: motions and loads, or their slopes just before each time."""
        rows, fields = self.rows, self.scene.start.fields
        names = {"v": "velocity", "w": "spin", "f": "slave_force", "t": "slave_moment"}
        result = {"velocity": np.zeros((len(times), len(rows.node), 3))}
        if rows.rotating:
            result["spin"] = np.zeros((len(times), rows.rotating, 3))
        for (node, quantity), x in self.signals.values.items():
            field = names[quantity]
            row = (rows.slave if quantity in "ft" else rows.node).get(node)
            if field not in fields or row is None:
                continue
            target = result.setdefault(field, np.zeros((len(times), fields[field] // 3, 3)))
            if row >= target.shape[1]:
                continue
            for k in range(3):
                y = x[:, k]
                if slopes:
                    before = np.clip(np.searchsorted(self.signals.time, times * (1 - 1e-12)) - 1, 0, len(y) - 2)
                    target[:, row, k] = (np.diff(y) / np.diff(self.signals.time))[before]
                else:
                    target[:, row, k] = np.interp(times, self.signals.time, y)
        return result

    def plan(self, substeps: int):
        """Step, and per step what is held in it and what stands at its end."""
        n = SAMPLES * substeps
        h = self.interval / substeps
        ends = h * np.arange(1, n + 1)
        held = self.inputs(ends - h * (0.5 if self.method == "midpoint input" else 1.0))
        return h, held, self.inputs(ends), self.inputs(ends, slopes=True)

    def trajectory(self, substeps: int) -> Trajectory:
        h, held, final, slopes = self.plan(substeps)
        s, rows = self.simulation, self.rows
        s.reset()
        s.initialise(0.0)
        v, f = np.empty((SAMPLES, len(rows.slaves), 3)), np.empty((SAMPLES, len(rows.masters), 3))
        for k in range(SAMPLES * substeps):
            for field in ("velocity", "spin"):
                if field in held:
                    s.set(field, held[field][k])
            s.step(h)
            if (k + 1) % substeps:
                continue
            self.answer(final, slopes, k)
            sample = k // substeps
            v[sample], f[sample] = rows.look(s)
            if self.reaction != "full":  # the host carries D
                f[sample] -= (self.added * slopes["velocity"][k])[rows.masters]
        return Trajectory(v, f)

    def answer(self, final: dict, slopes: dict, k: int):
        """Sets what stands at the end of step k."""
        for field, values in final.items():
            self.simulation.set(field, values[k])
        if self.reaction != "loads":
            self.simulation.set("acceleration", slopes["velocity"][k])
            if "spin" in slopes:
                self.simulation.set("angular_acceleration", slopes["spin"][k])

    def cost(self, substeps: int) -> tuple[float, float]:
        """CPU time (s) and steps per simulated second: inputs set, step, inputs set, reactions read."""
        h, held, final, slopes = self.plan(substeps)
        s = self.simulation

        def prepare():
            s.reset()
            s.initialise(0.0)

        def once():
            for k in range(SAMPLES * substeps):
                for field in ("velocity", "spin"):
                    if field in held:
                        s.set(field, held[field][k])
                s.step(h)
                self.answer(final, slopes, k)
                s.get("reaction_force")

        return measured(prepare, once, s, self.signals.end)[0], SAMPLES * substeps / self.signals.end


class HeavyRun:
    """The same motion integrated by RK4: driven nodes made free, too heavy for the tie, pushed as their given
    acceleration demands, which is constant between the rows of the input."""

    interval, limit = 1.0, 1e30  # steps are cut by hand, see `reference.solve`

    def __init__(self, scene: Scene, signals: Signals):
        self.scene, self.signals, self.rows = scene, signals, Rows(scene)
        samples = np.linspace(0, signals.end, SAMPLES + 1)
        rows = signals.time[np.abs(signals.time[:, None] - samples).min(axis=1) > 1e-9 * signals.end]
        self.edges = np.sort(np.concatenate([rows, samples]))
        self.sampled = np.isin(self.edges[1:], samples)
        nodes = scene.model.report()["nodes"]
        run = DrivenRun(scene, signals, "full", "held input")
        slopes, self.final = run.inputs(self.edges[1:], slopes=True), run.inputs(self.edges[1:])
        start = run.inputs(self.edges[:1])
        self.start = {field: start[field][0] for field in ("velocity", "spin") if field in start}
        gravity = np.array(scene.gravity)  # which a given motion knows nothing of
        self.push = {"node_force": (slopes["velocity"] - gravity) * nodes["mass"][:, None]}
        if "spin" in slopes:
            self.push["node_moment"] = slopes["spin"] * nodes["inertia"][: self.rows.rotating, None]
        self.simulation = scene.simulation()

    def trajectory(self, substeps: int) -> Trajectory:
        s = self.simulation
        s.reset()
        s.initialise(0.0)
        for field, values in self.start.items():
            s.set(field, values)
        v, f = [], []
        for k, duration in enumerate(np.diff(self.edges)):
            for field, values in self.push.items():
                s.set(field, values[k])
            for _ in range(substeps):
                s.step(duration / substeps)
            if self.sampled[k]:
                for field in ("slave_force", "slave_moment"):
                    if field in self.final:
                        s.set(field, self.final[field][k])
                for x, now in zip((v, f), self.rows.look(s)):
                    x.append(now)
        return Trajectory(np.array(v), np.array(f))
