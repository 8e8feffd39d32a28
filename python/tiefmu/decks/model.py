"""What a finite-element deck says, whatever its language: the readers fill it, to_scene.py turns it into a scene.

Numbers are in the units of the deck. Nodes are indices into `node_id`; sets, parts, properties and materials keep the
ids of the deck.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .._core import SceneError

# Nodes of one element: corners, then mid-side nodes. A shell4 or hex8 may repeat a node (a triangle, a wedge); a
# mid-side node of a tet10 may be -1, and so may the second node of a spring, which then ends at the ground.
KINDS = {
    "shell4": 4, "shell3": 3, "hex8": 8, "wedge6": 6, "tet4": 4, "tet10": 10, "spring": 2, "truss": 2, "beam": 2,
    "membrane4": 4, "membrane3": 3, "shell8": 8, "shell9": 9, "shell6": 6, "membrane8": 8, "membrane9": 9,
    "membrane6": 6, "hex20": 20, "wedge15": 15,
}  # fmt: skip
SHELLS = ("shell4", "shell3")
SOLIDS = ("hex8", "wedge6", "tet4", "tet10")
TURNING = (*SHELLS, "shell8", "shell9", "shell6", "beam")  # elements whose nodes rotate


@dataclass
class Elements:
    """Elements of one kind: id (n), nodes (n, KINDS[kind]), part (n, ids), thickness (n; of shells, 0: the part's);
    second_axis (n, 3): of beams, the side of their second axis, or None; a row of zeros: not given."""

    kind: str
    id: np.ndarray
    nodes: np.ndarray
    part: np.ndarray
    thickness: np.ndarray
    second_axis: np.ndarray | None = None


@dataclass
class Part:
    """property, material: ids, or 0; thickness: 0 where the property has it; name: how messages call it."""

    id: int
    title: str = ""
    property: int = 0
    material: int = 0
    thickness: float = 0.0
    where: str = ""
    name: str = ""

    def __post_init__(self):
        self.name = self.name or f"part {self.id}"


@dataclass
class Property:
    """kind: shell, solid, spring, truss, beam, void or other. values: see element_properties.py. type: in the deck."""

    id: int
    kind: str
    type: str = ""
    title: str = ""
    values: dict = field(default_factory=dict)
    where: str = ""


@dataclass
class Material:
    """density, young, poisson; damping: dm of shells where their property gives none, and the same always (None: the
    property's counts). void: no stiffness; per_area: the density is one per area, of the faces that solids join."""

    id: int
    law: str = ""
    title: str = ""
    density: float = 0.0
    young: float = 0.0
    poisson: float = 0.0
    damping: float = 0.0
    undamped: bool = False
    void: bool = False
    per_area: bool = False
    where: str = ""


@dataclass
class Faces:
    """Faces that make a surface: nodes (m, 4), -1 as a triangle's fourth; element ids and parts (m); thickness (m) as
    a tie's tolerance counts it: of a shell its own, of a solid volume over area."""

    nodes: np.ndarray = field(default_factory=lambda: np.empty((0, 4), np.int64))
    element: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    part: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    thickness: np.ndarray = field(default_factory=lambda: np.empty(0))

    def __len__(self) -> int:
        return len(self.nodes)

    def take(self, which: np.ndarray) -> "Faces":
        return Faces(self.nodes[which], self.element[which], self.part[which], self.thickness[which])

    @staticmethod
    def joined(faces: list["Faces"]) -> "Faces":
        """All of them, each set of nodes once, the first one's order of nodes kept."""
        if not faces:
            return Faces()
        keys = ("nodes", "element", "part", "thickness")
        found = Faces(*(np.concatenate([getattr(one, key) for one in faces]) for key in keys))
        _, first = np.unique(np.sort(found.nodes, axis=1), axis=0, return_index=True)
        return found.take(np.sort(first))


@dataclass
class Tie:
    """A tied interface. slaves: node indices; search_distance: None, the default of the language; pairwise: None, or
    (shares of the shorter diagonal and of the summed thicknesses): what is farther than the larger one, plus the
    length pairwise_more, is dropped. thick_slaves: whether the slaves' thickness counts there; slave_thickness: per
    node of the deck, or None: that of its shells. adjust: slaves are moved to the surface, thickness counted as in
    pairwise, or, with onto_middle, to its middle. hand_on_rotations: false where slaves pass no moment on;
    slave_rotations: false where those of slaves are not tied."""

    name: str
    slaves: np.ndarray
    faces: Faces
    formulation: str = "default"
    search: str = "box"
    search_distance: float | None = None
    unresolved: str = "error"
    pairwise: tuple[float, float] | None = None
    pairwise_more: float = 0.0
    thick_slaves: bool = True
    adjust: bool = False
    onto_middle: bool = False
    hand_on_rotations: bool = True
    slave_rotations: bool = True
    slave_thickness: np.ndarray | None = None
    where: str = ""


@dataclass
class Fixed:
    """Nodes whose motion is held: which of x, y, z (translations) and of the rotations about them."""

    nodes: np.ndarray
    translations: tuple[bool, bool, bool]
    rotations: tuple[bool, bool, bool]
    where: str = ""


@dataclass
class RigidBody:
    name: str
    main: int  # its main node, or -1
    nodes: np.ndarray
    where: str = ""


@dataclass
class Initial:
    nodes: np.ndarray
    v: np.ndarray | None = None
    w: np.ndarray | None = None
    where: str = ""


@dataclass
class Deck:
    """units: names of length, mass and time in the deck, or factors to m, kg and s.

    imposed: nodes whose motion the deck prescribes. frames: axes (3, 3, as rows) that springs name by id. lookup(name):
    nodes of a part or set, None where there is none. notes: what was decided and why; warnings: what the user should
    look at; ignored: keywords left aside, keyword -> [why, how often]. shape_lumping: masses of first-order elements by
    the integrals of their shape functions.
    """

    file: str
    language: str
    title: str = ""
    units: tuple = ("m", "kg", "s")
    node_id: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    position: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    elements: dict[str, Elements] = field(default_factory=dict)
    parts: dict[int, Part] = field(default_factory=dict)
    properties: dict[int, Property] = field(default_factory=dict)
    materials: dict[int, Material] = field(default_factory=dict)
    ties: list[Tie] = field(default_factory=list)
    added_mass: list[tuple[np.ndarray, float]] = field(default_factory=list)
    added_inertia: list[tuple[np.ndarray, float]] = field(default_factory=list)
    fixed: list[Fixed] = field(default_factory=list)
    imposed: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    rigid: list[RigidBody] = field(default_factory=list)
    initial: list[Initial] = field(default_factory=list)
    gravity: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    ignored: dict[str, list] = field(default_factory=dict)
    frames: dict[int, np.ndarray] = field(default_factory=dict)
    shape_lumping: bool = False
    lookup: Callable[[str], np.ndarray | None] = lambda name: None

    def nodes(self, ids, where: str) -> np.ndarray:
        """Indices of node ids (any shape); 0 gives -1. SceneError names the first that the deck does not have."""
        ids = np.asarray(ids, np.int64)
        index = self._find(ids)
        missing = (index < 0) & (ids != 0)
        if missing.any():
            span = f" (ids {self.node_id.min()}..{self.node_id.max()})" if len(self.node_id) else " (it has none)"
            raise SceneError(f"{where}: node {ids[missing].flat[0]} is not in the deck{span}")
        return index

    def _find(self, ids: np.ndarray) -> np.ndarray:
        if not len(self.node_id):
            return np.full(np.shape(ids), -1)
        if not hasattr(self, "_order"):
            self._order = np.argsort(self.node_id, kind="stable")
            self._sorted = self.node_id[self._order]
        place = np.minimum(np.searchsorted(self._sorted, ids), len(self.node_id) - 1)
        return np.where(self._sorted[place] == ids, self._order[place], -1)

    def merge_repeated_nodes(self, keyword: str, fail: Callable[[int, str], object]) -> np.ndarray:
        """The same node written twice, as includes do, is one node. fail(row, text): of one that is repeated elsewhere.
        Returns the rows that are kept."""
        rows = np.arange(len(self.node_id))
        order = np.argsort(self.node_id, kind="stable")
        twice = order[1:][self.node_id[order][1:] == self.node_id[order][:-1]]
        if not len(twice):
            return rows
        first = order[np.searchsorted(self.node_id[order], self.node_id[twice])]
        other = (self.position[first] != self.position[twice]).any(axis=1)
        if other.any():
            row = int(twice[other][0])
            fail(row, f"node {self.node_id[row]} is repeated at another place")
        self.notes.append(f"{keyword}: {len(twice)} nodes are written twice at the same place; they count once")
        kept = np.setdiff1d(rows, twice)
        self.node_id, self.position = self.node_id[kept], self.position[kept]
        self.__dict__.pop("_order", None)  # the index of node ids is of before
        return kept

    def warn(self, text: str):
        if text not in self.warnings:
            self.warnings.append(text)

    def part_values(self, parts: np.ndarray):
        """Part by part: yields (part, property or None, material or None, indices of its elements)."""
        ids, inverse = np.unique(parts, return_inverse=True)
        order = np.argsort(inverse, kind="stable")
        ends = np.cumsum(np.bincount(inverse, minlength=len(ids)))
        for number, members in zip(ids.tolist(), np.split(order, ends[:-1])):
            part = self.parts[number]
            yield part, self.properties.get(part.property), self.materials.get(part.material), members

    def thickness(self, elements: Elements) -> np.ndarray:
        """Of each shell: its own, else its part's, else its property's."""
        found = elements.thickness.copy()
        for part, prop, _, members in self.part_values(elements.part):
            own = part.thickness or (prop.values.get("thickness", 0.0) if prop else 0.0)
            found[members] = np.where(found[members] > 0, found[members], own)
        return found
