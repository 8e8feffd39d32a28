"""Damaged LS-DYNA decks: one line that names the file, the line and the keyword; never a traceback."""

import random

import deck_checks
import pytest
from dyna_cards import DynaDeck
from tiefmu import decks
from tiefmu.schema import shortened

PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.05), 12: (0.5, 0.5, 0.4)}


def deck(form: str = "fixed") -> DynaDeck:
    made = DynaDeck(form).nodes(PLATE | PIN).elastic().shell().part().elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.block("SECTION_DISCRETE", ("ir", 2, 0.0), ("rr", 0.0, 0.0)).part(2, 2, 2)
    made.block("MAT_SPRING_ELASTIC", ("ir", 2, 5e3)).block("ELEMENT_DISCRETE", ("IIII", 5, 2, 11, 12))
    made.block("ELEMENT_MASS", ("IIR", 7, 11, 0.5)).list_of("NODE", 1, [11])
    return made.tie(1, 1, name="TIED_SHELL_EDGE_TO_SURFACE_CONSTRAINED_OFFSET")


def message(text, tmp_path) -> str:
    (tmp_path / "deck.k").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(decks.SceneError) as error:
        decks.compiled(decks.read(tmp_path / "deck.k"))
    found = str(error.value)
    assert "\n" not in found and found.startswith(f"{tmp_path}/deck.k: ")
    return found.removeprefix(f"{tmp_path}/deck.k: ")


def changed(old: str, new: str) -> str:
    text = deck().text()
    assert old in text
    return text.replace(old, new, 1)


SHELL = deck().card("I" * 6, 1, 1, 1, 2, 3, 4)
CONTACT = "CONTACT_TIED_SHELL_EDGE_TO_SURFACE_CONSTRAINED_OFFSET_ID"


@pytest.mark.parametrize(
    "old, new, keyword, after, expected",
    [
        (SHELL, SHELL[:24], "ELEMENT_SHELL", 1, "element 1: a node or its id is missing"),
        (SHELL, SHELL[:-1] + "9", "ELEMENT_SHELL", 1, "element 1: node 9 is not in the deck"),
        (SHELL, SHELL[:-1] + "x", "ELEMENT_SHELL", 1, "columns 41 to 48: expected a whole number, found 'x'"),
        (
            SHELL,
            SHELL.replace(" 2 ", ",x,").replace("  ", ""),
            "ELEMENT_SHELL",
            1,
            "field 1: expected a whole number, found '1 1 1'",
        ),
        (SHELL, f"{SHELL}\n{SHELL}", "ELEMENT_SHELL", 2, "element 1 is repeated"),
        (SHELL, SHELL[:15] + "7" + SHELL[16:], "ELEMENT_SHELL", 1, "element 1: part 7 is not in the deck"),
        ("*ELEMENT_SHELL", "*ELEMENT_SHELL_COMPOSITE", "ELEMENT_SHELL_COMPOSITE", 0, "elements with COMPOSITE are not"),
        (
            "*ELEMENT_SHELL",
            "*ELEMENT_SHELL_THICKNESS",
            "ELEMENT_SHELL_THICKNESS",
            1,
            "is cut off: its last element has",
        ),
        ("*SECTION_SHELL\n         1", "*SECTION_SHELL\n         8", "PART", 2, "section 1 is not in the deck"),
        ("*MAT_ELASTIC\n         1", "*MAT_ELASTIC\n         8", "PART", 2, "material 1 is not in the deck"),
        (
            "*SECTION_DISCRETE\n         2",
            "*SECTION_DISCRETE\n         1",
            "SECTION_DISCRETE",
            1,
            "section 1 is repeated",
        ),
        (
            "*MAT_SPRING_ELASTIC\n         2",
            "*MAT_SPRING_ELASTIC\n         1",
            "MAT_SPRING_ELASTIC",
            1,
            "material 1 is repe",
        ),
        (
            "*MAT_SPRING_ELASTIC\n         2",
            "*MAT_SPRING_ELASTIC\n         3",
            "ELEMENT_DISCRETE",
            1,
            "part 2: material 2",
        ),
        ("part 2\n         2", "part 2\n         1", None, 0, "part 1 is repeated; the first one stands in"),
        ("*SET_NODE_LIST\n         1", "*SET_NODE_LIST\n         2", CONTACT, 0, "node set 1 is not in the deck"),
        ("        11\n*CONTACT", "        77\n*CONTACT", "SET_NODE_LIST", 2, "node 77 is not in the deck"),
        ("*ELEMENT_MASS\n       7      11", "*ELEMENT_MASS\n       7      77", "ELEMENT_MASS", 1, "node 77 is not"),
        (
            "*SECTION_SHELL\n         1         2\n     0.001     0.001     0.001     0.001\n",
            "*SECTION_SOLID\n         1         2\n",
            "PART",
            2,
            "part 1 has shell elements",
        ),
    ],
)
def test_messages(tmp_path, old, new, keyword, after, expected):
    text = changed(old, new)
    found = message(text, tmp_path)
    lines = text.split("\n")
    if keyword is None:
        keyword, line = "PART", lines.index("part 2") + 2
    else:
        line = lines.index(f"*{keyword}") + 1 + after
    assert found.startswith(f"line {line}: *{shortened(keyword)}: ") and expected in found, found


@pytest.mark.parametrize(
    "keyword", ["NODE", "MAT_ELASTIC", "SECTION_SHELL", "PART", "ELEMENT_SHELL", "SET_NODE_LIST", CONTACT]
)
def test_cut_decks(tmp_path, keyword):
    text = deck().text().split("\n")
    start = text.index(f"*{keyword}")
    for count in (1, 2):
        found = message("\n".join(text[: start + count]), tmp_path)
        assert "*" in found
    found = message("\n".join([*text[: start + 1], "*END"]), tmp_path)
    assert "*" in found


def test_numbers_that_are_none(tmp_path):
    node = deck().card("IRRR", 4, 0.0, 1.0, 0.0)
    start = deck().lines.index(node) + 1
    for word in ("abc", "nan", "1e999", "1_0", "1.5.2", "--1"):
        text = changed(node, deck().card("IsRR", 4, "", 1.0, 0.0)[:8] + f"{word:>16}{1.0:>16}")
        assert message(text, tmp_path) == f"line {start}: *NODE: columns 9 to 24: expected a number, found '{word}'"
    text = changed(node, f"{4:>8}{'&length':>16}{1.0:>16}")
    assert message(text, tmp_path) == f"line {start}: *NODE: parameter &length is not in the deck"


@pytest.mark.parametrize(
    "lines, expected",
    [
        (["*KEYWORD"], "*NODE: the deck has no nodes"),
        (["*KEYWORD", "hello", "*NODE"], "*NODE: the deck has no nodes"),
        (["*KEYWORD", "*INCLUDE"], "line 2: *INCLUDE: names no file"),
        (["*KEYWORD", "*INCLUDE", "no.k"], "line 3: *INCLUDE: no.k: no such file"),
        (["*KEYWORD", "*INCLUDE", "deck.k"], "deck.k: includes itself"),
        (["*KEYWORD", "*PARAMETER", "X a", ""], "line 3: *PARAMETER: expected R, I or C and a name, found 'X a'"),
        (
            ["*KEYWORD", "*PARAMETER", "Ra        one"],
            "line 3: *PARAMETER: parameter a: expected a number, found 'one'",
        ),
        (
            ["*KEYWORD", "*PARAMETER_EXPRESSION", "Ra        1/0"],
            "line 3: *PARAMETER_EXPRESSION: parameter a: '1/0' float division by zero",
        ),
        (
            ["*KEYWORD", "*PARAMETER_EXPRESSION", "Ra        2*b"],
            "line 3: *PARAMETER_EXPRESSION: parameter a: b is not in the deck",
        ),
        (
            ["*KEYWORD", "*NODE", "-----BEGIN PGP MESSAGE-----", "Charset"],
            "line 2: *NODE: is encrypted and cannot be read",
        ),
    ],
)
def test_files_that_are_no_decks(tmp_path, lines, expected):
    (tmp_path / "deck.k").write_text("\n".join([*lines, ""]))
    with pytest.raises(decks.SceneError) as error:
        decks.read(tmp_path / "deck.k")
    assert str(error.value).removeprefix(f"{tmp_path}/deck.k: ") == expected


def test_a_deck_without_ties(tmp_path):
    text = deck().text().replace(f"*{CONTACT}", "*CONTACT_AUTOMATIC_GENERAL_ID")
    assert message(text, tmp_path) == "*CONTACT: the deck has no tie"


def test_elements_without_area(tmp_path):
    text = deck().text()
    for number, x in PLATE.items():
        text = text.replace(
            deck().card("IRRR", number, *map(float, x)), deck().card("IRRR", number, float(number), 0.0, 0.0)
        )
    assert "element 1: its mass or stiffness would be infinite" in message(text, tmp_path)


BITS = [*deck_checks.BITS, b"99999999", b"*", b"*PART", b"$", b",", b"&a"]


def a_word(line: bytes, chance: random.Random) -> bytes | None:
    """Another word in a keyword."""
    if not line.startswith(b"*"):
        return None
    words = line.split(b"_")
    words[chance.randrange(len(words))] = chance.choice([b"ID", b"TITLE", b"SET", b"GENERAL", b"ADD", b"BEAM", b""])
    return b"_".join(words)


OWN = [deck_checks.columns(8, BITS), a_word]


def rich(form: str, folder) -> bytes:
    inner = DynaDeck(form).nodes({1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0)}).elements("SHELL", 1, {1: (1, 2, 3, 3)})
    inner.part(1, 1, 1).shell().elastic().write(folder / "inner.k")
    made = deck(form)
    made.block("PARAMETER", ("srsi", "R  a", 0.5, "I  b", 2)).block("PARAMETER_EXPRESSION", "Rc        2*a+1")
    made.block("INCLUDE_TRANSFORM", "inner.k", ("i" * 7, *[500] * 7), ("i", 500), ("rrr", 1.0, 1.0, 2.0), ("i", 3))
    made.block(
        "DEFINE_TRANSFORMATION",
        ("i", 3),
        ("srrr", "TRANSL", 5.0, 0.0, 0.0),
        ("srrrrrrr", "ROTATE", 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 30.0),
    )
    made.nodes(
        {
            21: (5, 0, 9),
            22: (6, 0, 9),
            23: (6, 1, 9),
            24: (5, 1, 9),
            25: (5, 0, 10),
            26: (6, 0, 10),
            27: (6, 1, 10),
            28: (5, 1, 10),
        }
    )
    made.solid(3).part(3, 3).elements("SOLID", 3, {30: tuple(range(21, 29)), 31: (21, 22, 24, 25, 25, 25, 25, 25)})
    made.block("ELEMENT_SHELL_THICKNESS", ("I" * 6, 40, 1, 1, 2, 3, 3), ("RRRR", *[0.1] * 4))
    made.block("SECTION_BEAM", ("iirrr", 4, 9, 1.0, 2.0, 1.0), ("rrrr", 0.1, 0.1, 0.0, 0.0)).part(4, 4, 1)
    made.block("ELEMENT_BEAM", ("I" * 5, 50, 4, 11, 12, 0)).block(
        "ELEMENT_INERTIA", ("II", 9, 12), ("r" * 7, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.5)
    )
    made.block("SET_SEGMENT_GENERAL", ("i", 5), ("si", "PART", 3), ("siiii", "SEG", 21, 22, 23, 24))
    made.block("SET_NODE_GENERAL", ("i", 6), ("si", "PART", 4), ("sii", "DNODE", 11, 12), ("si", "NODE", 60)).nodes(
        {60: (5.2, 0.2, 9.0)}
    )
    made.list_of("PART", 7, [3]).list_of("SHELL", 8, [1]).block("SET_NODE_LIST_GENERATE", ("i", 9), ("ii", 1, 2))
    made.block("BOUNDARY_SPC_SET", ("i" * 8, 9, 0, *[1] * 6)).block(
        "INITIAL_VELOCITY", ("i", 0), ("rrr", 1.0, 2.0, 3.0)
    )
    made.block("BOUNDARY_PRESCRIBED_MOTION_NODE", ("iiiir", 3, 1, 2, 5, 1.0)).list_of("NODE", 10, [3, 4])
    made.block("CONSTRAINED_NODAL_RIGID_BODY", ("iii", 33, 0, 10)).block("DEFINE_CURVE", ("i", 5), ("QQ", 0.0, 1.0))
    made.block("LOAD_BODY_Z", ("ir", 5, 9.81)).block("DEFINE_BOX", ("irrrrrr", 1, -9.0, 9.0, -9.0, 9.0, -9.0, 19.0))
    made.block("ELEMENT_MASS_PART", ("IRR", 3, 1.0, 0.0)).tie(
        6, 5, (4, 0), 2, "second", "TIED_NODES_TO_SURFACE", boxes=(1, 1)
    )
    return made.text().encode()


@pytest.mark.parametrize("form", ["fixed", "comma"])
def test_the_rich_deck_is_sound(tmp_path, form):
    (tmp_path / "deck.k").write_bytes(rich(form, tmp_path))
    found = decks.compiled(decks.read(tmp_path / "deck.k"))
    assert len(found.ties) == 2


@pytest.mark.parametrize("seed", range(4))
def test_random_damage(tmp_path, seed):
    chance, path = random.Random(seed), tmp_path / "deck.k"
    whole = rich("comma" if seed % 2 else "fixed", tmp_path)
    for _ in range(60):
        path.write_bytes(deck_checks.damaged(whole, chance, BITS, OWN))
        try:
            if decks.is_deck(path):
                decks.compiled(decks.read(path))
        except decks.SceneError as error:
            assert "\n" not in str(error) and str(error).startswith((str(path), "inner.k")), error
