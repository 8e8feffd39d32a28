"""Meshes from files: their ids and sets, what is added inline, and files that cannot be read."""

from pathlib import Path

import meshio
import pytest
import tiefmu
from conftest import toml


def found(scene: dict) -> dict:
    return tiefmu.report(tiefmu.load(scene))


ABAQUS = """*Heading
** a quad and two triangles, a beam, two slaves
*NODE, NSET=plate
 10, 0., 0., 0.
 20, 0.1, 0., 0.
 30, 0.1, 0.1
*Node
 40, 0., 0.1, 0.
 50, 0.2, 0., 0.
 60, 0.2, 0.1, 0.
 901, 0.03, 0.06, 0.004
 902, 0.17, 0.06, 0.004
*ELEMENT, TYPE=B31
 5, 50, 60
*ELEMENT, TYPE=S4R
 7, 10, 20, 30, 40
*ELEMENT, TYPE=S3, ELSET=right
 8, 20, 50, 30
 9, 50, 60, 30
*NSET, NSET=welds, GENERATE
 901, 902, 1
*NSET, NSET=rim
 10, 40,
 plate
*ELSET, ELSET=panel
 7, 8
*ELSET, ELSET=edge
 5
*ELSET, ELSET=whole
 panel, right
"""


@pytest.fixture
def abaqus_scene(tmp_path) -> dict:
    (tmp_path / "panel.inp").write_text(ABAQUS)
    return {
        "mesh": {"file": str(tmp_path / "panel.inp")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "weld", "segments": "whole", "slaves": "welds"}],
    }


def test_abaqus_file_keeps_its_ids(abaqus_scene):
    report = found(abaqus_scene)
    assert [(row["id"], row["segment"], row["nodes"]) for row in report["slaves"]] == [
        (901, 7, [10, 20, 30, 40]),
        (902, 9, [50, 60, 30]),
    ]
    assert report["notes"] == []


@pytest.mark.parametrize("name, moved", [("rim", {10, 20, 30, 40}), ("right", {20, 30, 50, 60}), ("edge", {50, 60})])
def test_abaqus_sets_of_nodes_and_of_elements(abaqus_scene, name, moved):
    abaqus_scene["node"].append({"nodes": name, "mass": 3.0})
    assert {row["id"] for row in found(abaqus_scene)["masters"] if row["mass"] == 3} == moved


@pytest.mark.parametrize(
    "tie, line",
    [
        ({"segments": "edge"}, "tie 'weld': segments: the set 'edge' holds no segment"),
        ({"segments": "rim"}, "tie 'weld': segments: 'rim' is a set of nodes, not of segments"),
        ({"segments": "panels"}, "tie 'weld': segments: the mesh has no set 'panels'; did you mean 'panel'?"),
        (
            {"slaves": "nuts"},
            "tie 'weld': slaves: the mesh has no set 'nuts'; known: edge, panel, plate, right, rim, welds, whole",
        ),
    ],
)
def test_wrong_sets(abaqus_scene, tie, line):
    abaqus_scene["tie"][0] |= tie
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(abaqus_scene)
    assert str(error.value) == f"scene: {line}"


@pytest.mark.parametrize(
    "old, new, line",
    [
        (
            "*ELEMENT, TYPE=S3, ELSET=right",
            "*ELEMENT, TYPE=S6, ELSET=right",
            "line 18: *ELEMENT: element 8 has 7 nodes, its type has 6",
        ),
        (" 901, 902, 1", " 901, 903, 1", "set 'welds': node 903 is not in the file"),
        (
            " 901, 902, 1",
            " 901, 902, 1, 1",
            "line 21: *NSET: set 'welds': GENERATE takes first, last and step, found '901, 902, 1, 1'",
        ),
        (" 7, 10, 20, 30, 40", " 7, 10, 20", "line 16: *ELEMENT: element 7 has 2 nodes, its type has 4"),
        (" 7, 10, 20, 30, 40", " 7, 10, 20, 30, 41", "segment 7: node 41 is not in the mesh (ids 10..902)"),
        (" 60, 0.2, 0.1, 0.", " 60, 0.2, x, 0.", "line 10: *NODE: expected a number, found 'x'"),
        (" 60, 0.2, 0.1, 0.", " 60, 0.2, nan, 0.", "node 60: a coordinate is not a finite number"),
        (" 60, 0.2, 0.1, 0.", " 50, 0.2, 0.1, 0.", "line 10: *NODE: node 50 is repeated"),
        (
            "*NSET, NSET=rim",
            "*NGEN\n 1, 2, 3\n*NSET, NSET=rim",
            "line 22: *NGEN: makes or moves nodes without listing them; write the mesh out in full",
        ),
        (" panel, right", " panels", "set 'whole': 'panels' is neither an id nor a set"),
        ("** a quad", "*INCLUDE, INPUT=more.inp\n** a quad", "line 2: *INCLUDE: more.inp: No such file or directory"),
    ],
)
def test_wrong_abaqus_files(abaqus_scene, old, new, line):
    path = Path(abaqus_scene["mesh"]["file"])
    path.write_text(ABAQUS.replace(old, new, 1))
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(abaqus_scene)
    assert str(error.value).startswith(f"scene: mesh: file: {path}: {line}")


def test_file_is_relative_to_the_scene_and_inline_adds(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "panel.inp").write_text(ABAQUS)
    scene = {
        "mesh": {"file": "parts/panel.inp", "nodes": [[1, 0.05, 0.05, 0.01]], "segments": [[1, 10, 20, 30, 40]]},
        "tie": [{"name": "inline", "segments": [1], "slaves": [1]}],
    }
    path = tmp_path / "weld.toml"
    path.write_text(toml(scene))
    assert tiefmu.report(tiefmu.load(path))["slaves"][0]["nodes"] == [10, 20, 30, 40]
    scene["mesh"]["nodes"][0][0] = 60
    path.write_text(toml(scene))
    with pytest.raises(tiefmu.SceneError, match="mesh: node 60 is repeated"):
        tiefmu.load(path)


GMSH2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
0 3 "corner"
1 4 "edge"
2 5 "panel"
$EndPhysicalNames
$Nodes
7
10 0 0 0
20 0.1 0 0
30 0.1 0.1 0
40 0 0.1 0
5 0.2 0.05 0
901 0.03 0.06 0.004
902 0.13 0.05 0.004
$EndNodes
$Elements
4
1 15 2 3 1 10
2 1 2 4 1 10 20
71 2 2 6 2 20 5 30
72 3 2 5 1 10 20 30 40
$EndElements
"""

GMSH4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
1 4 "edge"
2 5 "panel"
$EndPhysicalNames
$Entities
0 1 2 0
1 0 0 0 0.1 0 0 1 4 0
1 0 0 0 0.1 0.1 0 1 5 0
2 0 0 0 0.2 0.1 0 1 6 0
$EndEntities
$Nodes
2 7 5 902
2 1 0 4
10
20
30
40
0 0 0
0.1 0 0
0.1 0.1 0
0 0.1 0
2 2 0 3
5
901
902
0.2 0.05 0
0.03 0.06 0.004
0.13 0.05 0.004
$EndNodes
$Elements
3 3 2 72
1 1 1 1
2 10 20
2 2 2 1
71 20 5 30
2 1 3 1
72 10 20 30 40
$EndElements
"""


@pytest.mark.parametrize(
    "text, sets",
    [
        (GMSH2, {"corner": [10], "edge": [10, 20], "panel": [10, 20, 30, 40]}),
        (GMSH4, {"edge": [10, 20], "panel": [10, 20, 30, 40]}),
    ],
)
def test_gmsh_files_keep_their_ids_and_physical_groups(tmp_path, text, sets):
    path = tmp_path / "panel.msh"
    path.write_text(text)
    scene = {
        "mesh": {"file": str(path)},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "weld", "segments": [71, 72], "slaves": [901, 902]}],
    }
    report = found(scene)
    assert [(row["id"], row["segment"], row["nodes"]) for row in report["slaves"]] == [
        (901, 72, [10, 20, 30, 40]),
        (902, 71, [20, 5, 30]),
    ]
    assert report["notes"] == []
    for name, ids in sets.items():
        scene["node"] = [{"nodes": "all", "mass": 1.0}, {"nodes": name, "mass": 3.0}]
        assert [row["id"] for row in found(scene)["masters"] if row["mass"] == 3] == ids
    scene["tie"][0] |= {"segments": "panel", "slaves": [901]}
    assert found(scene)["slaves"][0]["segment"] == 72


@pytest.mark.parametrize("name", ["panel.vtk", "panel.vtu"])
def test_other_files_are_numbered_in_file_order_and_say_so(tmp_path, name):
    points = [
        [0, 0, 0],
        [0.1, 0, 0],
        [0.1, 0.1, 0],
        [0, 0.1, 0],
        [0.2, 0.05, 0],
        [0.03, 0.06, 0.004],
        [0.13, 0.05, 0.004],
    ]
    mesh = meshio.Mesh(points, [("line", [[0, 1]]), ("triangle", [[1, 4, 2]]), ("quad", [[0, 1, 2, 3]])])
    meshio.write(tmp_path / name, mesh)
    report = found(
        {
            "mesh": {"file": str(tmp_path / name)},
            "node": [{"nodes": "all", "mass": 1.0}],
            "tie": [{"name": "weld", "slaves": [6, 7]}],
        }
    )
    assert [(row["id"], row["segment"], row["nodes"]) for row in report["slaves"]] == [
        (6, 2, [1, 2, 3, 4]),
        (7, 1, [2, 5, 3]),
    ]
    assert report["warnings"][0] == (
        f"mesh: {tmp_path / name}: has no ids: nodes and segments are numbered from 1 in file order"
    )


@pytest.mark.parametrize("name, text", [("panel.xyz", "1 2 3"), ("panel.vtk", "nonsense"), ("panel.msh", "$Nodes\n")])
def test_unreadable_mesh_files(tmp_path, name, text, capfd):
    (tmp_path / name).write_text(text)
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load({"mesh": {"file": str(tmp_path / name)}, "tie": [{"name": "a", "slaves": [1]}]})
    assert str(error.value).startswith(f"scene: mesh: file: {tmp_path / name}: meshio cannot read it")
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


NASTRAN = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,.2,.2,0.\nCTRIA3,5,1,1,2,3\n"
IN_ABAQUS = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,.2,.2,0\n*ELEMENT, TYPE=S3\n5,1,2,3\n"


@pytest.mark.parametrize("name, text", [("panel.inp", IN_ABAQUS), ("panel.bdf", NASTRAN)])
def test_a_byte_order_mark_is_passed_over(tmp_path, name, text):
    (tmp_path / name).write_text(text, encoding="utf-8-sig")
    (tmp_path / "a.toml").write_text(
        f'[mesh]\nfile = "{name}"\n[[tie]]\nslaves = [4]\nsegments = [5]\n', encoding="utf-8-sig"
    )
    assert [row["id"] for row in found(tmp_path / "a.toml")["slaves"]] == [4]


def test_a_file_without_nodes_is_named(tmp_path):
    (tmp_path / "none.inp").write_text("*HEADING\n")
    with pytest.raises(tiefmu.SceneError, match=r"mesh: file: .*none\.inp: has no nodes; give nodes = "):
        tiefmu.load({"mesh": {"file": str(tmp_path / "none.inp")}, "tie": [{"slaves": [1]}]})
