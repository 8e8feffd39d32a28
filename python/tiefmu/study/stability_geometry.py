"""Cases of the stability study that geometry decides: orientation, spinning offsets, projections outside."""

import numpy as np

from .. import _core
from .._core import SceneError
from ..loading import load
from .limits import SQUARE, Limit, Value

# ------------------------------------------------------------------------------------------------------- 6: orientation

FRAMES = 1000


def row_sum(ibar: np.ndarray) -> float:
    """The rule that a well-known code uses in place of lambda: the largest row sum of Ibar^-1."""
    return float(np.linalg.inv(ibar).sum(axis=1).max())


def frames(count: int) -> list[np.ndarray]:
    """Random rotations, the same in every run."""
    rng, found = np.random.default_rng(5), []
    for _ in range(count):
        q, r = np.linalg.qr(rng.normal(size=(3, 3)))
        q = q * np.sign(np.diag(r))
        found.append(q * np.linalg.det(q))
    return found


def orientation_values() -> list[Value]:
    """A segment of 5:1 turned through FRAMES frames: (largest - smallest) / mean."""
    corners = np.array([[-2.5, -0.5, 0], [2.5, -0.5, 0], [2.5, 0.5, 0], [-2.5, 0.5, 0]])
    slave, spreads = np.array([0.7, 0.2, 0.5]), {"added mass": [], "limit": [], "row sum / lambda": []}
    for turn in frames(FRAMES):
        x = corners @ turn.T
        found = _core.kernels.node_inertia(x)
        spreads["row sum / lambda"].append(row_sum(found["ibar"]) / found["lambda"])
        scene = load(
            {
                "mesh": {
                    "nodes": [[k + 1, *p] for k, p in enumerate([*x.tolist(), (turn @ slave).tolist()])],
                    "segments": [[1, 1, 2, 3, 4]],
                },
                "node": [{"nodes": "all", "motion": "free", "mass": 0.1}, {"nodes": [5], "mass": 0.7, "inertia": 0.02}],
                "tie": [{"name": "tie", "segments": "all", "slaves": [5], "formulation": "optimized"}],
                "spring": [{"ground": [1, 2, 3, 4, 5], "kind": "bushing", "stiffness": 50.0}],
            }
        )
        spreads["added mass"].append(scene.start.get("added_mass")[0])
        spreads["limit"].append(scene.start.get("stable_time_step")[0])
    found = [
        Value(
            "6",
            f"{name} over {FRAMES} frames",
            "relative spread",
            0.0,
            float(np.ptp(spreads[name]) / np.mean(spreads[name])),
            tolerance,
        )
        for name, tolerance in (("added mass", 1e-12), ("limit", 1e-9))
    ]
    ratio = spreads["row sum / lambda"]
    # Theory 4: from 0.04 to 1.35 as the segment turns; a bound would never be below 1.
    return [
        *found,
        Value("6", "row-sum rule, smallest", "row sum / lambda", 0.04, float(min(ratio)), 0.1),
        Value("6", "row-sum rule, largest", "row sum / lambda", 1.35, float(max(ratio)), 0.1),
    ]


# --------------------------------------------------------------------------------------------------- 7: spinning offset


def spin_drift(theta: float, half: float, revolutions: int = 3) -> float:
    """Relative growth of the offset per revolution when its end is integrated from its velocity, with the part `half`
    of the centripetal term w x (w x d) h^2; theta: rotation per step, rad."""
    d, w = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, theta])
    steps = round(2 * np.pi / theta)
    for _ in range(revolutions * steps):
        turn = np.cross(w, d)
        d = d + turn + half * np.cross(w, turn)
    return float(np.log(np.linalg.norm(d)) / revolutions)


def program_drift(theta: float, revolutions: int) -> float:
    """The same of this program: a driven segment with rotations spinning about an oblique axis."""
    scene = load(
        {
            "mesh": {"nodes": [*SQUARE, [5, 0.3, 0.6, 0.5]], "segments": [[1, 1, 2, 3, 4]]},
            "node": [{"nodes": "all", "rotations": True, "mass": 1.0}],
            "tie": [{"name": "tie", "segments": "all", "slaves": [5]}],
            "interface": {"expose": ["drift"]},
        }
    )
    simulation = scene.simulation()
    simulation.initialise(0.0)
    simulation.set("spin", np.tile(2 * np.pi * np.array([1.0, 2.0, -2.0]) / 3, (4, 1)))
    steps = round(2 * np.pi / theta)
    for _ in range(steps * revolutions):
        simulation.step(1 / steps)
    return float(simulation.get("drift")[0]) / 0.5


def drift_values() -> list[Value]:
    found = []
    for parts in (50, 200):
        theta, name = 2 * np.pi / parts, f"{parts} steps a revolution"
        found += [
            Value("7", f"this program, {name}, after 100", "drift", 0.0, program_drift(theta, 100), 1e-12),
            Value("7", f"velocities integrated, {name}", "drift", np.pi * theta, spin_drift(theta, 0.0), 0.02),
            Value(
                "7",
                f"with half the centripetal term, {name}",
                "drift",
                np.pi / 4 * theta**3,
                spin_drift(theta, 0.5),
                0.02,
            ),
        ]
    return found


# ---------------------------------------------------------------------------- 8: outside the segment, collinear masters


def outside(xi: float, eta: float) -> dict:
    """Phi as it is and clamped, of a point above (xi, eta) of the unit square."""
    corners = np.array(SQUARE)[:, 1:]
    point = _core.kernels.shape(4, xi, eta) @ corners + [0, 0, 0.2]
    return _core.kernels.project(corners, point[None])


def refuses(aspect: float) -> bool:
    try:
        load(
            {
                "mesh": {
                    "nodes": [
                        [1, 0, 0, 0],
                        [2, aspect, 0, 0],
                        [3, aspect, 1, 0],
                        [4, 0, 1, 0],
                        [5, aspect / 2, 0.5, 0],
                    ],
                    "segments": [[1, 1, 2, 3, 4]],
                },
                "node": [{"nodes": "all", "mass": 1.0}],
                "tie": [{"name": "tie", "segments": "all", "slaves": [5], "formulation": "optimized"}],
            }
        )
    except SceneError as error:
        if "cond" not in str(error):
            raise
        return True
    return False


def geometry_limits() -> list[Limit]:
    """Masses m_i + Phi_i m_s turn negative past m_s/m_i = 1/|Phi_min|; cond(Ibar) = 1 + (a/b)^2 is refused past
    1e12."""
    found = []
    for xi, eta in ((1.5, 1.5), (1.3, 0.2), (1.1, 1.1)):
        phi = outside(xi, eta)["phi"][0]
        exact = _core.kernels.shape(4, xi, eta)
        found.append(
            Limit(
                "8",
                f"unclamped lumped mass at ({xi:g}, {eta:g})",
                "m_s / m_i",
                1 / abs(exact.min()),
                lambda r, phi=phi: bool((1 + r * phi).min() < 0),
            )
        )
    found.append(Limit("8", "cond(Ibar) of a rectangle", "a / b", np.sqrt(1e12 - 1), refuses))
    return found


def frequencies(inertia: str, projection: dict, slave_mass: float) -> np.ndarray:
    """Of four free masters of 1 kg on springs of 1 N/m, along z, rad/s ascending: from the accelerations that the
    solver answers unit displacements with."""
    corners = np.array(SQUARE)[:, 1:]
    slave = projection["phi"][0] @ corners
    simulation = load(
        {
            "mesh": {"nodes": [*SQUARE, [5, *slave.tolist()]], "segments": [[1, 1, 2, 3, 4]]},
            "node": [{"nodes": "all", "motion": "free", "mass": 1.0}, {"nodes": [5], "mass": slave_mass}],
            "tie": [{"name": "tie", "segments": "all", "slaves": [5], "search_distance": 10.0}],
            "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 1.0}],
            "model": {"inertia": inertia, "geometry": "small"},
        }
    ).simulation()
    simulation.initialise(0.0)
    answers = []
    for k in range(4):
        moved = corners.copy()
        moved[k, 2] += 1.0
        simulation.set("position", moved)
        answers.append(simulation.get("acceleration")[:, 2])
    return np.sqrt(np.sort(np.linalg.eigvals(-np.array(answers).T).real))


def clamp_values() -> list[Value]:
    """What the clamp costs: the error of the lowest of the masters' natural frequencies with lumped inertia against
    consistent inertia, a slave as heavy as the four masters. Only one mode moves the slave: 1/sqrt(1 + m_s Phi.Phi);
    lumped, the lowest is that of the master with the largest clamped share."""
    found = []
    for xi in (0.5, 1.0, 1.1, 1.3, 1.5):
        projection, mass = outside(xi, xi), 4.0
        phi, clamped = projection["phi"][0], projection["clamped"][0]
        measured = frequencies("lumped", projection, mass)[0] / frequencies("consistent", projection, mass)[0] - 1
        closed = np.sqrt((1 + mass * phi @ phi) / (1 + mass * clamped.max())) - 1
        found.append(
            Value(
                "8",
                f"lumping, clamped, at ({xi:g}, {xi:g})",
                "error of the lowest frequency",
                float(closed),
                float(measured),
                1e-6,
            )
        )
    return found
