"""The model that a command is given: a scene, or an FMU."""

import contextlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .arguments import existing, is_fmu
from .package import build
from .report import report
from .scene import load


def show_warnings(file: str, found: dict) -> None:
    """The warnings of a report, on stderr."""
    for line in found["warnings"]:
        print(f"warning: {file}: {line}", file=sys.stderr)


@contextlib.contextmanager
def fmu_of(model: str) -> Iterator[Path]:
    """The FMU, or that of the scene, whose warnings are shown; in a temporary folder."""
    if is_fmu(model):
        yield existing(model)
        return
    with tempfile.TemporaryDirectory(prefix="tiefmu-") as folder:
        scene = load(model)
        fmu = build(scene, Path(folder) / f"{scene.name}.fmu")
        show_warnings(model, report(scene))
        yield fmu
