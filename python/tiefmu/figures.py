"""What all charts share: matplotlib without a screen, and files that are the same in every run."""

from pathlib import Path
from typing import Any


def pyplot() -> Any:
    """matplotlib.pyplot; imported here, because that takes half a second."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot

    matplotlib.pyplot.rcParams["svg.hashsalt"] = "tiefmu"  # the same ids in every run
    return matplotlib.pyplot


def save(figure: Any, *paths: Path, dpi: int = 130) -> None:
    """Writes the figure to each path, PNG or SVG by its ending, without date and program; closes it. Raises OSError."""
    for path in paths:
        figure.savefig(path, dpi=dpi, metadata={"Date": None} if path.suffix == ".svg" else {"Software": None})
    pyplot().close(figure)
