"""*TIE of an input file."""

import numpy as np

from ...mesh.abaqus_assembly import Scope
from ...mesh.abaqus_cards import Block
from ..choice import Choice
from ..model import Faces, Tie
from . import surfaces
from .source import Source

REFUSED = {
    "CYCLICSYMMETRY": "is one of cyclic symmetry", "MULTISTAGE": "is one between stages",
    "FLUIDPERIODIC": "is one of fluids", "FLUIDCYCLIC": "is one of fluids",
}  # fmt: skip
SHARE = {"Abaqus": 0.05, "CalculiX": 0.025}  # default tolerance, of the typical size


def read(source: Source, wanted: list[str] | None):
    """Fills deck.ties with those named in `wanted`, or all."""
    choice = Choice(source.deck, "*TIE", wanted)
    for number, (scope, block) in enumerate(source.cards("TIE"), 1):
        name = block.get("NAME") or f"tie {number}"
        if scope.name:
            name = f"{scope.name}.{name}"
        if not choice.wants(name, number):
            continue
        for option, why in REFUSED.items():
            if block.has(option):
                block.fail(f"tie '{name}' {why}; only ties of two surfaces of a structure can be imported")
        if not any(line.strip() for line in block.lines):
            block.fail(f"tie '{name}': names no surfaces")
        for line, items in block.rows():
            if any(items):
                choice.add(one(source, scope, block, name, line, items), line + 1)
    choice.finish()


def one(source: Source, scope: Scope, block: Block, name: str, line: int, items: list[str]) -> Tie:
    deck = source.deck
    if len(items) < 2 or not items[0] or not items[1]:
        block.fail(f"tie '{name}': expected two surfaces, the slave's and the master's", line)
    nodes, of_faces = surfaces.slaves(source, scope, items[0], block, line)
    faces = surfaces.masters(source, scope, items[1], block, line)
    said = ["default: the shape functions at the projection"]
    kind = block.get("TYPE", "NODE TO SURFACE").upper().replace(" ", "")
    if kind not in ("NODETOSURFACE", "SURFACETOSURFACE"):
        block.fail(f"tie '{name}': TYPE = {block.get('TYPE')} is not understood")
    if kind == "SURFACETOSURFACE":
        deck.warn(
            f"{block.where}: tie '{name}': SURFACE TO SURFACE is taken as NODE TO SURFACE: slaves follow the surface "
            "at their own projections"
        )
    chosen_nodes = None
    if block.get("TIED NSET"):
        chosen_nodes = source.nodes(scope, block.get("TIED NSET"), block)
        nodes = np.intersect1d(nodes, chosen_nodes)
    if not len(nodes):
        block.fail(f"tie '{name}': slave '{items[0]}' holds no nodes", line)
    if not len(faces):
        block.fail(f"tie '{name}': master '{items[1]}' holds no faces", line)
    adjust = adjusted(block, name)
    tie = Tie(name, nodes, faces, unresolved="drop", adjust=adjust, where=block.where)
    tie.slave_rotations = not block.has("NO ROTATION")
    if not tie.slave_rotations:
        said.append("NO ROTATION: the slaves' rotations are left out")
        if block.get("CONSTRAINT RATIO") not in ("1", "1.", "1.0"):
            deck.warn(
                f"{block.where}: tie '{name}': translations are tied at the slaves, as with CONSTRAINT RATIO 1, not "
                "in between"
            )
    tolerance(source, tie, block, chosen_nodes is not None, said)
    thick = deck.language == "Abaqus" and not block.has("NO THICKNESS")
    tie.thick_slaves = thick and of_faces
    counts = thick and (faces.thickness.any() or (tie.thick_slaves and thickness_at(source, nodes)))
    if counts:
        said.append("half the thicknesses of shells are no gap")
    else:
        tie.faces = Faces(faces.nodes, faces.element, faces.part, np.zeros(len(faces)))
        tie.thick_slaves = False
    if tie.search_distance is not None and (counts or adjust):
        tie.pairwise, tie.pairwise_more, tie.search_distance = (0.0, 0.5 if counts else 0.0), tie.search_distance, None
    said.append("ADJUST: slaves are moved to the surface" if adjust else "ADJUST = NO: slaves stay where they are")
    deck.notes.append(f"tie '{name}' ({block.at(line)}): " + "; ".join(said))
    return tie


def adjusted(block: Block, name: str) -> bool:
    word = block.get("ADJUST", "YES").upper()
    if word not in ("YES", "NO", ""):
        block.fail(f"tie '{name}': ADJUST = {word} is neither YES nor NO")
    return word != "NO"


def thickness_at(source: Source, nodes: np.ndarray) -> bool:
    """Whether any of the nodes belongs to a shell."""
    for kind, elements in source.deck.elements.items():
        if kind.startswith("shell") and np.isin(elements.nodes, nodes).any():
            return True
    return False


def tolerance(source: Source, tie: Tie, block: Block, all_nodes: bool, said: list[str]):
    """Sets search_distance: the given one, else a share of the typical size of the master's faces."""
    given = block.get("POSITION TOLERANCE")
    value = float(block.numbers(0, [given])[0]) if given else 0.0
    if not 0 <= value < np.inf:
        block.fail(f"tie '{tie.name}': POSITION TOLERANCE = {given} is no distance")
    if all_nodes:
        x = source.deck.position
        tie.search_distance, tie.unresolved = float(np.linalg.norm(np.ptp(x, axis=0))), "error"
        said.append("TIED NSET: its nodes are tied however far they are")
        return
    if value > 1e-10:
        tie.search_distance = value
        said.append(f"POSITION TOLERANCE {value:g}")
        return
    share, size = SHARE[source.deck.language], typical_size(source, tie.faces)
    tie.search_distance = share * size
    what = "mean diagonal of the faces" if source.deck.language == "Abaqus" else "typical size of the faces"
    said.append(f"default tolerance {tie.search_distance:.6g}: {share:.1%} of the {what}, {size:.6g}")


def typical_size(source: Source, faces: Faces) -> float:
    """Abaqus: mean diagonal of the faces (of triangles, longest side). CalculiX (gentiedmpc.f): mean distance of the
    centres of triangles from their sides; quads are two triangles."""
    four = np.where(faces.nodes < 0, faces.nodes[:, [2]], faces.nodes)
    x = source.deck.position[four]
    if source.deck.language == "Abaqus":
        diagonals = np.mean([np.linalg.norm(x[:, i] - x[:, i + 2], axis=1) for i in (0, 1)], axis=0)
        longest = np.max([np.linalg.norm(x[:, i] - x[:, (i + 1) % 3], axis=1) for i in range(3)], axis=0)
        return float(np.where(faces.nodes[:, 3] < 0, longest, diagonals).mean())
    quad = faces.nodes[:, 3] >= 0
    triangles = np.concatenate([x[:, [0, 1, 2]], x[quad][:, [0, 2, 3]]])
    sides = np.stack([triangles[:, i] - triangles[:, i - 1] for i in range(3)], axis=1)
    twice = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return float((twice[:, None] / np.linalg.norm(sides, axis=2) / 3).mean())
