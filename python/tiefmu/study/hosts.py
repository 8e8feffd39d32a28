"""A host that moves the driven masters of a tie, in NumPy: point masses on ground springs, with rotary inertia.

Between two communication points, H apart, the host integrates its own equations exactly under the tie's last known load
(held, or extrapolated through the last two or three loads), so that what is left is the error of the coupling alone.
Freedoms are the masters' translations, three each, then the rotations of those that turn; a state is an array of
(rows, freedoms): displacement, velocity, acceleration, then what the extrapolation remembers.
"""

import functools
from dataclasses import dataclass

import numpy as np

from .._core import Diverged
from ..scene import Scene
from .ties import Tie

EXTRAPOLATIONS = ["held", "linear", "quadratic"]  # by order


def exponential(matrix: np.ndarray) -> np.ndarray:
    """exp of small matrices (..., n, n): Taylor series of the matrix over 2^s, squared s times."""
    squarings = max(0, int(np.ceil(np.log2(max(np.abs(matrix).sum(axis=-1).max(), 1e-300)))) + 3)
    small, result = matrix / 2.0**squarings, np.eye(matrix.shape[-1])
    term = result
    for k in range(1, 18):
        term = term @ small / k
        result = result + term
    for _ in range(squarings):
        result = result @ result
    return result


@dataclass
class Masses:
    """What the host carries, per freedom: (M + D) u'' + damping u' + stiffness u = load. kg, N s/m, N/m, or the same of
    rotations."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    def propagator(self, step: float) -> np.ndarray:
        """(2, 5, freedoms): u and H u' after the step, from u, H u' and the coefficients of H^2 load/mass as a
        polynomial of degree two in (time / H)."""
        kinds, which = np.unique(
            np.column_stack([step**2 * self.stiffness, step * self.damping]) / self.mass[:, None],
            axis=0,
            return_inverse=True,
        )
        generator = np.zeros((len(kinds), 5, 5))
        generator[:, 0, 1] = generator[:, 1, 2] = 1  # u' = H u', (H u')' = ... + q(s)
        generator[:, 1, :2] = -kinds
        generator[:, 2, 3], generator[:, 3, 4] = 1, 2  # q0 + q1 s + q2 s^2, its derivatives at the running s
        return np.moveaxis(exponential(generator)[which.ravel()][:, :2], 0, -1)


class Exchange:
    """Host and FMU in turns, each H long. A state is (rows, freedoms); `watched`: the row that tells growth."""

    rows: int
    watched: int

    def __init__(self, step: float, freedoms: int):
        self.size, self.freedoms = step, freedoms

    def rest(self) -> np.ndarray:
        return np.zeros((self.rows, self.freedoms))

    def following(self, state: np.ndarray) -> np.ndarray:
        """The state H later, of motions about rest."""
        raise NotImplementedError

    def restart(self) -> None:
        """The FMU back to time 0."""
        raise NotImplementedError

    def prepare(self, state: np.ndarray) -> None:
        """Brings the FMU to a state that it has not come to by itself."""

    def carry(self, state: np.ndarray, following: np.ndarray, time: float) -> None:
        """Brings along what the FMU keeps beside the state. Raises Diverged."""

    def units(self) -> np.ndarray:
        """What turns each row of a state into a displacement."""
        raise NotImplementedError

    def matrix(self) -> np.ndarray:
        """The one-step map of small motions about rest, column by column through the FMU's own answers; it is the whole
        map where the FMU keeps nothing beside the state (small geometry, and positions as inputs or no springs)."""
        columns = []
        for k in range(self.rest().size):
            state = self.rest()
            state.flat[k] = 1.0
            self.prepare(state)
            columns.append(self.following(state).ravel())
        return np.array(columns).T

    def roots(self) -> np.ndarray:
        """Eigenvalues of the one-step map. Freedoms without springs drift, which is no growth: their displacement is
        left out."""
        matrix, n = self.matrix(), self.freedoms
        drifting = np.flatnonzero(np.abs(matrix[n:, :n]).max(axis=0) == 0)
        kept = np.setdiff1d(np.arange(len(matrix)), drifting)
        matrix = matrix[np.ix_(kept, kept)]
        weight = np.repeat(self.units(), n)[kept]
        return np.linalg.eigvals(matrix * weight[:, None] / weight)

    def radius(self) -> float:
        """Spectral radius of the one-step map."""
        return float(np.abs(self.roots()).max())

    def growth(self, steps: int, seed: int = 1) -> float:
        """Measured growth of the watched row per step, from the second to the last quarter of a run from a random
        state; infinite where it overflows, 0 where it vanishes. A run ends early where only rounding is left."""
        rng = np.random.default_rng(seed)
        self.restart()
        state = rng.normal(size=(self.rows, self.freedoms)) / self.units()[:, None]
        self.prepare(state)
        peaks, first = np.zeros(4), 0.0
        for k in range(steps):
            try:
                following = self.following(state)
                self.carry(state, following, k * self.size)
            except Diverged:
                return float(np.inf)
            state = following
            size = np.abs(state[self.watched]).max()
            if not size < 1e200:
                return float(np.inf)
            if k == 0:
                first = size
            if size <= 1e-9 * first:
                return float((size / first) ** (1 / k)) if first > 0 else 0.0
            peaks[4 * k // steps] = max(peaks[4 * k // steps], size)
        return float((peaks[3] / peaks[1]) ** (2 / steps)) if peaks[1] > 0 else 0.0


class Coupling(Exchange):
    """The tie answers the host's motion, the host moves on with that answer.

    order: 0 load held, 1 linear, 2 quadratic extrapolation. lead: what is held is the load and so much of its last
    change, by the host; the tie's own lead, theory (5.11), shows as two more rows of the state. closed: with reaction
    `full`, the load is that of the accelerations which it causes: one step of Newton's method with the tie's
    derivatives of its loads, theory (5.7). differenced: the acceleration that the tie gets is the second order backward
    difference (BDF2) of the velocities in place of the host's own. host: with the inertia that the tie's `reaction`
    asks the host to carry.
    """

    watched = 2  # accelerations

    def __init__(
        self,
        tie: Tie,
        host: Masses,
        step: float,
        order: int = 0,
        differenced: bool = False,
        lead: float = 0.0,
        closed: bool = False,
    ):
        super().__init__(step, len(host.mass))
        assert (order > 0) + differenced + bool(lead) + tie.leads <= 1  # the rows beyond the third are of one of them
        self.tie, self.host, self.order, self.differenced, self.lead = tie, host, order, differenced, lead
        self.shift = host.propagator(step)
        self.rows = 5 if differenced or tie.leads else 4 if lead else 3 + order
        self.closing = self.newton() if closed else None

    def restart(self):
        self.tie.restart()

    def prepare(self, state):
        if self.tie.leads:
            self.tie.remember(*state[3:])

    @functools.cached_property
    def still(self) -> np.ndarray:
        """The loads at rest."""
        return self.load(self.rest())

    def newton(self) -> np.ndarray:
        """What a gap between the tie's load and the one that the host has used adds to the load: J (M - J)^-1 with the
        derivatives J of loads by accelerations, which are affine in them."""
        jacobian = self.tie.derivatives()
        return jacobian @ np.linalg.inv(np.diag(self.host.mass) - jacobian)

    def load(self, state: np.ndarray) -> np.ndarray:
        """What the tie answers at this state."""
        u, v, a = state[:3]
        if self.differenced:
            a = (3 * v - 4 * state[3] + state[4]) / (2 * self.size)
        load = self.tie.move(u, v, a)
        if self.closing is None:
            return load
        used = self.host.mass * a + self.host.stiffness * u + self.host.damping * v
        return load + self.closing @ (load - used)

    def following(self, state: np.ndarray) -> np.ndarray:
        return self.advance(state, self.load(state) - self.still)[0]

    def carry(self, state, following, time):
        if self.tie.keeps_state:
            self.tie.carry((state[1] + following[1]) / 2, time, self.size)

    def advance(self, state: np.ndarray, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state H later, and the extrapolated load there."""
        u, v = state[0], state[1]
        scale = self.size**2 / self.host.mass
        s = self.shift
        used = load + self.lead * (load - state[3]) if self.lead else load
        end, once, twice = used, 0.0, 0.0
        if self.order == 1:
            once = load - state[3]
        elif self.order == 2:
            once = 1.5 * load - 2 * state[3] + 0.5 * state[4]
            twice = 0.5 * (load + state[4]) - state[3]
        following = np.empty_like(state)
        hv, q = self.size * v, scale * used
        following[0] = s[0, 0] * u + s[0, 1] * hv + s[0, 2] * q
        following[1] = s[1, 0] * u + s[1, 1] * hv + s[1, 2] * q
        if self.order:
            end = load + once + twice
            following[:2] += s[:, 3] * (scale * once) + s[:, 4] * (scale * twice)
        following[1] /= self.size
        following[2] = (end - self.host.stiffness * following[0] - self.host.damping * following[1]) / self.host.mass
        if self.differenced:
            following[3], following[4] = v, state[3]
        elif self.tie.leads:
            following[3], following[4] = state[2], state[2] - state[3]
        elif self.rows > 3:
            following[3] = load
            if self.order == 2:
                following[4] = state[3]
        return following, end

    def units(self) -> np.ndarray:
        """1, H, H^2, then of what is remembered: velocities, accelerations or loads."""
        one = self.size if self.differenced else self.size**2
        memory = [one if self.differenced or self.tie.leads else one / np.mean(self.host.mass)] * (self.rows - 3)
        return np.array([1, self.size, self.size**2, *memory])


class FreeMasters(Exchange):
    """The FMU owns the masters: it gets what the host's springs and dampers do to them at the displacements that the
    host has and the last velocities, and answers with the velocities after the step, with which the host moves its
    displacements on. This is central difference in two programs, theory (5.10)."""

    watched, rows = 1, 2  # displacements, velocities

    def __init__(self, scene: Scene, stiffness, damping, step: float):
        """stiffness, damping: of every node's ground spring, N/m and N s/m: numbers, or per freedom."""
        self.simulation = scene.simulation()
        self.simulation.initialise(0.0)
        super().__init__(step, self.simulation.get("velocity").size)
        self.stiffness, self.damping = stiffness, damping

    def restart(self):
        self.simulation.reset()
        self.simulation.initialise(0.0)

    def prepare(self, state):
        self.simulation.set("velocity", state[1])

    def force(self, state: np.ndarray) -> np.ndarray:
        """What the host sends."""
        return -self.stiffness * state[0] - self.damping * state[1]

    def following(self, state):
        self.simulation.set("node_force", self.force(state))
        self.simulation.step(self.size)
        after = self.simulation.get("velocity").ravel()
        return np.array([state[0] + self.size * after, after])

    def units(self):
        return np.array([1, self.size])
