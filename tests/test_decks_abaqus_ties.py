"""Abaqus and CalculiX: *TIE, its options, its surfaces."""

import deck_checks
import numpy as np
import pytest
from input_deck import InputDeck
from tiefmu import decks
from tiefmu.decks import abaqus
from tiefmu.decks.shared_slaves import distances
from tiefmu.report import report

# Two shells side by side (elements 1, 2), a triangle (3), two hexahedra under the shells (10, 11), and pins above.
NODES = {
    **{1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (2, 0, 0), 6: (2, 1, 0), 7: (3, 0, 0)},
    **{11: (0, 0, -1), 12: (1, 0, -1), 13: (1, 1, -1), 14: (0, 1, -1), 15: (2, 0, -1), 16: (2, 1, -1)},
    **{21: (0.5, 0.5, 0.05), 22: (1.5, 0.5, 0.05), 23: (2.2, 0.2, 0.05), 24: (0.5, 0.5, 0.4)},
}
PINS = [21, 22, 23, 24]


def deck(moved: dict | None = None, calculix=False) -> InputDeck:
    made = InputDeck().nodes(NODES | (moved or {})).elastic()
    made.elements("S4R", "quads", {1: (1, 2, 3, 4), 2: (2, 5, 6, 3)}).elements("S3", "tri", {3: (5, 7, 6)})
    made.elements("C3D8R", "bricks", {10: (11, 12, 13, 14, 1, 2, 3, 4), 11: (12, 15, 16, 13, 2, 5, 6, 3)})
    made.block("ELSET, ELSET=shells", "quads, tri").shell("quads").shell("tri", 2e-3).solid("bricks")
    made.block("NSET, NSET=pins", ", ".join(map(str, PINS)))
    if calculix:
        made.block("STEP").block("STATIC").block("NODE FILE", "U").block("END STEP")
    return made


def read(made: InputDeck, tmp_path, **options):
    return decks.read(made.write(tmp_path / "deck.inp"), **options)


def raw(made: InputDeck, tmp_path, wanted=None):
    return abaqus.read(made.write(tmp_path / "deck.inp"), "deck.inp", wanted)


def slaves(made: InputDeck, tmp_path) -> list:
    return deck_checks.slaves(raw(made, tmp_path))


def faces(made: InputDeck, tmp_path) -> set:
    return deck_checks.faces(raw(made, tmp_path))


def refused(made: InputDeck, tmp_path) -> str:
    with pytest.raises(decks.SceneError) as error:
        raw(made, tmp_path)
    assert "\n" not in str(error.value)
    return str(error.value)


# options


def test_a_tie_as_people_write_it(tmp_path):
    found = read(deck().tie("pins", "shells", ", ADJUST=no, position tolerance=0.1, No Thickness"), tmp_path)
    table = found.scene.tables["tie"][0]
    assert table == {
        "name": "weld", "segments": "weld", "slaves": "weld slaves", "formulation": "default", "search": "box",
        "unresolved": "drop", "search_distance": 0.1,
    }  # fmt: skip
    assert any("tie 'weld' (" in line and "POSITION TOLERANCE 0.1" in line for line in found.deck.notes)


def test_the_default_tolerance_of_abaqus(tmp_path):
    """5 % of the mean diagonal: two squares of diagonal sqrt(2), a triangle of longest side sqrt(2)."""
    tie = raw(deck().tie("pins", "shells", ", ADJUST=NO, NO THICKNESS"), tmp_path).ties[0]
    assert tie.search_distance == pytest.approx(0.05 * np.sqrt(2))


def test_the_default_tolerance_of_calculix(tmp_path):
    """2.5 % of the mean distance of a triangle's centre from its sides: right triangles of legs 1, a third of each
    height, which are 1, 1 and 1/sqrt(2)."""
    found = raw(deck(calculix=True).tie("pins", "bricks", ", ADJUST=NO"), tmp_path)
    assert found.language == "CalculiX"
    size = (2 + 1 / np.sqrt(2)) / 9
    tie = raw(deck(calculix=True).tie("pins", "quads", ", ADJUST=NO"), tmp_path).ties[0]
    assert tie.search_distance == pytest.approx(0.025 * size)
    tie = raw(deck(calculix=True).tie("pins", "quads", ", ADJUST=NO, POSITION TOLERANCE=1e-11"), tmp_path).ties[0]
    assert tie.search_distance == pytest.approx(0.025 * size)


def test_slaves_beyond_the_tolerance_are_dropped_with_a_warning(tmp_path):
    found = read(deck().tie("pins", "shells", ", POSITION TOLERANCE=0.06"), tmp_path)
    assert found.scene.node_sets["weld slaves"].tolist() == [21, 22, 23]
    assert any("1 slaves, the first is node 24, are farther" in line for line in found.deck.warnings)


def test_half_thicknesses_are_no_gap(tmp_path):
    """Slave sheet 0.1, master 0.2: at 0.2 above, the gap is 0.05."""
    made = InputDeck().elastic().nodes({1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0)})
    made.nodes({5: (0.2, 0.2, 0.2), 6: (0.8, 0.2, 0.2), 7: (0.8, 0.8, 0.22), 8: (0.2, 0.8, 0.2)})
    made.elements("S4R", "low", {1: (1, 2, 3, 4)}).elements("S4R", "high", {2: (5, 6, 7, 8)})
    made.shell("low", 0.2).shell("high", 0.1).block("SURFACE, NAME=under", "high, SNEG")
    made.block("NSET, NSET=bare", "5, 6, 7, 8")

    def tied(slave, options):
        text = made.text() + f"*TIE, NAME=t, ADJUST=NO, POSITION TOLERANCE=0.06{options}\n{slave}, low\n"
        (tmp_path / "deck.inp").write_text(text)
        return [row["id"] for row in report(decks.load(tmp_path / "deck.inp"))["slaves"]]

    assert tied("under", "") == [5, 6, 8]
    with pytest.raises(decks.SceneError, match=r"tie 't': all its slaves are dropped"):
        tied("under", ", NO THICKNESS")
    with pytest.raises(decks.SceneError, match=r"tie 't': all its slaves are dropped"):
        tied("bare", "")  # nodes alone have no thickness: 0.1 remain


def test_adjust_moves_slaves_to_the_surface(tmp_path):
    made = deck().tie("pins", "bricks", ", POSITION TOLERANCE=0.45")
    found = read(made, tmp_path)
    at = dict(zip(found.scene.node_id.tolist(), found.scene.position.tolist()))
    assert at[21] == pytest.approx([0.5, 0.5, 0], abs=1e-15) and at[24] == pytest.approx([0.5, 0.5, 0], abs=1e-15)
    assert at[23] == pytest.approx([2, 0.2, 0], abs=1e-12)  # beside the surface: to its edge
    assert any("are moved to the surface, node 24 the farthest, by 0.4" in line for line in found.deck.notes)


def test_adjust_leaves_room_for_the_thickness(tmp_path):
    """The master is 1 mm thick: slaves end 0.5 mm above its middle."""
    found = read(deck().tie("pins", "quads", ", POSITION TOLERANCE=0.5"), tmp_path)
    at = dict(zip(found.scene.node_id.tolist(), found.scene.position.tolist()))
    assert at[21] == pytest.approx([0.5, 0.5, 5e-4], abs=1e-15)


@pytest.mark.parametrize(
    "options", [", NO ROTATION", ", NO ROTATION, CONSTRAINT RATIO=0.5", ", NoRotation, ConstraintRatio=1."]
)
def test_no_rotation_leaves_those_of_the_slaves_out(tmp_path, options):
    made = deck().block("ELEMENT, TYPE=S4R, ELSET=lid", "4, 31, 32, 33, 34").shell("lid")
    made.nodes({31: (0.1, 0.1, 0.1), 32: (0.9, 0.1, 0.1), 33: (0.9, 0.9, 0.1), 34: (0.1, 0.9, 0.1)})
    found = read(made.tie("lid", "quads", f"{options}, POSITION TOLERANCE=0.5"), tmp_path)
    turning = dict(zip(found.scene.node_id.tolist(), found.scene.columns["rotations"].tolist()))
    assert [turning[node] for node in (1, 2, 31, 32)] == ["true", "true", "false", "false"]
    assert any("translations are tied at the slaves" in line for line in found.deck.warnings) == ("1." not in options)


def test_tied_nset(tmp_path):
    made = deck().block("NSET, NSET=some", "21, 24").tie("pins", "quads", ", TIED NSET=some, ADJUST=NO")
    assert read(made, tmp_path).scene.node_sets["weld slaves"].tolist() == [21, 24]


@pytest.mark.parametrize("kind", ["SURFACE TO SURFACE", "NODE TO SURFACE", "surface to surface"])
def test_types(tmp_path, kind):
    found = raw(deck().tie("pins", "quads", f", TYPE={kind}"), tmp_path)
    assert any("SURFACE TO SURFACE is taken" in line for line in found.warnings) == (kind[0] in "Ss")


@pytest.mark.parametrize(
    "options, words",
    [
        (", CYCLIC SYMMETRY", "line 35: *TIE: tie 'weld' is one of cyclic symmetry; only ties of two surfaces"),
        (", FLUID PERIODIC", "line 35: *TIE: tie 'weld' is one of fluids"),
        (", ADJUST=MAYBE", "line 35: *TIE: tie 'weld': ADJUST = MAYBE is neither YES nor NO"),
        (", TYPE=MORTAR", "line 35: *TIE: tie 'weld': TYPE = MORTAR is not understood"),
        (", POSITION TOLERANCE=x", "line 36: *TIE: expected a number, found 'x'"),
        (", POSITION TOLERANCE=-1", "line 35: *TIE: tie 'weld': POSITION TOLERANCE = -1 is no distance"),
    ],
)
def test_options_that_are_refused(tmp_path, options, words):
    made = deck().tie("pins", "quads", options)
    words = words.replace("line 35", f"line {len(made.lines) - 1}").replace("line 36", f"line {len(made.lines)}")
    assert refused(made, tmp_path).startswith(f"deck.inp: {words}")


# surfaces of masters

SHELL_1, SHELL_2, TRIANGLE = frozenset({1, 2, 3, 4}), frozenset({2, 3, 5, 6}), frozenset({5, 6, 7})
SIDES_10 = {frozenset(s) for s in ({11, 12, 13, 14}, {1, 2, 11, 12}, {3, 4, 13, 14}, {1, 4, 11, 14})}
SIDES_11 = {frozenset(s) for s in ({12, 15, 16, 13}, {2, 5, 12, 15}, {3, 6, 13, 16}, {5, 6, 15, 16})}


@pytest.mark.parametrize(
    "rows, expected",
    [
        (["quads, SPOS"], {SHELL_1, SHELL_2}),
        (["quads, SNEG", "3, SPOS"], {SHELL_1, SHELL_2, TRIANGLE}),
        (["shells,"], {SHELL_1, SHELL_2, TRIANGLE}),
        (["shells"], {SHELL_1, SHELL_2, TRIANGLE}),
        (["bricks, S2"], {SHELL_1, SHELL_2}),
        (["10, S1", "11, S4"], {frozenset({11, 12, 13, 14}), frozenset({5, 6, 15, 16})}),
        (["bricks,"], SIDES_10 | SIDES_11 | {SHELL_1, SHELL_2}),
        (["10,"], SIDES_10 | {SHELL_1}),
        (["quads, SPOS", "bricks, S2"], {SHELL_1, SHELL_2}),
    ],
)
def test_surfaces_of_elements(tmp_path, rows, expected):
    assert faces(deck().block("SURFACE, NAME=top, TYPE=ELEMENT", *rows).tie("pins", "TOP"), tmp_path) == expected


@pytest.mark.parametrize(
    "name, expected", [("shells", {SHELL_1, SHELL_2, TRIANGLE}), ("bricks", SIDES_10 | SIDES_11 | {SHELL_1, SHELL_2})]
)
def test_sets_of_elements_by_name(tmp_path, name, expected):
    assert faces(deck().tie("pins", name), tmp_path) == expected


def test_second_order_faces_are_split_over_their_mid_side_nodes(tmp_path):
    nodes = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 2, 0), 4: (0, 2, 0), 5: (1, 0, 0), 6: (2, 1, 0), 7: (1, 2, 0)}
    nodes |= {8: (0, 1, 0), 21: (1, 1, 0.01)}
    made = InputDeck().nodes(nodes).elastic().elements("S8R", "e", {1: tuple(range(1, 9))}).shell("e")
    assert faces(made.block("NSET, NSET=pins", "21").tie("pins", "e"), tmp_path) == {
        frozenset(s) for s in ({1, 5, 8}, {2, 5, 6}, {3, 6, 7}, {4, 7, 8}, {5, 6, 7, 8})
    }
    corners = {1: (0, 0, 0), 2: (2, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2), 5: (1, 0, 0), 6: (1, 1, 0), 7: (0, 1, 0)}
    corners |= {8: (0, 0, 1), 9: (1, 0, 1), 10: (0, 1, 1), 21: (0.3, 0.3, -0.01)}
    made = InputDeck().nodes(corners).elastic().elements("C3D10", "e", {1: tuple(range(1, 11))}).solid("e")
    made.block("NSET, NSET=pins", "21").block("SURFACE, NAME=top", "e, S1").tie("pins", "top")
    assert faces(made, tmp_path) == {frozenset(s) for s in ({1, 5, 7}, {2, 5, 6}, {3, 6, 7}, {5, 6, 7})}


@pytest.mark.parametrize(
    "row, words",
    [
        ("quads, E1", "'top': 'E1' names no face of an element"),
        ("bricks, S7", "'top': element 10 has no face 7"),
        ("nothing, S1", "'top': 'nothing' is neither an id nor a set"),
        ("77, S1", "'top': element 77 is not in the file"),
        ("points,", "'top': element 30 of type MASS has no face"),
    ],
)
def test_surfaces_that_are_none(tmp_path, row, words):
    made = deck().elements("MASS", "points", {30: (21,)}).block("MASS, ELSET=points", "1.")
    made.block("SURFACE, NAME=top", row).tie("pins", "top")
    assert refused(made, tmp_path) == f"deck.inp: line {len(made.lines)}: *TIE: {words}"


def test_masters_of_nodes_are_refused(tmp_path):
    made = deck().block("SURFACE, NAME=s, TYPE=NODE", "pins").tie("pins", "s")
    assert "master 's' is a surface of nodes; a tie here needs faces" in refused(made, tmp_path)
    assert "master 'pins' is a set of nodes" in refused(deck().tie("pins", "pins"), tmp_path)
    assert "there is no surface or set 'sky'" in refused(deck().tie("pins", "sky"), tmp_path)
    assert "there is no surface or set 'sky'" in refused(deck().tie("sky", "quads"), tmp_path)


# surfaces of slaves


@pytest.mark.parametrize(
    "options, rows, expected",
    [
        (", TYPE=NODE", ["pins"], PINS),
        (", TYPE=NODE", ["21, 1.0", "24"], [21, 24]),
        ("", ["tri, SPOS"], [5, 6, 7]),
        ("", ["10, S1"], [11, 12, 13, 14]),
        ("", ["quads, E1"], [1, 2, 5]),
        ("", ["1, E3", "2, E3"], [3, 4, 6]),
        ("", ["quads, EDGE"], [1, 2, 3, 4, 5, 6]),
        ("", ["tri, E3", "10, S1"], [5, 6, 11, 12, 13, 14]),
    ],
)
def test_surfaces_as_slaves(tmp_path, options, rows, expected):
    made = deck({101: (0, 0, 50), 102: (1, 0, 50), 103: (0, 1, 50)}).elements("SFM3D3", "far", {99: (101, 102, 103)})
    assert slaves(made.block(f"SURFACE, NAME=s{options}", *rows).tie("s", "far"), tmp_path) == expected


def test_mid_side_nodes_are_slaves(tmp_path):
    nodes = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 2, 0), 4: (0, 2, 0), 5: (1, 0, 0), 6: (2, 1, 0), 7: (1, 2, 0)}
    nodes |= {8: (0, 1, 0), 101: (0, 0, 50), 102: (1, 0, 50), 103: (0, 1, 50)}
    made = InputDeck().nodes(nodes).elastic().elements("S8R", "e", {1: tuple(range(1, 9))}).shell("e")
    made.elements("SFM3D3", "far", {99: (101, 102, 103)}).block("SURFACE, NAME=s", "e, E2")
    assert slaves(made.tie("s", "far"), tmp_path) == [2, 3, 6]


# choosing


def test_ties_are_chosen_by_name_and_pairs_of_one_tie_kept_apart(tmp_path):
    made = deck().block("NSET, NSET=a", "21").block("NSET, NSET=b", "22")
    made.tie("a", "quads", name="Left").block("TIE, NAME=right", "b, quads", "b, tri")
    assert [tie.name for tie in raw(made, tmp_path).ties] == ["Left", "right", "right (2)"]
    assert [tie.name for tie in raw(made, tmp_path, ["RIGHT"]).ties] == ["right", "right (2)"]
    with pytest.raises(decks.SceneError, match=r"\*TIE: no tie is called 'lef'; did you mean 'Left'"):
        raw(made, tmp_path, ["lef"])


def test_a_slave_of_two_ties_stays_with_the_nearer_surface(tmp_path):
    made = deck({31: (1.0, 0.5, 0.05), 32: (1.5, 0.5, 0.02)}).block("NSET, NSET=a", "21, 31, 32")
    made.block("NSET, NSET=c", "31, 32, 22").elements("S4R", "high", {77: (41, 42, 43, 44)}).shell("high")
    made.nodes({41: (1, 0, 0.04), 42: (2, 0, 0.04), 43: (2, 1, 0.04), 44: (1, 1, 0.04)})
    made.block("ELSET, ELSET=one", "1").tie("a", "one", ", ADJUST=NO, POSITION TOLERANCE=1", "low")
    made.tie("c", "high", ", ADJUST=NO, POSITION TOLERANCE=1", "high")
    found = read(made, tmp_path)
    # 31 is 0.05 above the first and 0.01 above the second; 32 is too far beside the first
    assert found.scene.node_sets["low slaves"].tolist() == [21]
    assert found.scene.node_sets["high slaves"].tolist() == [22, 31, 32]
    assert any("tie 'low': 1 slaves, the first is node 31, are slaves of tie 'high'" in w for w in found.deck.warnings)
    decks.compiled(found)


def test_distances_from_triangles():
    triangle = np.array([[[0, 0, 0], [2, 0, 0], [0, 2, 0]]], float)
    points = np.array([[0.5, 0.5, 3], [-3, -4, 0], [2, 2, 1], [1, -2, 0], [3, 0, 0], [0.5, 0.5, 0]])
    expected = [3, 5, np.sqrt(2 + 1), 2, 1, 0]
    assert distances(points, triangle) == pytest.approx(expected)
    assert distances(points, triangle[:, [1, 0, 2]]) == pytest.approx(expected)


def test_a_mesh_is_no_deck(tmp_path):
    made = deck()
    assert not decks.is_deck(made.write(tmp_path / "mesh.inp"))
    with pytest.raises(decks.UsageError, match="is no deck"):
        decks.read(tmp_path / "mesh.inp")
    assert decks.is_deck(made.tie("pins", "quads").write(tmp_path / "deck.inp"))
    assert not decks.is_deck(deck().block("HEADING", "** *TIE").write(tmp_path / "mesh.inp"))
