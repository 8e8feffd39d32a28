"""A scene coupled to a host: the packaged FMU over communication steps, against the monolithic system."""

import math
import time
from dataclasses import dataclass

import numpy as np

from .. import schema
from .._core import Diverged, SceneError
from ..scene import Scene
from . import coupling_free
from .coupling_reference import Reference, relative
from .hosts import EXTRAPOLATIONS, Coupling, Masses
from .limits import GROWS
from .ties import InProcess, Packaged
from .variants import Source, change

OMEGA = 1000.0  # rad/s, of each of the host's masters on its ground spring, or of the exchanged spring; at least
ZETA = 0.05  # of the host
EXCHANGE_ZETA = 0.25
WINDOW = 2.0  # simulated time in radians of that spring
AMPLITUDE = 1e-4  # of the mean edge of a segment: what is seen is the coupling, not the geometry
LARGEST_MATRIX = 200  # rows of a one-step map
MAX_STEPS = 6000  # of a run in its place


@dataclass(frozen=True)
class Way:
    """A way to couple, theory 5. reaction, reaction_lead: of the scene; reaction "spring-damper": force exchange with
    massless slaves on springs and dampers to ground; "free": the solver owns the masters; closed: of the host, see
    `Coupling`."""

    name: str
    reaction: str
    extrapolations: tuple[str, ...] = tuple(EXTRAPOLATIONS)
    reaction_lead: float = 0.0
    closed: bool = False


WAYS = [
    Way("loads", "loads"),
    Way("full", "full"),
    Way("split", "split"),
    Way("split-lead-inside", "split", ("held",), reaction_lead=1.0),
    Way("full-closed", "full", ("held", "linear"), closed=True),
    Way("free", "free", ("held",)),
    Way("spring-damper", "spring-damper"),
]


@dataclass
class Row:
    scene: str
    host: str
    reaction: str  # name of a Way
    extrapolation: str  # of the tie's loads, by the host
    mass_ratio: float  # slaves over masters
    step: float  # s
    step_omega: float  # rad
    steps: int
    error_velocity: float  # of the slaves, relative L2 over the trajectory, against the monolithic system
    error_force: float  # of the tie's loads on the masters
    error_final: float  # of the slaves' velocities at the end
    power_residual: float  # W, rms over the communication points: sum f.v with the load the host used, minus with
    power_residual_relative: float  # the one the tie answers; relative to the rms of the interface's power
    radius: float  # growth per step: spectral radius of the one-step map, or of a run where that is too large
    status: str  # "stable", "unstable" (radius > 1, but the run is short) or "diverged" (no errors, no cost)
    cpu: float  # s per simulated second


class Study:
    """A scene whose driven masters a host takes over, with pulses on its slaves. Raises SceneError."""

    def __init__(self, path, host: str = "sprung", mass_ratio: float | None = None):
        self.source, self.host = Source(path), host
        if not self.source.any_driven:
            raise SceneError(
                f"{path}: has no driven masters, so there is nothing for a host to move; "
                'motion = "driven" in a [[node]] table gives them to the host'
            )
        self.base = self.source.arrays(self.source.tables, heavy=False)
        self.base.initial = []
        change(self.base.model, gravity=[0.0, 0.0, 0.0], position="input", reaction_lead=0.0)
        change(self.base.interface, expose=[], hide=[])
        tie = InProcess(self.scene("loads"))
        found = self.source.scene.model.report()
        self.slaves = found["slaves"]["id"][np.argsort(found["slaves"]["number"])].tolist()
        self.tied = float(found["slaves"]["mass"].sum())
        n = 3 * len(tie.names.driven)
        host_mass = float(tie.own[:n:3].sum())
        if mass_ratio and not tie.own[:n].all():  # no masses to scale: equal ones
            tie.own[:n], host_mass = self.tied / (mass_ratio * n / 3), self.tied / mass_ratio
        for k in np.flatnonzero(tie.own <= 0):
            place = k // 3 if k < n else tie.names.driven.index(tie.names.turning[(k - n) // 3])
            what = "mass" if k < n else "inertia"
            raise SceneError(
                f"{path}: master {tie.node_ids[place]}: has no {what} of its own, which a host needs; "
                f"give {what} in a [[node]] table" + (", or --mass-ratio" if what == "mass" else "")
            )
        self.own = tie.own * (self.tied / (mass_ratio * host_mass) if mass_ratio and self.tied > 0 else 1.0)
        self.ratio = self.tied / float(self.own[:n:3].sum())
        self.translations, self.node_ids, self.names = n, tie.node_ids.tolist(), tie.names
        self.omega = max(OMEGA, self.own_frequency())
        self.window = WINDOW / self.omega
        self.force = AMPLITUDE * self.edge() * self.omega**2 * float(self.own[:n:3].sum()) / len(self.slaves)
        self.direction = np.tile([1.0, 0.5, -2.0], len(self.slaves))

    def edge(self) -> float:
        place = {row[0]: np.array(row[1:], float) for row in self.base.mesh.nodes}
        return float(
            np.mean(
                [
                    np.linalg.norm(place[a] - place[b])
                    for _, *s in self.base.mesh.segments
                    for a, b in zip(s, s[1:] + s[:1])
                ]
            )
        )

    def amplitude_velocity(self) -> float:
        """What the pulses make, m/s, about."""
        return AMPLITUDE * self.edge() * self.omega

    def pulse(self, t: float) -> float:
        """0 before the start, with its first three derivatives, so that an extrapolation's past is exact."""
        return math.sin(math.pi * t / self.window) ** 4 if t > 0 else 0.0

    def own_frequency(self) -> float:
        """Highest frequency of the scene's own springs with free masters, rad/s."""
        tables = self.tables("full")
        for node in tables.node:
            if node.nodes[0] in self.node_ids:
                k = self.node_ids.index(node.nodes[0])
                node.motion, node.mass = "free", float(self.own[3 * k])
        return 2 / float(self.source.compile(tables).start.get("stable_time_step")[0])

    def tables(self, reaction: str) -> schema.SceneTables:
        """SI tables of the scene in this reaction mode, with lumped inertia in `loads`."""
        tables = self.base.model_copy(deep=True)
        if reaction == "spring-damper":
            change(tables.model, reaction="loads", inertia="lumped")
            for table in tables.node:
                if table.nodes[0] in self.slaves:
                    table.mass = table.inertia = 0.0
            share = float(self.own[: self.translations : 3].sum()) / len(self.slaves)
            tables.spring += [
                schema.Spring(
                    ground=[slave],
                    kind="bushing",
                    stiffness=share * self.omega**2,
                    damping=2 * EXCHANGE_ZETA * share * self.omega,
                )
                for slave in self.slaves
            ]
        else:
            change(tables.model, reaction=reaction, inertia="lumped" if reaction == "loads" else "consistent")
        return tables

    def scene(self, reaction: str, geometry: str | None = None, reaction_lead: float = 0.0) -> Scene:
        tables = self.tables(reaction)
        change(tables.model, reaction_lead=reaction_lead)
        if geometry:
            change(tables.model, geometry=geometry)
        return self.source.compile(tables)

    def masses(self, reaction: str, added: np.ndarray) -> Masses:
        """The host carries D but in `full`; translations are sprung unless it is rigid or the exchange is a spring."""
        sprung = self.own * (np.arange(len(self.own)) < self.translations)
        sprung = sprung * (self.host == "sprung" and reaction != "spring-damper")
        return Masses(
            self.own + (0.0 if reaction == "full" else 1.0) * added,
            sprung * self.omega**2,
            sprung * 2 * ZETA * self.omega,
        )

    def rows(self, steps: list[int]):
        """One Row for each way, extrapolation and number of steps."""
        references = {}
        for way in WAYS:
            kind = "spring-damper" if way.reaction == "spring-damper" else "tie"
            if kind not in references:
                references[kind] = Reference(self, way.reaction)
            if way.reaction == "free":
                free = coupling_free.scene(self)
                yield from (self.free_row(free, references[kind], way, count) for count in steps)
                continue
            linear = InProcess(self.scene(way.reaction, "small", way.reaction_lead))
            with Packaged(self.scene(way.reaction, reaction_lead=way.reaction_lead)) as tie:
                for extrapolation in way.extrapolations:
                    for count in steps:
                        yield self.row(tie, linear, references[kind], way, extrapolation, count)

    def row(
        self, tie: Packaged, linear: InProcess, reference: "Reference", way: Way, extrapolation: str, count: int
    ) -> Row:
        size, host = self.window / count, self.masses(way.reaction, tie.added)
        order = EXTRAPOLATIONS.index(extrapolation)
        probe = Coupling(linear, host, size, order, closed=way.closed)
        radius = self.rate(probe)
        run = self.simulate(tie, host, size, order, count, way.closed)
        times = np.arange(count + 1) * size
        return self.judged(run, reference, way, extrapolation, count, radius, times, times)

    def free_row(self, free: Scene, reference: Reference, way: Way, count: int) -> Row:
        size = self.window / count
        owner, times = coupling_free.Owner(self, free, size), np.arange(count) * size
        radius = owner.masters.growth(min(MAX_STEPS, max(400, math.ceil(16 * math.pi / (size * self.omega)))))
        run = owner.simulate(count)
        return self.judged(run, reference, way, "held", count, radius, times + size / 2, times)

    def judged(
        self,
        run,
        reference: Reference,
        way: Way,
        extrapolation: str,
        count: int,
        radius: float,
        velocity_times: np.ndarray,
        load_times: np.ndarray,
    ) -> Row:
        """run: of `simulate`; times: of its velocities and loads, s."""
        size = self.window / count
        row = Row(
            scene=self.source.name,
            host=self.host,
            reaction=way.name,
            extrapolation=extrapolation,
            mass_ratio=self.ratio,
            step=size,
            step_omega=size * self.omega,
            steps=count,
            error_velocity=math.nan,
            error_force=math.nan,
            error_final=math.nan,
            power_residual=math.nan,
            power_residual_relative=math.nan,
            radius=radius,
            status="diverged",
            cpu=math.nan,
        )
        if run is None:
            return row
        velocity, load, residual, cpu = run
        exact_velocity, exact_load = reference.at(velocity_times, "velocity"), reference.at(load_times, "load")
        if not relative(velocity, exact_velocity) < 10:
            return row
        row.error_velocity, row.error_force = relative(velocity, exact_velocity), relative(load, exact_load)
        row.error_final = relative(velocity[-1:], exact_velocity[-1:])
        row.power_residual = float(np.sqrt(np.mean(residual[1:] ** 2)))
        row.power_residual_relative = row.power_residual / reference.power_rms
        row.cpu, row.status = cpu, "stable" if radius <= GROWS else "unstable"
        return row

    def rate(self, probe: Coupling) -> float:
        """Growth per step: by the spectral radius; by a run of eight periods of the host where the tie keeps a state
        that the one-step map leaves out or the matrix is large, unless that takes too many steps."""
        steps = max(400, math.ceil(16 * math.pi / (probe.size * self.omega)))
        large = probe.rest().size > LARGEST_MATRIX
        if large or (probe.tie.keeps_state and steps <= MAX_STEPS):
            return probe.growth(min(steps, MAX_STEPS))
        return probe.radius()

    def simulate(self, tie: Packaged, host: Masses, size: float, order: int, count: int, closed: bool = False):
        """(slave velocities, loads of the tie on the masters, power residuals) at the communication points, and CPU s
        per s; or None where it diverges."""
        tie.restart()
        coupling = Coupling(tie, host, size, order, closed=closed)
        state, used = coupling.rest(), None
        carried = host.mass - self.own
        velocity = np.empty((count + 1, len(self.direction)))
        load, residual = np.empty((count + 1, len(self.own))), np.zeros(count + 1)
        bound = 1e6 * self.amplitude_velocity()
        start = time.process_time()
        for n in range(count + 1):
            tie.push(self.force * self.pulse(n * size) * self.direction)
            answer = coupling.load(state)
            velocity[n] = tie.slave_velocity()
            load[n] = answer - carried * state[2]
            if used is not None:
                residual[n] = (used - answer) @ state[1]
            if n == count:
                break
            following, used = coupling.advance(state, answer)
            if not abs(following[1]).max() < bound:
                return None
            try:
                tie.carry((state[1] + following[1]) / 2, n * size, size)
            except Diverged:
                return None
            state = following
        return velocity, load, residual, (time.process_time() - start) / self.window
