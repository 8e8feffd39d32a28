"""A picture of a run: one panel a quantity, a line a variable."""

import re
from pathlib import Path

import numpy as np

LINES = 8   # most in a panel: those that move most
PANELS = 8  # most in a picture


def plot(result: np.ndarray, path: Path, title: str, units: dict[str, str]):
    """Writes a PNG. result: as from `run`; units: variable name -> unit. Raises OSError."""
    import matplotlib  # here, because importing it takes half a second
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    panels = {}
    for name in result.dtype.names:
        if name != "time" and np.abs(result[name]).max() < 1e29:  # not a step that nothing limits
            panels.setdefault(re.sub(r"\[\d+\]", "", name), []).append(name)
    shown = list(panels.items())[:PANELS]
    figure, axes = plt.subplots(max(len(shown), 1), 1, sharex=True, squeeze=False,
                                figsize=(9, 1 + 2.2 * max(len(shown), 1)), layout="constrained")
    for axis, (quantity, names) in zip(axes[:, 0], shown):
        names = sorted(names, key=lambda name: -np.ptp(result[name]))
        for name in names[:LINES]:
            axis.plot(result["time"], result[name], linewidth=1, label=name)
        axis.set_ylabel(f"{quantity} [{units.get(names[0]) or '1'}]")
        axis.grid(alpha=0.3)
        axis.legend(fontsize="x-small", loc="upper left", bbox_to_anchor=(1, 1),
                    title=f"{LINES} of {len(names)}" if len(names) > LINES else None, title_fontsize="x-small")
    axes[-1, 0].set_xlabel("time [s]")
    figure.suptitle(title)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
