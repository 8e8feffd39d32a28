"""Tied contacts of LS-DYNA decks: kinds, sides, sets of all kinds, tolerances."""

import deck_checks
import numpy as np
import pytest
from dyna_cards import DynaDeck
from tiefmu import decks
from tiefmu.decks import dyna

# Two shells side by side (elements 1, 2 of part 1), a triangle (3, part 2), a hexahedron under them (10, part 3) whose
# top is the first shell, another one beside it (11), and four nodes above.
NODES = {
    **{1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (2, 0, 0), 6: (2, 1, 0), 7: (3, 0, 0)},
    **{11: (0, 0, -1), 12: (1, 0, -1), 13: (1, 1, -1), 14: (0, 1, -1), 15: (2, 0, -1), 16: (2, 1, -1)},
    **{21: (0.5, 0.5, 0.05), 22: (1.5, 0.5, 0.05), 23: (2.2, 0.2, 0.04), 24: (0.5, 0.5, 0.06)},
}


def deck(moved: dict | None = None) -> DynaDeck:
    found = DynaDeck().nodes(NODES | (moved or {})).elastic().elastic(2).shell().shell(2, 2e-3).solid(3)
    found.part(1).part(2, 2, 2).part(3, 3).elements("SHELL", 1, {1: (1, 2, 3, 4), 2: (2, 5, 6, 3)})
    found.elements("SHELL", 2, {3: (5, 7, 6, 6)})
    found.elements("SOLID", 3, {10: (11, 12, 13, 14, 1, 2, 3, 4), 11: (12, 15, 16, 13, 2, 5, 6, 3)})
    return found.list_of("NODE", 99, [21, 22, 23, 24]).block("ELEMENT_MASS_NODE_SET", ("IIR", 1, 99, 2.0))


def read(made: DynaDeck, tmp_path, **options):
    return decks.read(made.write(tmp_path / "deck.k"), **options)


def slaves(made: DynaDeck, tmp_path) -> list:
    return deck_checks.slaves(dyna.read(made.write(tmp_path / "deck.k"), "deck.k"))


def faces(made: DynaDeck, tmp_path) -> set:
    return deck_checks.faces(dyna.read(made.write(tmp_path / "deck.k"), "deck.k"))


# kinds of contacts

# rotations handed on to masters, rotations of slaves tied; slaves that are moved onto the surface have no arm
TRANSLATIONS, OFFSET_MOMENT, ALL = (False, False), (True, False), (True, True)
MOVED = (True, False)


@pytest.mark.parametrize(
    "name, rotations, moved, penalty",
    [
        ("TIED_NODES_TO_SURFACE", MOVED, True, False),
        ("TIED_NODES_TO_SURFACE_OFFSET", TRANSLATIONS, False, True),
        ("TIED_NODES_TO_SURFACE_CONSTRAINED_OFFSET", OFFSET_MOMENT, False, False),
        ("TIED_SURFACE_TO_SURFACE", MOVED, True, False),
        ("TIED_SURFACE_TO_SURFACE_OFFSET", TRANSLATIONS, False, True),
        ("TIED_SURFACE_TO_SURFACE_CONSTRAINED_OFFSET", OFFSET_MOMENT, False, False),
        ("TIED_SURFACE_TO_SURFACE_FAILURE", TRANSLATIONS, False, True),
        ("TIED_SHELL_EDGE_TO_SURFACE", ALL, True, False),
        ("TIED_SHELL_EDGE_TO_SURFACE_OFFSET", ALL, False, True),
        ("TIED_SHELL_EDGE_TO_SURFACE_CONSTRAINED_OFFSET", ALL, False, False),
        ("TIED_SHELL_EDGE_TO_SURFACE_BEAM_OFFSET", ALL, False, True),
        ("TIED_SHELL_EDGE_TO_SOLID", ALL, True, False),
        ("SPOTWELD", ALL, True, False),
        ("SPOTWELD_BEAM_OFFSET", ALL, False, True),
        ("SPOTWELD_CONSTRAINED_OFFSET", ALL, False, False),
        ("SPOTWELD_WITH_TORSION", ALL, False, True),
        ("TIEBREAK_NODES_TO_SURFACE", TRANSLATIONS, False, True),
        ("TIEBREAK_NODES_ONLY", TRANSLATIONS, False, True),
        ("AUTOMATIC_SURFACE_TO_SURFACE_TIEBREAK", TRANSLATIONS, False, True),
        ("AUTOMATIC_SURFACE_TO_SURFACE_TIED_WELD", TRANSLATIONS, False, True),
        ("AUTOMATIC_SURFACE_TO_SURFACE_MORTAR_TIED", TRANSLATIONS, False, True),
    ],
)
def test_kinds(tmp_path, name, rotations, moved, penalty):
    found = read(deck().tie(99, 1, name=name), tmp_path)
    (tie,) = found.deck.ties
    assert (tie.hand_on_rotations, tie.slave_rotations) == rotations and tie.adjust == moved
    assert any("it is taken as kinematic" in line for line in found.deck.warnings) == penalty
    assert found.scene.tables["tie"][0]["formulation"] == ("optimized" if name.endswith("SOLID") else "default")
    at = dict(zip(found.scene.node_id.tolist(), found.scene.position.tolist()))
    assert at[21] == [0.5, 0.5, 0.0 if moved else 0.05]


def test_rotations_of_slaves_and_masters(tmp_path):
    """Shells over shells: tied with rotations, by the offset alone, by translations alone."""
    upper = {31: (0.2, 0.2, 1e-3), 32: (0.8, 0.2, 1e-3), 33: (0.8, 0.8, 1e-3), 34: (0.2, 0.8, 1e-3)}
    for name, master, slave in (
        ("TIED_SHELL_EDGE_TO_SURFACE", "true", "true"),
        ("TIED_NODES_TO_SURFACE_CONSTRAINED_OFFSET", "true", "false"),
        ("TIED_NODES_TO_SURFACE", "true", "false"),
        ("TIED_NODES_TO_SURFACE_OFFSET", "false", "false"),
    ):
        made = deck(upper).part(4).elements("SHELL", 4, {4: tuple(upper)}).tie(4, 1, (3, 3), name=name)
        columns = read(made, tmp_path).scene.columns
        turning = dict(zip(columns["id"].tolist(), columns["rotations"].tolist()))
        assert (turning[1], turning[31]) == (master, slave), name
        inertia = dict(zip(columns["id"].tolist(), columns["inertia"].tolist()))
        assert (inertia[31] > 0) == (slave == "true")


def test_masters_keep_rotations_that_another_tie_needs(tmp_path):
    made = deck().list_of("NODE", 1, [21]).list_of("NODE", 2, [22])
    made.tie(1, 1, name="TIED_NODES_TO_SURFACE_OFFSET", title="no moment")
    found = read(made.tie(2, 1, name="SPOTWELD_CONSTRAINED_OFFSET", number=2, title="weld"), tmp_path)
    assert [tie.hand_on_rotations for tie in found.deck.ties] == [True, True]
    assert any("tie 'no moment': the moment of its offset goes to its masters" in w for w in found.deck.warnings)


@pytest.mark.parametrize("name", ["AUTOMATIC_SINGLE_SURFACE_TIED", "TIED_SOMETHING", "AUTOMATIC_GENERAL_TIEBREAK"])
def test_ties_that_are_not_understood_are_said(tmp_path, name):
    found = read(deck().tie(99, 1, name=name, number=2).tie(99, 1), tmp_path)
    assert any(f"*CONTACT_{name}_ID: ties of this kind are not understood" in line for line in found.deck.warnings)


def test_contacts_that_do_not_tie_are_the_hosts(tmp_path):
    found = read(deck().tie(99, 1, name="AUTOMATIC_SINGLE_SURFACE", number=2).tie(99, 1), tmp_path).deck
    assert found.ignored["*CONTACT"] == ["contacts that do not tie are the host's", 1] and len(found.ties) == 1


# options and names


def test_names_and_options(tmp_path):
    made = deck().tie(99, 1, name="AUTOMATIC_GENERAL", option="").tie(21, 1, (4, 3), option="")
    made.list_of("NODE", 21, [21]).list_of("NODE", 22, [22]).list_of("NODE", 23, [23])
    made.block(
        "CONTACT_TIED_NODES_TO_SURFACE_MPP_ID",
        *["        77a weld, of sorts", ("ii", 1, 200), "&        0         1", ("i" * 4, 22, 1, 4, 3), "", ""],
    )
    made.block("CONTACT_TIED_NODES_TO_SURFACE_TITLE", "        78second", ("i" * 4, 23, 2, 4, 3))
    assert [tie.name for tie in read(made, tmp_path).deck.ties] == ["tie 2", "a weld, of sorts", "second"]
    for wanted, name in (("2", "tie 2"), ("77", "a weld, of sorts"), ("SECOND", "second")):
        assert [tie.name for tie in read(made, tmp_path, ties=[wanted]).deck.ties] == [name]
    with pytest.raises(decks.SceneError, match=r"\*CONTACT: no tie is called 'secnd'; did you mean 'second'"):
        read(made, tmp_path, ties=["secnd"])


def test_comma_format_with_a_heading(tmp_path):
    made = deck()
    made.form = "comma"
    assert [tie.name for tie in read(made.tie(99, 1, title="left, upper"), tmp_path).deck.ties] == ["left, upper"]


# tolerance


def distances(found) -> list:
    return found.scene.node_sets["weld slaves"].tolist()


def test_the_criterion(tmp_path):
    """0.05 of the shorter diagonal is 0.0707 over the quads and 0.05 over the triangle's side; thicknesses are thin."""
    near = {21: (0.5, 0.5, 0.0707), 22: (1.5, 0.5, 0.0708), 23: (2.2, 0.2, 0.049), 24: (2.2, 0.2, 0.051)}
    found = read(deck(near).list_of("PART", 5, [1, 2]).tie(99, 5, (4, 2)), tmp_path)
    assert distances(found) == [21, 23]
    assert any("2 slaves, the first is node 22, are farther" in line for line in found.deck.warnings)


def thick(part: str = "PART", *contact) -> DynaDeck:
    """A plate 0.2 thick, and above it one 0.1 thick at 0.179, a corner at 0.181: 0.6 (0.1 + 0.2) = 0.18."""
    made = DynaDeck().elastic().shell(1, 0.2).shell(2, 0.1).part(1)
    made.block(part, ("iii", 2, 2, 1), *contact, title="upper")
    made.nodes({1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (0.2, 0.2, 0.179), 6: (0.8, 0.2, 0.179)})
    made.nodes({7: (0.8, 0.8, 0.181), 8: (0.2, 0.8, 0.179)})
    return made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).elements("SHELL", 2, {2: (5, 6, 7, 8)})


@pytest.mark.parametrize(
    "options, kept",
    [
        ({}, [5, 6, 8]),
        ({"thickness": (0.11, 0.0)}, [5, 6, 7, 8]),  # 0.6 (0.11 + 0.2)
        ({"thickness": (0.0, 0.25)}, [5, 6, 7, 8]),
        ({"scale": (1.1, 1.0)}, [5, 6, 7, 8]),
        ({"thickness": (-0.3, 0.0)}, [5, 6, 8]),  # 0.6 0.3 alone
        ({"thickness": (-0.2, -0.11)}, [5, 6, 7, 8]),
    ],
)
def test_thicknesses(tmp_path, options, kept):
    assert distances(read(thick().tie(2, 1, (3, 3), **options), tmp_path)) == kept


def test_contact_thickness_of_parts(tmp_path):
    for values in ((0.11, 0.0), (0.0, 1.1)):
        made = thick("PART_CONTACT", ("rrrrrr", 0.0, 0.0, 0.0, 0.0, *values)).tie(2, 1, (3, 3))
        assert distances(read(made, tmp_path)) == [5, 6, 7, 8]


def test_no_slave_within_its_tolerance(tmp_path):
    far = dict.fromkeys((21, 22, 23, 24), (0.5, 0.5, 0.5))
    with pytest.raises(decks.SceneError, match="tie 'weld': all its slaves are dropped"):
        read(deck(far).tie(99, 1), tmp_path)


def test_solids_have_no_thickness(tmp_path):
    near = {21: (0.5, 0.5, 0.0707), 22: (1.5, 0.5, 0.0708)}
    made = deck(near)
    found = read(made.list_of("NODE", 5, [21, 22]).tie(5, 3, (4, 3)), tmp_path)
    assert distances(found) == [21]


# sides

SHELL_1, SHELL_2, TRIANGLE = frozenset({1, 2, 3, 4}), frozenset({2, 3, 5, 6}), frozenset({5, 6, 7})
SIDES_10 = {frozenset(s) for s in ({11, 12, 13, 14}, {1, 2, 11, 12}, {3, 4, 13, 14}, {1, 4, 11, 14})}
SIDES_11 = {frozenset(s) for s in ({12, 15, 16, 13}, {2, 5, 12, 15}, {3, 6, 13, 16}, {5, 6, 15, 16})}
BETWEEN = frozenset({2, 3, 12, 13})


def with_sets(made: DynaDeck) -> DynaDeck:
    made.segments(1, [(1, 2, 3, 4)]).segments(2, [(5, 7, 6, 6)]).segments(3, [(5, 7, 6, 0)])
    made.list_of("SHELL", 1, [1, 3]).list_of("PART", 1, [1, 2]).list_of("PART", 3, [3]).list_of("SOLID", 1, [11])
    made.block("SET_SEGMENT_GENERAL", ("i", 4), ("si", "PART", 2), ("siiii", "SEG", 1, 2, 3, 4))
    made.block("SET_SEGMENT_GENERAL", ("i", 5), ("si", "PART", 3), ("si", "SHELL", 3))
    made.block("SET_SEGMENT_ADD", ("i", 6), ("ii", 1, 2)).block(
        "SET_SEGMENT_TITLE", "named", ("i", 7), ("iiii", 2, 5, 6, 3)
    )
    made.block("SET_SEGMENT_GENERAL", ("i", 8), ("si", "BOX", 1)).block("SET_SEGMENT_GENERAL", ("i", 9), ("s", "ALL"))
    made.block("SET_SEGMENT_GENERAL", ("i", 10), ("si", "SET_SOLID", 1), ("si", "SET_SHELL", 1))
    return made.block("DEFINE_BOX", ("irrrrrr", 1, -0.5, 1.5, -0.5, 1.5, -0.5, 0.5))


@pytest.mark.parametrize(
    "number, kind, expected",
    [
        (1, 0, {SHELL_1}),
        (2, 0, {TRIANGLE}),
        (3, 0, {TRIANGLE}),
        (4, 0, {TRIANGLE, SHELL_1}),
        (5, 0, {TRIANGLE, SHELL_1, SHELL_2} | SIDES_10 | SIDES_11),
        (6, 0, {SHELL_1, TRIANGLE}),
        (7, 0, {SHELL_2}),
        (8, 0, {SHELL_1}),
        (9, 0, {TRIANGLE, SHELL_1, SHELL_2} | SIDES_10 | SIDES_11),
        (10, 0, {TRIANGLE, SHELL_1, SHELL_2, BETWEEN} | SIDES_11),
        (1, 1, {SHELL_1, TRIANGLE}),
        (1, 2, {SHELL_1, SHELL_2, TRIANGLE}),
        (3, 3, {SHELL_1, SHELL_2} | SIDES_10 | SIDES_11),
        (2, 3, {TRIANGLE}),
        (0, 5, {TRIANGLE, SHELL_1, SHELL_2} | SIDES_10 | SIDES_11),
        (3, 6, {SHELL_1, SHELL_2, TRIANGLE}),
    ],
)
def test_master_sides(tmp_path, number, kind, expected):
    assert faces(with_sets(deck()).tie(99, number, (4, kind)), tmp_path) == expected


@pytest.mark.parametrize(
    "number, kind, expected",
    [
        (99, 4, [21, 22, 23, 24]),
        (2, 0, [5, 6, 7]),
        (1, 1, [1, 2, 3, 4, 5, 6, 7]),
        (2, 3, [5, 6, 7]),
        (1, 2, [1, 2, 3, 4, 5, 6, 7]),
        (3, 3, [1, 2, 3, 4, 5, 6, 11, 12, 13, 14, 15, 16]),
        (3, 6, [1, 2, 3, 4, 5, 6, 7]),
    ],
)
def test_slave_sides(tmp_path, number, kind, expected):
    made = (
        with_sets(deck()).nodes({101: (0, 0, 50), 102: (1, 0, 50), 103: (0, 1, 50)}).segments(50, [(101, 102, 103, 0)])
    )
    assert slaves(made.tie(number, 50, (kind, 0)), tmp_path) == expected


def test_boxes_of_sides(tmp_path):
    made = with_sets(deck()).tie(99, 1, (4, 2), boxes=(1, 1))
    assert slaves(made, tmp_path) == [21, 22, 24] and faces(made, tmp_path) == {SHELL_1}


def test_inner_nodes_of_solids_are_no_slaves(tmp_path):
    n = 2
    number = {p: 100 + i for i, p in enumerate(np.ndindex(n + 1, n + 1, n + 1), 1)}
    nodes = {i: np.array(p) + (0, 0, 5) for p, i in number.items()}
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = {50 + i: tuple(number[tuple(np.add(c, d))] for d in corners) for i, c in enumerate(np.ndindex(n, n, n))}
    made = deck().nodes(nodes).part(7, 3).elements("SOLID", 7, cells)
    assert slaves(made.tie(7, 1, (3, 3)), tmp_path) == sorted(set(nodes) - {number[1, 1, 1]})


# sets of nodes


@pytest.mark.parametrize(
    "keyword, rows, expected",
    [
        ("SET_NODE", [("iii", 21, 0, 23)], [21, 23]),
        ("SET_NODE_LIST", [("i" * 8, *[21] * 8), ("i", 24)], [21, 24]),
        ("SET_NODE_LIST_GENERATE", [("iiii", 21, 22, 24, 30)], [21, 22, 24]),
        ("SET_NODE_LIST_GENERATE_INCREMENT", [("iii", 21, 24, 2)], [21, 23]),
        ("SET_NODE_COLUMN", [("irr", 21, 1.0, 2.0), ("i", 24)], [21, 24]),
        ("SET_NODE_ADD", [("ii", 99, 98)], [11, 21, 22, 23, 24]),
        ("SET_NODE_GENERAL", [("sii", "NODE", 21, 11), ("si", "PART", 2), ("si", "DNODE", 11)], [5, 6, 7, 21]),
        (
            "SET_NODE_GENERAL",
            [("s", "ALL"), ("si", "DPART", 1), ("si", "DPART", 3), ("si", "DNODE", 24)],
            [7, 21, 22, 23, 101, 102, 103],
        ),
        ("SET_NODE_GENERAL", [("si", "BOX", 1), ("si", "SHELL", 3), ("si", "SET_NODE", 98)], [5, 6, 7, 11, 21, 22]),
    ],
)
def test_node_sets(tmp_path, keyword, rows, expected):
    made = deck().block(keyword, ("i", 1), *rows).list_of("NODE", 98, [11])
    made.block("DEFINE_BOX", ("irrrrrr", 1, 0.1, 1.9, 0.1, 0.9, 0.01, 0.055))
    made.nodes({101: (0, 0, 50), 102: (1, 0, 50), 103: (0, 1, 50)}).segments(50, [(101, 102, 103, 0)])
    assert slaves(made.tie(1, 50, (4, 0)), tmp_path) == expected


@pytest.mark.parametrize(
    "keyword, rows, expected",
    [
        ("SET_PART_LIST_GENERATE", [("ii", 1, 2)], {SHELL_1, SHELL_2, TRIANGLE}),
        ("SET_PART_COLUMN", [("i", 2)], {TRIANGLE}),
        ("SET_PART_ADD", [("i", 8)], {TRIANGLE}),
        ("SET_PART_LIST_TITLE", [("ii", 1, 2)], {SHELL_1, SHELL_2, TRIANGLE}),
    ],
)
def test_part_sets(tmp_path, keyword, rows, expected):
    title = ["named"] if keyword.endswith("TITLE") else []
    made = deck().block(keyword, *title, ("i", 1), *rows).list_of("PART", 8, [2])
    assert faces(made.tie(99, 1, (4, 2)), tmp_path) == expected


@pytest.mark.parametrize(
    "keyword, rows, expected",
    [
        ("SET_SHELL_LIST_GENERATE", [("ii", 2, 3)], {SHELL_2, TRIANGLE}),
        ("SET_SHELL_GENERAL", [("si", "PART", 1), ("si", "ELEM", 3), ("si", "DELEM", 2)], {SHELL_1, TRIANGLE}),
        ("SET_SHELL_GENERAL", [("s", "ALL"), ("si", "DPART", 1)], {TRIANGLE}),
        ("SET_SHELL_ADD", [("i", 8)], {SHELL_2}),
    ],
)
def test_shell_sets(tmp_path, keyword, rows, expected):
    made = deck().block(keyword, ("i", 1), *rows).list_of("SHELL", 8, [2])
    assert faces(made.tie(99, 1, (4, 1)), tmp_path) == expected


@pytest.mark.parametrize(
    "blocks, message",
    [
        ([("SET_NODE_ADD", ("i", 1), ("i", 2)), ("SET_NODE_ADD", ("i", 2), ("i", 1))], "node set 1 holds itself"),
        ([("SET_NODE_ADD", ("i", 1), ("i", 7))], "node set 7 is not in the deck"),
        ([("SET_NODE_LIST", ("i", 1), ("ii", 21, 77))], "node 77 is not in the deck"),
        ([("SET_NODE_GENERAL", ("i", 1), ("si", "PART", 77))], "part 77 is not in the deck"),
        ([("SET_NODE_GENERAL", ("i", 1), ("si", "SALECPT", 1))], "'SALECPT' is not understood"),
        ([("SET_NODE_GENERAL", ("i", 1), ("si", "BOX", 5))], "box 5 is not in the deck"),
        ([("SET_NODE_INTERSECT", ("i", 1), ("i", 99))], "sets with INTERSECT are not understood"),
        ([("SET_NODE", ("i", 1), ("i", 21)), ("SET_NODE", ("i", 1), ("i", 22))], "node set 1 is repeated"),
        ([("SET_NODE", ("i", 1))], r"its slave side \(node set 1\) holds no nodes"),
        ([], "node set 1 is not in the deck"),
    ],
)
def test_sets_that_cannot_be_resolved(tmp_path, blocks, message):
    made = deck()
    for keyword, *cards in blocks:
        made.block(keyword, *cards)
    with pytest.raises(decks.SceneError, match=r"^deck.k: line \d+: \*.*" + message):
        slaves(made.tie(1, 1), tmp_path)


@pytest.mark.parametrize(
    "sides, types, message",
    [
        ((99, 1), (4, 4), "a side of type 4 is not understood"),
        ((99, 1), (7, 3), "a side of type 7 is not understood"),
        ((99, 0), (4, 3), "names no part"),
        ((99, 77), (4, 3), "part 77 is not in the deck"),
        ((99, 77), (4, 0), "segment set 77 is not in the deck"),
    ],
)
def test_sides_that_are_wrong(tmp_path, sides, types, message):
    with pytest.raises(decks.SceneError, match=rf"^deck.k: line \d+: \*CONTACT_\w+: .*{message}"):
        slaves(deck().tie(*sides, types), tmp_path)


def test_a_slave_that_is_a_master_elsewhere(tmp_path):
    made = deck().list_of("NODE", 1, [7]).nodes({31: (3, 0, 0.01), 32: (4, 0, 0.01), 33: (3, 1, 0.01)})
    made.segments(9, [(31, 32, 33, 0)]).tie(1, 9, (4, 0), 1, "chain").tie(99, 2, (4, 3), 2, "top")
    with pytest.raises(decks.SceneError, match=r"node 7 is a slave here and a master of tie 'top'.*--tie"):
        read(made, tmp_path)
    assert read(made, tmp_path, ties=["top"]).deck.ties[0].name == "top"


def test_slaves_of_their_own_surface_are_passed_over(tmp_path):
    found = read(deck().list_of("NODE", 1, [5, 21]).tie(1, 1), tmp_path)
    assert distances(found) == [21]
    assert any("1 slaves, the first is node 5, belong to its own surface" in line for line in found.deck.warnings)


def test_birth_and_death(tmp_path):
    made = deck().block(
        "CONTACT_TIED_NODES_TO_SURFACE", ("i" * 4, 99, 1, 4, 3), ("r" * 8, *[0.0] * 6, 0.1, 0.5), ("r", 1.0)
    )
    assert any("birth and death times are left aside" in line for line in read(made, tmp_path).deck.warnings)


# ties of whole parts


def tower(order=("low", "high")) -> DynaDeck:
    """Three parts of bricks on each other, 0.01 apart, tied as whole parts: the middle one is a slave below and a
    master above."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    made = DynaDeck().elastic().solid(1)
    for part, (size, base) in enumerate([(4.0, 0.0), (2.0, 4.01), (1.0, 6.02)], 1):
        ids = [100 * part + i for i in range(8)]
        made.nodes(
            {n: tuple(np.round(np.array(c) * size + (0.1 * part, 0.1 * part, base), 6)) for n, c in zip(ids, corners)}
        )
        made.part(part).elements("SOLID", part, {part: tuple(ids)})
    ties = {"low": (2, 1, (3, 3), 1, "low"), "high": (3, 2, (3, 3), 2, "high")}
    for name in order:
        made.tie(*ties[name], "TIED_SURFACE_TO_SURFACE_CONSTRAINED_OFFSET")
    return made


@pytest.mark.parametrize("order", [("low", "high"), ("high", "low")])
def test_a_part_that_is_slave_of_one_and_master_of_another(tmp_path, order):
    found = read(tower(order), tmp_path)
    sets = {name: ids.tolist() for name, ids in found.scene.node_sets.items()}
    assert sets == {"low slaves": [200, 201, 202, 203], "high slaves": [300, 301, 302, 303]}
    rows = found.scene.segments[np.isin(found.scene.segment_id, found.scene.segment_sets["high"])]
    assert [set(row) for row in rows.tolist()] == [{204, 205, 206, 207}]
    assert any("of its 6 segments the 1 that hold slaves are taken" in line for line in found.deck.notes)
    decks.compiled(found)


def test_a_part_that_is_the_slave_of_two_ties(tmp_path):
    made = tower(("low",)).tie(2, 3, (3, 3), 2, "high", "TIED_SURFACE_TO_SURFACE_CONSTRAINED_OFFSET")
    made.lines = [line.replace("6.02", "9.02") for line in made.lines]  # the upper part away: nothing is in reach
    found = read(made, tmp_path)
    assert [tie["name"] for tie in found.scene.tables["tie"]] == ["low"]
    assert any("tie 'high': " in line and "left out" in line for line in found.deck.warnings)
    made = tower(("low",)).nodes({1: (0, 0, 6.02), 2: (5, 0, 6.02), 3: (5, 5, 6.02), 4: (0, 5, 6.02)})
    made.segments(5, [(1, 2, 3, 4)]).tie(2, 5, (3, 0), 2, "high", "TIED_SURFACE_TO_SURFACE_CONSTRAINED_OFFSET")
    sets = {name: ids.tolist() for name, ids in read(made, tmp_path).scene.node_sets.items()}
    assert sets == {"low slaves": [200, 201, 202, 203], "high slaves": [204, 205, 206, 207]}
