"""How Radioss starter decks are written: formats, comments, includes, submodels, transformations, units."""

import re
from pathlib import Path

import numpy as np
import pytest
from deck_cards import RadiossDeck
from tiefmu import decks
from tiefmu.decks import radioss
from tiefmu.decks.element_properties import nodal
from tiefmu.decks.radioss import keywords, ties

PLATE = {1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.25, 0.5, 0.0)}


def plate(deck=None, nodes=None) -> RadiossDeck:
    """A square shell and a node tied to it."""
    deck = (deck or RadiossDeck()).nodes(nodes or PLATE | PIN).elastic().shell().part()
    deck.elements("SHELL", 1, {1: (1, 2, 3, 4)})
    deck.block("/ADMAS/0/1", (0.5, 1), title="pin")
    return deck.node_group(1, [11]).surface(1, "PART", [1]).tie()


def read(text, tmp_path, name="deck_0000.rad"):
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return decks.read(tmp_path / name)


def positions(deck) -> dict:
    return dict(zip(deck.node_id.tolist(), deck.position.tolist()))


@pytest.mark.parametrize("version", [41, 44, 51, 90, 100, 110, 120, 140, 2017, 2021, 2022, 2024, 2026])
def test_formats_say_the_same(tmp_path, version):
    deck = read(plate(RadiossDeck(version)).text(), tmp_path).deck
    assert positions(deck) == {number: list(map(float, x)) for number, x in (PLATE | PIN).items()}
    assert [tie.name for tie in deck.ties] == ["weld"]
    assert deck.parts[1].title == "part 1" and deck.materials[1].young == 2.1e11
    values = nodal(deck)
    assert values.mass.tolist() == pytest.approx([7800 * 1e-3 / 4] * 4 + [0.5])


def test_comments_and_blank_cards(tmp_path):
    lines = plate().text().split("\n")
    found = []
    for line in lines:
        found += [line, "# a remark", "$ another", "#---1----|----2----|"]
        if line.startswith(("/NODE", "/SHELL")):
            found += ["", "          "]  # a blank card is no node
    deck = read("\r\n".join(found), tmp_path).deck
    assert len(deck.node_id) == 5 and len(deck.elements["shell4"].id) == 1


def test_what_follows_enddata_is_not_read(tmp_path):
    text = plate().text().replace("/END", "#enddata")
    assert len(read(text + "/NODE\n" + "nonsense\n", tmp_path).deck.node_id) == 5


@pytest.mark.parametrize(
    "text, value",
    [
        ("1.5", 1.5),
        (".5", 0.5),
        ("3.", 3.0),
        ("1.5E-3", 1.5e-3),
        ("1.5d-3", 1.5e-3),
        ("1.5D-3", 1.5e-3),
        ("1.5-3", 1.5e-3),
        ("+1.5+3", 1.5e3),
        ("-2-1", -0.2),
        ("", 0.0),
    ],
)
@pytest.mark.parametrize("left", [False, True])
def test_numbers_as_fortran_reads_them(tmp_path, text, value, left):
    field = f"{text:<20}" if left else f"{text:>20}"
    node = f"{4:>10}{field}{1.0:>20}{0.0:>20}"
    written = plate().text().replace(f"{4:>10}{0.0:>20.12g}{1.0:>20.12g}{0.0:>20.12g}", node)
    assert positions(read(written, tmp_path).deck)[4] == [value, 1.0, 0.0]


def test_fields_that_touch(tmp_path):
    big = {1000000001: (-1.234567890123e-100,) * 3}
    text = plate(nodes=PLATE | PIN | big).text().replace(" " * 2 + "-1.2345", "  -1.2345")
    row = "1000000002" + "-1.2345678901234E+01" * 3
    deck = read(text.replace("/NODE\n", f"/NODE\n{row}\n"), tmp_path).deck
    assert positions(deck)[1000000002] == [-12.345678901234] * 3


def test_includes_also_inside_a_block(tmp_path):
    lines = plate().text().split("\n")
    start = lines.index("/NODE")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "nodes.inc").write_text("\n".join(["# in a file of its own", *lines[start + 2 : start + 4]]))
    main = [*lines[: start + 2], "#include parts/nodes.inc", *lines[start + 4 :]]
    (tmp_path / "rest.inc").write_text("\n".join([*main[start + 8 :], "#enddata", "nonsense"]))
    main = [*main[: start + 8], "#include rest.inc", "/END"]
    found = read("\n".join(main), tmp_path)
    assert sorted(found.deck.node_id) == [1, 2, 3, 4, 11] and len(found.deck.ties) == 1


def test_messages_name_the_included_file(tmp_path):
    lines = plate().text().split("\n")
    start = lines.index("/NODE")
    (tmp_path / "nodes.inc").write_text(lines[start + 2] + "\n\n#\n         3                 one\n")
    text = "\n".join([*lines[: start + 2], "#include nodes.inc", *lines[start + 4 :]])
    with pytest.raises(decks.SceneError) as error:
        read(text, tmp_path)
    assert str(error.value) == "nodes.inc: line 4: /NODE: columns 11 to 30: expected a number, found 'one'"


def test_submodels_shift_ids(tmp_path):
    inner = RadiossDeck()
    inner.lines = []
    inner.nodes({1: (0, 0, 1), 2: (1, 0, 1), 3: (1, 1, 1), 4: (0, 1, 1), 12: (0.5, 0.25, 1)})
    inner.elements("SHELL", 1, {1: (1, 2, 3, 4)}).part(1, 1, 1).shell(1, 2e-3).elastic(1)
    inner.node_group(1, [12]).surface(1, "PART", [1]).tie(title="upper")
    inner.block("/ADMAS/0/1", (0.25, 1), title="pin")
    deck = plate()
    deck.lines += ["//SUBMODEL/7", "moved", "".join(f"{n:>10}" for n in (1000, 2000, 3000, 4000, 5000, 6000))]
    deck.lines += [*inner.lines, "//ENDSUB"]
    deck.block("/TRANSFORM/TRA/1", (0, 0.0, 0.0, 9.0, 0, 0, 7), title="up")
    found = read(deck.text(), tmp_path).deck
    assert positions(found)[2004] == [0, 1, 10] and positions(found)[4] == [0, 1, 0]
    assert found.parts[4001].property == 6001 and found.parts[4001].material == 5001
    assert found.elements["shell4"].id.tolist() == [1, 3001]
    tie = next(tie for tie in found.ties if tie.name == "upper")
    assert found.node_id[tie.slaves].tolist() == [2012] and tie.faces.element.tolist() == [3001]
    values = dict(zip(found.node_id.tolist(), nodal(found).mass))
    assert values[2012] == 0.25 and values[2001] == pytest.approx(2 * values[1])


def test_a_submodel_with_one_offset_shifts_all_ids_by_it(tmp_path):
    deck = RadiossDeck()
    deck.lines += ["//SUBMODEL/7", "moved", f"{100:>10}"]
    found = plate(deck)
    found.lines.append("//ENDSUB")
    deck = read(found.text(), tmp_path).deck
    assert sorted(deck.node_id) == [101, 102, 103, 104, 111] and sorted(deck.parts) == [101]


@pytest.mark.parametrize(
    "kind, cards, x, expected",
    [
        ("TRA", [(2, 1.0, 2.0, 3.0, 0, 0, 0)], (1, 0, 0), (2, 2, 3)),
        ("TRA", [(2, 9.0, 9.0, 9.0, 1, 3, 0)], (1, 0, 0), (2, 1, 0)),
        ("ROT", [(2, 0.0, 0.0, 0.0, 0, 0, 0), (None, 0.0, 0.0, 2.0, 90.0)], (1, 0, 3), (0, 1, 3)),
        ("ROT", [(2, 1.0, 0.0, 0.0, 0, 0, 0), (None, 1.0, 0.0, 1.0, -90.0)], (3, 0, 5), (1, -2, 5)),
        ("SYM", [(2, 1.0, 0.0, 0.0, 0, 0, 0), (None, 3.0, 0.0, 0.0)], (4, 5, 6), (-2, 5, 6)),
        ("SCA", [(2, 2.0, 0.0, 3.0, 0, 0, 0)], (1, 2, 3), (2, 2, 9)),
        ("SCA", [(2, 2.0, 1.0, 3.0, 2, 0, 0)], (3, 2, 3), (5, 2, 9)),
        (
            "MATRIX",
            [(2, 0.0, -1.0, 0.0, 5.0, 0), (None, 1.0, 0.0, 0.0, 6.0), (None, 0.0, 0.0, 1.0, 7.0)],
            (1, 2, 3),
            (3, 7, 10),
        ),
    ],
)
def test_transformations(tmp_path, kind, cards, x, expected):
    deck = plate(nodes=PLATE | PIN | {21: x}).node_group(2, [21]).block(f"/TRANSFORM/{kind}/3", *cards, title="t")
    found = positions(read(deck.text(), tmp_path).deck)
    assert found[21] == pytest.approx(expected, abs=1e-15) and found[3] == [1, 1, 0]


def test_submodels_move_before_node_groups(tmp_path):
    deck = plate()
    deck.lines += ["//SUBMODEL/7", "moved", f"{0:>10}"]
    deck.nodes({21: (1, 0, 0)}).lines.append("//ENDSUB")
    deck.node_group(2, [21]).block("/TRANSFORM/ROT/1", (2, 0.0, 0.0, 0.0), (None, 0.0, 0.0, 1.0, 90.0), title="turns")
    deck.block("/TRANSFORM/TRA/2", (0, 1.0, 0.0, 0.0, 0, 0, 7), title="first moves")
    assert positions(read(deck.text(), tmp_path).deck)[21] == pytest.approx([0, 2, 0], abs=1e-15)


def test_submodels_in_submodels(tmp_path):
    deck = plate()
    deck.lines += ["//SUBMODEL/7", "outer", f"{100:>10}", "//SUBMODEL/8", "inner", f"{0:>10}{1000:>10}"]
    deck.nodes({1: (1, 0, 0)}).lines.append("//ENDSUB")
    deck.nodes({2: (2, 0, 0)}).lines.append("//ENDSUB")
    deck.block("/TRANSFORM/TRA/1", (0, 0.0, 0.0, 5.0, 0, 0, 7), title="both")
    deck.block("/TRANSFORM/TRA/2", (0, 0.0, 3.0, 0.0, 0, 0, 8), title="the inner one")
    found = positions(read(deck.text(), tmp_path).deck)
    assert found[1101] == [1, 3, 5] and found[102] == [2, 0, 5] and found[3] == [1, 1, 0]


def test_encrypted_blocks_are_refused_by_name(tmp_path):
    deck = plate().block("/MAT/LAW2/5", "x" * 20 + "Q" * 60, title="secret")
    with pytest.raises(decks.SceneError, match="/MAT/LAW2/5: is encrypted and cannot be read"):
        read(deck.text(), tmp_path)


# units


def units_of(tmp_path, units, density, young):
    deck = RadiossDeck(units=units).nodes(PLATE | PIN).elastic(1, density, young).shell().part()
    deck.elements("SHELL", 1, {1: (1, 2, 3, 4)}).block("/ADMAS/0/1", (0.5, 1), title="pin")
    return read(deck.node_group(1, [11]).surface(1, "PART", [1]).tie().text(), tmp_path)


@pytest.mark.parametrize(
    "units, density, young",
    [
        (("kg", "m", "s"), 7850.0, 2.1e11),
        (("Mg", "mm", "s"), 7.85e-9, 2.1e5),
        (("t", "mm", "s"), 7.85e-9, 2.1e5),
        (("kg", "mm", "ms"), 7.85e-6, 210.0),
        (("g", "mm", "ms"), 7.85e-3, 2.1e5),
        (("g", "cm", "mus"), 7.85, 2.1),
    ],
)
def test_units_of_begin(tmp_path, units, density, young):
    found = units_of(tmp_path, units, density, young)
    mass, length, time = ({"Mg": "t", "mus": "us"}.get(word, word) for word in units)
    assert found.scene.tables["units"] == {"length": length, "mass": mass, "time": time}
    assert not found.deck.warnings


def test_units_without_a_name_become_si(tmp_path):
    found = units_of(tmp_path, ("kg", "0.0254", "s"), 7850 * 0.0254**3, 2.1e11 * 0.0254)
    assert "units" not in found.scene.tables
    assert found.scene.position[1].tolist() == pytest.approx([0.0254, 0, 0])
    assert found.scene.columns["mass"][-1] == 0.5
    assert found.scene.columns["inertia"][0] == pytest.approx(nodal(found.deck).inertia[0] * 0.0254**2)
    k = dict(zip(found.deck.node_id.tolist(), nodal(found.deck).stiffness))[1]
    assert found.scene.columns["stiffness"][0] == pytest.approx(k)  # kg/s2


def test_units_that_cannot_be_right_are_warned_of(tmp_path):
    found = units_of(tmp_path, ("kg", "mm", "ms"), 7.85e-9, 2.1e5)
    assert len(found.deck.warnings) == 1
    assert (
        "its units cannot be right" in found.deck.warnings[0] and "in mm, t, s it would have" in found.deck.warnings[0]
    )


def test_missing_units_are_guessed_from_a_material_and_said(tmp_path):
    found = units_of(tmp_path, None, 7.85e-9, 2.1e5)
    assert found.deck.units == ("mm", "t", "s") and "names no units; mm, t, s are taken" in found.deck.warnings[0]


def test_a_word_that_is_no_unit(tmp_path):
    with pytest.raises(decks.SceneError, match=r"line 5: /BEGIN: 'furlong' is no unit"):
        units_of(tmp_path, ("kg", "furlong", "s"), 7850.0, 2.1e11)


def test_decks_are_recognised_by_their_first_line(tmp_path):
    (tmp_path / "a.k").write_text(plate().text())
    assert decks.language(tmp_path / "a.k") is radioss
    (tmp_path / "b.toml").write_text("#RADIOSS STARTER\n")
    assert not decks.is_deck(tmp_path / "b.toml")
    assert np.array_equal(decks.read(tmp_path / "a.k").deck.node_id, [1, 2, 3, 4, 11])


def test_the_page_names_every_keyword():
    page = (Path(__file__).parents[1] / "docs/decks_radioss.md").read_text()
    named = set(re.findall(r"`/+([A-Z0-9_]+)", page))
    known = keywords.USED | set().union(*keywords.SAFE.values()) | set(keywords.MATTERS)
    assert named - {"END"} == known
    for flag in (*ties.FORMULATIONS, *ties.REFUSED):
        assert re.search(rf"Spotflag [\d, ]*\b{flag}\b", page), flag
