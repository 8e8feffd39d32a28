"""Where each method fails: the cases of the stability study, with their closed forms (theory 4 to 8)."""

import numpy as np

from .. import _core
from .._core import SceneError
from ..scene import load
from .limits import SQUARE, FreeRun, Limit, Value, coupled, plate

ITEMS = {
    "1": "mass ratio, reaction 'full'",
    "2": "mass ratio, reactions 'split' and 'loads'",
    "3": "spring-damper exchange, force held",
    "4": "integrators, lagged damping, penalty tie",
    "5": "nodal rule with an offset",
    "6": "orientation",
    "7": "spinning offset",
    "8": "outside the segment, nearly collinear masters",
}


def limits() -> list[Limit]:
    return [
        *full_limits(),
        *split_limits(),
        *exchange_limits(),
        *integrator_limits(),
        *hole_limits(),
        *geometry_limits(),
    ]


# --------------------------------------------------------------------------------------------------- 1: reaction "full"


def full_limits() -> list[Limit]:
    """r = m / 4 M, whatever the step: 1, 1/2, 1/(2^(k+1) - 1) (theory 5)."""
    schemes = [
        ("held", 0, False, 1.0),
        ("BDF2-differenced velocity", 0, True, 1 / 2),
        ("linear", 1, False, 1 / 3),
        ("quadratic", 2, False, 1 / 7),
    ]
    found = []
    for name, order, differenced, closed in schemes:
        for step in (1.0, 0.1, 0.01):

            def coupling(r, step=step, order=order, differenced=differenced):
                return coupled(plate(4 * r, "full"), "full", step, order, differenced)

            found.append(
                Limit(
                    "1",
                    f"{name}, H = {step:g} s",
                    "tied mass / host mass",
                    closed,
                    lambda r, c=coupling: c(r).growth(400) > 1,
                    lambda r, c=coupling: c(r).radius(),
                )
            )
    return found


# ------------------------------------------------------------------------------------- 2: reactions "split" and "loads"

RATIOS = [0.1, 1.0, 10.0, 1000.0]
OFFSET = {"place": (0.6, 0.5, 0.4), "formulation": "optimized"}


def split_limits() -> list[Limit]:
    """Two that must hold for `split` to be stable. What the host carries: with D' in place of D, D < M + D' (modes that
    the slave does not move). And damping: a load held for a step lags by H (r + 1/2), r = D/M, where the host's springs
    accelerate such a mode, which is negative damping: H omega < 2 zeta (1 + r) / (r (r + 1/2))."""
    found = []
    for r in (10.0, 1000.0):

        def carrying(share, r=r):
            return coupled(plate(4 * r, "split"), "split", 0.1, share=share * (r - 1) / r)

        found.append(
            Limit(
                "2",
                f"split, r = {r:g}, host carries D' instead of D",
                "(D - M) / D'",
                1.0,
                lambda x, c=carrying: c(1 / x).growth(400) > 1,
                lambda x, c=carrying: c(1 / x).radius(),
            )
        )
    for r, zeta in ((1.0, 0.02), (10.0, 0.05)):

        def sprung(step, r=r, zeta=zeta):
            return coupled(plate(4 * r, "split"), "split", step, omega=1.0, zeta=zeta)

        found.append(
            Limit(
                "2",
                f"split, r = {r:g}, sprung host, zeta = {zeta:g}",
                "H omega",
                2 * zeta * (1 + r) / (r * (r + 0.5)),
                lambda x, c=sprung: c(x).growth(4000) > 1,
                lambda x, c=sprung: c(x).radius(),
            )
        )
    return found


def split_values() -> list[Value]:
    """Rate at which the accelerations of host and tie settle: max D/(M+D) for `split`, at once for `loads`."""
    found = []
    for r in RATIOS:
        for name, kind in (("at the centre", {}), ("off the centre and the plane", OFFSET)):
            coupling = coupled(plate(4 * r, "split", **kind), "split", 0.1)
            rate = (coupling.tie.added / (coupling.tie.own + coupling.tie.added)).max()
            found.append(Value("2", f"split, r = {r:g}, slave {name}", "rate", rate, coupling.growth(60), 1e-3))
        found.append(
            Value("2", f"loads, r = {r:g}", "rate", 0.0, coupled(plate(4 * r, "loads"), "loads", 0.1).growth(60), 1e-12)
        )
    return found


# -------------------------------------------------------------------------------------------- 3: spring-damper exchange


def exchange(step: float, zeta: float):
    """Host of 4 kg, spring-damper of omega = 1 rad/s on the slave."""
    return coupled(plate(0.0, "loads", spring=(4.0, 8.0 * zeta)), "loads", step)


def exchange_limits() -> list[Limit]:
    return [
        Limit(
            "3",
            f"zeta = {zeta:g}",
            "H omega",
            min(4 * zeta, 1 / zeta),
            lambda x, z=zeta: exchange(x, z).growth(3000) > 1,
            lambda x, z=zeta: exchange(x, z).radius(),
        )
        for zeta in (0.1, 0.3, 0.5, 0.8, 2.0)
    ]


def held_value() -> list[Value]:
    """Without damping it grows at every step, by sqrt(1 + k H^2 / 2m)."""
    return [
        Value(
            "3",
            f"zeta = 0, H omega = {x:g}",
            "growth a step - 1",
            np.sqrt(1 + x**2 / 2) - 1,
            exchange(x, 0.0).growth(3000) - 1,
            0.02,
        )
        for x in (0.1, 0.5)
    ]


# ------------------------------------------------------------------------------------------------------- 4: integrators

METHODS = {"central-difference": 2.0, "symplectic-euler": 2.0, "noh-bathe": 3.74, "rk4": np.sqrt(8)}


def free_plate(slave_mass: float, method: str, damping: float = 0.0) -> FreeRun:
    """Four free masters of 1 kg on ground springs of 400 N/m, a slave in their middle; omega = 20 rad/s for tilts."""
    return FreeRun(
        load(
            {
                "mesh": {"nodes": [*SQUARE, [5, 0.5, 0.5, 0.0]], "segments": [[1, 1, 2, 3, 4]]},
                "node": [{"nodes": "all", "motion": "free", "mass": 1.0}, {"nodes": [5], "mass": slave_mass}],
                "tie": [{"name": "tie", "segments": "all", "slaves": [5]}],
                "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 400.0, "damping": damping}],
                "initial": [{"nodes": [1], "v": [0.3, 0.1, 1.0]}, {"nodes": [2], "v": [0.1, -0.2, -0.5]}],
                "model": {"inertia": "consistent", "geometry": "small"},
                "integrator": {"method": method},
            }
        )
    )


def penalty_plate(stiffness: float) -> FreeRun:
    """A massless slave at (0.4, 0.3) of a free quad, a spring between it and a mass of 0.7 kg at the same place."""
    return FreeRun(
        load(
            {
                "mesh": {"nodes": [*SQUARE, [5, 0.4, 0.3, 0.0], [6, 0.4, 0.3, 0.0]], "segments": [[1, 1, 2, 3, 4]]},
                "node": [
                    {"nodes": "all", "motion": "free", "mass": 1.0},
                    {"nodes": [5], "mass": 0.0},
                    {"nodes": [6], "mass": 0.7},
                ],
                "tie": [{"name": "tie", "segments": "all", "slaves": [5]}],
                "spring": [{"nodes": [5, 6], "kind": "bushing", "stiffness": stiffness}],
                "initial": [{"nodes": [6], "v": [0.3, 0.1, 1.0]}],
                "model": {"geometry": "small"},
            }
        )
    )


def integrator_limits() -> list[Limit]:
    found = []
    for method, closed in METHODS.items():
        run = free_plate(3.0, method)
        found.append(
            Limit(
                "4",
                method,
                "omega dt",
                closed,
                lambda x, r=run: r.grows(x / 20),
                lambda x, r=run: r.radius(x / 20),
                20 * run.limit,
            )
        )
    for zeta in (0.05, 0.2, 0.5, 1.0, 2.0):
        run = free_plate(0.0, "central-difference", 2 * zeta * 20)
        found.append(
            Limit(
                "4",
                f"central-difference, lagged damping, zeta = {zeta:g}",
                "omega dt",
                2 * (np.sqrt(1 + zeta**2) - zeta),
                lambda x, r=run: r.grows(x / 20),
                None,
                20 * run.limit,
            )
        )
    phi = _core.kernels.shape(4, -0.2, -0.4)
    for stiffness in (1e2, 1e6):
        run = penalty_plate(stiffness)
        found.append(
            Limit(
                "4",
                f"penalty tie, k = {stiffness:g} N/m",
                "dt, s",
                2 / np.sqrt(stiffness * (1 / 0.7 + np.sum(phi**2))),
                run.grows,
                run.radius,
                run.limit,
            )
        )
    return found


# -------------------------------------------------------------------------------------------- 5: hole in the nodal rule


def hole() -> FreeRun:
    """Default tie with an offset, masters without inertia of their own, a spring from slave to an equal free mass."""
    return FreeRun(
        load(
            {
                "mesh": {
                    "nodes": [
                        [1, -1, -1, 0],
                        [2, 1, -1, 0],
                        [3, 1, 1, 0],
                        [4, -1, 1, 0],
                        [5, 0, 0, 0.3],
                        [6, 1, 0, 0.3],
                    ],
                    "segments": [[1, 1, 2, 3, 4]],
                },
                "node": [
                    {"nodes": "all", "motion": "free", "rotations": True},
                    {"nodes": [5], "mass": 2.0},
                    {"nodes": [6], "mass": 2.0, "rotations": False},
                ],
                "tie": [{"name": "tie", "segments": "all", "slaves": [5]}],
                "spring": [{"nodes": [5, 6], "kind": "axial", "stiffness": 100.0}],
                "initial": [{"nodes": [6], "v": [1e-3, 0, 0]}],
                "model": {"geometry": "small"},
            }
        )
    )


def hole_limits() -> list[Limit]:
    run = hole()
    return [
        Limit(
            "5",
            "default, offset, massless masters",
            "dt / nodal step",
            np.sqrt(2 / 3),
            lambda x: run.grows(x * run.nodal),
            None,
            run.limit / run.nodal,
        )
    ]


def hole_values() -> list[Value]:
    """0.81 of the nodal step passes, 0.83 and the customary 0.9 diverge; the program's own limit is safe at 1.0. Grows
    is 1, does not 0."""
    run = hole()
    cases = [
        ("0.81 of the nodal step", 0.81 * run.nodal, 0),
        ("0.83 of the nodal step", 0.83 * run.nodal, 1),
        ("0.9 of the nodal step", 0.9 * run.nodal, 1),
        ("1.0 of the program's own limit", run.limit, 0),
    ]
    return [Value("5", case, "grows", expected, float(run.grows(step)), 0.0) for case, step, expected in cases]


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


VALUES = [split_values, held_value, hole_values, orientation_values, drift_values, clamp_values]
