"""Damaged decks: one line that names the file, the line and the keyword; never a traceback."""

import random

import deck_checks
import pytest
from deck_cards import RadiossDeck
from tiefmu import decks

PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.1), 12: (0.5, 0.5, 0.4)}


def deck() -> RadiossDeck:
    made = RadiossDeck().nodes(PLATE | PIN).elastic().shell().part().elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.spring(2, 13, 0.2, 0.02, k=(5.0, 2.0, 2.0, 3.0, 3.0, 3.0)).part(2, 2, 0).elements("SPRING", 2, {5: (11, 12)})
    return made.node_group(1, [11], "pin").surface(1, "PART", [1]).tie(1, 1, 1, 0, 1, 0, 0.5)


def message(text, tmp_path) -> str:
    (tmp_path / "deck_0000.rad").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(decks.SceneError) as error:
        decks.compiled(decks.read(tmp_path / "deck_0000.rad"))
    found = str(error.value)
    assert "\n" not in found and found.startswith(f"{tmp_path}/deck_0000.rad: ")
    return found.removeprefix(f"{tmp_path}/deck_0000.rad: ")


def changed(old: str, new: str, count: int = 1) -> str:
    text = deck().text()
    assert old in text
    return text.replace(old, new, count)


def line_of(text: str) -> int:
    return deck().lines.index(text) + 1


SHELL = f"{1:>10}{1:>10}{2:>10}{3:>10}{4:>10}"


@pytest.mark.parametrize(
    "old, new, keyword, after, expected",
    [
        (SHELL, SHELL[:30], "/SHELL/1", 1, "element 1: a node or its id is missing"),
        (SHELL, SHELL[:-1] + "9", "/SHELL/1", 1, "element 1: node 9 is not in the deck"),
        (SHELL, SHELL[:-1] + "x", "/SHELL/1", 1, "columns 41 to 50: expected a whole number, found 'x'"),
        (SHELL, f"{SHELL}\n{SHELL}", "/SHELL/1", 0, "element 1 is repeated"),
        ("/SHELL/1", "/SHELL/7", "/SHELL/7", 1, "element 1: part 7 is not in the deck"),
        ("/SHELL/1", "/SHELL", "/SHELL", 0, "expected an id in the keyword, found ''"),
        ("/PROP/TYPE1/1", "/PROP/TYPE1/8", "/PART/1", 0, "property 1 is not in the deck"),
        ("/MAT/LAW1/1", "/MAT/LAW1/8", "/PART/1", 0, "material 1 is not in the deck"),
        ("/PART/2\n", "/PART/1\n", "/PART/1", 0, "part 1 is repeated"),
        ("/PROP/TYPE13/2", "/PROP/TYPE13/1", "/PROP/TYPE13/1", 0, "property 1 is repeated"),
        ("/PROP/TYPE1/1", "/PROP/TYPE1/1/3", "/PROP/TYPE1/1/3", 0, "its unit 3 is not supported"),
        ("/NODE", "/NODE/2", "/NODE/2", 0, "its unit 2 is not supported"),
        ("/GRNOD/NODE/1", "/GRNOD/NODE/2", "/INTER/TYPE2/1", 0, "GRNOD 1 is not in the deck"),
        ("/SURF/PART/1", "/SURF/PART/2", "/INTER/TYPE2/1", 0, "SURF 1 is not in the deck"),
        ("/SURF/PART/1", "/SURF/PLANE/1", "/SURF/PLANE/1", 0, "surfaces of type PLANE are not understood"),
        ("/INTER/TYPE2/1", "/INTER/TYPE2/x", "/INTER/TYPE2/x", 0, "expected an id in the keyword, found 'x'"),
    ],
)
def test_messages(tmp_path, old, new, keyword, after, expected):
    text = changed(old, new)
    found = message(text, tmp_path)
    line = text.split("\n").index(keyword) + 1 + after
    if keyword == "/PART/1" and "repeated" in expected:
        line = text.split("\n").index(keyword, line) + 1
    assert found.startswith(f"line {line}: {keyword}: {expected}")


@pytest.mark.parametrize(
    "keyword", ["/NODE", "/MAT/LAW1/1", "/PROP/TYPE1/1", "/PROP/TYPE13/2", "/PART/1", "/INTER/TYPE2/1"]
)
def test_cut_decks(tmp_path, keyword):
    text = deck().text().split("\n")
    start = text.index(keyword)
    found = message("\n".join(text[: start + 1]), tmp_path)  # nothing behind the keyword
    assert "/" in found
    if keyword.startswith("/INTER"):
        assert found == f"line {start + 1}: {keyword}: is cut off: no title"
        found = message("\n".join(text[: start + 2]), tmp_path)
        assert found == f"line {start + 2}: {keyword}: is cut off: card 1 is missing"


def test_numbers_that_are_none(tmp_path):
    node = f"{4:>10}{0.0:>20.12g}{1.0:>20.12g}"
    start = line_of("/NODE") + 4
    for word in ("abc", "nan", "1e999", "1_0", "1.5.2", "--1"):
        text = changed(node, f"{4:>10}{word:>20}{1.0:>20.12g}")
        assert message(text, tmp_path) == f"line {start}: /NODE: columns 11 to 30: expected a number, found '{word}'"
    found = message(changed(node, f"{4:>10}{'&length':>20}{1.0:>20.12g}"), tmp_path)
    assert found == f"line {start}: /NODE: parameter &length is not in the deck"
    huge = changed(f"{4:>10}{0.0:>20.12g}", f"{'9' * 10}{0.0:>20.12g}")
    assert "node 4 is not in the deck" in message(huge, tmp_path)


def test_nodes_written_twice(tmp_path):
    node = f"{4:>10}{0.0:>20.12g}{1.0:>20.12g}{0.0:>20.12g}"
    assert "node 4 is repeated at another place" in message(changed(node, f"{node}\n{node[:-1]}5"), tmp_path)
    (tmp_path / "deck_0000.rad").write_text(changed(node, f"{node}\n{node}"))
    assert any("1 nodes are written twice" in line for line in decks.read(tmp_path / "deck_0000.rad").deck.notes)


def test_elements_without_area(tmp_path):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (2, 0, 0), 4: (3, 0, 0)}
    text = deck().text()
    for number, x in nodes.items():
        old = f"{number:>10}" + "".join(f"{v:>20.12g}" for v in PLATE[number])
        text = text.replace(old, f"{number:>10}" + "".join(f"{v:>20.12g}" for v in x))
    found = message(text, tmp_path)
    assert found.startswith(
        f"line {line_of('/PART/1')}: /PART/1: part 1: element 1: its mass or stiffness would be infinite"
    )


def test_negative_thickness(tmp_path):
    text = deck().text().replace(f"{0.001:>20.12g}", f"{-0.001:>20.12g}")
    assert "element 1: its mass or stiffness would be negative" in message(text, tmp_path)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("#RADIOSS STARTER\n", "/NODE: the deck has no nodes"),
        ("#RADIOSS STARTER\nhello\n", "line 2: expected a keyword such as /BEGIN, found 'hello'"),
        ("#RADIOSS STARTER\n/BEGIN\n", "/NODE: the deck has no nodes"),
        ("#RADIOSS STARTER\n#include\n", "line 2: #include names no file"),
        ("#RADIOSS STARTER\n#include no.inc\n", "line 2: #include: no.inc: No such file or directory"),
        ("#RADIOSS STARTER\n//ENDSUB\n", "line 2: //ENDSUB without //SUBMODEL"),
        ("#RADIOSS STARTER\n//SUBMODEL/1\nt\n\n", "//ENDSUB is missing"),
        ("#RADIOSS STARTER\n//SUBMODEL/1/2\nt\n\n", "line 2: //SUBMODEL: its unit 2 is not supported"),
        ("#RADIOSS STARTER\n//OTHER/1\n", "line 2: //OTHER is not understood"),
    ],
)
def test_files_that_are_no_decks(tmp_path, text, expected):
    assert expected in message(text, tmp_path)


def test_a_deck_that_includes_itself(tmp_path):
    (tmp_path / "deck_0000.rad").write_text("#RADIOSS STARTER\n#include deck_0000.rad\n")
    with pytest.raises(decks.SceneError, match="includes itself"):
        decks.read(tmp_path / "deck_0000.rad")


def test_a_deck_without_ties(tmp_path):
    text = deck().text().replace("/INTER/TYPE2/1", "/INTER/TYPE7/1")
    assert message(text, tmp_path) == "/INTER/TYPE2: the deck has no tie"


BITS = [*deck_checks.BITS, b"999999999", b"/", b"/PART/9", b"#"]


def a_word(line: bytes, chance: random.Random) -> bytes | None:
    """Another word in a keyword."""
    if not line.startswith(b"/"):
        return None
    words = line.split(b"/")
    words[chance.randrange(1, len(words))] = chance.choice(BITS)
    return b"/".join(words)


def shorter(line: bytes, chance: random.Random) -> bytes | None:
    """A keyword without its last word."""
    return (line.rpartition(b"/")[0] or b"/") if line.startswith(b"/") else None


OWN = [deck_checks.columns(10, BITS), a_word, shorter]


def rich() -> bytes:
    made = deck().nodes({90: (1, 0.5, -1), 21: (5, 0, 0), 22: (6, 0, 0), 23: (6, 1, 0), 24: (5, 1, 0), 25: (5, 0, 1)})
    made.solid(3).part(3, 3, subset=4).elements("TETRA4", 3, {30: (21, 22, 24, 25)}).block("/SUBSET/4", title="s")
    made.elements("TETRA10", 3, {31: (21, 22, 24, 25, 0, 0, 0, 0, 0, 0)}).node_group(2, [1, 2])
    made.block("/RBODY/3", (90, 0, 0, 0, 7.0, 2, 0, 0, 0), (0.0, 0.0, 0.0), title="head")
    made.block("/INIVEL/TRA/1", (1.0, 2.0, 3.0, 0, 0), title="all").block("/BCS/1", ("   111 111", 0, 2), title="b")
    made.block("/FUNCT/1", (0.0, 1.0), (1.0, 1.0), title="f").block(
        "/SKEW/FIX/4", (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), title="k"
    )
    made.block("/GRAV/1", (1, "         Z", 0, 0, 0, None, 1.0, -9.81), title="g")
    made.block("/IMPVEL/1", (1, "         X", 0, 0, 2), (1.0, 1.0), title="i")
    made.block("/ADMAS/1/2", (3.0, 2), title="a").block("/ADMAS/5/5", (7.0, 3), title="a")
    made.block("/SET/GENERAL/50", f"{'PART':<10}{3:>10}", f"{'NODE_G':<10}{21:>10}{23:>10}{1:>10}", title="s")
    made.block("/BOX/RECTA/1", (0, 0, 0), (0.4, 0.4, 0.0), (0.6, 0.6, 0.2), title="b").block(
        "/GRNOD/BOX/60", (1,), title="b"
    )
    made.block("/SURF/GRBRIC/EXT/70", (80,), title="s").block("/GRBRIC/BRIC/80", (30,), title="s")
    made.block("/TRANSFORM/ROT/3", (50, 0.0, 0.0, 0.0, 0, 0, 0), (None, 0.0, 0.0, 2.0, 90.0), title="r")
    made.nodes({41: (-0.9, 5.3, 0.1)}).node_group(61, [41]).tie(2, 61, 70, 2, 0, 0, 9.0, title="second")
    return made.text().encode()


def test_the_rich_deck_is_sound(tmp_path):
    (tmp_path / "deck_0000.rad").write_bytes(rich())
    assert len(decks.compiled(decks.read(tmp_path / "deck_0000.rad")).ties) == 2


@pytest.mark.parametrize("seed", range(4))
def test_random_damage(tmp_path, seed):
    chance, whole, path = random.Random(seed), rich(), tmp_path / "deck_0000.rad"
    for _ in range(60):
        path.write_bytes(deck_checks.damaged(whole, chance, BITS, OWN))
        try:
            decks.compiled(decks.read(path))
        except decks.SceneError as error:
            assert "\n" not in str(error) and str(error).startswith(str(path)), error
