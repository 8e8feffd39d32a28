"""What a study runs: the loads and motions given to a scene over time, single runs under them, their errors and cost.

A scene with free nodes is integrated over equal intervals in which all inputs are constant - the mean of what was given
- for every method, step and reference alike, so that the errors are those of the method and not of sampling the
input. Driven nodes of such a scene are free ones with a mass nothing can move (Variant, `heavy`), accelerated as given.
"""

import itertools
import time
from dataclasses import dataclass

import numpy as np

from ..scene import Scene
from ..signals import read_inputs
from . import ports

REPEATS = 3
SHORTEST = 0.005  # s of CPU time that one measurement takes at least
LONGEST = 0.3  # s after which a measurement is not repeated


@dataclass
class Trajectory:
    """At the end of each interval: v (n, slaves, 3) and f (n, masters, 3), by ascending node id, m/s and N. f is the
    tie's whole load on the master, inertia included. energy_residual: largest over the run, relative."""

    v: np.ndarray
    f: np.ndarray
    energy_residual: float = np.nan

    def difference(self, other: "Trajectory") -> tuple[float, float, float]:
        """Relative L2 of velocities and of loads over the whole run; velocities at its end, relative to the largest
        of the run, because many runs end at rest."""
        top = float(np.sqrt((other.v**2).sum(axis=(1, 2)).max(initial=0.0)))
        with np.errstate(over="ignore", invalid="ignore"):
            end = float(np.linalg.norm(self.v[-1] - other.v[-1]))
        return relative(self.v, other.v), relative(self.f, other.f), end / top if top > 0 else relative(end, 0.0)


def relative(x, exact) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        scale = float(np.linalg.norm(exact))
        error = float(np.linalg.norm(x - exact))
    return error / scale if scale > 0 else (np.inf if error > 0 else 0.0)


class Signals:
    """Inputs over time, linear between rows. values: {(node id, "f" | "t" | "v" | "w"): (rows, 3)}, SI; end: s."""

    def __init__(self, time: np.ndarray, values: dict):
        self.time, self.values = time, values
        # integral up to each row, for means over intervals
        steps = np.diff(time)[:, None]
        self.integral = {
            key: np.vstack([np.zeros(3), np.cumsum(0.5 * steps * (x[1:] + x[:-1]), axis=0)])
            for key, x in values.items()
        }

    @classmethod
    def read(cls, scene: Scene, path) -> "Signals":
        """The CSV of `tiefmu run`, inputs of ports as those of their nodes; None: nothing but the start values. Raises
        RunError, UsageError."""
        if path is None:
            return cls(np.zeros(1), {})
        inputs, known = {}, {}
        for number, block in enumerate(scene.start.variables):
            short = block["name"].removeprefix(block["prefix"] + ".")
            components = block["components"]
            for k, name in enumerate(scene.start.variable_names(number)):
                known[name] = _Variable(name, block["causality"])
                owner = block["labels"] if block["prefix"] == "port" else block["ids"]
                node = owner[k // components] if len(owner) else 0
                inputs[name] = (
                    node if isinstance(node, str) else int(node),
                    short.removesuffix("_ext"),
                    k % components,
                )
        table = read_inputs(path, known)
        values = {}
        for name in (table.dtype.names or ())[1:]:
            node, quantity, k = inputs[name]
            if quantity in ("f", "t", "v", "w"):  # accelerations are taken as the slopes of the velocities
                values.setdefault((node, quantity), np.zeros((len(table), 3)))[:, k] = table[name]
        return cls(*ports.expand(scene, table["time"], values))

    @property
    def end(self) -> float:
        return float(self.time[-1])

    def at(self, key, t: float) -> np.ndarray:
        x = self.values[key]
        return np.array([np.interp(t, self.time, x[:, k]) for k in range(3)])

    def mean(self, key, a: float, b: float) -> np.ndarray:
        return (self._integral(key, b) - self._integral(key, a)) / (b - a)

    def _integral(self, key, t: float) -> np.ndarray:
        x, t = self.values[key], float(t)
        if t >= self.end:
            return self.integral[key][-1] + (t - self.end) * x[-1]
        row = max(int(np.searchsorted(self.time, t, side="right")) - 1, 0)
        return self.integral[key][row] + 0.5 * (t - self.time[row]) * (x[row] + self.at(key, t))


@dataclass
class _Variable:
    name: str
    causality: str
    type: str = "Real"
    variability: str = "continuous"


class Rows:
    """Where nodes stand in the arrays of a scene's simulations."""

    def __init__(self, scene: Scene, masters=None, slaves=None):
        """masters, slaves: the ids to look at (ascending); by default all."""
        found = scene.model.report()
        nodes = found["nodes"]
        self.node = {int(i): k for k, i in enumerate(nodes["id"])}
        self.slave = {int(i): k for k, i in enumerate(found["slaves"]["id"])}
        self.rotating = nodes["rotating"]
        self.slave_ids = sorted(self.slave) if slaves is None else slaves
        self.master_ids = sorted(nodes["id"][nodes["master"] > 0].tolist()) if masters is None else masters
        self.masters = [self.node[i] for i in self.master_ids]
        self.tied = all(i in self.slave for i in self.slave_ids)  # else they are nodes on penalty springs
        self.slaves = [(self.slave if self.tied else self.node)[i] for i in self.slave_ids]

    def look(self, simulation) -> tuple[np.ndarray, np.ndarray]:
        """Velocities of the slaves and loads of the tie on the masters, now."""
        v = simulation.get("slave_velocity" if self.tied else "velocity")[self.slaves]
        return v, simulation.get("reaction_force")[self.masters]


class Held:
    """Constant inputs for one interval after the other.

    For each, the arrays to write: {field: (values)}; None where nothing changes against the interval before.
    """

    def __init__(self, scene: Scene, rows: Rows, signals: Signals, edges: np.ndarray):
        fields = scene.start.fields
        mass, inertia = (scene.model.report()["nodes"][key] for key in ("mass", "inertia"))
        place = {
            "node_force": (len(rows.node), 3),
            "node_moment": (rows.rotating, 3),
            "slave_force": (len(rows.slave), 3),
            "slave_moment": (fields.get("slave_moment", 0) // 3, 3),
        }
        self.start = {}
        velocity, spin = scene.start.get("velocity"), scene.start.get("spin") if rows.rotating else None
        for (node, quantity), _ in signals.values.items():  # driven nodes start with the motion given at the start
            row = rows.node.get(node)
            if quantity == "v":
                velocity[row] = signals.at((node, "v"), edges[0])
                self.start["velocity"] = velocity
            elif quantity == "w" and spin is not None and row < rows.rotating:
                spin[row] = signals.at((node, "w"), edges[0])
                self.start["spin"] = spin
        self.changes, last = [], {}
        for a, b in itertools.pairwise(edges):
            now = {}
            for (node, quantity), _ in signals.values.items():
                key = (node, quantity)
                if quantity in ("v", "w"):
                    row = rows.node[node]
                    if quantity == "w" and row >= rows.rotating:
                        continue
                    field = "node_force" if quantity == "v" else "node_moment"
                    heavy = (mass if quantity == "v" else inertia)[row]
                    value = heavy * (signals.at(key, b) - signals.at(key, a)) / (b - a)
                    if quantity == "v":
                        value -= heavy * np.array(scene.gravity)  # which a given motion knows nothing of
                elif node in rows.slave:
                    field, row = ("slave_force" if quantity == "f" else "slave_moment"), rows.slave[node]
                    value = signals.mean(key, a, b)
                else:
                    field, row = ("node_force" if quantity == "f" else "node_moment"), rows.node[node]
                    value = signals.mean(key, a, b)
                if row < place[field][0]:
                    now.setdefault(field, np.zeros(place[field]))[row] += value
            changed = {field: x for field, x in now.items() if field not in last or not np.array_equal(x, last[field])}
            last = now
            self.changes.append(changed)


class FreeRun:
    """Runs of one compiled scene under held inputs, at any step."""

    def __init__(self, scene: Scene, signals: Signals, edges: np.ndarray, rows: Rows | None = None):
        self.scene, self.edges = scene, edges
        self.rows = rows or Rows(scene)
        self.held = Held(scene, self.rows, signals, edges)
        self.interval = float(edges[1] - edges[0])
        self.limit = scene.start.integrator_limit
        self.simulation = scene.simulation()
        self.energy = "energy" in scene.start.fields

    def restart(self, substeps: int):
        """At the start, each interval to be cut in so many steps whatever the limit says."""
        s = self.simulation
        s.reset()
        s.set("time_step", np.array([self.interval / substeps * (1 + 1e-9)]))
        s.set("safety", np.array([1e9]))
        s.initialise(float(self.edges[0]))
        for field, values in self.held.start.items():
            s.set(field, values)

    def trajectory(self, substeps: int) -> Trajectory:
        """Raises Diverged."""
        self.restart(substeps)
        s, n = self.simulation, len(self.edges) - 1
        v, f = np.empty((n, len(self.rows.slaves), 3)), np.empty((n, len(self.rows.masters), 3))
        energy = np.zeros((n, 5))
        for k, changed in enumerate(self.held.changes):
            for field, values in changed.items():
                s.set(field, values)
            s.step(self.interval)
            v[k], f[k] = self.rows.look(s)
            if self.energy:
                energy[k] = s.get("energy")
        top = np.abs(energy[:, [0, 1, 3]]).max(initial=0.0)
        return Trajectory(v, f, np.abs(energy[:, 4]).max() / top if top > 0 else np.nan)

    def cost(self, substeps: int) -> tuple[float, float]:
        """CPU time (s) and force evaluations per simulated second; nothing is read while it runs. Raises Diverged."""
        return measured(lambda: self.restart(substeps), self.once, self.simulation, self.edges[-1] - self.edges[0])

    def once(self):
        s, interval = self.simulation, self.interval
        for changed in self.held.changes:
            for field, values in changed.items():
                s.set(field, values)
            s.step(interval)


def measured(prepare, once, simulation, duration: float) -> tuple[float, float]:
    """Median CPU time and the evaluations of `once`, both per second of `duration`."""
    times = []
    while len(times) < REPEATS and sum(times) < LONGEST:
        count, total = 0, 0.0
        while not count or total < SHORTEST:
            prepare()
            began = time.process_time()
            once()
            total += time.process_time() - began
            count += 1
        times.append(total / count)
    return float(np.median(times)) / duration, simulation.evaluations / duration
