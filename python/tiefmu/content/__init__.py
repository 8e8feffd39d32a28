"""What an FMU carries beside model and binary (FMI 2.0.4, section 2.3): for people and for tools that connect FMUs.

Documentation page and licences, a picture, reference results, terminals.
"""

from importlib.metadata import distribution
from pathlib import Path

from ..scene import Scene
from .documentation import page
from .picture import Picture
from .reference_results import reference
from .terminals import array_terminals, terminals

LICENSES = Path(__file__).parents[1] / "licenses"


def content(scene: Scene, found: dict, step: float, fmi: int) -> dict[str, bytes]:
    """Path in the archive -> bytes. found: the scene's report; step: of the default experiment, s; fmi: 2 or 3."""
    picture = Picture(scene.model.report())
    files = {
        "documentation/index.html": page(scene, found, picture, fmi),
        "model.png": picture.png(),
        "terminalsAndIcons/terminalsAndIcons.xml": terminals(scene)
        if fmi == 2
        else array_terminals(found["interface"]),
    }
    files |= {f"documentation/licenses/{path.name}": path.read_bytes() for path in LICENSES.glob("*.txt")}
    files["documentation/licenses/tiefmu.txt"] = own_license().encode()
    return files | reference(scene, step)


def own_license() -> str:
    """The file LICENSE of the project, as installed."""
    text = distribution("tiefmu").read_text("licenses/LICENSE")
    assert text, "installed without its LICENSE"
    return text
