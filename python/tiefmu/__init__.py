"""Tied interfaces between meshes as FMI 2.0 and 3.0 co-simulation units.

scene = tiefmu.load("weld.toml")     # or a dict of the same shape; raises SceneError
tiefmu.report(scene)                 # what became of it, as a dict
tiefmu.build(scene, "weld.fmu")      # the FMU
simulation = scene.simulation()      # the same in this process, on NumPy arrays

Errors, each with one line that names the place: SceneError (of `load`, and of a simulation that cannot start),
UsageError (of `build`: a file that cannot be written), Diverged and StepTooLong (of Simulation.step).
"""

from importlib.metadata import version

from ._core import Simulation
from .errors import Diverged, RunError, SceneError, StepTooLong, UsageError
from .loading import load
from .package import build
from .report import report
from .scene import Scene

__version__ = version("tiefmu")
__all__ = [
    "Diverged",
    "RunError",
    "Scene",
    "SceneError",
    "Simulation",
    "StepTooLong",
    "UsageError",
    "build",
    "load",
    "report",
]
