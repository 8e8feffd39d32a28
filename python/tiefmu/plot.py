"""A picture of a run: one panel a quantity, a line a variable."""

import re
from pathlib import Path

from . import figures
from .errors import UsageError
from .results import Result

LINES = 8  # most in a panel: those that move most
PANELS = 8  # most in a picture, in this order
PICTURES = (".png", ".svg")
ORDER = ["port", "slave", "master", "point", "energy", "power_residual", "drift"]


def check_picture(path: Path) -> None:
    """Raises UsageError where the ending says no format."""
    if path.suffix.lower() not in PICTURES:
        raise UsageError(f"{path}: pictures are written as {', '.join(PICTURES)}; the ending chooses")


def plot(result: Result, path: Path, title: str) -> None:
    """Writes a picture of what `run` returned. Raises OSError."""
    panels: dict[str, list[str]] = {}
    for name in result.names:
        if re.split(r"[.\[]", name)[0] in ORDER:
            quantity = "energy" if name.startswith("energy.") else re.sub(r"\[[^]]*\]", "", name)
            panels.setdefault(quantity, []).append(name)
    shown = sorted(panels.items(), key=lambda panel: ORDER.index(panel[0].split(".")[0]))[:PANELS]
    if len(panels) > PANELS:
        title += f" ({PANELS} of {len(panels)} quantities)"
    if result.every > 1:
        title += f" (every {result.every}th row)"
    moved = dict(zip(result.names, (result.high - result.low)[1:].tolist()))
    figure, axes = figures.pyplot().subplots(
        max(len(shown), 1),
        1,
        sharex=True,
        squeeze=False,
        figsize=(9, 1 + 2.2 * max(len(shown), 1)),
        layout="constrained",
    )
    for axis, (quantity, names) in zip(axes[:, 0], shown):
        names = sorted(names, key=lambda name: -moved[name])
        for name in names[:LINES]:
            axis.plot(result["time"], result[name], linewidth=1, label=name)
        axis.set_ylabel(f"{quantity} [{result.units[names[0]]}]")
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
