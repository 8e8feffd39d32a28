"""Tied interfaces between meshes as FMI 2.0 co-simulation units.

scene = tiefmu.load("weld.toml")     # or a dict of the same shape; raises SceneError
tiefmu.report(scene)                 # what became of it, as a dict
tiefmu.build(scene, "weld.fmu")      # the FMU
simulation = scene.simulation()      # the same in this process, on NumPy arrays
"""

from importlib.metadata import version

from ._core import SceneError, Simulation
from .package import build
from .report import report
from .scene import Scene, load

__version__ = version("tiefmu")
__all__ = ["Scene", "SceneError", "Simulation", "build", "load", "report"]
