"""Faces of solids and shells, language by language the same: what a surface of parts or elements consists of."""

import numpy as np

from .element_lengths import hex_volume, shell_area, tetra_length
from .model import SHELLS, SOLIDS, Deck, Elements, Faces

# Corners of the faces of solids, seen from outside counter-clockwise; -1 closes a triangle.
FACES = {
    "hex8": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
    "wedge6": [[0, 2, 1, -1], [3, 4, 5, -1], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "tet4": [[0, 2, 1, -1], [0, 1, 3, -1], [1, 2, 3, -1], [2, 0, 3, -1]],
}
# Of a ten-node tetrahedron: corners, then mid-side nodes of the edges between them.
QUADRATIC = [[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9]]


def shell_faces(deck: Deck, elements: Elements, which: np.ndarray) -> Faces:
    """The shells themselves; which: bool per element."""
    nodes = elements.nodes[which]
    if nodes.shape[1] == 3:
        nodes = np.column_stack([nodes, np.full(len(nodes), -1)])
    return Faces(tidy(nodes), elements.id[which], elements.part[which], deck.thickness(elements)[which])


def solid_faces(deck: Deck, elements: Elements, which: np.ndarray) -> tuple[Faces, np.ndarray]:
    """All faces of the solids, and for each its corners sorted, by which faces of two elements are the same."""
    nodes, ids, parts = elements.nodes[which], elements.id[which], elements.part[which]
    if elements.kind == "tet10":
        faces = np.stack([nodes[:, face] for face in QUADRATIC], axis=1).reshape(-1, 6)
        found = np.column_stack([faces[:, :3], np.full(len(faces), -1)])
    else:
        local = np.array(FACES[elements.kind])
        faces = nodes[:, np.where(local < 0, 0, local)]
        found = np.where(local < 0, -1, faces).reshape(-1, 4)
    per = len(found) // max(len(nodes), 1)
    found = tidy(found)
    thickness = np.repeat(depth(deck, elements.kind, nodes), per)
    return Faces(found, np.repeat(ids, per), np.repeat(parts, per), thickness), np.sort(found, axis=1)


def depth(deck: Deck, kind: str, nodes: np.ndarray) -> np.ndarray:
    """Volume over the area of the largest face: t_m of a solid in the tolerance of a tie."""
    x = deck.position[nodes]
    if kind in ("tet4", "tet10"):
        volume, length = tetra_length(x[:, :4])
        return length / 3 if len(volume) else volume
    if kind == "wedge6":
        x = x[:, [0, 1, 2, 2, 3, 4, 5, 5]]
    area = np.max([shell_area(x[:, face]) for face in FACES["hex8"]], axis=0) if len(x) else np.empty(0)
    return hex_volume(x) / np.maximum(area, 1e-300)


def tidy(nodes: np.ndarray) -> np.ndarray:
    """Faces (m, 4) with a repeated node as triangles; -1 as the fourth."""
    nodes = nodes.copy()
    for repeated, kept in (((2, 3), (0, 1, 2)), ((0, 3), (0, 1, 2)), ((0, 1), (0, 2, 3)), ((1, 2), (0, 1, 3))):
        same = (nodes[:, 3] >= 0) & (nodes[:, repeated[0]] == nodes[:, repeated[1]])
        if same.any():
            nodes[same] = np.column_stack([nodes[same][:, kept], np.full(same.sum(), -1)])
    return nodes


def real_faces(faces: Faces) -> np.ndarray:
    """Which faces have three corners at least: a collapsed face of a degenerate solid has fewer."""
    n = faces.nodes
    return (n[:, 0] != n[:, 1]) & (n[:, 1] != n[:, 2]) & (n[:, 0] != n[:, 2])


def split_quadratic(deck: Deck, faces: Faces) -> Faces:
    """Triangles of ten-node tetrahedra as four triangles each over their mid-side nodes, where those are given."""
    tets = deck.elements.get("tet10")
    if tets is None or not len(faces):
        return faces
    all_nodes = np.stack([tets.nodes[:, face] for face in QUADRATIC], axis=1).reshape(-1, 6)
    keys = np.sort(all_nodes[:, :3], axis=1)
    wanted = np.sort(np.where(faces.nodes < 0, np.iinfo(np.int64).max, faces.nodes), axis=1)[:, :3]
    triangle = faces.nodes[:, 3] < 0
    place = match_rows(keys, wanted)
    quadratic = triangle & (place >= 0) & np.isin(faces.element, tets.id)
    quadratic[quadratic] = (all_nodes[place[quadratic], 3:] >= 0).all(axis=1)
    if not quadratic.any():
        return faces
    a, b, c, ab, bc, ca = all_nodes[place[quadratic]].T[[0, 1, 2, 3, 4, 5]]
    four = [np.stack(corner, axis=1) for corner in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    nodes = np.concatenate([np.column_stack([tri, np.full(len(tri), -1)]) for tri in four])
    rest = faces.take(~quadratic)
    return Faces(
        np.concatenate([rest.nodes, nodes]),
        *(
            np.concatenate([getattr(rest, key), np.tile(getattr(faces, key)[quadratic], 4)])
            for key in ("element", "part", "thickness")
        ),
    )


def match_rows(rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Index in `rows` of each row of `wanted`, or -1."""
    if not len(rows):
        return np.full(len(wanted), -1)
    both = np.concatenate([rows, wanted])
    _, inverse = np.unique(both, axis=0, return_inverse=True)
    inverse = inverse.ravel()
    first = np.full(inverse.max() + 1, -1)
    first[inverse[: len(rows)][::-1]] = np.arange(len(rows))[::-1]
    return first[inverse[len(rows) :]]


def exterior(deck: Deck, selected: dict[str, np.ndarray]) -> Faces:
    """Outer faces: of the selected solids those that no other selected solid shares and no selected shell coats.
    selected: kind -> bool per element."""
    groups = [
        solid_faces(deck, deck.elements[kind], which)
        for kind, which in selected.items()
        if kind in SOLIDS and which.any()
    ]
    if not groups:
        return Faces()
    faces = Faces(
        *(np.concatenate([getattr(one, key) for one, _ in groups]) for key in ("nodes", "element", "part", "thickness"))
    )
    keys = np.concatenate([key for _, key in groups])
    coats = [
        np.sort(shell_faces(deck, deck.elements[kind], which).nodes, axis=1)
        for kind, which in selected.items()
        if kind in SHELLS and which.any()
    ]
    coat = np.concatenate(coats) if coats else np.empty((0, 4), np.int64)
    _, inverse = np.unique(np.concatenate([keys, coat]), axis=0, return_inverse=True)
    times = np.bincount(inverse.ravel())
    outer = (times[inverse.ravel()[: len(keys)]] == 1) & real_faces(faces)
    return split_quadratic(deck, faces.take(outer))


def shells_of(deck: Deck, selected: dict[str, np.ndarray]) -> Faces:
    """The selected shells as faces."""
    return Faces.joined(
        [shell_faces(deck, deck.elements[kind], which) for kind, which in selected.items() if kind in SHELLS]
    )


def segments_of_nodes(deck: Deck, nodes: np.ndarray) -> Faces:
    """Faces given by node indices (m, 4; -1 as a triangle's fourth); each takes element, part and thickness of the
    shell that has the same nodes."""
    faces = tidy(nodes)
    element, part, thickness = np.zeros(len(faces), np.int64), np.zeros(len(faces), np.int64), np.zeros(len(faces))
    shells = shells_of(deck, {kind: np.ones(len(one.id), bool) for kind, one in deck.elements.items()})
    if len(shells):
        place = match_rows(np.sort(shells.nodes, axis=1), np.sort(faces, axis=1))
        hit = place >= 0
        element[hit], part[hit] = shells.element[place[hit]], shells.part[place[hit]]
        thickness[hit] = shells.thickness[place[hit]]
    return Faces(faces, element, part, thickness)


def all_faces(deck: Deck, selected: dict[str, np.ndarray]) -> Faces:
    """Shells and every face of the selected solids, each once."""
    groups = [shells_of(deck, selected)]
    for kind, which in selected.items():
        if kind in SOLIDS and which.any():
            faces = solid_faces(deck, deck.elements[kind], which)[0]
            groups.append(split_quadratic(deck, faces.take(real_faces(faces))))
    return Faces.joined(groups)
