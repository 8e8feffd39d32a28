"""Abaqus input files as people write them: sets, parts and instances, surfaces, includes."""

import numpy as np
import pytest
import tiefmu
from tiefmu import mesh
from tiefmu.mesh.data import Mesh


def read(tmp_path, text: str, name="deck.inp") -> Mesh:
    (tmp_path / name).write_text(text)
    whole = Mesh()
    mesh.read_into(whole, tmp_path / name, name)
    return whole


def nodes(whole: Mesh, name: str) -> list[int]:
    return whole.node_id[whole.select_nodes("tie", name)].tolist()


def segments(whole: Mesh, name: str) -> list[int]:
    index = whole.select_segments("tie", name)
    return whole.segment_id[index].tolist()


FLAT = """*Heading
*NODE, NSET=First
 1, 0., 0., 0.
 2, 1.D0, 0., -1.5d-1
 3, 1, 1
 4, , 1.,
*Node,
 Nset=first
 5, 2., 0., 0.
 6, 2., 1., 0.
 11, .5, .5, .1
 12, 1.5, .5, .1

*ELEMENT, TYPE=S4R, ELSET = "Left"
** a comment in between
 1, 1, 2, 3, 4
*Element, type=S3,
 elset=RIGHT
 2, 2, 5, 6
 3, 2, 6, 3
*NSET, NSET=sl
 11
*NSET, NSET=SL, UNSORTED
 12,
*NSET, nset=Of Elements, ELSET=right
*NSET, NSET=steps, GENERATE
 1, 5, 2
*ELSET, ELSET=left
 3
*ELSET, ELSET=later
 left, 2
"""


def test_sets_of_one_name_add_up_in_any_case(tmp_path):
    whole = read(tmp_path, FLAT)
    for name in ("sl", "SL", "Sl"):
        assert nodes(whole, name) == [11, 12]
    assert nodes(whole, "FIRST") == [1, 2, 3, 4, 5, 6, 11, 12]
    assert nodes(whole, "of elements") == [2, 3, 5, 6]
    assert nodes(whole, "steps") == [1, 3, 5]
    assert segments(whole, "LEFT") == [1, 3]
    assert segments(whole, "Later") == [1, 2, 3]
    assert nodes(whole, "left") == [1, 2, 3, 4, 6]


def test_numbers_as_fortran_writes_them_and_blank_fields(tmp_path):
    whole = read(tmp_path, FLAT)
    assert whole.position[:4].tolist() == [[0, 0, 0], [1, 0, -0.15], [1, 1, 0], [0, 1, 0]]


def test_scene_and_file_may_differ_in_case(tmp_path):
    (tmp_path / "deck.inp").write_text(FLAT)
    scene = {
        "mesh": {"file": str(tmp_path / "deck.inp")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"name": "a", "segments": "LATER", "slaves": "Sl"}],
    }
    assert [row["id"] for row in tiefmu.report(tiefmu.load(scene))["slaves"]] == [11, 12]


def test_degenerate_quads(tmp_path):
    whole = read(
        tmp_path,
        "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,2,0,0\n"
        "*ELEMENT, TYPE=S4\n1,1,2,3,3\n2,1,2,3\n3,1,2,3,0\n4,1,2,3,\n5,1,2,3,4\n6,1,2,3,\n4\n",
    )
    assert whole.segments.tolist() == [[0, 1, 2, -1]] * 4 + [[0, 1, 2, 3]] * 2


# ------------------------------------------------------------------------------------------------- parts and instances

PART = """*PART, NAME=plate
*NODE
 1, 0., 0., 0.
 2, 1., 0., 0.
 3, 1., 1., 0.
 4, 0., 1., 0.
*ELEMENT, TYPE=S4, ELSET=skin
 1, 1, 2, 3, 4
*NSET, NSET=rim
 1, 2
*END PART
"""
OTHER = """*PART, NAME=bolt
*NODE, NSET=tip
 101, 0.5, 0.25, 0.1
*END PART
"""
ASSEMBLY = """*ASSEMBLY, NAME=all
*INSTANCE, NAME=Low, PART=PLATE
*END INSTANCE
*INSTANCE, NAME=high, PART=plate
 0., 0., 2.
 0., 0., 2., 0., 0., 3., 90.
*END INSTANCE
*INSTANCE, NAME=weld, PART=bolt
 0., 0., 0.5
*END INSTANCE
*NODE
 1, 9., 9., 9.
*NSET, NSET=reference
 1
*NSET, NSET=both, INSTANCE=high
 3, 4
*NSET, NSET=both, INSTANCE=low
 rim
*NSET, NSET=mixed
 low.1, HIGH.rim, weld.tip
*ELSET, ELSET=upper, INSTANCE=high
 1
*SURFACE, NAME=face, TYPE=ELEMENT
 upper, SPOS
 low.skin, SNEG
*END ASSEMBLY
"""


def test_instances_are_moved_then_turned(tmp_path):
    whole = read(tmp_path, PART + OTHER + ASSEMBLY)
    at = dict(zip(whole.node_id.tolist(), whole.position))
    assert len(at) == 10
    for number, right in {
        1: [0, 0, 0],
        3: [1, 1, 0],
        1001: [0, 0, 2],
        1002: [0, 1, 2],  # (1, 0) turned by 90 degrees about z
        1003: [-1, 1, 2],
        2101: [0.5, 0.25, 0.6],
        3001: [9, 9, 9],
    }.items():
        assert at[number] == pytest.approx(right, abs=1e-15)
    assert whole.segment_id.tolist() == [1, 1001]
    assert whole.notes == [
        "mesh: deck.inp: ids of its instances are not unique: added 1000 to those of 'high', 2000 to those of 'weld', "
        "3000 to those of the assembly itself"
    ]


@pytest.mark.parametrize(
    "name, ids",
    [
        ("low.rim", [1, 2]),
        ("HIGH.RIM", [1001, 1002]),
        ("rim", [1, 2, 1001, 1002]),
        ("both", [1, 2, 1003, 1004]),
        ("mixed", [1, 1001, 1002, 2101]),
        ("reference", [3001]),
        ("high.4", [1004]),
        ("tip", [2101]),
        ("upper", [1001, 1002, 1003, 1004]),
    ],
)
def test_sets_of_instances(tmp_path, name, ids):
    assert nodes(read(tmp_path, PART + OTHER + ASSEMBLY), name) == ids


def test_segments_of_instances(tmp_path):
    whole = read(tmp_path, PART + OTHER + ASSEMBLY)
    assert segments(whole, "upper") == [1001]
    assert segments(whole, "Low.skin") == [1]
    assert segments(whole, "SKIN") == segments(whole, "face") == [1, 1001]


def test_unique_ids_are_kept(tmp_path):
    one = ASSEMBLY.replace(
        "*INSTANCE, NAME=high, PART=plate\n 0., 0., 2.\n 0., 0., 2., 0., 0., 3., 90.\n*END INSTANCE\n", ""
    )
    one = one[: one.index("*NODE")] + "*END ASSEMBLY\n"
    whole = read(tmp_path, PART + OTHER + one)
    assert whole.node_id.tolist() == [1, 2, 3, 4, 101]
    assert whole.notes == []


def test_a_turn_about_a_slanted_axis_is_rigid(tmp_path):
    turned = "*INSTANCE, NAME=i, PART=plate\n 1., 2., 3.\n 1., 0., 1., 3., 1., 2., 37.\n*END INSTANCE\n"
    whole = read(tmp_path, PART + turned)
    x = whole.position
    distances = np.linalg.norm(x[:, None] - x[None], axis=2)
    flat = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    assert distances == pytest.approx(np.linalg.norm(flat[:, None] - flat[None], axis=2), abs=1e-14)
    # independent: the rotation vector's matrix exponential
    from scipy.spatial.transform import Rotation

    axis = np.array([2, 1, 1]) / np.sqrt(6)
    turn = Rotation.from_rotvec(np.radians(37) * axis).as_matrix()
    a = np.array([1, 0, 1])
    shifted = np.pad(flat, ((0, 0), (0, 1))) + np.array([1, 2, 3])
    right = (shifted - a) @ turn.T + a
    assert x == pytest.approx(right, abs=1e-14)


# ------------------------------------------------------------------------------------------------------------ surfaces

CUBES = """*NODE
 1,0,0,0\n 2,1,0,0\n 3,1,1,0\n 4,0,1,0\n 5,0,0,1\n 6,1,0,1\n 7,1,1,1\n 8,0,1,1
 9,2,0,0\n 10,2,1,0\n 11,2,0,1\n 12,2,1,1
*ELEMENT, TYPE=C3D8R, ELSET=cubes
 1, 1,2,3,4,5,6,7,8
 2, 2,9,10,3,6,11,12,7
*ELEMENT, TYPE=S4, ELSET=skin
 3, 5,6,7,8
*SURFACE, NAME=top
 cubes, S2
*SURFACE, TYPE=ELEMENT, NAME=Ends
 1, S6
 2, S4
*SURFACE, NAME=free
 1,
*SURFACE, NAME=coat
 skin, SPOS
*SURFACE, NAME=few, TYPE=NODE
 3, 1.0
 12
*SURFACE, NAME=sum, COMBINE=UNION
 top, ends
*SURFACE, NAME=rest, COMBINE=DIFFERENCE
 free, ends
*SURFACE, NAME=edge
 skin, E1
*SURFACE, NAME=gone
 7, S1
*SURFACE, NAME=none
 1, S7
*SURFACE, NAME=round, TYPE=REVOLUTION
 1., 2.
"""


@pytest.mark.parametrize(
    "name, faces",
    [
        ("TOP", [{5, 6, 7, 8}, {6, 7, 11, 12}]),
        ("ends", [{1, 4, 5, 8}, {9, 10, 11, 12}]),
        ("free", [{1, 2, 3, 4}, {5, 6, 7, 8}, {1, 2, 5, 6}, {3, 4, 7, 8}, {1, 4, 5, 8}]),
        ("coat", [{5, 6, 7, 8}]),
        ("sum", [{5, 6, 7, 8}, {6, 7, 11, 12}, {1, 4, 5, 8}, {9, 10, 11, 12}]),
    ],
)
def test_surfaces(tmp_path, name, faces):
    whole = read(tmp_path, CUBES)
    index = whole.select_segments("tie", name)
    got = [frozenset(whole.node_id[row].tolist()) for row in whole.segments[index]]
    assert sorted(map(sorted, got)) == sorted(map(sorted, faces))
    assert nodes(whole, name) == sorted(set().union(*faces))


def test_a_surface_of_nodes_is_a_set_of_nodes(tmp_path):
    assert nodes(read(tmp_path, CUBES), "few") == [3, 12]
    with pytest.raises(tiefmu.SceneError, match="tie: 'few' is a set of nodes, not of segments"):
        read(tmp_path, CUBES).select_segments("tie", "few")


@pytest.mark.parametrize(
    "name, words",
    [
        ("edge", "'E1' names no face of an element"),
        ("gone", "element 7 is not in the file"),
        ("none", "element 1 has no face 7"),
        ("rest", "is a *SURFACE with COMBINE = DIFFERENCE, which is not read"),
        ("round", "is a *SURFACE of type REVOLUTION, which is not read"),
    ],
)
def test_surfaces_that_cannot_be_used_cost_nothing_until_they_are(tmp_path, name, words):
    whole = read(tmp_path, CUBES)
    with pytest.raises(tiefmu.SceneError) as error:
        whole.select_segments("tie", name)
    assert str(error.value) == f"mesh: file: deck.inp: set '{name}': {words}"


# ------------------------------------------------------------------------------------------------------------- includes


def test_includes(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "nodes.txt").write_text(" 1,0,0,0\n 2,1,0,0\n*Include, input=more.txt\n")
    (tmp_path / "parts" / "more.txt").write_text("** only data\n 3,0,1,0\n")
    (tmp_path / "elements.txt").write_text(" 7, 1, 2, 3\n")
    whole = read(
        tmp_path, "*NODE, NSET=n\n*INCLUDE, INPUT=parts/nodes.txt\n*ELEMENT, TYPE=S3, INPUT=elements.txt, ELSET=e\n"
    )
    assert nodes(whole, "n") == [1, 2, 3]
    assert segments(whole, "e") == [7]
    (tmp_path / "parts" / "more.txt").write_text("*INCLUDE, INPUT=nodes.txt\n")
    with pytest.raises(
        tiefmu.SceneError, match=r"file: deck.inp: more.txt: line 1: \*INCLUDE: nodes.txt includes itself"
    ):
        read(tmp_path, "*NODE, NSET=n\n*INCLUDE, INPUT=parts/nodes.txt\n")


@pytest.mark.parametrize(
    "text, words",
    [
        (
            "*NODE\n1,0,0,0\n*INSTANCE, NAME=a, PART=b\n*END INSTANCE\n",
            "line 3: *INSTANCE: instance 'a': there is no part 'b'",
        ),
        (
            PART + "*INSTANCE, NAME=a, PART=plate\n1,2,3,4\n*END INSTANCE\n",
            "line 12: *INSTANCE: instance 'a': expected a translation",
        ),
        (
            PART + "*INSTANCE, NAME=a, PART=plate\n1,2,3\n0,0,0,0,0,0,9\n*END INSTANCE\n",
            "line 12: *INSTANCE: instance 'a': the axis of its rotation has no direction",
        ),
        (
            PART + "*INSTANCE, NAME=a, PART=plate\n*INSTANCE, NAME=A, PART=plate\n",
            "line 13: *INSTANCE: instance 'A' is repeated",
        ),
        ("*NODE, SYSTEM=Q\n1,0,0,0\n", "line 1: *NODE: SYSTEM = Q is none of R, C, S"),
        ("*ELEMENT\n1,1,2,3\n", "line 1: *ELEMENT: parameter TYPE is missing"),
    ],
)
def test_wrong_files(tmp_path, text, words):
    with pytest.raises(tiefmu.SceneError) as error:
        read(tmp_path, text)
    assert str(error.value).startswith(f"file: deck.inp: {words}")


def test_a_set_that_holds_itself(tmp_path):
    whole = read(tmp_path, FLAT + "*NSET, NSET=a\nb\n*NSET, NSET=b\na\n")
    with pytest.raises(tiefmu.SceneError, match="set 'a': 'a' holds itself"):
        whole.select_nodes("tie", "a")


def test_cylindrical_and_spherical_nodes(tmp_path):
    whole = read(tmp_path, "*NODE, SYSTEM=C\n1, 2., 90., 3.\n*NODE, SYSTEM=S\n2, 2., 0., 90.\n3, 2., 90., 0.\n")
    assert whole.position == pytest.approx(np.array([[0, 2, 3], [0, 0, 2], [0, 2, 0]]), abs=1e-15)


def test_second_order_elements_elsewhere_cost_nothing(tmp_path):
    ten = ", ".join(str(n) for n in (1, 2, 3, 5, 6, 6, 6, 6, 6, 6))
    whole = read(
        tmp_path,
        FLAT + f"*ELEMENT, TYPE=C3D10\n 20, {ten}\n*ELEMENT, TYPE=STRI65\n 21, 1, 2, 3, 4, 5, 6\n"
        "*ELEMENT, TYPE=C3D20R\n 22, 1, 2, 3, 4, 5, 6, 11, 12, 1, 1,\n 1, 1, 1, 1, 1, 1, 1, 1,\n 1, 1\n"
        "*ELEMENT, TYPE=U17\n 30, 1, 2,\n 3\n",
    )
    assert whole.segment_id.tolist() == [1, 2, 3, 21]
    assert whole.second_order.tolist() == [False] * 3 + [True]
    assert whole.element_id.tolist() == [1, 2, 3, 20, 21, 22, 30]
