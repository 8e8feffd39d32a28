"""The model that a command is given: a scene, or an FMU."""

import contextlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .arguments import existing, is_fmu
from .decks import is_deck
from .loading import load
from .package import build
from .report import of_each_kind, report
from .scene import Scene


def show_warnings(file: str, found: dict) -> None:
    """The warnings of a report, on stderr."""
    for line in of_each_kind(found["warnings"], 10, f": tiefmu info {file} --json"):
        print(f"warning: {file}: {line}", file=sys.stderr)


def places(scene: Scene) -> list[str]:
    """What exposes the positions of all that the scene has, where they are no inputs."""
    shown = {block["name"] for block in scene.start.variables}
    kinds = {name.split(".")[0] for name in shown} & {"master", "slave", "point"}
    return [f"{kind}.r" for kind in sorted(kinds) if f"{kind}.r" not in shown]


@contextlib.contextmanager
def fmu_of(model: str, positions: bool = False) -> Iterator[Path]:
    """The FMU, or that of the scene, whose warnings are shown; in a temporary folder. positions: a scene exposes where
    its nodes are."""
    if is_fmu(model):
        yield existing(model)
        return
    with tempfile.TemporaryDirectory(prefix="tiefmu-") as folder:
        scene = load(model)
        if positions and not is_deck(Path(model)):
            scene = load(model, places(scene))
        fmu = build(scene, Path(folder) / f"{scene.name}.fmu")
        show_warnings(model, report(scene))
        yield fmu
