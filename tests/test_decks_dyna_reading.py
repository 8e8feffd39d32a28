"""How LS-DYNA keyword decks are written: fixed, comma and long format, comments, parameters, includes."""

import re
from pathlib import Path

import pytest
from dyna_cards import DynaDeck
from tiefmu import decks
from tiefmu.decks import dyna, parameters
from tiefmu.decks.dyna import keywords, ties
from tiefmu.decks.element_properties import nodal

PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.0005)}


def plate(made: DynaDeck | None = None, nodes: dict | None = None) -> DynaDeck:
    made = (made or DynaDeck()).nodes(nodes or PLATE | PIN).elastic().shell().part()
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).list_of("NODE", 1, [11]).tie()
    return made.block("ELEMENT_MASS", ("IIR", 1, 11, 0.5))


def read(text: str, tmp_path):
    (tmp_path / "deck.k").write_text(text)
    return decks.read(tmp_path / "deck.k")


def positions(deck) -> dict:
    return dict(zip(deck.node_id.tolist(), deck.position.tolist()))


@pytest.mark.parametrize("form", ["fixed", "comma", "long", "i10"])
def test_formats_say_the_same(tmp_path, form):
    found = read(plate(DynaDeck(form)).text(), tmp_path)
    deck = found.deck
    assert positions(deck) == {number: list(map(float, x)) for number, x in (PLATE | PIN).items()}
    assert [tie.name for tie in deck.ties] == ["weld"] and deck.parts[1].title == "part 1"
    assert deck.materials[1].young == 2.1e11 and deck.materials[1].poisson == 0.3
    assert nodal(deck).mass.tolist() == pytest.approx([7800 * 1e-3 * 2 / 4] * 4 + [0.5])
    assert found.scene.node_sets["weld slaves"].tolist() == [11]


def test_marks_behind_keywords_change_the_format_of_one_keyword(tmp_path):
    made = plate(nodes=PLATE)
    made.form = "long"
    made.block("NODE +", ("IRRR", 11, 0.5, 0.5, 0.0005))
    made.form = "i10"
    made.block("ELEMENT_SHELL%", ("I" * 6, 3, 1, 1, 2, 3, 4))
    deck = read(made.text(), tmp_path).deck
    assert positions(deck)[11] == [0.5, 0.5, 0.0005] and deck.elements["shell4"].id.tolist() == [1, 3]
    made = plate(DynaDeck("long"), PLATE)
    made.form = "fixed"
    made.block("NODE-", ("IRRR", 11, 0.5, 0.5, 0.0005))
    assert positions(read(made.text(), tmp_path).deck)[11] == [0.5, 0.5, 0.0005]


def test_fields_that_touch(tmp_path):
    text = plate().text().replace("*NODE\n", "*NODE\n12345678-1.234567890E+01-1.234567890E+01-1.234567890E+01\n")
    assert positions(read(text, tmp_path).deck)[12345678] == [-12.3456789] * 3
    row = "".join(f"{n:>8}" for n in (10000001, 10000002, 12345678, 12345679, 12345680, 12345681))
    nodes = {12345678: (0, 0, 9), 12345679: (1, 0, 9), 12345680: (1, 1, 9), 12345681: (0, 1, 9)}
    made = plate(nodes=PLATE | PIN | nodes).part(10000002).block("ELEMENT_SHELL", row)
    assert "  " not in row and read(made.text(), tmp_path).deck.elements["shell4"].part.tolist() == [1, 10000002]


def test_comments_case_blanks_and_line_ends(tmp_path):
    found = ["$# LS-DYNA Keyword file created by LS-PrePost(R)"]
    for line in plate().text().split("\n"):
        found += [line.lower() + "  " if line.startswith("*") else line, "$#   eid     pid      n1", "$ a remark"]
    found += ["*NODE", "what follows *END is not read"]
    text = "\r\n".join(found)
    assert len(read(text, tmp_path).deck.node_id) == 5
    assert read(text.replace("*keyword", "*KEYWORD 200M MEMORY=12"), tmp_path).deck.ties[0].name == "weld"


def test_keywords_in_pieces(tmp_path):
    made = DynaDeck()
    for number, x in (PLATE | PIN).items():
        made.nodes({number: x})
    made.block("PART", ("iii", 1, 1, 1), "second, with a comma", ("iii", 2, 1, 1), title="first")
    made.block(
        "SECTION_SHELL_TITLE", "thin", ("ii", 1, 2), ("rrrr", 1e-3, 0.0, 0.0, 0.0), "thick", ("ii", 2, 2), ("r", 2e-3)
    )
    made.block("MAT_ELASTIC_TITLE", "steel", ("irrr", 1, 7800.0, 2.1e11, 0.3))
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).list_of("NODE", 1, [11]).tie()
    deck = read(made.text(), tmp_path).deck
    assert deck.parts[2].title == "second, with a comma" and deck.properties[2].values["thickness"] == 2e-3
    assert deck.properties[2].title == "thick" and deck.materials[1].title == "steel"


def test_without_the_keyword_line(tmp_path):
    assert len(read(plate(DynaDeck(bare=True)).text(), tmp_path).deck.ties) == 1


def test_which_files_are_decks(tmp_path):
    for name, text, answer in (
        ("a.txt", "$ remark\n*KEYWORD\n", True),
        ("b.inp", "*HEADING\n** Abaqus\n*NODE\n", False),
        ("c.inp", "*Node\n 1, 0., 0., 0.\n*Element, type=S4\n", False),
        ("d.dat", "*NODE\n       1\n*ELEMENT_SHELL\n", True),
        ("e.k", "*NODE\n       1\n", True),
        ("f.k", "** Abaqus\n*NODE\n", False),
        ("g.k", "#RADIOSS STARTER\n", False),
        ("h.k", "", False),
    ):
        (tmp_path / name).write_text(text)
        assert (decks.language(tmp_path / name) is dyna) == answer, name


# parameters


@pytest.mark.parametrize("form", ["fixed", "comma", "long"])
def test_parameters(tmp_path, form):
    made = DynaDeck(form)
    made.block("PARAMETER", ("srsr", "R thick", 1e-3, "Rheight", 0.0005), ("srsi", "I  sect", 1, "Rminus", -0.5))
    made.block("PARAMETER_EXPRESSION", "Rtwice    2*thick+0*(sqrt(4.0)-2)", "I fourty  min(40,50)/1.d0")
    made.nodes(PLATE).block("NODE", ("IRRR", 11, "-&minus", 0.5, "&HEIGHT")).elastic()
    made.block("SECTION_SHELL", ("ii", "&sect", 2), ("r", "&twice")).part(1, "&sect")
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).list_of("NODE", 1, [11]).tie()
    made.block("ELEMENT_MASS", ("IIR", "&fourty", 11, 0.5))
    if form == "long":
        made.lines = [
            line.replace("Rtwice    ", "Rtwice".ljust(20)).replace("I fourty  ", "I fourty".ljust(20))
            for line in made.lines
        ]
    deck = read(made.text(), tmp_path).deck
    assert deck.properties[1].values["thickness"] == 2e-3
    assert positions(deck)[11] == [0.5, 0.5, 0.0005]


def test_parameters_of_one_file(tmp_path):
    (tmp_path / "inner.k").write_text(
        "*KEYWORD\n*PARAMETER_LOCAL\nRz        3.0\n*NODE\n      21             1.0             1.0              &z\n"
    )
    text = plate().text().replace("*KEYWORD\n", "*KEYWORD\n*PARAMETER\nRz        5.0\n*INCLUDE\ninner.k\n")
    text = text.replace("*END", "*NODE\n      22             1.0             1.0              &z\n*END")
    found = positions(read(text, tmp_path).deck)
    assert found[21][2] == 3.0 and found[22][2] == 5.0


@pytest.mark.parametrize(
    "text, value",
    [
        ("1+2*3", 7.0),
        ("(1+2)*3", 9.0),
        ("2**3", 8.0),
        ("-a/4", -0.5),
        ("1.5d1", 15.0),
        ("SQRT(&A*8)", 4.0),
        ("max(1, a, 3)", 3.0),
        ("mod(7,4)", 3.0),
        ("sin(pi/2)", 1.0),
        ("nint(2.5)", 3.0),
    ],
)
def test_expressions(text, value):
    scope = parameters.Scope()
    scope.names["a"] = 2
    assert parameters.evaluate(text, scope) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["1/0", "9**9**9**9", "__import__('os')", "a.b", "[1]", "'x'*9", "1 if 1 else 2", "(" * 400 + ")" * 400, "sqrt(-1)"]
    + ["a" * 2000, "", "lambda: 1", "open(1)", "True", "1 +"],
)
def test_expressions_that_are_none(text):
    scope = parameters.Scope()
    scope.names["a"] = 2
    with pytest.raises((ValueError, KeyError)):
        parameters.evaluate(text, scope)


# includes


def test_includes(tmp_path):
    lines = plate().text().split("\n")
    start = lines.index("*NODE")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "nodes.k").write_text("\n".join(["*KEYWORD", *lines[start : start + 3], "*END", "*nonsense"]))
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "a long name of a file.k").write_text("\n".join(["*NODE", *lines[start + 3 : start + 6]]))
    main = ["*KEYWORD", "*INCLUDE_PATH", "more", "*INCLUDE", "sub\\nodes.k", "a long name +", "of a file.k"]
    main[-2:] = ["a long name of +", " a file.k"]
    main[-2:] = ["a long name of a file.k"]
    found = read("\n".join([*main, *lines[start + 6 :]]), tmp_path)
    assert sorted(found.deck.node_id) == [1, 2, 3, 4, 11] and len(found.deck.ties) == 1


def test_a_file_name_on_two_cards(tmp_path):
    lines = plate().text().split("\n")
    start = lines.index("*NODE")
    (tmp_path / "folder_of_nodes.k").write_text("\n".join(lines[start : start + 6]))
    text = "\n".join(["*KEYWORD", "*INCLUDE", "folder_ +", "of_nodes.k", *lines[start + 6 :]])
    assert len(read(text, tmp_path).deck.node_id) == 5


def component() -> DynaDeck:
    """A plate with a pin and a tie of its own, in metres, for *INCLUDE_TRANSFORM."""
    made = DynaDeck().nodes({1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 12: (0.5, 0.25, 0)})
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).part(1, 1, 1).shell(1, 2e-3).elastic(1)
    made.list_of("NODE", 1, [12]).list_of("PART", 1, [1]).tie(1, 1, (4, 2), 5, title="upper")
    return made.block("ELEMENT_MASS_NODE_SET", ("IIR", 1, 1, 0.25))


def included(tmp_path, offsets=(0,) * 7, other=0, factors=(1.0, 1.0, 1.0), transform=0, *blocks):
    component().write(tmp_path / "component.k")
    made = plate()
    cards = [("i" * 7, *offsets), ("i", other), ("rrr", *factors), ("i", transform)]
    made.block("INCLUDE_TRANSFORM", "component.k", *cards)
    for keyword, *rows in blocks:
        made.block(keyword, *rows)
    return read(made.text(), tmp_path).deck


def test_offsets_of_an_included_component(tmp_path):
    deck = included(tmp_path, (1000, 2000, 3000, 4000, 5000, 6000, 7000), 8000)
    assert positions(deck)[1004] == [0, 1, 0] and deck.elements["shell4"].id.tolist() == [1, 2001]
    assert deck.parts[3001].property == 8001 and deck.parts[3001].material == 4001
    tie = next(tie for tie in deck.ties if tie.name == "upper")
    assert deck.node_id[tie.slaves].tolist() == [1012] and tie.faces.element.tolist() == [2001]
    masses = dict(zip(deck.node_id.tolist(), nodal(deck).mass))
    assert masses[1012] == 0.25 and masses[1001] == pytest.approx(7800 * 2e-3 / 4)
    assert any(line.startswith("*INCLUDE_TRANSFORM: component.k") for line in deck.notes)


def test_units_of_an_included_component(tmp_path):
    """kg, mm, s from a component in t, m, ms: factors from its units to the deck's."""
    offsets = (1000, 2000, 3000, 4000, 5000, 6000, 7000)
    deck = included(tmp_path, offsets, 8000, (1000.0, 1e-3, 1000.0))
    assert positions(deck)[1003] == [1000, 1000, 0]
    assert deck.properties[8001].values["thickness"] == pytest.approx(2.0)
    assert deck.materials[4001].density == pytest.approx(7800 * 1000 / 1000**3)
    assert deck.materials[4001].young == pytest.approx(2.1e11 * 1000 / 1000 / 1e-6)
    masses = dict(zip(deck.node_id.tolist(), nodal(deck).mass))
    assert masses[1012] == 250 and masses[1001] == pytest.approx(7800 * 2e-3 / 4 * 1000)


@pytest.mark.parametrize(
    "rows, expected",
    [
        ([("srrr", "TRANSL", 1.0, 2.0, 3.0)], (2, 2, 3)),
        ([("srrr", "SCALE", 2.0, 0.0, 3.0)], (2, 0, 0)),
        ([("srrrrrrr", "ROTATE", 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 90.0)], (2, -1, 0)),
        ([("srrrrrrr", "ROTATE", 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 90.0)], (0, 1, 0)),
        (
            [
                *[("srrrr", "POINT", 1.0, 0.0, 0.0, 0.0), ("srrrr", "POINT", 2.0, 0.0, 0.0, 5.0)],
                ("srrr", "ROTATE", 1.0, 2.0, -90.0),
            ],
            (0, -1, 0),
        ),
        ([("srrrrrr", "MIRROR", 3.0, 0.0, 0.0, 4.0, 0.0, 0.0)], (5, 0, 0)),
        ([("srrr", "TRANSL2ND", 1.0, 3.0, 5.0)], (1 + 5 * 2 / 5**0.5, 5 / 5**0.5, 0)),
        ([("srrrr", "ROTATE3NA", 1.0, 2.0, 3.0, 90.0)], (0, 1, 0)),
        ([("srrrrrr", "POS6N", 1.0, 2.0, 4.0, 4.0, 1.0, 3.0)], (0, 0, 0)),
        ([("srrr", "SCALE", 2.0, 2.0, 2.0), ("srrr", "TRANSL", 0.0, 1.0, 0.0)], (2, 1, 0)),
        ([("srrr", "TRANSL", 0.0, 1.0, 0.0), ("srrr", "SCALE", 2.0, 2.0, 2.0)], (2, 2, 0)),
    ],
)  # fmt: skip
def test_transformations_move_node_2_of_the_component(tmp_path, rows, expected):
    offsets = (1000, 2000, 3000, 4000, 5000, 6000, 7000)
    deck = included(
        tmp_path, offsets, 8000, (1.0, 1.0, 1.0), 9, ("DEFINE_TRANSFORMATION_TITLE", "moves it", ("i", 9), *rows)
    )
    assert positions(deck)[1002] == pytest.approx(expected, abs=1e-14)
    assert positions(deck)[3] == [2, 1, 0]


def test_components_in_components(tmp_path):
    """The inner offsets, factors and moves first, then those of the outer file."""
    component().write(tmp_path / "component.k")
    middle = DynaDeck().block(
        "INCLUDE_TRANSFORM", "component.k", ("i" * 7, *[10] * 7), ("i", 10), ("rrr", 1.0, 1.0, 2.0), ("i", 1)
    )
    middle.block("DEFINE_TRANSFORMATION", ("i", 1), ("srrr", "TRANSL", 1.0, 0.0, 0.0)).write(tmp_path / "middle.k")
    made = plate().block("DEFINE_TRANSFORMATION", ("i", 7), ("srrrrrrr", "ROTATE", 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 90.0))
    made.block("INCLUDE_TRANSFORM", "middle.k", ("i" * 7, *[100] * 7), ("i", 100), ("rrr", 1.0, 1.0, 10.0), ("i", 7))
    deck = read(made.text(), tmp_path).deck
    # node 2 at x = 1: times 2, plus 1, times 10, then turned; the move by 1 is in units of the middle file
    assert positions(deck)[112] == pytest.approx([0, 30, 0], abs=1e-13)
    assert sorted(deck.parts) == [1, 111]


def test_messages_name_the_included_file(tmp_path):
    (tmp_path / "inner.k").write_text("*KEYWORD\n$\n*NODE\n      21             one\n")
    with pytest.raises(decks.SceneError) as error:
        read(plate().text().replace("*END", "*INCLUDE\ninner.k\n*END"), tmp_path)
    assert str(error.value) == "inner.k: line 4: *NODE: columns 9 to 24: expected a number, found 'one'"


# units


@pytest.mark.parametrize(
    "names, density, young, units",
    [
        (("mm", "sec", "ton"), 7.85e-9, 2.1e5, ("mm", "t", "s")),
        (("m", "sec", "kg"), 7850.0, 2.1e11, ("m", "kg", "s")),
        (None, 7.85e-9, 2.1e5, ("mm", "t", "s")),
        (None, 7.85e-6, 210.0, ("mm", "kg", "ms")),
        (None, 7850.0, 2.1e11, ("m", "kg", "s")),
    ],
)
def test_units(tmp_path, names, density, young, units):
    made = DynaDeck().nodes(PLATE | PIN).elastic(1, density, young).shell().part()
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).list_of("NODE", 1, [11]).tie()
    if names:
        made.block("CONTROL_UNITS", ("sss", *names))
    found = read(made.text(), tmp_path).deck
    assert found.units == units
    assert any("names no units" in line for line in found.warnings) == (names is None)


def test_the_page_names_every_keyword():
    page = (Path(__file__).parents[1] / "docs/decks_dyna.md").read_text()
    named = set(re.findall(r"`\*([A-Z0-9_]+)", page))
    known = keywords.USED | keywords.FILES | set().union(*keywords.SAFE.values()) | set(keywords.MATTERS)
    assert known <= named, sorted(known - named)
    for name in named:
        assert keywords.place(name)[0] != "unknown", name
        if name.startswith("CONTACT_"):
            assert ties.kind_of(name.removeprefix("CONTACT_")) is not None or "AUTOMATIC" in name
