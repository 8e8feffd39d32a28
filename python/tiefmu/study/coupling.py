"""`tiefmu study coupling SCENE`: the packaged FMU under FMPy against a host in NumPy, over the communication step."""

import argparse
import csv
import itertools
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .. import schema
from .._core import Diverged, SceneError
from ..scene import Scene
from . import page
from .hosts import EXTRAPOLATIONS, Coupling, InProcess, Masses, Packaged
from .limits import GROWS
from .variants import Source

OMEGA = 1000.0  # rad/s, of each of the host's masters on its ground spring, or of the exchanged spring; at least
ZETA = 0.05  # of the host
EXCHANGE_ZETA = 0.25
WINDOW = 2.0  # simulated time in radians of that spring
AMPLITUDE = 1e-4  # of the mean edge of a segment: what is seen is the coupling, not the geometry
REACTIONS = ["loads", "full", "split", "spring-damper"]
REFERENCE = 1000  # points of the reference
LARGEST_MATRIX = 200  # rows of a one-step map
MAX_STEPS = 6000  # of a run in its place
TIMES = ["cpu"]  # columns that differ from run to run


@dataclass
class Row:
    scene: str
    host: str
    reaction: str  # or "spring-damper": force exchange with massless slaves on springs and dampers to ground
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


def add_parser(studies):
    study = studies.add_parser(
        "coupling",
        help="the packaged FMU against a host, over the communication step",
        description="Couples the FMU of a scene with driven masters to a host that carries them, for each reaction "
        "mode and extrapolation, and compares with the monolithic system.",
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


def positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a positive number")
    return value


def run(options) -> int:
    from tqdm import tqdm

    if not 0.5 <= options.decades <= 6:
        raise SceneError(f"--decades: expected 0.5 to 6, found {options.decades:g}")
    studies = [Study(path, options.host, options.mass_ratio) for path in options.scene]
    options.out.mkdir(parents=True, exist_ok=True)
    steps, sections, interrupted = ladder(options.decades), [], False
    total = len(studies) * len(REACTIONS) * len(EXTRAPOLATIONS) * sum(steps)
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


# ------------------------------------------------------------------------------------------------------- one scene


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
        self.base.model.gravity, self.base.initial = [0.0, 0.0, 0.0], []
        self.base.interface, self.base.model.position = schema.Interface(), "input"
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
            tables.model.reaction, tables.model.inertia = "loads", "lumped"
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
            tables.model.reaction, tables.model.inertia = reaction, "lumped" if reaction == "loads" else "consistent"
        return tables

    def scene(self, reaction: str, geometry: str | None = None) -> Scene:
        tables = self.tables(reaction)
        if geometry:
            tables.model.geometry = geometry
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
        """One Row for each reaction, extrapolation and number of steps."""
        references = {}
        for reaction in REACTIONS:
            kind = "spring-damper" if reaction == "spring-damper" else "tie"
            if kind not in references:
                references[kind] = Reference(self, reaction)
            linear = InProcess(self.scene(reaction, "small"))
            with Packaged(self.scene(reaction)) as tie:
                for order, extrapolation in enumerate(EXTRAPOLATIONS):
                    for count in steps:
                        yield self.row(tie, linear, references[kind], reaction, order, extrapolation, count)

    def row(
        self,
        tie: Packaged,
        linear: InProcess,
        reference: "Reference",
        reaction: str,
        order: int,
        extrapolation: str,
        count: int,
    ) -> Row:
        size, host = self.window / count, self.masses(reaction, tie.added)
        probe = Coupling(linear, host, size, order)
        radius = self.rate(probe)
        row = Row(
            self.source.name,
            self.host,
            reaction,
            extrapolation,
            self.ratio,
            size,
            size * self.omega,
            count,
            *[math.nan] * 5,
            radius,
            "diverged",
            math.nan,
        )
        run = self.simulate(tie, host, size, order, count)
        if run is None:
            return row
        velocity, load, residual, cpu = run
        times = np.arange(count + 1) * size
        exact_velocity, exact_load, _exact_power = (reference.at(times, key) for key in ("velocity", "load", "power"))
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

    def simulate(self, tie: Packaged, host: Masses, size: float, order: int, count: int):
        """(slave velocities, loads of the tie on the masters, power residuals) at the communication points, and CPU s
        per s; or None where it diverges."""
        tie.restart()
        coupling = Coupling(tie, host, size, order)
        state, used = coupling.rest(), None
        carried = host.mass - self.own
        velocity = np.empty((count + 1, len(self.direction)))
        load, residual = np.empty((count + 1, len(self.own))), np.zeros(count + 1)
        bound = 1e6 * AMPLITUDE * self.edge() * self.omega
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


def relative(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


class Reference:
    """The monolithic system: the same scene with free masters of the host's masses on the host's springs, consistent
    inertia, Runge-Kutta. Pulses are held at their value in the middle of each step, which is of second order with even
    powers only, so four halvings extrapolate to eighth order; `error` is what the last extrapolation still changed."""

    def __init__(self, study: Study, reaction: str):
        self.study = study
        tables = study.tables(reaction)
        tables.model.reaction, tables.model.inertia, tables.model.position = "loads", "consistent", "integrated"
        if reaction == "spring-damper":
            tables.model.inertia = "lumped"  # of massless slaves: nothing to lump
        tables.integrator = schema.Integrator(method="rk4", safety=0.5)
        self.host = study.masses(reaction, 0 * study.own)
        table = {node.nodes[0]: node for node in tables.node}
        for k, node in enumerate(study.node_ids):
            table[node].motion, table[node].mass = "free", float(study.own[3 * k])
            if self.host.stiffness[3 * k]:
                tables.spring.append(
                    schema.Spring(
                        ground=[node],
                        kind="bushing",
                        stiffness=float(self.host.stiffness[3 * k]),
                        damping=float(self.host.damping[3 * k]),
                    )
                )
        self.turning = [study.node_ids[study.names.driven.index(i)] for i in study.names.turning]
        for k, node in enumerate(self.turning):
            table[node].inertia = float(study.own[study.translations + 3 * k])
        self.tables, self.scene = tables, study.source.compile(tables)
        self.values, self.error = self.romberg([self.run(REFERENCE * 2**level) for level in range(4)])
        self.power_rms = float(np.sqrt(np.mean(self.values["power"] ** 2)))

    @staticmethod
    def romberg(levels: list[dict]) -> tuple[dict, float]:
        """The limit of runs with halved steps, errors in h^2, h^4, h^6, and the relative change by the last of them."""
        last, error = {}, 0.0
        for key in levels[0]:
            column = [level[key] for level in levels]
            for power in (4, 16, 64):
                before = column[-1]
                column = [fine + (fine - coarse) / (power - 1) for coarse, fine in itertools.pairwise(column)]
            last[key], error = column[0], max(error, relative(before, column[0]))
        return last, error

    def run(self, count: int) -> dict[str, np.ndarray]:
        """At REFERENCE + 1 points: slave velocities, loads on the masters by freedom, their power."""
        study, simulation = self.study, self.scene.simulation()
        simulation.initialise(0.0)
        index = {int(i): k for k, i in enumerate(self.scene.model.report()["nodes"]["id"])}
        rows, turning = [index[i] for i in study.node_ids], [index[i] for i in self.turning]
        start, size, every = (
            simulation.get("position")[rows] if "position" in simulation.fields else 0.0,
            study.window / count,
            count // REFERENCE,
        )
        found = {"velocity": [], "load": [], "power": []}
        for n in range(count + 1):
            if n % every == 0:
                simulation.set_values(study.names.slave_force, study.force * study.pulse(n * size) * study.direction)
                a, v = simulation.get("acceleration")[rows].ravel(), simulation.get("velocity")[rows].ravel()
                u = (simulation.get("position")[rows] - start).ravel() if "position" in simulation.fields else 0 * v
                if turning:
                    a = np.concatenate([a, simulation.get("angular_acceleration")[turning].ravel()])
                    v = np.concatenate([v, simulation.get("spin")[turning].ravel()])
                    u = np.concatenate([u, np.zeros(3 * len(turning))])
                load = study.own * a + self.host.stiffness * u + self.host.damping * v
                found["velocity"].append(simulation.get_values(study.names.slave_velocity))
                found["load"].append(load)
                found["power"].append([load @ v])
            if n < count:
                middle = study.force * study.pulse((n + 0.5) * size) * study.direction
                simulation.set_values(study.names.slave_force, middle)
                simulation.step(size)
        return {key: np.array(values) for key, values in found.items()}

    def at(self, times: np.ndarray, key: str) -> np.ndarray:
        """At any times in the window, by polynomials of degree seven through the eight points around."""
        place = np.clip(times / self.study.window * REFERENCE, 0, REFERENCE)
        first = np.clip(np.floor(place).astype(int) - 3, 0, REFERENCE - 7)
        s, values, result = place - first, self.values[key], 0.0
        for k in range(8):
            weight = np.ones_like(s)
            for m in range(8):
                if m != k:
                    weight = weight * (s - m) / (k - m)
            result = result + weight[:, None] * values[first + k]
        return result


# ------------------------------------------------------------------------------------------------------ charts and page

COLOURS = {"loads": "#b8860b", "full": "#b3402e", "split": "#1f5fa8", "spring-damper": "#3b7d4f"}
STYLES = {"held": "-", "linear": "--", "quadratic": ":"}
MARKERS = {"held": "o", "linear": "s", "quadratic": "^"}


def draw(rows: list[Row], folder: Path, name: str) -> Path:
    """Errors of velocities and loads and the power residual over H omega, PNG and SVG; returns the latter."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = name  # the same ids in every run
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D

    panels = [
        ("error_velocity", "error of the slaves' velocities"),
        ("error_force", "error of the loads on the masters"),
        ("power_residual_relative", "power residual"),
    ]
    figure, axes = plt.subplots(2, 2, figsize=(12, 9.5), sharex=True, layout="constrained")
    ways = [(reaction, style) for reaction in REACTIONS for style in EXTRAPOLATIONS]
    for place, (reaction, style) in enumerate(ways):
        own = [row for row in rows if (row.reaction, row.extrapolation) == (reaction, style)]
        good = [row for row in own if row.status == "stable"]
        look = {"marker": MARKERS[style], "markersize": 4, "color": COLOURS[reaction], "fillstyle": "none"}
        for axis, (key, _) in zip(axes.flat, panels):
            axis.plot(
                [row.step_omega for row in good],
                [getattr(row, key) for row in good],
                STYLES[style],
                linewidth=1.3,
                **look,
            )
        last = axes[1, 1]
        last.plot([row.step_omega for row in good], [place] * len(good), linestyle="", **look)
        bad = [row.step_omega for row in own if row.status != "stable"]
        last.plot(bad, [place] * len(bad), "x", color=COLOURS[reaction], markersize=6)
    for axis, (_, title) in zip(axes.flat, panels):
        axis.set(xscale="log", yscale="log", title=title, ylabel="relative L2 error  [1]")
        axis.grid(alpha=0.3)
    axes[1, 0].set_ylabel("rms of the residual / rms of the power  [1]")
    axes[1, 1].set_yticks(range(len(ways)), [f"{reaction}, {style}" for reaction, style in ways])
    axes[1, 1].set(title="stable (open) or not (cross)", ylim=(len(ways) - 0.5, -0.5))
    for axis in axes[1]:
        axis.set_xlabel(r"communication step  $H\,\omega$  [rad]")
    handles = [Line2D([], [], color=c, label=r) for r, c in COLOURS.items()]
    handles += [
        Line2D(
            [],
            [],
            color="black",
            linestyle=STYLES[s],
            marker=MARKERS[s],
            markersize=4,
            fillstyle="none",
            label=f"load {s}" if s == "held" else f"extrapolated, {s}",
        )
        for s in EXTRAPOLATIONS
    ]
    handles.append(Line2D([], [], color="black", marker="x", linestyle="", label="unstable or diverged"))
    figure.legend(handles=handles, ncol=4, loc="outside lower center", frameon=False)
    figure.suptitle(
        f"{rows[0].scene}: {rows[0].host} host, slaves {rows[0].mass_ratio:.3g} times as heavy as its masters"
    )
    for suffix in ("png", "svg"):
        figure.savefig(
            folder / f"{name}.{suffix}", dpi=130, metadata={"Software": None} if suffix == "png" else {"Date": None}
        )
    plt.close(figure)
    return folder / f"{name}.svg"


INTRO = [
    "The packaged FMU runs under FMPy; the other side is a host in NumPy that carries the driven masters as point "
    f"masses. They stand on ground springs of {OMEGA:g} rad/s (or of the highest frequency of the scene's own springs) "
    f"with {100 * ZETA:g} % damping, unless the host is rigid. Between communication points it solves its own "
    "equations exactly under the tie's last load - held, or extrapolated linearly or quadratically - so the error is "
    "that of the coupling. Smooth pulses act on the slaves; the exact solution is the monolithic system.",
    "'loads' is lumped, so its error cannot fall below that of lumping. 'spring-damper' exchanges a force: the slaves "
    "weigh nothing and hang on springs and dampers inside the FMU. The power residual is sum f.v at a communication "
    "point with the load that the host has used, minus with the load that the tie answers there.",
]


def section(study: Study, rows: list[Row], figure: Path) -> page.Section:
    return page.Section(
        study.source.name,
        [verdict(rows)],
        [("Error over communication step", figure)],
        list(Row.__dataclass_fields__),
        [list(asdict(row).values()) for row in rows],
    )


def verdict(rows: list[Row]) -> str:
    """Largest stable step of each reaction and extrapolation."""
    words = []
    for reaction in REACTIONS:
        for style in EXTRAPOLATIONS:
            own = [row for row in rows if (row.reaction, row.extrapolation) == (reaction, style)]
            good = [row.step_omega for row in own if row.status == "stable"]
            if own:
                words.append(
                    f"{reaction}, {style}: "
                    + (f"stable up to H omega = {max(good):.3g}" if good else "unstable at every step")
                )
    return "; ".join(words) + "."
