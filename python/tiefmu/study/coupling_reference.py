"""The monolithic system that a coupling is compared with, solved to rounding."""

import itertools
from typing import TYPE_CHECKING

import numpy as np

from .. import schema
from .variants import EXACT_TOLERANCE, change

if TYPE_CHECKING:
    from .coupling_runs import Study

REFERENCE = 1000  # points of the reference


def relative(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


class Reference:
    """The monolithic system: the same scene with free masters of the host's masses on the host's springs, consistent
    inertia, Runge-Kutta. Pulses are held at their value in the middle of each step, which is of second order with even
    powers only, so four halvings extrapolate to eighth order; `error` is what the last extrapolation still changed."""

    def __init__(self, study: "Study", reaction: str):
        self.study = study
        tables = study.tables(reaction)
        tables.model.reaction, tables.model.inertia, tables.model.position = "loads", "consistent", "integrated"
        tables.model.solver_tolerance = EXACT_TOLERANCE
        if reaction == "spring-damper":
            tables.model.inertia = "lumped"  # of massless slaves: nothing to lump
        change(tables.integrator, method="rk4", time_step=0.0, safety=0.5)
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
        s, values = place - first, self.values[key]
        result = np.zeros((len(times), values.shape[1]))
        for k in range(8):
            weight = np.ones_like(s)
            for m in range(8):
                if m != k:
                    weight = weight * (s - m) / (k - m)
            result = result + weight[:, None] * values[first + k]
        return result
