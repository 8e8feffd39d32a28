"""Which way of coupling is stable and right for a given host: its point in the stability map."""

from dataclasses import dataclass

import numpy as np

from ..errors import UsageError
from ..scene import MOTIONS, Assembly
from . import ports
from .stability_map import BY_NAME, MODES, Point, point
from .variants import Source, Variant

ALIKE = 2.0  # errors of coupling closer than this factor count as equal; then the simpler mode wins


@dataclass
class Ratios:
    """Mass that the tie adds over the host's, theory 5; inf where the host has none. full: largest eigenvalue of
    M^-1 T^T M_s T; carried: of M^-1 D."""

    full: float
    carried: float

    @property
    def largest(self) -> float:
        return max(self.full, self.carried)


def ratios(source: Source) -> Ratios:
    """Of a scene with driven nodes, whose masses are the host's; the nodes of a port are one body."""
    scene = source.build(Variant())
    nodes, simulation = scene.model.report()["nodes"], scene.simulation()
    simulation.initialise(0.0)
    driven, rotating = np.flatnonzero(nodes["motion"] == MOTIONS.index("driven")), nodes["rotating"]
    unknowns = [("acceleration", i, k) for i in driven for k in range(3)]
    unknowns += [("angular_acceleration", i, k) for i in driven if i < rotating for k in range(3)]
    added = {"acceleration": scene.start.get("added_mass")}
    own = {"acceleration": nodes["mass"]}
    if rotating:
        added["angular_acceleration"], own["angular_acceleration"] = scene.start.get("added_inertia"), nodes["inertia"]

    def reaction():
        loads = {"acceleration": simulation.get("reaction_force")}
        if rotating:
            loads["angular_acceleration"] = simulation.get("reaction_moment")
        return np.array([loads[field][i, k] for field, i, k in unknowns])

    zero, columns = reaction(), []
    for field, i, k in unknowns:
        a = np.zeros((len(nodes["id"]) if field == "acceleration" else rotating, 3))
        a[i, k] = 1.0
        simulation.set(field, a)
        columns.append(zero - reaction())
        simulation.set(field, 0 * a)
    bodies = ports.rigid(source.own, nodes["id"][driven].tolist(), (driven < rotating).tolist())
    mass, carried = (
        bodies.T @ (np.array([values[field][i] for field, i, _ in unknowns])[:, None] * bodies)
        for values in (own, added)
    )
    return Ratios(largest(bodies.T @ np.array(columns).T @ bodies, mass), largest(carried, mass))


def largest(tied: np.ndarray, own: np.ndarray) -> float:
    """Eigenvalue of own^-1 tied, where something is tied; inf where the host has no mass there."""
    used = np.abs(tied).max(axis=0) > 1e-12 * max(np.abs(tied).max(initial=0.0), 1e-300)
    if not used.any():
        return 0.0
    own = own[np.ix_(used, used)]
    if np.linalg.matrix_rank(own, hermitian=True) < len(own):
        return np.inf
    return float(np.abs(np.linalg.eigvals(np.linalg.solve(own, tied[np.ix_(used, used)]))).max())


def frequency(source: Source, stiffness: float | None) -> float:
    """rad/s, of the stiffest driven master on its spring in the host. stiffness: N/m; None: the scene's own. Raises
    UsageError where none is known."""
    nodes = source.scene.model.report()["nodes"]
    driven = (nodes["motion"] == MOTIONS.index("driven")) & (nodes["master"] > 0)
    if stiffness is None:
        assembly = Assembly(source.tables.model_copy(deep=True), source.folder)
        given = dict(zip(assembly.mesh.node_id.tolist(), assembly.values["stiffness"].tolist()))
        springs = np.array([given[node] for node in nodes["id"][driven].tolist()])
    else:
        springs = np.full(int(driven.sum()), stiffness)
    if not springs.any():
        raise UsageError(
            f"{source.file}: no stiffness of the host is known; give --host-stiffness, or stiffness in a [[node]] table"
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sqrt(np.nanmax(springs / nodes["mass"][driven])))


@dataclass
class Verdict:
    """step: s; ratio, step_omega: the point in the map; points: of every mode; chosen: the simplest within the
    tolerance, else the simplest green one about as good as the best (None: there is none); green_step: the largest
    step, halved from `step`, at which one is green."""

    step: float
    ratio: float
    step_omega: float
    points: list[Point]
    chosen: Point | None
    green_step: tuple[float, str] | None = None

    def lines(self, tolerance: float) -> list[str]:
        lines = [
            f"host: step {self.step:.4g} s, H omega = {self.step_omega:.3g}, tied mass over the host's r = "
            f"{self.ratio:.3g}"
        ]
        for p in self.points:
            words = f"error {p.error:.2g}" if p.stable else "unstable"
            lines.append(f"  {p.mode:<19} {words:<14} {'green' if p.green else ''}".rstrip())
        if self.chosen:
            above = "" if self.chosen.error <= tolerance else f", above the {tolerance:g} allowed"
            lines.append(
                f"reaction: {self.chosen.mode}, coupling error {self.chosen.error:.2g}{above}; the host has to: "
                f"{BY_NAME[self.chosen.mode].asks}"
            )
        else:
            lines.append("reaction: none is stable and right to 10 % at this step")
            if self.green_step:
                lines.append(f"  the first that is: {self.green_step[1]} at {self.green_step[0]:.3g} s")
        return lines


def judge(source: Source, step: float, stiffness: float | None, tolerance: float) -> Verdict:
    """Raises UsageError."""
    if not source.any_driven:
        raise UsageError(f"{source.file}: --host-step: no master is driven, so there is nothing for a host to move")
    ratio = ratios(source).largest
    if np.isinf(ratio):
        raise UsageError(
            f"{source.file}: --host-step: a driven master has no mass or inertia of its own, which the host must have; "
            "give mass and inertia in a [[node]] table"
        )
    ratio = max(ratio, 1e-6)
    omega = frequency(source, stiffness)
    points = [point(mode.name, ratio, step * omega) for mode in MODES]
    green = [p for p in points if p.green]
    within = [p for p in green if p.error <= tolerance]
    least = min((p.error for p in green), default=0.0)
    chosen = next(iter(within or [p for p in green if p.error <= ALIKE * least]), None)
    verdict = Verdict(step, ratio, step * omega, points, chosen)
    for halvings in range(1, 30) if chosen is None else []:
        h = step / 2**halvings
        found = next((mode.name for mode in MODES if point(mode.name, ratio, h * omega).green), None)
        if found:
            verdict.green_step = (h, found)
            break
    return verdict
