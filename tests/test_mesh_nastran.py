"""Nastran bulk data in its three field formats, with continuations, coordinate systems, properties and sets."""

import numpy as np
import pytest
import tiefmu
from tiefmu import mesh
from tiefmu.mesh.data import Mesh


def read(tmp_path, text: str, name="deck.bdf") -> Mesh:
    (tmp_path / name).write_text(text)
    whole = Mesh()
    mesh.read_into(whole, tmp_path / name, name)
    return whole


def nodes(whole: Mesh, name: str) -> list[int]:
    return sorted(whole.node_id[whole.select_nodes("tie", name)].tolist())


def segments(whole: Mesh, name: str) -> list[int]:
    index = whole.select_segments("tie", name)
    return sorted(whole.segment_id[index].tolist())


SMALL = """$ a comment
SOL 101
CEND
SET 3 = 5,20,
  30 THRU 40
SET 4 = 10 THRU 12 EXCEPT 11
BEGIN BULK
GRID           5       0     0.0      0.       0
GRID    20              1.+0    -1.5-1  0.
GRID*                 30                       1              1.D0
*                    0.0
GRID,40,,0.,1.E+0,0.
GRID    1000001         2.      .5      0.      $ behind
CQUAD4  10      7       5       20      30      40
CTRIA3  11      8       20      1000001 30
CQUAD4  12      7       5       20      30      30
CQUAD4,13,9,5,20,30
CBAR    14      21      5       20      0.      0.      1.
SET1    6       5       20      THRU    40
SET3    7       ELEM    10      12
ENDDATA
GRID    77              0.      0.      0.
"""


@pytest.mark.parametrize("name", ["deck.bdf", "deck.NAS", "deck.dat", "deck.fem"])
def test_own_ids_and_all_ways_to_write_numbers(tmp_path, name):
    whole = read(tmp_path, SMALL, name)
    at = dict(zip(whole.node_id.tolist(), whole.position.tolist()))
    assert at == {5: [0, 0, 0], 20: [1, -0.15, 0], 30: [1, 1, 0], 40: [0, 1, 0], 1000001: [2, 0.5, 0]}
    got = {int(i): whole.node_id[row[row >= 0]].tolist() for i, row in zip(whole.segment_id, whole.segments)}
    assert got == {10: [5, 20, 30, 40], 11: [20, 1000001, 30], 12: [5, 20, 30], 13: [5, 20, 30]}
    assert whole.warnings == []


def test_properties_and_sets(tmp_path):
    whole = read(tmp_path, SMALL)
    assert segments(whole, "pid 7") == segments(whole, "PID 7") == [10, 12]
    assert nodes(whole, "pid 21") == [5, 20]
    assert segments(whole, "set 7") == segments(whole, "set 4") == [10, 12]
    with pytest.raises(tiefmu.SceneError, match="set 'set 3': node 31 is not in the file"):
        whole.select_nodes("tie", "set 3")
    with pytest.raises(tiefmu.SceneError, match="set 'set 6': element 5 is not in the file"):
        whole.select_segments("tie", "set 6")


def test_sets_of_nodes(tmp_path):
    whole = read(
        tmp_path, SMALL.replace("  30 THRU 40", "  40").replace("5       20      THRU    40", "5       20") + "\n"
    )
    assert nodes(whole, "set 3") == [5, 20, 40]
    assert nodes(whole, "set 6") == [5, 20]


def test_sets_of_optistruct(tmp_path):
    sets = "SET            9    GRID    LIST\n+              5      20\nSET     8       ELEM    LIST\n"
    deck = SMALL.replace("SET1    6", sets + "+       10      THRU    12\nSET1    6")
    whole = read(tmp_path, deck, "deck.fem")
    assert nodes(whole, "set 9") == [5, 20]
    assert segments(whole, "set 8") == [10, 11, 12]


def test_coordinate_systems(tmp_path):
    """A cylindrical system in a rectangular one that is moved and turned by 90 degrees about z."""
    whole = read(
        tmp_path,
        "BEGIN BULK\n"
        "CORD2R,1,0,10.,0.,0.,10.,0.,1.\n,10.,1.,0.\n"
        "CORD2C,2,1,0.,0.,5.,0.,0.,6.\n,1.,0.,5.\n"
        "CORD2S,3,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
        "GRDSET,,1\n"
        "GRID,1,0,1.,2.,3.\nGRID,2,,1.,2.,3.\nGRID,3,2,2.,90.,1.\nGRID,4,3,2.,90.,90.\n",
    )
    # system 1: origin (10, 0, 0), x along global y, y along global -x
    right = [[1, 2, 3], [10 - 2, 1, 3], [10 - 2, 0, 6], [0, 2, 0]]
    assert whole.position == pytest.approx(np.array(right, float), abs=1e-14)


def test_second_order_elements_and_continuations(tmp_path):
    grids = "".join(f"GRID,{i},,{i}.,{i * i}.,{i % 3}.\n" for i in range(1, 21))
    hexa = [1, 1, *range(1, 21)]
    lines = ["CHEXA   " + "".join(f"{n:8d}" for n in hexa[:8]), "+       " + "".join(f"{n:8d}" for n in hexa[8:16])]
    lines += ["        " + "".join(f"{n:8d}" for n in hexa[16:])]
    whole = read(
        tmp_path,
        grids + "\n".join(lines) + "\nCQUAD8,2,5,1,2,3,4,5,6\n,7,8\nCQUAD8,3,5,1,2,3,4\nCTRIA6,4,5,1,2,3,4,5,6\n"
        "CTETRA,6,5,1,2,3,5\nCFAKE,1,2,3\n,4,5,6\n",
    )
    assert dict(zip(whole.segment_id.tolist(), whole.second_order.tolist())) == {2: True, 3: False, 4: True}
    assert nodes(whole, "pid 1") == list(range(1, 21))
    index = whole.select_segments("tie", "pid 1")
    assert len(index) == 6 and whole.second_order[index].all()


def test_includes(tmp_path):
    (tmp_path / "grids.inc").write_text("GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\n")
    whole = read(tmp_path, "BEGIN BULK\nINCLUDE 'grids.inc'\nCTRIA3,5,1,1,2,3\n")
    assert whole.segment_id.tolist() == [5]
    (tmp_path / "grids.inc").write_text("INCLUDE 'deck.bdf'\n")
    with pytest.raises(tiefmu.SceneError, match=r"INCLUDE: deck\.bdf includes itself"):
        read(tmp_path, "BEGIN BULK\nINCLUDE 'grids.inc'\n")


def test_a_grid_that_is_written_twice_in_one_place_is_one(tmp_path):
    whole = read(tmp_path, "GRID,7,,0.,1.,2.\nGRID,5,,0.,0.,0.\nGRID,7,,0.,1.,2.0\n")
    assert whole.node_id.tolist() == [7, 5] and whole.position.tolist() == [[0, 1, 2], [0, 0, 0]]
    with pytest.raises(tiefmu.SceneError, match="node 7 is repeated"):
        read(tmp_path, "GRID,7,,0.,1.,2.\nGRID,5,,0.,0.,0.\nGRID,7,,0.,1.,2.01\n")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("GRID    20      ", "GRID    x       ", "GRID: expected a whole number, found 'x'"),
        ("1.+0", "1.+z", "GRID 20: expected a number, found '1.+z'"),
        ("1.E+0,0.", "1.E+0,nan", "node 40: a coordinate is not a finite number"),
        (
            "GRID    20              ",
            "GRID    20      4       ",
            "coordinate system 4 is not in the file as CORD2R, CORD2C or CORD2S",
        ),
        ("GRID    20 ", "GRID    5  ", "node 5 is repeated"),
        ("CTRIA3  11", "CTRIA3  10", "element 10 is repeated"),
        ("20      1000001 30", "20      1000002 30", "segment 11: node 1000002 is not in the mesh (ids 5..1000001)"),
        ("THRU    40", "THRU      ", "SET1 6: 'THRU' where an id was expected"),
    ],
)
def test_wrong_files(tmp_path, old, new, words):
    with pytest.raises(tiefmu.SceneError) as error:
        read(tmp_path, SMALL.replace(old, new, 1))
    assert str(error.value) == f"file: deck.bdf: {words}"
