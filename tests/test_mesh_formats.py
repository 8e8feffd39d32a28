"""MED, Exodus and what meshio reads: groups, ids where the format has them, a warning where not."""

import sys

import h5py
import meshio
import netCDF4
import numpy as np
import pytest
import solids
import tiefmu
from tiefmu import mesh
from tiefmu.mesh.data import Mesh

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0], [0.5, 0.5, 0.1], [1.3, 0.5, 0.1]], float)
CELLS = [("line", [[0, 1]]), ("triangle", [[1, 4, 2]]), ("quad", [[0, 1, 2, 3]])]


def read(path) -> Mesh:
    whole = Mesh()
    mesh.read_into(whole, path, path.name)
    return whole


def nodes(whole: Mesh, name: str) -> list[int]:
    return sorted(whole.node_id[whole.select_nodes("tie", name)].tolist())


def segments(whole: Mesh, name: str) -> list[int]:
    index = whole.select_segments("tie", name)
    return sorted(whole.segment_id[index].tolist())


# ----------------------------------------------------------------------------------------------------------------- MED


def write_med(path):
    data = meshio.Mesh(POINTS, CELLS)
    data.point_data["point_tags"] = np.array([0, 2, 2, 0, 0, 3, 3])
    data.point_tags = {2: ["edge"], 3: ["slaves", "name 1", "name 2"]}
    data.cell_data["cell_tags"] = [np.array([-4]), np.array([-5]), np.array([-6])]
    data.cell_tags = {-4: ["edge"], -5: ["skin"], -6: ["skin", "quads"]}
    meshio.write(path, data)


def test_groups_of_med(tmp_path):
    write_med(tmp_path / "panel.med")
    with h5py.File(tmp_path / "panel.med", "a") as data:  # names as tools of today and of yesterday write them
        for family in data["FAS/mesh/NOEUD"].values():
            for row, text in zip((1, 2), ("rôle".encode(), "côté".encode("latin-1"))):
                if len(family["GRO/NOM"]) > row:
                    family["GRO/NOM"][row] = np.frombuffer(text.ljust(80, b"\0"), np.int8)
    whole = read(tmp_path / "panel.med")
    assert nodes(whole, "edge") == [2, 3]
    assert nodes(whole, "slaves") == nodes(whole, "rôle") == nodes(whole, "côté") == [6, 7]
    assert segments(whole, "skin") == [1, 2]
    assert nodes(whole, "quads") == [1, 2, 3, 4]
    assert whole.position.tolist() == POINTS.tolist()
    quad = whole.select_segments("tie", "quads")
    assert whole.segments[quad].tolist() == [[0, 1, 2, 3]]
    assert whole.warnings == ["mesh: panel.med: has no ids: nodes and segments are numbered from 1 in file order"]


def test_numbers_of_med(tmp_path):
    write_med(tmp_path / "panel.med")
    with h5py.File(tmp_path / "panel.med", "a") as data:
        (step,) = data["ENS_MAA/mesh"].values()
        step["NOE"]["NUM"] = np.array([10, 20, 30, 40, 5, 901, 902])
        for kind, number in (("SE2", 1), ("TR3", 71), ("QU4", 72)):
            step["MAI"][kind]["NUM"] = np.array([number])
        data["CHA"].create_group("a field that is none")
    whole = read(tmp_path / "panel.med")
    assert nodes(whole, "slaves") == [901, 902]
    assert segments(whole, "skin") == [71, 72]
    assert nodes(whole, "quads") == [10, 20, 30, 40]
    assert whole.warnings == []


def test_a_med_scene_from_end_to_end(tmp_path):
    write_med(tmp_path / "panel.med")
    scene = {
        "mesh": {"file": str(tmp_path / "panel.med")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "a", "segments": "skin", "slaves": "slaves"}],
    }
    rows = tiefmu.report(tiefmu.load(scene))["slaves"]
    assert [row["nodes"] for row in rows] == [[1, 2, 3, 4], [2, 5, 3]]
    assert rows[0]["weights"] == pytest.approx([0.25] * 4)
    assert rows[1]["weights"] == pytest.approx([0.35, 0.3, 0.35])


# -------------------------------------------------------------------------------------------------------------- Exodus


def write_exodus(path):
    meshio.write(path, meshio.Mesh(POINTS, CELLS[1:], point_sets={"slaves": np.array([5, 6]), "rim": np.array([0, 3])}))


def test_sets_of_exodus(tmp_path):
    write_exodus(tmp_path / "panel.exo")
    whole = read(tmp_path / "panel.exo")
    assert nodes(whole, "slaves") == [6, 7]
    assert nodes(whole, "rim") == [1, 4]
    assert segments(whole, "block 1") == [2]
    assert whole.warnings == ["mesh: panel.exo: has no ids: nodes and segments are numbered from 1 in file order"]


def add_text(data, name: str, texts: list[str], dimension: str):
    if "len_name" not in data.dimensions:
        data.createDimension("len_name", 33)
    variable = data.createVariable(name, "S1", (dimension, "len_name"))
    variable[:] = np.array([list(text.ljust(33, "\0")) for text in texts], "S1")


@pytest.mark.parametrize("kind", ["hexahedron", "wedge", "tetra", "pyramid"])
@pytest.mark.parametrize("file_format", ["NETCDF4", "NETCDF3_64BIT_OFFSET"])
def test_ids_blocks_and_side_sets_of_exodus(tmp_path, kind, file_format):
    """The side sets that other tools write name a solid and a side by Exodus' numbers: all sides of all elements that
    lie in the plane z = 0, found from the coordinates."""
    points, cells = solids.block(kind)
    sides = {  # corners of the sides 1, 2, ... in the manual of Exodus II
        "hexahedron": [(1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (1, 5, 8, 4), (1, 4, 3, 2), (5, 6, 7, 8)],
        "wedge": [(1, 2, 5, 4), (2, 3, 6, 5), (1, 4, 6, 3), (1, 3, 2), (4, 5, 6)],
        "tetra": [(1, 2, 4), (2, 3, 4), (1, 4, 3), (1, 3, 2)],
        "pyramid": [(1, 2, 5), (2, 3, 5), (3, 4, 5), (1, 5, 4), (1, 4, 3, 2)],
    }[kind]
    bottom = [
        (e + 1, s)
        for e, cell in enumerate(cells)
        for s, side in enumerate(sides, 1)
        if (points[cell[np.array(side) - 1]][:, 2] == 0).all()
    ]
    with netCDF4.Dataset(tmp_path / "block.e", "w", format=file_format) as data:
        for name, size in {
            "num_dim": 3, "num_nodes": len(points), "num_elem": len(cells), "num_el_blk": 1,
            "num_el_in_blk1": len(cells), "num_nod_per_el1": cells.shape[1], "num_side_sets": 2,
            "num_side_ss1": len(bottom), "num_side_ss2": 1,
        }.items():  # fmt: skip
            data.createDimension(name, size)
        for k, axis in enumerate("xyz"):
            data.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = points[:, k]
        connect = data.createVariable("connect1", "i4", ("num_el_in_blk1", "num_nod_per_el1"))
        connect.elem_type = {"hexahedron": "HEX8", "wedge": "WEDGE6", "tetra": "tetra4", "pyramid": "PYRAMID5"}[kind]
        connect[:] = cells + 1
        data.createVariable("node_num_map", "i4", ("num_nodes",))[:] = 10 * np.arange(1, len(points) + 1)
        data.createVariable("elem_num_map", "i4", ("num_elem",))[:] = 500 + np.arange(1, len(cells) + 1)
        data.createVariable("eb_prop1", "i4", ("num_el_blk",))[:] = [7]
        add_text(data, "eb_names", ["foam"], "num_el_blk")
        data.createVariable("ss_prop1", "i4", ("num_side_sets",))[:] = [30, 31]
        add_text(data, "ss_names", ["bottom", ""], "num_side_sets")
        data.createVariable("elem_ss1", "i4", ("num_side_ss1",))[:] = [e for e, _ in bottom]
        data.createVariable("side_ss1", "i4", ("num_side_ss1",))[:] = [s for _, s in bottom]
        data.createVariable("elem_ss2", "i4", ("num_side_ss2",))[:] = [1]
        data.createVariable("side_ss2", "i4", ("num_side_ss2",))[:] = [1]
    whole = read(tmp_path / "block.e")
    assert whole.node_id.tolist() == (10 * np.arange(1, len(points) + 1)).tolist()
    assert whole.warnings == []
    index = whole.select_segments("tie", "bottom")
    corners = [whole.position[row[row >= 0]] for row in whole.segments[index]]
    assert all((x[:, 2] == 0).all() for x in corners)
    assert sum(map(solids.area, corners)) == pytest.approx(solids.SIZE[0] * solids.SIZE[1])
    (single,) = whole.select_segments("tie", "sideset 31")
    assert set(whole.segments[single][whole.segments[single] >= 0]) == set(cells[0][np.array(sides[0]) - 1])
    assert whole.segment_id[single] % 1000 == 501
    outer = whole.select_segments("tie", "foam")
    assert sum(solids.area(whole.position[row[row >= 0]]) for row in whole.segments[outer]) == pytest.approx(
        solids.TOTAL
    )


# ---------------------------------------------------------------------------------------------------------------- rest


def test_global_ids_of_vtk(tmp_path):
    data = meshio.Mesh(POINTS, CELLS)
    data.point_data["GlobalNodeId"] = np.array([10, 20, 30, 40, 5, 901, 902])
    data.cell_data["GlobalElementId"] = [np.array([1]), np.array([71]), np.array([72])]
    meshio.write(tmp_path / "panel.vtu", data)
    whole = read(tmp_path / "panel.vtu")
    assert whole.node_id.tolist() == [10, 20, 30, 40, 5, 901, 902]
    assert segments(whole, "all") == [71, 72]
    assert whole.warnings == []


def test_numbers_on_elements_are_sets(tmp_path):
    data = meshio.Mesh(POINTS, CELLS[1:])
    data.cell_data["medit:ref"] = [np.array([3]), np.array([8])]
    data.point_data["medit:ref"] = np.zeros(len(POINTS), int)
    meshio.write(tmp_path / "panel.mesh", data)
    whole = read(tmp_path / "panel.mesh")
    assert segments(whole, "ref 8") == [2]
    assert nodes(whole, "ref 3") == [2, 3, 5]


@pytest.mark.parametrize(
    "ending, cells, count",
    [("xdmf", CELLS, 2), ("vtk", CELLS, 2), ("stl", CELLS[1:2], 1), ("cgns", [("tetra", [[0, 1, 2, 5]])], 4)],
)
def test_other_formats(tmp_path, ending, cells, count):
    meshio.write(tmp_path / f"panel.{ending}", meshio.Mesh(POINTS, cells))
    whole = read(tmp_path / f"panel.{ending}")
    assert len(segments(whole, "all")) == count
    assert "numbered from 1 in file order" in whole.warnings[0]


def test_the_warning_is_printed_by_build(tmp_path, command):
    meshio.write(tmp_path / "panel.vtk", meshio.Mesh(POINTS, CELLS))
    (tmp_path / "a.toml").write_text(
        'mesh = {file = "panel.vtk"}\nnode = [{nodes = "all", mass = 1}]\ntie = [{slaves = [6]}]\n'
    )
    done = command("build", "a.toml")
    assert done.returncode == 0
    assert done.stderr.splitlines()[0] == (
        "warning: a.toml: mesh: panel.vtk: has no ids: nodes and segments are numbered from 1 in file order"
    )


@pytest.mark.parametrize("ending, library", [("med", "h5py"), ("exo", "netCDF4"), ("xdmf", "h5py"), ("cgns", "h5py")])
def test_without_hdf5_the_extra_is_named(tmp_path, monkeypatch, ending, library):
    path = tmp_path / f"panel.{ending}"
    meshio.write(path, meshio.Mesh(POINTS, [("tetra", [[0, 1, 2, 5]])]))
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(tiefmu.SceneError) as error:
        read(path)
    assert str(error.value) == f"file: {path.name}: reading it needs {library}: pip install 'tiefmu[hdf5]'"


@pytest.mark.parametrize("ending", ["med", "exo"])
def test_damaged_files_are_refused_in_one_line(tmp_path, ending):
    path = tmp_path / f"panel.{ending}"
    (write_med if ending == "med" else write_exodus)(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(7)
    for _ in range(60):
        data = bytearray(whole[: rng.integers(1, len(whole))] if rng.random() < 0.3 else whole)
        for at in rng.integers(0, len(data), 40):
            data[at] = rng.integers(0, 256)
        path.write_bytes(bytes(data))
        try:
            read(path)
        except tiefmu.SceneError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize(
    "name, cells, words",
    [
        ("panel.cgns", CELLS[1:], "it knows CGNS of tetrahedra alone; save the mesh as Exodus, MED or Gmsh"),
        ("panel.xdmf", [CELLS[2], ("line3", [[0, 1, 2]])], "it does not know 34"),
    ],
)
def test_what_meshio_writes_and_does_not_read(tmp_path, name, cells, words):
    meshio.write(tmp_path / name, meshio.Mesh(POINTS, cells))
    with pytest.raises(tiefmu.SceneError) as error:
        read(tmp_path / name)
    assert str(error.value) == f"file: {name}: meshio cannot read it: {words}"
