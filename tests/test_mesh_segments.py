"""What segments and sets of a mesh mean to a tie: triangles written as quads, second-order faces, faces of solids,
slaves that are masters."""

from pathlib import Path

import meshio
import numpy as np
import pytest
import solids
import tiefmu
from tiefmu import mesh
from tiefmu.mesh.data import Mesh


def found(scene: dict) -> dict:
    return tiefmu.report(tiefmu.load(scene))


def read(path: Path) -> Mesh:
    whole = Mesh()
    mesh.read_into(whole, path, path.name)
    return whole


# ------------------------------------------------------------------------------------------------- triangles as quads


@pytest.mark.parametrize("row", [[1, 1, 2, 4, 4], [1, 1, 2, 4, 0], [1, 1, 2, 4]])
def test_a_quad_without_a_fourth_node_of_its_own_is_a_triangle(weld, row):
    weld["mesh"]["segments"] = [row]
    slave = found(weld)["slaves"][0]
    assert slave["nodes"] == [1, 2, 4]
    # area coordinates of (0.03, 0.06) in the triangle (0, 0), (0.1, 0), (0, 0.1)
    assert slave["weights"] == pytest.approx([0.1, 0.3, 0.6], abs=1e-12)


def test_other_repeated_nodes_are_named_and_cost_nothing_elsewhere(weld):
    weld["mesh"]["segments"] = [[1, 1, 2, 3, 4], [8, 1, 1, 2, 3], [9, 1, 2, 3, 2]]
    weld["tie"][0]["segments"] = [1]
    report = found(weld)
    assert report["slaves"][0]["segment"] == 1
    assert "mesh: segments that repeat a node, which no tie can use: 8, 9" in report["notes"]


# --------------------------------------------------------------------------------------------------------- second order


def second_order(tmp_path, kind: str) -> dict:
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    if kind == "triangle6":
        corners = corners[:3]
    n = len(corners)
    mid = [(np.array(corners[i]) + corners[(i + 1) % n]) / 2 for i in range(n)]
    if kind == "quad9":
        mid.append([0.5, 0.5, 0])
    # a second segment above it, whose mid-side node is a slave of the first
    points = [*corners, *mid, [0.6, 0.3, 0.1]]
    points += [[0.4, 0.2, 0.2], [0.8, 0.2, 0.2], [0.6, 0.4, 0.2], [0.6, 0.2, 0.2], [0.7, 0.3, 0.2], [0.5, 0.3, 0.2]]
    first = len(corners) + len(mid)
    cells = [(kind, [list(range(first))]), ("triangle6", [list(range(first + 1, first + 7))])]
    meshio.write(tmp_path / "second.vtu", meshio.Mesh(points, cells))
    return {
        "mesh": {"file": str(tmp_path / "second.vtu")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "a", "segments": [1], "slaves": [first + 1, first + 5]}],
    }


@pytest.mark.parametrize("kind", ["triangle6", "quad8", "quad9"])
def test_a_second_order_face_is_its_corner_nodes(tmp_path, kind):
    scene = second_order(tmp_path, kind)
    report = found(scene)
    corners = 3 if kind == "triangle6" else 4
    slaves = report["slaves"]
    assert [row["nodes"] for row in slaves] == [list(range(1, corners + 1))] * 2
    for row, (x, y) in zip(slaves, [(0.6, 0.3), (0.6, 0.2)]):  # the second one is a mid-side node
        right = [1 - x, x - y, y] if corners == 3 else [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y]
        assert row["weights"] == pytest.approx(right, abs=1e-12)
    assert "tie 'a': second-order segments, used as the linear ones of their corner nodes: 1" in report["notes"]


# ------------------------------------------------------------------------------------------------------ faces of solids


@pytest.mark.parametrize("kind", ["hexahedron", "wedge", "tetra", "pyramid"])
@pytest.mark.parametrize("ending", ["vtk", "msh", "inp", "bdf", "vtu"])
def test_outer_faces_of_solids(tmp_path, kind, ending):
    points, cells = solids.block(kind)
    path = tmp_path / f"block.{ending}"
    write_solids(path, points, kind, cells)
    whole = read(path)
    index = whole.select_segments("tie", "all")
    assert len(set(map(frozenset, whole.segments[index].tolist()))) == len(index)
    total = 0.0
    for nodes in whole.segments[index]:
        corners = whole.position[nodes[nodes >= 0]]
        assert solids.outside(corners)
        total += solids.area(corners)
    assert total == pytest.approx(solids.TOTAL)


def write_solids(path: Path, points, kind: str, cells):
    if path.suffix == ".inp":
        name = {"hexahedron": "C3D8", "wedge": "C3D6", "tetra": "C3D4", "pyramid": "C3D5"}[kind]
        lines = ["*NODE", *(f"{i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(points, 1)), f"*ELEMENT, TYPE={name}"]
        lines += [", ".join(map(str, [i, *(cell + 1)])) for i, cell in enumerate(cells, 1)]
        path.write_text("\n".join(lines))
    elif path.suffix == ".bdf":
        name = {"hexahedron": "CHEXA", "wedge": "CPENTA", "tetra": "CTETRA", "pyramid": "CPYRAM"}[kind]
        lines = [f"GRID    {i:8d}        {x:8.3f}{y:8.3f}{z:8.3f}" for i, (x, y, z) in enumerate(points, 1)]
        for i, cell in enumerate(cells, 1):
            text = "".join(f"{number:8d}" for number in [i, 1, *(cell + 1)])
            lines += [f"{name:8}{text[:64]}", *([f"+       {text[64:]}"] if len(text) > 64 else [])]
        path.write_text("\n".join(lines))
    else:
        meshio.write(
            path, meshio.Mesh(points, [(kind, cells)]), **({"file_format": "gmsh22"} if path.suffix == ".msh" else {})
        )


def test_ids_of_faces_are_face_and_element(tmp_path):
    points, cells = solids.block("hexahedron")
    write_solids(tmp_path / "block.inp", points, "hexahedron", cells)
    whole = read(tmp_path / "block.inp")
    # 12 elements: face f of element e is 100 f + e. Faces of element 1, in the corner at the origin: 1 (z = 0),
    # 3 (y = 0) and 6 (x = 0)
    index = whole.select_segments("tie", "all")
    ids = whole.segment_id[index].tolist()
    assert [i for i in ids if i % 100 == 1] == [101, 301, 601]
    alone = read(tmp_path / "block.inp")
    index = alone.select_segments("tie", [601, 301])
    assert alone.segment_id[index].tolist() == [601, 301]
    assert (alone.position[alone.segments[index[0]]][:, 0] == 0).all()
    assert (alone.position[alone.segments[index[1]]][:, 1] == 0).all()
    with pytest.raises(tiefmu.SceneError, match="tie: segment 701 is not in the mesh"):
        alone.select_segments("tie", [701])
    # the inner face between two elements is one too, if it is asked for
    assert len(alone.select_segments("tie", [401])) == 1


def test_a_slave_on_a_block_of_tetrahedra(tmp_path):
    points, cells = solids.block("tetra")
    points = np.vstack([points, [1.2, 0.3, 2.05]])
    write_solids(tmp_path / "block.inp", points, "tetra", cells)
    scene = {
        "mesh": {"file": str(tmp_path / "block.inp")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "a", "slaves": [len(points)]}],
    }
    row = found(scene)["slaves"][0]
    corners = points[np.array(row["nodes"]) - 1]
    assert len(corners) == 3 and (corners[:, 2] == 2).all()
    assert np.array(row["weights"]) @ corners == pytest.approx([1.2, 0.3, 2.0])
    assert row["distance"] == pytest.approx(0.05)


def test_collapsed_hexahedra(tmp_path):
    """A wedge and a tetrahedron written as hexahedra, one on the other: faces without area are none, others are
    triangles, and the shared one is not outer."""
    (tmp_path / "collapsed.inp").write_text(
        "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1, 0, 1\n6, 0, 1, 1\n7, 0, 0, 2\n"
        "*ELEMENT, TYPE=C3D8\n1, 1, 2, 3, 3, 4, 5, 6, 6\n2, 4, 5, 6, 6, 7, 7, 7, 7\n"
    )
    whole = read(tmp_path / "collapsed.inp")
    index = whole.select_segments("tie", "all")
    got = {frozenset(whole.node_id[nodes[nodes >= 0]].tolist()) for nodes in whole.segments[index]}
    assert got == set(
        map(frozenset, [(1, 2, 3), (1, 2, 4, 5), (2, 3, 5, 6), (1, 3, 4, 6), (4, 5, 7), (5, 6, 7), (4, 6, 7)])
    )
    assert len(index) == 7


def test_a_set_with_shells_and_solids_means_its_shells(tmp_path):
    points, cells = solids.block("hexahedron")
    write_solids(tmp_path / "block.inp", points, "hexahedron", cells)
    with (tmp_path / "block.inp").open("a") as file:
        file.write(
            "\n*ELEMENT, TYPE=S4, ELSET=both\n50, 1, 2, 6, 5\n*ELSET, ELSET=both\n1, 2\n*ELSET, ELSET=solid\n1, 2\n"
        )
    whole = read(tmp_path / "block.inp")
    for name in ("all", "both"):
        assert whole.segment_id[whole.select_segments("tie", name)].tolist() == [50]
    assert whole.notes == [
        "tie: 'all' means its 1 triangles and quads, not the faces of its 12 solids",
        "tie: 'both' means its 1 triangles and quads, not the faces of its 2 solids",
    ]
    assert len(whole.select_segments("tie", "solid")) == 10  # two cubes side by side


# ----------------------------------------------------------------------------------------------------- slaves of a set


def test_masters_in_a_set_of_slaves_are_passed_over(weld):
    weld["tie"][0]["slaves"] = "all"
    report = found(weld)
    assert [row["id"] for row in report["slaves"]] == [101]
    assert (
        "tie 'weld': nodes of the set of slaves that are masters of this tie, passed over: 1, 2, 3, 4"
        in report["notes"]
    )
    weld["tie"][0]["slaves"] = [1, 101]
    with pytest.raises(tiefmu.SceneError, match="tie 'weld': slave 1: is also a master, on segment 1"):
        tiefmu.load(weld)
