"""/INTER/TYPE2: its flags, its node groups and surfaces, sets of all kinds."""

import deck_checks
import numpy as np
import pytest
from deck_cards import RadiossDeck
from tiefmu import decks
from tiefmu.decks import radioss

# Two shells side by side (elements 1, 2 of part 1), a triangle (3, part 2), a hexahedron under them (10, part 3) whose
# top is the first shell, another one beside it (11), and four nodes above.
NODES = {
    **{1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (2, 0, 0), 6: (2, 1, 0), 7: (3, 0, 0)},
    **{11: (0, 0, -1), 12: (1, 0, -1), 13: (1, 1, -1), 14: (0, 1, -1), 15: (2, 0, -1), 16: (2, 1, -1)},
    **{21: (0.5, 0.5, 0.1), 22: (1.5, 0.5, 0.1), 23: (2.2, 0.2, 0.1), 24: (0.5, 0.5, 0.4)},
}


def deck(moved: dict | None = None) -> RadiossDeck:
    found = RadiossDeck().nodes(NODES | (moved or {})).elastic().elastic(2).shell().shell(2, 2e-3).solid(3)
    found.part(1, subset=5).part(2, 2, 2, subset=6).part(3, 3)
    found.elements("SHELL", 1, {1: (1, 2, 3, 4), 2: (2, 5, 6, 3)}).elements("SH3N", 2, {3: (5, 7, 6)})
    found.elements("BRICK", 3, {10: (11, 12, 13, 14, 1, 2, 3, 4), 11: (12, 15, 16, 13, 2, 5, 6, 3)})
    found.block("/SUBSET/5", (6,), title="outer").block("/SUBSET/6", title="inner")
    return found.node_group(99, [21, 22, 23, 24], "pins").block("/ADMAS/0/1", (0.5, 99), title="pins")


def read(made: RadiossDeck, tmp_path, **options):
    return decks.read(made.write(tmp_path / "deck_0000.rad"), **options)


def tie_of(made: RadiossDeck, tmp_path):
    return read(made, tmp_path).deck.ties[0]


def slaves(made: RadiossDeck, tmp_path) -> list:
    return deck_checks.slaves(radioss.read(made.write(tmp_path / "deck_0000.rad"), "deck_0000.rad"))


def faces(made: RadiossDeck, tmp_path) -> set:
    return deck_checks.faces(radioss.read(made.write(tmp_path / "deck_0000.rad"), "deck_0000.rad"))


def default_tie() -> RadiossDeck:
    return deck().surface(1, "PART", [1, 2])


# flags


@pytest.mark.parametrize(
    "spotflag, formulation",
    [
        (0, "default"),
        (2, "default"),
        (5, "default"),
        (4, "default"),
        (27, "default"),
        (1, "optimized"),
        (28, "optimized"),
    ],
)
def test_spotflag(tmp_path, spotflag, formulation):
    found = read(default_tie().tie(1, 99, 1, 0, spotflag, 0, 0.5), tmp_path)
    tie = found.deck.ties[0]
    assert tie.formulation == formulation == found.scene.tables["tie"][0]["formulation"]
    assert any("penalty" in line for line in found.deck.warnings) == (spotflag in (27, 28))


@pytest.mark.parametrize("spotflag", [20, 21, 22, 25, 26, 30])
def test_spotflags_that_are_no_kinematic_ties_are_refused(tmp_path, spotflag):
    with pytest.raises(decks.SceneError, match=rf"line \d+: /INTER/TYPE2/1: tie 'weld': Spotflag {spotflag} "):
        read(default_tie().tie(1, 99, 1, 0, spotflag), tmp_path)


def test_spotflag_4_hands_no_rotations_on(tmp_path):
    found = read(default_tie().tie(1, 99, 1, 0, 4, 0, 0.5), tmp_path)
    assert set(found.scene.columns["rotations"]) == {"false"}
    assert any("hands no rotations on" in line for line in found.deck.warnings)


@pytest.mark.parametrize("search, name", [(0, "box"), (2, "box"), (1, "nearest-node")])
def test_isearch(tmp_path, search, name):
    assert tie_of(default_tie().tie(1, 99, 1, 0, 1, search, 0.5), tmp_path).search == name


@pytest.mark.parametrize(
    "ignore, unresolved, how", [(0, "error", "rms"), (1000, "error", "rms"), (1, "drop", "rms"), (2, "drop", "pair")]
)
def test_ignore_and_the_distance_it_brings(tmp_path, ignore, unresolved, how):
    found = radioss.read(default_tie().tie(1, 99, 1, ignore, 1).write(tmp_path / "d.rad"), "d.rad")
    tie = found.ties[0]
    assert tie.unresolved == unresolved
    # sides of the three segments: 1 1 1 1, 1 1 1 1, 1 sqrt2 1 and none
    assert tie.search_distance == (pytest.approx(np.sqrt((8 + 4) / 12)) if how == "rms" else None)
    assert (tie.pairwise == (0.05, 0.6)) == (how == "pair")


def test_ignore_3_is_taken_as_2(tmp_path):
    one, other = (read(default_tie().tie(1, 99, 1, ignore, 1, 0, 0.2), tmp_path) for ignore in (2, 3))
    assert one.scene.tables == other.scene.tables


def test_fields_that_a_scene_has_nothing_for_are_said(tmp_path):
    made = default_tie().block("/INTER/TYPE2/1", (99, 1, 0, 1, 3, 0, 2, 5, 0.5), title="weld")
    found = read(made, tmp_path).deck
    assert "Level and Idel left aside" in found.notes[0]
    assert any("tie 'weld': columns 71 to 80, '5', are not understood" in line for line in found.warnings)


def test_a_distance_of_its_own(tmp_path):
    tie = tie_of(default_tie().tie(1, 99, 1, 2, 1, 0, 0.45), tmp_path)
    assert tie.search_distance == 0.45 and tie.pairwise is None


def test_pairs_farther_than_their_own_tolerance_are_dropped(tmp_path):
    """0.05 of the shorter diagonal (of the triangle, side) is more than 0.6 t: the
    tolerance is 0.0707 over the shells, and 0.05 over the triangle."""
    near = {21: (0.5, 0.5, 0.0707), 22: (1.5, 0.5, 0.0708), 23: (2.2, 0.2, 0.049), 24: (2.2, 0.2, 0.051)}
    found = read(deck(near).surface(1, "PART", [1, 2]).tie(1, 99, 1, 2, 1), tmp_path)
    assert found.scene.node_sets["weld slaves"].tolist() == [21, 23]
    assert any("2 slaves, the first is node 22, are farther" in line for line in found.deck.warnings)


def test_no_slave_within_its_tolerance(tmp_path):
    with pytest.raises(decks.SceneError, match="tie 'weld': all its slaves are dropped"):
        read(default_tie().tie(1, 99, 1, 2, 1), tmp_path)


def test_thick_shells_widen_the_tolerance(tmp_path):
    """0.6 (t_s + t_m): the slave's own shell and the master's, 0.6 (0.1 + 0.2) = 0.18."""
    made = RadiossDeck().elastic().shell(1, 0.2).shell(2, 0.1).part(1).part(2, 2)
    made.nodes({1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (0.2, 0.2, 0.179), 6: (0.8, 0.2, 0.179)})
    made.nodes({7: (0.8, 0.8, 0.181), 8: (0.2, 0.8, 0.179)})
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).elements("SHELL", 2, {2: (5, 6, 7, 8)})
    made.node_group(1, [5, 6, 7, 8]).surface(1, "PART", [1]).tie(1, 1, 1, 2)
    assert read(made, tmp_path).scene.node_sets["weld slaves"].tolist() == [5, 6, 8]


def test_defaults_of_the_deck(tmp_path):
    made = default_tie().block("/DEFAULT/INTER/TYPE2", (None, None, 2, 1, None, 1)).tie(1, 99, 1)
    found = radioss.read(made.write(tmp_path / "d.rad"), "d.rad").ties[0]
    assert (found.formulation, found.search, found.unresolved) == ("optimized", "nearest-node", "drop")
    made = default_tie().block("/DEFAULT/INTER/TYPE2", (None, None, 2, 1, None, 1)).tie(1, 99, 1, 1000, 5, 2)
    found = radioss.read(made.write(tmp_path / "d.rad"), "d.rad").ties[0]
    assert (found.formulation, found.search, found.unresolved) == ("default", "box", "error")


# node groups


@pytest.mark.parametrize(
    "kind, ids, expected",
    [
        ("NODE", [21, 23], [21, 23]),
        ("NODENS", [21, 23], [21, 23]),
        ("NODE", [21, 23, -23], [21]),
        ("GENE", [21, 22, 24, 30], [21, 22, 24]),
        ("GEN_INCR", [21, 24, 2], [21, 23]),
        ("GRNOD", [99, -98], [21, 22, 24]),
        ("BOX", [1], [21]),
        ("PART", [2], [5, 6, 7]),
        ("SUBSET", [5], [1, 2, 3, 4, 5, 6, 7]),
        ("SUBSET", [6], [5, 6, 7]),
        ("MAT", [2], [5, 6, 7]),
        ("PROP", [2], [5, 6, 7]),
        ("GRPART", [1], [5, 6, 7]),
        ("GRSHEL", [1], [2, 3, 5, 6]),
        ("GRSH3N", [1], [5, 6, 7]),
        ("GRBRIC", [1], [2, 3, 5, 6, 12, 13, 15, 16]),
        ("SURF", [2], [5, 6, 7]),
    ],
)
def test_node_groups(tmp_path, kind, ids, expected):
    made = deck().block(f"/GRNOD/{kind}/1", tuple(ids), title="wanted").node_group(98, [23])
    made.block("/BOX/RECTA/1", (0, 0, 0), (0.4, 0.4, 0.0), (0.6, 0.6, 0.2), title="box")
    made.block("/GRPART/PART/1", (2,), title="g").block("/GRSHEL/SHEL/1", (2,), title="g")
    made.block("/GRSH3N/PART/1", (2,), title="g").block("/GRBRIC/BRIC/1", (11,), title="g")
    made.surface(2, "PART", [2])
    # the surface that they are tied to is far away
    made.nodes({101: (0, 0, 50), 102: (1, 0, 50), 103: (0, 1, 50)}).surface(1, "SEG", [1, 101, 102, 103])
    assert slaves(made.tie(1, 1, 1), tmp_path) == expected


# surfaces

SHELL_1, SHELL_2, TRIANGLE = frozenset({1, 2, 3, 4}), frozenset({2, 3, 5, 6}), frozenset({5, 6, 7})
SIDES_10 = {frozenset(s) for s in ({11, 12, 13, 14}, {1, 2, 11, 12}, {3, 4, 13, 14}, {1, 4, 11, 14})}
SIDES_11 = {frozenset(s) for s in ({12, 15, 16, 13}, {2, 5, 12, 15}, {3, 6, 13, 16}, {5, 6, 15, 16})}
BETWEEN = frozenset({2, 3, 12, 13})


@pytest.mark.parametrize(
    "kind, ids, expected",
    [
        ("PART", [1], {SHELL_1, SHELL_2}),
        ("PART", [1, 2], {SHELL_1, SHELL_2, TRIANGLE}),
        ("PART/EXT", [3], SIDES_10 | SIDES_11 | {SHELL_1, SHELL_2}),
        ("PART/ALL", [3], SIDES_10 | SIDES_11 | {SHELL_1, SHELL_2, BETWEEN}),
        ("SUBSET", [5], {SHELL_1, SHELL_2, TRIANGLE}),
        ("MAT", [2], {TRIANGLE}),
        ("PROP", [2], {TRIANGLE}),
        ("GRSHEL", [1], {SHELL_2}),
        ("GRSHEL", [2], {SHELL_1}),
        ("GRSH3N", [1], {TRIANGLE}),
        ("GRBRIC/EXT", [1], SIDES_11 | {SHELL_2, BETWEEN}),
        ("GRBRIC", [1], SIDES_11 | {SHELL_2, BETWEEN}),
        ("SURF", [2, 3], {SHELL_1, SHELL_2, TRIANGLE}),
        ("SEG", [1, 1, 2, 3, 4], {SHELL_1}),
        ("SEG", [1, 5, 7, 6, 6], {TRIANGLE}),
        ("SEG", [1, 5, 7, 6, 0], {TRIANGLE}),
    ],
)
def test_surfaces(tmp_path, kind, ids, expected):
    made = deck().surface(1, kind, ids).surface(2, "PART", [1]).surface(3, "PART", [2])
    made.block("/GRSHEL/SHEL/1", (2,), title="g").block("/GRSHEL/GENE/2", (1, 1), title="g")
    made.block("/GRSH3N/SH3N/1", (3,), title="g").block("/GRBRIC/BRIC/1", (11,), title="g")
    assert faces(made.tie(1, 99, 1), tmp_path) == expected


def test_a_coat_of_shells_takes_the_place_of_the_solids_faces(tmp_path):
    made = deck().surface(1, "PART/EXT", [1, 3]).tie(1, 99, 1)
    found = radioss.read(made.write(tmp_path / "d.rad"), "d.rad")
    ids = found.ties[0].faces
    assert len(ids) == 2 + 8  # two coats, ten outer faces of which two are coated
    assert sorted(ids.element[ids.part == 1].tolist()) == [1, 2]


def test_ten_node_tetrahedra_give_four_triangles_each_face(tmp_path):
    nodes = {1: (0, 0, 0), 2: (2, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2), 5: (1, 0, 0), 6: (1, 1, 0), 7: (0, 1, 0)}
    nodes |= {8: (0, 0, 1), 9: (1, 0, 1), 10: (0, 1, 1), 21: (0.3, 0.3, -0.1)}
    made = RadiossDeck().nodes(nodes).elastic().solid().part()
    made.elements("TETRA10", 1, {1: tuple(range(1, 11))}).node_group(99, [21]).surface(1, "PART/EXT", [1])
    found = faces(made.tie(1, 99, 1), tmp_path)
    assert len(found) == 16
    assert {frozenset(s) for s in ({1, 5, 7}, {5, 2, 6}, {7, 6, 3}, {5, 6, 7})} <= found
    made = RadiossDeck().nodes(nodes).elastic().solid().part()
    made.elements("TETRA10", 1, {1: (1, 2, 3, 4, 0, 0, 0, 0, 0, 0)}).node_group(99, [21]).surface(1, "PART/EXT", [1])
    assert len(faces(made.tie(1, 99, 1), tmp_path)) == 4


# /SET

SET_CASES = [
    ("NODE", [21, 23], [21, 23]),
    ("NODE_G", [21, 24, 2], [21, 23]),
    ("PART", [2], [5, 6, 7]),
    ("PART_G", [2, 2], [5, 6, 7]),
    ("SUBS", [6], [5, 6, 7]),
    ("MAT", [2], [5, 6, 7]),
    ("PROP", [2], [5, 6, 7]),
    ("SHELL", [2], [2, 3, 5, 6]),
    ("SH3N", [3], [5, 6, 7]),
    ("SOLID", [11], [2, 3, 5, 6, 12, 13, 15, 16]),
    ("SEG", [1, 1, 2, 3, 4], [1, 2, 3, 4]),
    ("SET", [7], [21, 22]),
    ("BOX", [1], [21]),
]


def clause(word: str, ids) -> str:
    return f"{word:<10}" + "".join(f"{i:>10}" for i in ids)


@pytest.mark.parametrize("word, ids, expected", SET_CASES)
def test_set_clauses(tmp_path, word, ids, expected):
    made = deck().block("/SET/GENERAL/1", clause(word, ids), title="wanted")
    made.block("/SET/GENERAL/7", clause("NODE", [21, 22]), title="other")
    made.block("/BOX/RECTA/1", (0, 0, 0), (0.4, 0.4, 0.0), (0.6, 0.6, 0.2), title="box")
    made.nodes({101: (0, 0, 50), 102: (1, 0, 50), 103: (0, 1, 50)}).surface(1000, "SEG", [1, 101, 102, 103])
    assert slaves(made.tie(1, 1, 1000), tmp_path) == expected


def test_sets_continue_and_delete(tmp_path):
    rows = [clause("NODE", [21, 22, 23]), clause("", [24]), clause("NODE_D", [22])]
    made = deck().block("/SET/GENERAL/5", *rows, title="wanted").surface(1, "PART", [1])
    assert slaves(made.tie(1, 5, 1), tmp_path) == [21, 23, 24]


def test_sets_as_surfaces(tmp_path):
    made = deck().block("/SET/GENERAL/50", clause("PART", [1]), clause("SH3N", [3]), clause("SHELL_D", [1]), title="s")
    assert faces(made.tie(1, 99, 50), tmp_path) == {SHELL_2, TRIANGLE}
    made = deck().block("/SET/GENERAL/50", clause("SOLID", [11]), title="s")
    assert faces(made.tie(1, 99, 50), tmp_path) == SIDES_11 | {SHELL_2, BETWEEN}


def test_sets_that_collect(tmp_path):
    made = deck().block("/SET/COLLECT/50", clause("NODE", [21]), title="s")
    made.block("/SET/COLLECT/50", clause("NODE", [24]), title="s").surface(1, "PART", [1])
    assert slaves(made.tie(1, 50, 1), tmp_path) == [21, 24]


@pytest.mark.parametrize(
    "blocks, message",
    [
        ([("/GRNOD/GRNOD/1", (2,)), ("/GRNOD/GRNOD/2", (1,))], "GRNOD 1 holds itself"),
        ([("/SET/GENERAL/1", clause("SET", [1]))], "SET 1 holds itself"),
        ([("/GRNOD/GRNOD/1", (7,))], "GRNOD 7 is not in the deck"),
        ([("/GRNOD/NODE/1", (21, 77))], "node 77 is not in the deck"),
        ([("/GRNOD/PART/1", (77,))], "part 77 is not in the deck"),
        ([("/GRNOD/SHELLY/1", (77,))], "sets of type SHELLY are not understood"),
        ([("/SET/GENERAL/1", clause("NODES", [21]))], "the clause NODES is not understood"),
        ([("/SET/GENERAL/1", clause("NODE_X", [21]))], "the clause NODE_X is not understood"),
        ([("/GRNOD/NODE/1", (21,)), ("/GRNOD/NODE/1", (22,))], "GRNOD 1 is repeated"),
        ([("/GRNOD/BOX/1", (5,)), ("/BOX/RECTA/5", (3, 0, 0))], "this box is not understood"),
        ([("/GRNOD/NODE/1",)], "node group 1 is empty"),
    ],
)
def test_sets_that_cannot_be_resolved(tmp_path, blocks, message):
    made = default_tie()
    for keyword, *cards in blocks:
        made.block(keyword, *cards, title="s")
    with pytest.raises(decks.SceneError, match=r"^deck_0000.rad: line \d+: /.*" + message):
        slaves(made.tie(1, 1, 1), tmp_path)


# choosing ties


def two_ties() -> RadiossDeck:
    made = default_tie().node_group(1, [21]).node_group(2, [22])
    return made.tie(1, 1, 1, title="left weld").tie(2, 2, 1, title="right weld")


@pytest.mark.parametrize("wanted", ["right weld", "Right Weld", "2"])
def test_ties_are_chosen_by_title_or_id(tmp_path, wanted):
    assert [tie.name for tie in read(two_ties(), tmp_path, ties=[wanted]).deck.ties] == ["right weld"]


def test_all_ties_by_default_and_those_of_one_name_apart(tmp_path):
    made = two_ties().node_group(3, [23]).tie(3, 3, 1, title="left weld")
    assert [tie.name for tie in read(made, tmp_path).deck.ties] == ["left weld", "right weld", "left weld (3)"]


def test_a_tie_that_is_not_there(tmp_path):
    with pytest.raises(decks.SceneError, match="no tie is called 'rigt weld'; did you mean 'right weld'"):
        read(two_ties(), tmp_path, ties=["rigt weld"])


def test_a_slave_that_is_a_master_elsewhere(tmp_path):
    made = deck().surface(1, "PART", [1]).surface(2, "PART", [2]).node_group(1, [21]).node_group(2, [7])
    made.nodes({31: (5, 0, 0), 32: (6, 0, 0), 33: (5, 1, 0)}).surface(3, "SEG", [1, 31, 32, 33])
    made.node_group(3, [23]).tie(1, 2, 3, title="chain").tie(2, 3, 2, title="top")
    with pytest.raises(decks.SceneError, match=r"node 7 is a slave here and a master of tie 'top'.*--tie"):
        read(made, tmp_path)


def test_slaves_of_their_own_surface_are_passed_over(tmp_path):
    found = read(default_tie().node_group(1, [5, 21]).tie(1, 1, 1), tmp_path)
    assert found.scene.node_sets["weld slaves"].tolist() == [21]
    assert any("1 slaves, the first is node 5, belong to its own surface" in line for line in found.deck.warnings)


def test_a_tie_that_keeps_no_slave_is_left_out(tmp_path):
    """One whose slaves are all of another tie, and one that finds nothing within its tolerance: the others stay."""
    shared = two_ties().tie(3, 1, 1, title="once more")
    found = read(shared, tmp_path)
    assert [tie["name"] for tie in found.scene.tables["tie"]] == ["left weld", "right weld"]
    assert any("tie 'once more': every slave belongs to another tie" in line for line in found.deck.warnings)
    far = two_ties().nodes({31: (0.5, 0.5, 0.3)}).node_group(3, [31]).tie(3, 3, 1, 2, title="far")
    found = read(far.block("/ADMAS/5/2", (0.5, 31), title="far"), tmp_path)
    assert [tie["name"] for tie in found.scene.tables["tie"]] == ["left weld", "right weld"]
    assert set(found.scene.node_sets) == {"left weld slaves", "right weld slaves"}
    assert any("tie 'far': none of its slaves is left" in line for line in found.deck.warnings)
    decks.compiled(found)
