"""Abaqus and CalculiX: springs and dashpots as springs of the scene."""

import pytest
from input_deck import InputDeck
from test_decks_abaqus_model import column, deck, read, refused
from tiefmu import decks


def spring(kind: str, rows: tuple, keyword="SPRING", nodes=(11, 12), options="") -> InputDeck:
    return deck().elements(kind, "fastener", {5: nodes}).block(f"{keyword}, ELSET=fastener{options}", *rows)


def springs_of(made, tmp_path):
    found = read(made, tmp_path)
    decks.compiled(found)
    return found.scene.tables.get("spring", [])


def test_axial_springs_and_dashpots(tmp_path):
    (table,) = springs_of(spring("SPRINGA", ("", "1000.")), tmp_path)
    assert table == {"nodes": [11, 12], "kind": "axial", "stiffness": 1000.0, "damping": 0.0}
    (table,) = springs_of(spring("SPRINGA", (", ,", "1000."), nodes=(12, 11)), tmp_path)
    assert table == {"nodes": [12, 11], "kind": "axial", "stiffness": 1000.0, "damping": 0.0}
    (table,) = springs_of(spring("DASHPOTA", ("", "7."), "DASHPOT"), tmp_path)
    assert table == {"nodes": [11, 12], "kind": "axial", "stiffness": 0.0, "damping": 7.0}


def test_a_fastener_of_a_spring_and_a_dashpot(tmp_path):
    made = (
        spring("SPRINGA", (" ", "1000.")).elements("DASHPOTA", "d", {6: (11, 12)}).block("DASHPOT, ELSET=d", "", "7.")
    )
    assert [table["damping"] for table in springs_of(made, tmp_path)] == [0.0, 7.0]


@pytest.mark.parametrize("freedom, key", [(1, "stiffness"), (3, "stiffness"), (5, "rotational_stiffness")])
def test_springs_of_fixed_directions(tmp_path, freedom, key):
    made = spring("SPRING2", (f"{freedom}, {freedom}", "1000."))
    if freedom > 3:
        made.block("RIGID BODY, REF NODE=12, TIE NSET=plate nodes").block('NSET, NSET="plate nodes"', "1, 2, 3, 4")
        made.elements("ROTARYI", "j", {7: (11,), 8: (12,)}).block("ROTARY INERTIA, ELSET=j", "1., 1., 1.")
    (table,) = springs_of(made, tmp_path)
    expected = [0.0, 0.0, 0.0]
    expected[(freedom - 1) % 3] = 1000.0
    assert table["kind"] == "bushing" and table[key] == expected
    assert column(read(made, tmp_path), "rotations")[12] == ("true" if freedom > 3 else "false")


def test_springs_to_ground(tmp_path):
    (table,) = springs_of(spring("SPRING1", ("2", "1000."), nodes=(11,)), tmp_path)
    assert table == {"ground": [11], "kind": "bushing", "stiffness": [0.0, 1000.0, 0.0]}


def test_oriented_springs(tmp_path):
    made = spring("SPRING2", ("1, 1", "1000."), options=", ORIENTATION=o")
    made.block("ORIENTATION, NAME=O, SYSTEM=RECTANGULAR", "0., 1., 0., -1., 0., 0.")
    (table,) = springs_of(made, tmp_path)
    assert table["stiffness"] == [0.0, 1000.0, 0.0]


def test_springs_that_are_not_linear_take_their_slope_at_rest(tmp_path):
    made = spring("SPRINGA", ("", "-10., -1.", "0., 0.", "30., 2.", "90., 3."), options=", NONLINEAR")
    found = read(made, tmp_path)
    assert found.scene.tables["spring"][0]["stiffness"] == 15.0
    assert any("*SPRING: is nonlinear; its slope at rest, 15, is taken" in line for line in found.deck.warnings)


def test_springs_away_from_the_tie_are_the_hosts(tmp_path):
    assert springs_of(spring("SPRINGA", ("", "1000."), nodes=(12, 13)), tmp_path) == []
    found = read(spring("SPRINGA", ("", "1000."), nodes=(2, 13)), tmp_path)
    plain = read(deck(), tmp_path)
    assert column(found, "stiffness")[2] == pytest.approx(column(plain, "stiffness")[2] + 1000.0)


@pytest.mark.parametrize(
    "made, words",
    [
        (spring("SPRINGA", ("", "-1.")), "*SPRING: -1 is no stiffness"),
        (spring("SPRINGA", ("",)), "*SPRING: has no stiffness"),
        (spring("SPRING2", ("7, 7", "1.")), "*SPRING: expected its degrees of freedom, 1 to 6"),
        (spring("SPRINGA", ("", "1."), nodes=(11,)), "*ELEMENT: element 5: a node is missing"),
    ],
)
def test_springs_that_are_none(tmp_path, made, words):
    assert words in refused(made, tmp_path)
