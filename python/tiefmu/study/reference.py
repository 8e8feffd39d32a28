"""Solutions to rounding: the solver's own RK4 on halved steps, extrapolated.

On a fixed grid of steps the global error of RK4 is a series h^4, h^5, h^6, ... Each halving of the step removes one
more term (Richardson, Romberg); what the last halving changed in the extrapolated values is the error estimate. Where
that stays above the tolerance, rounding is to blame - positions keep the digits of the mesh, and forces come from their
differences - and the estimate says so.
"""

import numpy as np

from .._core import Diverged, SceneError
from .driven import HeavyRun
from .motion import FreeRun, Trajectory

ORDERS = 4  # terms removed at most: h^4 .. h^7
LEVELS = 12  # halvings at most
MOST_STEPS = 5e5  # of one run


def solve(run: FreeRun | HeavyRun, tolerance: float) -> tuple[Trajectory, tuple[float, float]]:
    """The trajectory of a scene compiled with method "rk4", and the estimated relative errors of its velocities and
    loads. Stops where the velocities are within `tolerance`, or where halving no longer helps. Raises SceneError."""
    substeps = max(2, int(np.ceil(run.interval / (0.5 * run.limit)))) if run.limit < 1e29 else 2
    intervals, last = len(run.edges) - 1, []
    best, best_error = Trajectory(np.zeros(0), np.zeros(0)), (np.inf, np.inf)
    for level in range(LEVELS):
        if level > 3 and substeps * intervals > MOST_STEPS:
            break
        try:
            row = [run.trajectory(substeps)]
        except Diverged as why:
            raise SceneError(f"{run.scene.file}: the reference solution diverged: {why}") from None
        for order, coarser in enumerate(last[:ORDERS], 4):
            factor = 1 / (2.0**order - 1)
            row.append(
                Trajectory(row[-1].v + factor * (row[-1].v - coarser.v), row[-1].f + factor * (row[-1].f - coarser.f))
            )
        if last:
            error = row[-1].difference(last[-1])[:2]
            stagnates = level > 3 and error[0] > 0.5 * best_error[0]
            if error[0] < best_error[0]:
                best, best_error = row[-1], error
            if stagnates or error[0] <= tolerance:
                break
        last = row
        substeps *= 2
    return best, best_error
