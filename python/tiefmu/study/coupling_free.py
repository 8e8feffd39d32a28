"""A scene whose masters the solver owns beside a host of their springs: theory (5.10), for the coupling study."""

import time
from typing import TYPE_CHECKING

import numpy as np

from .._core import Diverged
from ..scene import Scene
from .hosts import FreeMasters
from .variants import EXACT_TOLERANCE, change

if TYPE_CHECKING:
    from .coupling_runs import Study


def scene(study: "Study") -> Scene:
    """The tie with masters of the host's masses that are free; their ground springs stay with the host."""
    tables = study.tables("full")
    change(tables.model, reaction="loads", position="integrated", solver_tolerance=EXACT_TOLERANCE)
    table = {node.nodes[0]: node for node in tables.node}
    for k, node in enumerate(study.node_ids):
        table[node].motion, table[node].mass = "free", float(study.own[3 * k])
    for k, node in enumerate(turning_ids(study)):
        table[node].inertia = float(study.own[study.translations + 3 * k])
    return study.source.compile(tables)


def turning_ids(study: "Study") -> list[int]:
    """Masters that turn."""
    return [study.node_ids[study.names.driven.index(number)] for number in study.names.turning]


class Owner:
    """The host of a scene from `scene`: forces from displacements, displacements from velocities."""

    def __init__(self, study: "Study", free: Scene, size: float):
        self.study, self.host = study, study.masses("full", 0 * study.own)
        nodes = free.model.report()["nodes"]
        place = {int(i): k for k, i in enumerate(nodes["id"])}
        self.rows = [place[i] for i in study.node_ids]
        self.turning = [place[i] for i in turning_ids(study)]
        n = study.translations
        springs = np.zeros((2, len(nodes["id"]), 3))
        springs[:, self.rows] = np.reshape([self.host.stiffness[:n], self.host.damping[:n]], (2, -1, 3))
        self.masters = FreeMasters(free, springs[0].ravel(), springs[1].ravel(), size)

    def motion(self) -> np.ndarray:
        """Velocities and spins of the masters by freedom."""
        simulation = self.masters.simulation
        v = simulation.get("velocity")[self.rows].ravel()
        return np.concatenate([v, simulation.get("spin")[self.turning].ravel()]) if self.turning else v

    def simulate(self, count: int):
        """As Study.simulate, a row a step: slaves' velocities in the middle of the step, loads at its start."""
        study, masters, simulation = self.study, self.masters, self.masters.simulation
        masters.restart()
        state, before, used = masters.rest(), np.zeros(len(study.own)), np.zeros(study.translations)
        velocity, load = np.empty((count, len(study.direction))), np.empty((count, len(study.own)))
        residual = np.zeros(count)
        bound = 1e6 * study.amplitude_velocity()
        start = time.process_time()
        for n in range(count):
            force = study.force * study.pulse(n * masters.size) * study.direction
            simulation.set_values(study.names.slave_force, force)
            sent = np.zeros(len(study.own))
            sent[: study.translations] = masters.force(state).reshape(-1, 3)[self.rows].ravel()
            residual[n] = (used - sent[: study.translations]) @ before[: study.translations]
            try:
                state = masters.following(state)
            except Diverged:
                return None
            after = self.motion()
            if not abs(after).max() < bound:
                return None
            velocity[n] = simulation.get_values(study.names.slave_velocity)
            load[n] = study.own * (after - before) / masters.size - sent
            before, used = after, sent[: study.translations]
        return velocity, load, residual, (time.process_time() - start) / study.window
