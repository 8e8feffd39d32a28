"""A picture of a run: one panel a quantity, a line a variable."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from . import figures

if TYPE_CHECKING:
    from fmpy.simulation import SimulationResult

LINES = 8  # most in a panel: those that move most
PANELS = 8  # most in a picture, in this order
ORDER = ["port", "slave", "master", "point", "energy", "power_residual", "drift"]


def plot(result: "SimulationResult", path: Path, title: str) -> None:
    """Writes a PNG of what `run` returned. Raises OSError."""
    units = {
        variable.name: variable.unit or (variable.declaredType and variable.declaredType.unit)
        for variable in result.modelDescription.modelVariables
    }
    panels = {}
    for name in result.dtype.names:
        if re.split(r"[.\[]", name)[0] in ORDER:
            quantity = "energy" if name.startswith("energy.") else re.sub(r"\[[^]]*\]", "", name)
            panels.setdefault(quantity, []).append(name)
    shown = sorted(panels.items(), key=lambda panel: ORDER.index(panel[0].split(".")[0]))[:PANELS]
    figure, axes = figures.pyplot().subplots(
        max(len(shown), 1),
        1,
        sharex=True,
        squeeze=False,
        figsize=(9, 1 + 2.2 * max(len(shown), 1)),
        layout="constrained",
    )
    for axis, (quantity, names) in zip(axes[:, 0], shown):
        names = sorted(names, key=lambda name: -np.ptp(result[name]))
        for name in names[:LINES]:
            axis.plot(result["time"], result[name], linewidth=1, label=name)
        axis.set_ylabel(f"{quantity} [{units[names[0]]}]")
        axis.grid(alpha=0.3)
        axis.legend(
            fontsize="x-small",
            loc="upper left",
            bbox_to_anchor=(1, 1),
            title=f"{LINES} of {len(names)}" if len(names) > LINES else None,
            title_fontsize="x-small",
        )
    axes[-1, 0].set_xlabel("time [s]")
    figure.suptitle(title)
    figures.save(figure, path, dpi=110)
