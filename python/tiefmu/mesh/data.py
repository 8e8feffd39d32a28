"""Nodes, segments and sets of a scene, on arrays; what a mesh file gives, and what ties ask for."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from .._core import SceneError
from ..schema import suggestion
from . import faces
from .faces import CORNERS


@dataclass
class Block:
    """Elements of one kind. shape: a key of CORNERS, or anything else for what has no faces (lines, points, ...).
    ids (n). nodes (n, k): node ids, corners first, then mid-side nodes; 0 stands for none."""

    shape: str
    ids: np.ndarray
    nodes: np.ndarray


class Sets:
    """Named sets. A set that cannot be resolved holds a SceneError, raised by who asks for it.
    any_case: names compare without case."""

    def __init__(self, any_case: bool = False):
        self.any_case = any_case
        self._values: dict[str, tuple[str, object]] = {}  # key -> name as first written, value

    def key(self, name: str) -> str:
        return name.upper() if self.any_case else name

    def __contains__(self, name: str) -> bool:
        return self.key(name) in self._values

    def __iter__(self) -> Iterator[str]:
        return (name for name, _ in self._values.values())

    def __getitem__(self, name: str):
        value = self._values[self.key(name)][1]
        if isinstance(value, SceneError):
            raise value
        return value

    def __setitem__(self, name: str, value):
        key = self.key(name)
        self._values[key] = self._values[key][0] if key in self._values else name, value


@dataclass
class MeshFile:
    """What a reader hands on. Rows count the elements through all blocks, from 0.

    node_sets: name -> node ids. element_sets: name -> rows. face_sets: name -> (rows, faces), two arrays: faces of
    solids as numbered in faces.py, 0 for those that no other solid of the file shares; of triangles and quads, which
    are one face each, the number is not looked at. own_ids: False where the format has none. instances: of an Abaqus
    assembly, name in upper case -> what was added to its ids."""

    node_id: np.ndarray
    position: np.ndarray
    blocks: list[Block] = field(default_factory=list)
    node_sets: Sets = field(default_factory=Sets)
    element_sets: Sets = field(default_factory=Sets)
    face_sets: Sets = field(default_factory=Sets)
    own_ids: bool = True
    notes: list[str] = field(default_factory=list)
    instances: dict[str, int] = field(default_factory=dict)


class Mesh:
    """node_id (n), position (n, 3) in the units of the file; segment_id (m), segments (m, 4): node indices, a
    triangle's fourth is -1; second_order (m): only the corner nodes of the segment's element are in it.
    notes, warnings: remarks of the reading.

    Segments are the triangles and quads of file and scene; faces of solids join them when a tie asks for them."""

    def __init__(self):
        self.node_id = np.empty(0, np.int64)
        self.position = np.empty((0, 3))
        self.segment_id = np.empty(0, np.int64)
        self.segments = np.empty((0, 4), np.int32)
        self.second_order = np.empty(0, bool)
        self.notes: list[str] = []
        self.warnings: list[str] = []
        self.file = ""
        self.content = MeshFile(self.node_id, self.position)
        self.element_id = np.empty(0, np.int64)  # per row
        self.block_of = np.empty(0, int)  # per row
        self.first_row = np.empty(0, int)  # per block
        self.segment_of = np.empty(0, int)  # per row: index of the triangle's or quad's segment, -1 for other elements
        self.face_keys = np.empty(0, np.int64)  # of segments that are faces of solids, the last ones: row * 8 + face

    # what is in it

    def add_nodes(self, ids, position):
        """Appends nodes: ids (n), position (n, 3)."""
        self.node_id = np.concatenate([self.node_id, np.asarray(ids, np.int64)])
        self.position = np.concatenate([self.position, np.asarray(position, float).reshape(-1, 3)])
        if self.node_id.min(initial=1) < 1:
            raise SceneError(f"node {self.node_id.min()}: ids start at 1")
        refuse_repeated("node", self.node_id)

    def add_segments(self, ids, node_ids, second_order=False):
        """Appends segments: ids (n), node_ids (n, 4). A quad whose fourth node is 0, or its third again, is a
        triangle; one that repeats another node is kept as it is, and named."""
        node_ids = np.array(node_ids, np.int64).reshape(-1, 4)
        ids = np.asarray(ids, np.int64)
        if ids.min(initial=1) < 1:
            raise SceneError(f"segment {ids.min()}: ids start at 1")
        node_ids[node_ids[:, 3] == node_ids[:, 2], 3] = 0
        nodes = find(self.node_id, node_ids)
        missing = np.argwhere((nodes < 0) & ((node_ids != 0) | (np.arange(4) < 3)))
        if len(missing):
            row, column = missing[0]
            raise SceneError(f"segment {ids[row]}: node {node_ids[row, column]} is not in the mesh{span(self.node_id)}")
        self.append_segments(ids, nodes, second_order)
        ordered = np.sort(nodes, axis=1)
        repeating = ids[(ordered[:, 1:] == ordered[:, :-1]).any(axis=1)]
        if len(repeating):
            self.notes.append(f"mesh: segments that repeat a node, which no tie can use: {listed(repeating)}")

    def append_segments(self, ids, nodes, second_order):
        self.segment_id = np.concatenate([self.segment_id, ids])
        self.segments = np.concatenate([self.segments, nodes.astype(np.int32)])
        self.second_order = np.concatenate([self.second_order, np.broadcast_to(second_order, len(ids))])
        refuse_repeated("segment", self.segment_id)

    def take(self, file: MeshFile, name: str):
        """Puts the content of a file into the empty mesh; `name` is how messages call the file."""
        self.content, self.file = file, name
        self.add_nodes(file.node_id, file.position)
        sizes = [len(block.ids) for block in file.blocks]
        self.first_row = np.cumsum([0, *sizes])[:-1]
        self.block_of = np.repeat(np.arange(len(sizes)), sizes)
        self.element_id = np.concatenate([np.empty(0, np.int64), *(block.ids for block in file.blocks)])
        self.segment_of = np.full(len(self.element_id), -1)
        ids, nodes, second = [np.empty(0, np.int64)], [np.empty((0, 4), np.int64)], [np.empty(0, bool)]
        count = 0
        for block, start in zip(file.blocks, self.first_row):
            if block.shape in ("triangle", "quad"):
                corners, n = CORNERS[block.shape], len(block.ids)
                self.segment_of[start : start + n] = np.arange(count, count + n)
                ids.append(block.ids)
                nodes.append(np.pad(block.nodes[:, :corners], ((0, 0), (0, 4 - corners))))
                second.append(np.full(n, block.nodes.shape[1] > corners))
                count += n
        self.add_segments(np.concatenate(ids), np.concatenate(nodes), np.concatenate(second))
        self.notes += [f"mesh: {name}: {note}" for note in file.notes]
        if not file.own_ids:
            self.warnings.append(f"mesh: {name}: has no ids: nodes and segments are numbered from 1 in file order")

    # what a table of the scene asks for

    def select_nodes(self, where: str, wanted) -> np.ndarray:
        """Indices of the nodes that "all", a set's name or a list of ids means: sorted, or as listed."""
        if isinstance(wanted, list):
            index = find(self.node_id, np.array(wanted, np.int64))
            if (index < 0).any():
                missing = wanted[int(np.argmax(index < 0))]
                raise SceneError(f"{where}: node {missing} is not in the mesh{span(self.node_id)}")
            return index
        if wanted == "all":
            return np.arange(len(self.node_id))
        file = self.content
        try:
            if wanted in file.node_sets:
                index = self.nodes_of_ids(file.node_sets[wanted])
            elif wanted in file.element_sets:
                index = self.nodes_of_ids(self.nodes_of_rows(file.element_sets[wanted]))
            elif wanted in file.face_sets:
                faces_of_set = self.segments_of_faces(*file.face_sets[wanted])  # may add to self.segments
                index = np.unique(self.segments[faces_of_set])
                index = index[index >= 0]
            else:
                instance, _, number = wanted.rpartition(".")
                offset = file.instances.get(instance.upper())
                if offset is None or not number.isdecimal() or len(number) > 18:
                    known = suggestion(wanted, {*file.node_sets, *file.element_sets, *file.face_sets})
                    known = known or "; it has no sets of nodes: give ids or 'all'"
                    raise SceneError(f"{where}: the mesh has no set '{wanted}'{known}") from None
                index = self.nodes_of_ids(np.array([int(number) + offset]))
        except SceneError as error:
            raise self.in_set(where, wanted, error) from None
        if not len(index):
            raise SceneError(f"{where}: the set '{wanted}' holds no node")
        return index

    def select_segments(self, where: str, wanted) -> np.ndarray:
        """Indices of the segments that "all", a set's name or a list of ids means. Of "all", and of a set of
        elements, these are the triangles and quads; where it has none, the outer faces of its solids."""
        if isinstance(wanted, list):
            return self.segments_of_ids(where, wanted)
        file, plain = self.content, len(self.segment_id) - len(self.face_keys)
        try:
            if wanted == "all":
                index, solids = np.arange(plain), self.solid_rows(np.arange(len(self.element_id)))
                if not plain:
                    index = self.outer_faces(solids)
            elif wanted in file.face_sets:
                index, solids = self.segments_of_faces(*file.face_sets[wanted]), np.empty(0, int)
            elif wanted in file.element_sets:
                rows = file.element_sets[wanted]
                index, solids = self.segment_of[rows], self.solid_rows(rows)
                index = np.unique(index[index >= 0])
                if not len(index):
                    index = self.outer_faces(solids)
            elif wanted in file.node_sets:
                raise SceneError(f"{where}: '{wanted}' is a set of nodes, not of segments")
            else:
                known = suggestion(wanted, {*file.element_sets, *file.face_sets})
                known = known or "; it has no sets of segments: give ids or 'all'"
                raise SceneError(f"{where}: the mesh has no set '{wanted}'{known}")
        except SceneError as error:
            raise self.in_set(where, wanted, error) from None
        if not len(index):
            none = "the mesh has no segments" if wanted == "all" else f"the set '{wanted}' holds no segment"
            raise SceneError(f"{where}: {none}")
        if len(solids) and index.max() < plain:
            self.notes.append(
                f"{where}: '{wanted}' means its {len(index)} triangles and quads, not the faces of its "
                f"{len(solids)} solids"
            )
        return index

    def in_set(self, where: str, name: str, error: SceneError) -> SceneError:
        """The error as it is if it names the table already, else with the file and the set that it comes from."""
        words = str(error)
        return error if words.startswith(where) else SceneError(f"mesh: file: {self.file}: set '{name}': {words}")

    def nodes_of_ids(self, ids: np.ndarray) -> np.ndarray:
        ids = np.unique(ids)
        index = find(self.node_id, ids)
        if (index < 0).any():
            raise SceneError(f"node {ids[index < 0][0]} is not in the file")
        return np.unique(index)

    def nodes_of_rows(self, rows: np.ndarray) -> np.ndarray:
        """Ids of the nodes of elements, mid-side nodes too."""
        found = [np.empty(0, np.int64)]
        for number, block in enumerate(self.content.blocks):
            found.append(block.nodes[rows[self.block_of[rows] == number] - self.first_row[number]].ravel())
        ids = np.unique(np.concatenate(found))
        return ids[ids != 0]

    # segments that are faces of solids

    def solid_rows(self, rows: np.ndarray) -> np.ndarray:
        solid = np.array([block.shape in faces.FACES for block in self.content.blocks], bool)
        return rows[solid[self.block_of[rows]]] if len(rows) else rows

    def corner_nodes(self, rows: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Shape, rows and node indices (n, corners) of solids, block by block."""
        for number, block in enumerate(self.content.blocks):
            mine = rows[self.block_of[rows] == number]
            if block.shape not in faces.FACES or not len(mine):
                continue
            ids = block.nodes[mine - self.first_row[number], : CORNERS[block.shape]]
            nodes = find(self.node_id, ids)
            if (nodes < 0).any():
                row, column = np.argwhere(nodes < 0)[0]
                element, node = self.element_id[mine[row]], ids[row, column]
                raise SceneError(f"element {element}: node {node} is not in the mesh{span(self.node_id)}")
            yield block.shape, mine, nodes

    def outer_faces(self, solids: np.ndarray, among: np.ndarray | None = None) -> np.ndarray:
        """Segments that are the faces of `solids` (rows) that no other of them, or of `among`, shares."""
        rows, numbers, corners = faces.of_solids(self.corner_nodes(np.unique(solids if among is None else among)))
        outer = faces.not_shared(corners)
        if among is not None:
            outer &= np.isin(rows, solids)
        return self.face_segments(rows[outer], numbers[outer], corners[outer])

    def segments_of_faces(self, rows: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Segments that are the faces `numbers` of elements `rows` (see MeshFile.face_sets)."""
        plain = self.segment_of[rows]
        found = [plain[plain >= 0]]
        exposed = self.solid_rows(rows[numbers == 0])
        if len(exposed):
            found.append(self.outer_faces(exposed, among=self.solid_rows(np.arange(len(self.element_id)))))
        given = (numbers != 0) & (plain < 0)
        if given.any():
            rows, numbers = rows[given], numbers[given]
            all_rows, all_numbers, corners = faces.of_solids(self.corner_nodes(self.solid_rows(np.unique(rows))))
            place = find(all_rows * 8 + all_numbers, rows * 8 + numbers)
            if (place < 0).any():
                first = int(np.argmax(place < 0))
                raise SceneError(f"element {self.element_id[rows[first]]} has no face {numbers[first]}")
            found.append(self.face_segments(rows, numbers, corners[place]))
        return np.unique(np.concatenate(found))

    def face_segments(self, rows: np.ndarray, numbers: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Segments of faces, added to the mesh where they are new; faces of fewer than three nodes are none."""
        area = corners[:, 2] >= 0
        rows, numbers, corners = rows[area], numbers[area], corners[area]
        keys, order = np.unique(rows * 8 + numbers, return_index=True)
        new = find(self.face_keys, keys) < 0
        order = order[new]
        second = np.array([b.nodes.shape[1] > CORNERS.get(b.shape, 99) for b in self.content.blocks], bool)
        step = self.face_step()
        largest = int(self.element_id.max(initial=0))
        if len(order):
            if int(numbers.max()) * step + largest >= 2**63:
                raise SceneError(f"element {largest}: its id is too large for its faces to be numbered")
            ids = numbers[order] * step + self.element_id[rows[order]]
            self.append_segments(ids, corners[order], second[self.block_of[rows[order]]])
        self.face_keys = np.concatenate([self.face_keys, keys[new]])
        return len(self.segment_id) - len(self.face_keys) + find(self.face_keys, keys)

    def face_step(self) -> int:
        """Face f of the solid e is segment f * step + e: the power of ten above all ids of elements."""
        return 10 ** len(str(int(self.element_id.max(initial=0))))

    def segments_of_ids(self, where: str, wanted: list[int]) -> np.ndarray:
        index = find(self.segment_id, np.array(wanted, np.int64))
        solids = self.solid_rows(np.arange(len(self.element_id)))
        if (index < 0).any() and len(solids) and self.face_step() < 2**63:
            number, element = np.divmod(np.array(wanted, np.int64)[index < 0], self.face_step())
            place = find(self.element_id[solids], element)
            place = place[(place >= 0) & (number > 0)]
            rows, numbers, corners = faces.of_solids(self.corner_nodes(np.unique(solids[place])))
            ids = numbers * self.face_step() + self.element_id[rows]
            asked = np.isin(ids, wanted)
            self.face_segments(rows[asked], numbers[asked], corners[asked])
            index = find(self.segment_id, np.array(wanted, np.int64))
        if (index < 0).any():
            missing = wanted[int(np.argmax(index < 0))]
            raise SceneError(f"{where}: segment {missing} is not in the mesh{span(self.segment_id)}")
        return index


def find(ids: np.ndarray, wanted: np.ndarray, order: np.ndarray | None = None) -> np.ndarray:
    """Index of each wanted id in ids; -1 where there is none. order: that sorts ids, where it is known."""
    if not len(ids):
        return np.full(np.shape(wanted), -1)
    if order is None:
        order = np.argsort(ids, kind="stable")
    place = np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)
    index = order[place]
    return np.where(ids[index] == wanted, index, -1)


def span(ids: np.ndarray) -> str:
    """' (ids 1..101)', to go behind 'is not in the mesh'."""
    return f" (ids {ids.min()}..{ids.max()})" if len(ids) else " (it has none)"


def listed(ids: np.ndarray) -> str:
    """ "1, 2, 3" in ascending order, or the first ten and how many there are."""
    ids = np.sort(ids)
    words = ", ".join(map(str, ids[:10]))
    return words if len(ids) <= 10 else f"{words}, ... ({len(ids)} in all)"


def refuse_repeated(what: str, ids: np.ndarray):
    ordered = np.sort(ids)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if len(twice):
        raise SceneError(f"{what} {twice[0]} is repeated")
