"""Damaged Abaqus and CalculiX decks: one line that names the file, the line and the keyword; never a traceback."""

import random

import deck_checks
import numpy as np
import pytest
from input_deck import InputDeck
from tiefmu import UsageError, decks
from tiefmu.report import report

RICH = """*HEADING
all of it
*PART, NAME=Plate
*NODE
1, 0., 0., 0.
2, 2., 0., 0.
3, 2., 1., 0.
4, 0., 1., 0.
*ELEMENT, TYPE=S4R
1, 1, 2, 3, 4
*NSET, NSET=all, GENERATE
1, 4, 1
*ELSET, ELSET=all
1
*SHELL SECTION, ELSET=all, MATERIAL=steel, OFFSET=SPOS
0.001, 5
*END PART
*PART, NAME=Block
*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
*ELEMENT, TYPE=C3D8R, ELSET=brick
1, 1, 2, 3, 4, 5,
6, 7, 8
*SOLID SECTION, ELSET=brick, MATERIAL=steel
,
*END PART
*ASSEMBLY, NAME=whole
*INSTANCE, NAME=low, PART=block
0., 0., -1.
*END INSTANCE
*INSTANCE, NAME=high, PART=plate
0.2, 0.3, 0.01
0.2, 0.3, 0.01, 0.2, 0.3, 1., 20.
*END INSTANCE
*NODE
901, 0.4, 0.5, 0.02
902, 0.4, 0.5, 0.5
903, 1., 0.5, 1.
*ELEMENT, TYPE=MASS, ELSET=points
901, 901
902, 902
*MASS, ELSET=points
0.25
*ELEMENT, TYPE=SPRINGA, ELSET=fastener
905, 901, 902
*SPRING, ELSET=fastener

1000.
*ELEMENT, TYPE=SPRING2, ELSET=bush
906, 901, 902
*SPRING, ELSET=bush, ORIENTATION=o
2, 2
70.
*ORIENTATION, NAME=o
0., 1., 0., -1., 0., 0.
*ELSET, ELSET=_s, INTERNAL, INSTANCE=high
1
*SURFACE, NAME=edge
_s, E1
*SURFACE, NAME=top
low.brick, S2
*SURFACE, NAME=over
_s, SPOS
*NSET, NSET=pin
901
*TIE, NAME=first, ADJUST=YES, POSITION TOLERANCE=0.5
edge, top
*SURFACE, NAME=bottom, TYPE=NODE
low.1
low.2
*COUPLING, CONSTRAINT NAME=c, REF NODE=903, SURFACE=bottom
*KINEMATIC
1, 6
*RIGID BODY, REF NODE=903, PIN NSET=high.all
*END ASSEMBLY
*MATERIAL, NAME=STEEL
*DENSITY
7800.,
*ELASTIC
2.1E11, 0.3
*INITIAL CONDITIONS, TYPE=VELOCITY
low.brick nodes, 3, -2.
*BOUNDARY
high.2, ENCASTRE
*AMPLITUDE, NAME=a
0., 0., 1., 1.
*STEP
*DYNAMIC, EXPLICIT
, 1.
*BOUNDARY, AMPLITUDE=a
low.3, 1, 1, 0.5
*DLOAD
, GRAV, 9.81, 0., 0., -1.
*NODE FILE
U
*END STEP
""".replace("*NSET, NSET=pin", '*NSET, NSET="brick nodes", ELSET=brick, INSTANCE=low\n*NSET, NSET=pin').replace(
    "low.brick nodes, 3", '"brick nodes", 3'
)  # fmt: skip


BITS = [*deck_checks.BITS, b"*", b"**", b"*PART, NAME=plate", b",", b'"', b"=", b"1.D0", b"low.", b"E9"]


def a_field(line: bytes, chance: random.Random) -> bytes:
    """Another field."""
    fields = line.split(b",")
    fields[chance.randrange(len(fields))] = chance.choice(BITS)
    return b",".join(fields)


def a_field_less(line: bytes, chance: random.Random) -> bytes:
    fields = line.split(b",")
    fields.pop(chance.randrange(len(fields)))
    return b",".join(fields)


OWN = [a_field, a_field_less]


def test_the_rich_deck_is_sound(tmp_path):
    (tmp_path / "deck.inp").write_text(RICH)
    found = decks.read(tmp_path / "deck.inp")
    assert {row["tie"] for row in report(decks.compiled(found))["slaves"]} == {"first"}
    assert len(found.deck.rigid) == 2 and len(found.deck.elements["spring"].id) == 2


@pytest.mark.parametrize("seed", range(4))
def test_random_damage(tmp_path, seed):
    chance, path = random.Random(seed), tmp_path / "deck.inp"
    for _ in range(60):
        text = deck_checks.damaged(RICH.encode(), chance, BITS, OWN)
        path.write_bytes(text)
        try:
            decks.compiled(decks.read(path))
        except (decks.SceneError, UsageError) as error:
            assert "\n" not in str(error) and str(error).startswith(str(path)), (error, text)


@pytest.mark.parametrize("end", range(3, RICH.count("\n"), 7))
def test_cut_decks(tmp_path, end):
    (tmp_path / "deck.inp").write_text("\n".join(RICH.split("\n")[:end]))
    try:
        decks.compiled(decks.read(tmp_path / "deck.inp"))
    except (decks.SceneError, UsageError) as error:
        assert "\n" not in str(error) and str(error).startswith(str(tmp_path / "deck.inp")), error


@pytest.mark.parametrize(
    "text, words",
    [
        ("*TIE, NAME=a\nb, c\n", "*NODE: the deck has no nodes"),
        ("*HEADING\n*NODE\n1,0,0,0\n*TIE, NAME=a\n", "line 4: *TIE: tie 'a': names no surfaces"),
        ("*INCLUDE, INPUT=no.inc\n*TIE\na,b\n", "line 1: *INCLUDE: no.inc: No such file or directory"),
        ("*INCLUDE\n*TIE\na,b\n", "line 1: *INCLUDE: parameter INPUT is missing"),
        ("*INCLUDE, INPUT=deck.inp\n*TIE\na,b\n", "line 1: *INCLUDE: deck.inp includes itself"),
        ("*INCLUDE, INPUT=.\n*TIE\na,b\n", "line 1: *INCLUDE: .: Is a directory"),
        (
            "*HEADING\n*NODE, NSET=x\n1, 1e400, 0., 0.\n*TIE\na,b\n",
            "*NODE: node 1: a coordinate is not a finite number",
        ),
    ],
)
def test_files_that_are_no_decks(tmp_path, text, words):
    (tmp_path / "deck.inp").write_text(text)
    with pytest.raises(decks.SceneError) as error:
        decks.compiled(decks.read(tmp_path / "deck.inp"))
    assert str(error.value) == f"{tmp_path}/deck.inp: {words}"


def test_a_large_deck_keeps_its_lines(tmp_path):
    """Bulk lines are read at once; what is wrong in one of them is still named."""
    rng = np.random.default_rng(1)
    lines = [f"{k}, " + ", ".join(f"{x:.6g}" for x in rng.uniform(0, 9, 3)) for k in range(1, 2001)]
    made = InputDeck().block("NODE", *lines).tie("a", "b")
    lines[1234] = lines[1234].rpartition(",")[0] + ", zero"
    text = made.text().replace(made.lines[3 + 1234], lines[1234])
    (tmp_path / "deck.inp").write_text(text)
    with pytest.raises(decks.SceneError, match=r"deck.inp: line 1238: \*NODE: expected a number, found 'zero'"):
        decks.read(tmp_path / "deck.inp")
