"""Radioss decks: parameters, layered shells, connecting solids, rigid links, units by name."""

import pytest
import tiefmu
from deck_cards import RadiossDeck
from deck_checks import by_node
from tiefmu import decks

PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.1)}
AREA = 2.0


def deck(**changes) -> RadiossDeck:
    """A plate with a tied node. changes: of the blocks shell, elastic, part."""
    made = RadiossDeck().nodes(PLATE | PIN)
    changes.get("elastic", lambda d: d.elastic())(made)
    changes.get("shell", lambda d: d.shell())(made)
    made.part().elements("SHELL", 1, {1: (1, 2, 3, 4)}).node_group(1, [11], "pin").surface(1, "PART", [1])
    return made.tie(1, 1, 1, 0, 1, 0, 0.5).block("/ADMAS/5/1", (0.5, 11), title="pin")


def read(made: RadiossDeck, tmp_path):
    return decks.read(made.write(tmp_path / "deck_0000.rad"))


def refused(made: RadiossDeck, tmp_path) -> str:
    with pytest.raises(tiefmu.SceneError) as error:
        read(made, tmp_path)
    return str(error.value).split(": ", 1)[1]


# /PARAMETER


def test_parameters(tmp_path):
    """In single cards and in tables, as numbers and in expressions, before and behind where they are used."""
    made = deck(shell=lambda d: d.block("/PROP/TYPE1/1", (0,), (0.0,), (0, 0, f"{'&thick':>20}"), title="plate"))
    made.block("/PARAMETER/GLOBAL/REAL/1", "half      " + f"{5e-4:>20}", title="half the thickness")
    made.block("/PARAMETER/GLOBAL/INTEGER/2", "Four      " + f"{4:>10}", title="a number")
    made.block("/PARAMETER/GLOBAL/REAL_EXPR/3", "thick     2*half+", "0*sqrt(four)", title="an expression")
    made.block("/PARAMETER/GLOBAL/TEXT/4", "word      " + f"{5:>10}", "hello", title="a text")
    made.block("/PARAMETER/GLOBAL/REAL/5", "third     " + f"{1 / 3:>20.17g}", title="digits")
    text = "\n".join(made.lines)
    node = f"{11:>10}{0.5:>20.12g}"
    assert node in text
    made.lines = text.replace(node, f"{11:>10}{'&third':>20}").split("\n")
    found = read(made, tmp_path)
    assert by_node(found.deck)[1]["m"] == pytest.approx(7800 * 1e-3 * AREA / 4, rel=1e-15)
    x = found.deck.position[found.deck.node_id.tolist().index(11), 0]
    assert x == pytest.approx(1 / 3, rel=1e-16)


def test_local_parameters(tmp_path):
    """Inside a submodel its own value counts."""
    made = RadiossDeck().block("/PARAMETER/GLOBAL/REAL/1", "x         " + f"{7.0:>20}", title="outside").nodes(PLATE)
    made.elastic().shell().part().elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.block("//SUBMODEL/1", (0, 0, 0, 0, 0, 0), title="pin")
    made.block("/PARAMETER/LOCAL/REAL/2", "x         " + f"{0.5:>20}", title="inside")
    made.block("/NODE", f"{11:>10}{'&x':>20}{0.5:>20}{0.1:>20}").block("//ENDSUB")
    made.block("/NODE", f"{12:>10}{'-&x':>20}{0.5:>20}{0.1:>20}")
    made.node_group(1, [11]).surface(1, "PART", [1]).tie(1, 1, 1, 0, 1, 0, 0.5).block(
        "/ADMAS/5/1", (0.5, 11), title="pin"
    )
    found = read(made, tmp_path).deck
    at = dict(zip(found.node_id.tolist(), found.position[:, 0].tolist()))
    assert (at[11], at[12]) == (0.5, -7.0)


@pytest.mark.parametrize(
    "head, card, message",
    [
        ("REAL", "y         two", "/PARAMETER/GLOBAL/REAL/1: parameter y: expected a number, found 'two'"),
        ("REAL_EXPR", "y         2*z", "/PARAMETER/GLOBAL/REAL_EXPR/1: parameter y: z is not in the deck"),
        ("LIST", "y         2", "/PARAMETER/GLOBAL/LIST/1: type 'LIST' is not understood; INTEGER, REAL,"),
        ("REAL", "          2", "/PARAMETER/GLOBAL/REAL/1: has no name"),
    ],
)
def test_wrong_parameters(tmp_path, head, card, message):
    assert message in refused(deck().block(f"/PARAMETER/GLOBAL/{head}/1", card, title="wrong"), tmp_path)


def test_unknown_parameter(tmp_path):
    made = deck(shell=lambda d: d.block("/PROP/TYPE1/1", (0,), (0.0,), (0, 0, f"{'&thick':>20}"), title="plate"))
    assert "/PROP/TYPE1/1: parameter &thick is not in the deck" in refused(made, tmp_path)


# layered shells


def sandwich(kind: int, rows, thick=4e-3):
    head = [(0,), (0.0,), (len(rows), 0, thick), (0.0, 0.0, 0.0)]
    return lambda d: d.elastic(2, 1000.0, 1e9, 0.3).block(f"/PROP/TYPE{kind}/1", *head, *rows, title="layers")


@pytest.mark.parametrize("kind", [11, 16])
def test_layers(tmp_path, kind):
    """Steel 1 mm, core 2 mm, steel 1 mm: their masses; stiffness of the part's material."""
    angles = (0.0,) if kind == 11 else (0.0, 90.0)
    rows = [(*angles, t, 0.0, number) for t, number in ((1e-3, 1), (2e-3, 2), (1e-3, 1))]
    found = read(deck(shell=sandwich(kind, rows)), tmp_path).deck
    steel = by_node(read(deck(shell=lambda d: d.shell(thickness=4e-3)), tmp_path).deck)
    layered = by_node(found)
    assert layered[1]["m"] == pytest.approx((2 * 7800e-3 + 2 * 1000e-3) * AREA / 4)
    assert layered[1]["k"] == pytest.approx(steel[1]["k"])
    assert any("the 3 layers of part 1 are taken as one of their mean density" in line for line in found.warnings)


def test_layers_that_do_not_fill_the_thickness(tmp_path):
    """The starter scales them to it."""
    rows = [(0.0, 1e-3, 0.0, 1), (0.0, 1e-3, 0.0, 2)]
    found = by_node(read(deck(shell=sandwich(11, rows)), tmp_path).deck)
    assert found[1]["m"] == pytest.approx((7800 + 1000) / 2 * 4e-3 * AREA / 4)


@pytest.mark.parametrize("kind", [17, 51])
def test_plies(tmp_path, kind):
    """Types 17 and 51 name plies of type 19; substacks and interfaces stand between them."""

    def shell(d):
        d.elastic(2, 1000.0, 1e9, 0.3)
        d.block("/PROP/PLY/21", (1, 1e-3, 0.0), title="steel").block("/PROP/TYPE19/22", (2, 2e-3, 0.0), title="core")
        sub = ["       SUB         1         2", "lower half"]
        rows = [(0,), (0.0,), (0, 0, 0.0), (0.0, 0.0, 0.0), *sub, (21, 0.0, 0.0), "", (22, 0.0, 0.0), ""]
        return d.block(f"/PROP/TYPE{kind}/1", *rows, "       INT        21        22", title="stack")

    found = read(deck(shell=shell), tmp_path).deck
    assert by_node(found)[1]["m"] == pytest.approx((7800e-3 + 2 * 1000e-3) * AREA / 4)


def test_layers_of_what_is_not_there(tmp_path):
    assert "material 9 of a layer is not in the deck" in refused(
        deck(shell=sandwich(11, [(0.0, 1e-3, 0.0, 9)])), tmp_path
    )

    def shell(d):
        rows = [(0,), (0.0,), (0, 0, 0.0), (0.0, 0.0, 0.0), (21, 0.0, 0.0), ""]
        return d.block("/PROP/TYPE51/1", *rows, title="stack")

    assert "/PROP/TYPE51/1: ply 21 is not in the deck" in refused(deck(shell=shell), tmp_path)


# connecting solids


@pytest.mark.parametrize("per_area, mass", [(0, 7800 * 0.1 * 0.1 * 0.02 / 8), (1, 7800 * 0.1 * 0.1 / 8)])
def test_connecting_solids(tmp_path, per_area, mass):
    """Type 43 has the mass of its density, per volume or per area, and no stiffness; its forces are the host's."""
    corners = [(a, b, c) for c in (0.0, 0.02) for a, b in ((0.5, 0.5), (0.6, 0.5), (0.6, 0.6), (0.5, 0.6))]
    cube = {20 + i: x for i, x in enumerate(corners)}
    made = deck().nodes(cube).block("/MAT/LAW59/2", (7800.0,), (1e14, 1e14, per_area), (0,), title="glue")
    made.block("/PROP/CONNECT/2", (4,), title="weld").part(2, 2, 2).elements("BRICK", 2, {9: tuple(cube)})
    found = read(made, tmp_path)
    assert by_node(found.deck)[20]["m"] == pytest.approx(mass) and by_node(found.deck)[20]["k"] == 0
    made.lines = (
        "\n".join(made.lines)
        .replace("/GRNOD/NODE/1\npin\n        11", "/GRNOD/NODE/1\npin\n        11        20")
        .split("\n")
    )
    found = read(made, tmp_path)
    assert any("1 connecting solids are at slaves" in line for line in found.deck.warnings)


# rigid links, units


def test_rigid_link(tmp_path):
    made = deck().nodes({30: (3, 3, 3)}).node_group(3, [1, 2], "links")
    made.block("/RBE2/5", (30, "          ", 0, 3), title="frame")
    found = read(made, tmp_path)
    assert found.scene.tables["interface"]["ports"] == [{"name": "frame", "nodes": "frame", "at": [3.0, 3.0, 3.0]}]
    assert found.scene.node_sets["frame"].tolist() == [1, 2]
    made = deck().nodes({30: (3, 3, 3)}).node_group(3, [1, 2], "links")
    found = read(made.block("/RBE2/5", (30, "   111 000", 0, 3), title="frame"), tmp_path)
    assert "interface" not in found.scene.tables
    assert any("/RBE2/5: joins directions 111 000 only" in line for line in found.deck.warnings)


def test_constraints_that_are_not_read_are_named(tmp_path):
    for keyword in ("RBE3", "RLINK", "MPC", "CYL_JOINT"):
        found = read(deck().block(f"/{keyword}/7", (1, 0, 0), title="link"), tmp_path).deck
        assert any(f"/{keyword}/7: is not read" in line for line in found.warnings), keyword


def test_units_of_the_deck_by_name(tmp_path):
    """HyperMesh writes /UNIT with the units of /BEGIN and names it in each block."""
    made = deck(elastic=lambda d: d.block("/MAT/LAW1/1/2", (7800.0,), (2.1e11, 0.3), title="steel"))
    own = "".join(f"{unit:>20}" for unit in ("kg", "m", "s"))
    found = read(made.block("/UNIT/2", own, title="the deck's"), tmp_path).deck
    assert by_node(found)[1]["m"] == pytest.approx(7800 * 1e-3 * AREA / 4)
    made = deck(elastic=lambda d: d.block("/MAT/LAW1/1/2", (7800.0,), (2.1e11, 0.3), title="steel"))
    other = "".join(f"{unit:>20}" for unit in ("kg", "mm", "ms"))
    assert "/MAT/LAW1/1/2: its unit 2 is not supported" in refused(
        made.block("/UNIT/2", other, title="other"), tmp_path
    )


def test_a_deck_in_small_letters_behind_a_byte_order_mark(tmp_path):
    made = deck().text()
    small = "\ufeff" + "\n".join(line if line.startswith("#") else line.lower() for line in made.split("\n"))
    (tmp_path / "deck_0000.rad").write_text(small, encoding="utf-8")
    found = decks.read(tmp_path / "deck_0000.rad")
    assert len(found.scene.node_id) == 5
    assert not found.deck.warnings


def test_an_include_with_a_head_of_its_own(tmp_path):
    """HyperCrash writes #RADIOSS STARTER, /BEGIN and /END into includes."""
    text = "\n".join(deck().lines)
    head, body = text.split("/NODE", 1)
    (tmp_path / "mesh.inc").write_text(head + "/NODE" + body + "\n#enddata\n/END\n")
    (tmp_path / "deck_0000.rad").write_text(head + "#include mesh.inc\n/END\n")
    assert len(decks.read(tmp_path / "deck_0000.rad").scene.node_id) == 5
