"""The model that a command is given: a scene, or an FMU."""

import contextlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .arguments import existing, is_fmu
from .loading import load
from .package import build
from .report import of_each_kind, report
from .scene import Scene


def show_warnings(file: str, found: dict) -> None:
    """The warnings of a report, on stderr."""
    for line in of_each_kind(found["warnings"], 10, f": tiefmu info {file} --json"):
        print(f"warning: {file}: {line}", file=sys.stderr)


@contextlib.contextmanager
def fmu_of(model: str, positions: bool = False) -> Iterator[tuple[Path, Scene | None]]:
    """The FMU; or that of a scene or deck, whose warnings are shown, in a temporary folder, and the scene. positions:
    the latter shows where its nodes are."""
    if is_fmu(model):
        yield existing(model), None
        return
    with tempfile.TemporaryDirectory(prefix="tiefmu-") as folder:
        scene = load(model, positions=positions)
        fmu = build(scene, Path(folder) / f"{scene.name}.fmu")
        show_warnings(model, report(scene))
        yield fmu, scene
