"""Where each method fails: the cases of the stability study, with their closed forms (theory 4 to 8)."""

import numpy as np

from .. import _core
from ..loading import load
from .limits import SQUARE, FreeRun, Limit, Value, coupled, owned, plate
from .stability_geometry import clamp_values, drift_values, geometry_limits, orientation_values
from .stability_map import worst

ITEMS = {
    "1": "mass ratio, reaction 'full'",
    "2": "mass ratio, reactions 'split' and 'loads'",
    "3": "spring-damper exchange, force held",
    "4": "integrators, damping, penalty tie",
    "5": "nodal rule with an offset",
    "6": "orientation",
    "7": "spinning offset",
    "8": "outside the segment, nearly collinear masters",
    "9": "what couples heavy slaves",
}


def limits() -> list[Limit]:
    return [
        *full_limits(),
        *split_limits(),
        *exchange_limits(),
        *integrator_limits(),
        *hole_limits(),
        *geometry_limits(),
        *heavy_limits(),
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
                f"central-difference, damped, zeta = {zeta:g}",
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


# ----------------------------------------------------------------------------------------- 9: what couples heavy slaves


def heavy_limits() -> list[Limit]:
    """The FMU owns the masters: central difference whatever the mass ratio, theory (5.10). Leads on an undamped host,
    which takes longer to grow than a run lasts, theory (5.13)."""
    return [
        led(case, square, lead, inside)
        for case, square, lead, inside in (
            ("last change held too", 2 / 9, 1.0, 0.0),
            ("lead inside the FMU", 3 / 32, 0.0, 1.0),
        )
    ] + [
        Limit(
            "9",
            f"free, r = {r:g}, zeta = {zeta:g}",
            "H omega",
            2 * (np.sqrt(1 + zeta**2) - zeta),
            lambda x, r=r, z=zeta: owned(r, x, 1.0, z).growth(4000) > 1,
            lambda x, r=r, z=zeta: owned(r, x, 1.0, z).radius(),
        )
        for r, zeta in ((1.0, 0.02), (1000.0, 0.2))
    ]


def led(case: str, square: float, lead: float, inside: float) -> Limit:
    """square: of H omega, times r."""
    r = 100.0
    scene = plate(4 * r, "split", reaction_lead=inside)
    return Limit(
        "9",
        f"split, {case}, r = {r:g}, zeta = 0",
        "H omega",
        np.sqrt(square / r),
        None,
        lambda x: coupled(scene, "split", x, omega=1.0, lead=lead).radius(),
    )


def heavy_values() -> list[Value]:
    """Errors of the worst vibration's frequency, undamped host: theory (5.8), (5.9), (5.10)."""
    x, found = 1e-3, []
    for r in (1.0, 10.0, 100.0):

        def error(reaction, step, r=r, reaction_lead=0.0, **way):
            scene = plate(4 * r, reaction, reaction_lead=reaction_lead)
            return worst(coupled(scene, reaction, step, omega=1.0, **way).roots(), r, step, 0.0)

        for name, step, closed, measured in (
            ("full closed, held", x, x * r / (4 * np.sqrt(1 + r)), error("full", x, closed=True)),
            ("full closed, linear", 50 * x, 5 / 24 * r / (1 + r) * (50 * x) ** 2,
             error("full", 50 * x, order=1, closed=True)),
            ("split, last change held too", x, x * r / (4 * (1 + r)), error("split", x, lead=1.0)),
            ("split, lead inside the FMU", x / 10, x / 10 * r / (4 * (1 + r)),
             error("split", x / 10, reaction_lead=1.0)),
            ("free", 50 * x, (50 * x) ** 2 / 24, worst(owned(r, 50 * x, 1.0, 0.0).roots(), r, 50 * x, 0.0)),
        ):  # fmt: skip
            found.append(Value("9", f"{name}, r = {r:g}, H omega = {step:g}", "error", closed, measured, 0.05))
    return found


VALUES = [split_values, held_value, hole_values, orientation_values, drift_values, clamp_values, heavy_values]
