"""One model written in each language gives the same scene, to rounding."""

import numpy as np
import pytest
from deck_cards import RadiossDeck
from dyna_cards import DynaDeck
from input_deck import InputDeck
from tiefmu import decks

# A plate of two rectangles, whose right edge a reference node moves; a lid of one rectangle that is tied to it and held
# by a spring with a dashpot; a block of two bricks, and a sheet that stands on it, tied by its edge.
NODES = {
    1: (0, 0, 0), 2: (2, 0, 0), 3: (4, 0, 0), 4: (0, 1, 0), 5: (2, 1, 0), 6: (4, 1, 0),
    11: (-1, -1, -1), 12: (1, -1, -1), 13: (-1, 0.5, -1), 14: (1, 0.5, -1), 15: (-1, 2, -1), 16: (1, 2, -1),
    21: (-1, -1, 0), 22: (1, -1, 0), 23: (-1, 0.5, 0), 24: (1, 0.5, 0), 25: (-1, 2, 0), 26: (1, 2, 0),
    31: (2.5, 0.25, 0.1), 32: (3.5, 0.25, 0.1), 33: (3.5, 0.75, 0.1), 34: (2.5, 0.75, 0.1), 41: (2.5, 0.25, 2),
    51: (4, 0.5, 1), 61: (-0.5, 0, 0), 62: (0.5, 0, 0), 63: (0.5, 0, 1), 64: (-0.5, 0, 1),
}  # fmt: skip
PLATE = {1: (1, 2, 5, 4), 2: (2, 3, 6, 5)}
LID = {3: (31, 32, 33, 34), 4: (61, 62, 63, 64)}
BLOCK = {10: (11, 12, 14, 13, 21, 22, 24, 23), 11: (13, 14, 16, 15, 23, 24, 26, 25)}
SPRING = {20: (31, 41)}
DENSITY, YOUNG, POISSON = 7800.0, 2.1e11, 0.3
PLATE_THICKNESS, LID_THICKNESS = 2e-3, 1e-3
STIFFNESS, DAMPING, POINT_MASS = 4000.0, 30.0, 0.25
START = 1.5, 0.0, -2.0
GRAVITY = -9.81


def radioss(path):
    deck = RadiossDeck().nodes(NODES).elastic(1, DENSITY, YOUNG, POISSON).shell(1, PLATE_THICKNESS).solid(3)
    deck.shell(2, LID_THICKNESS).spring(4, 4, mass=0.0, k=[STIFFNESS], c=[DAMPING])
    deck.part(1, 1).part(2, 2).part(3, 3).part(4, 4, 0)
    deck.elements("SHELL", 1, PLATE).elements("SHELL", 2, LID).elements("BRICK", 3, BLOCK).elements("SPRING", 4, SPRING)
    deck.node_group(1, [61, 62]).node_group(2, [31, 32, 33, 34]).node_group(3, [2]).node_group(4, [3, 6])
    deck.node_group(5, [21, 22]).surface(1, "PART/EXT", [3]).surface(2, "PART", [1])
    deck.tie(1, 1, 1, 1, 0, 0, 0.01, title="glue").tie(2, 2, 2, 1, 0, 0, 0.2, title="lid")
    deck.block("/ADMAS/0/1", (POINT_MASS, 5), title="two")
    deck.block("/BCS/1", ("   111 111", 0, 5), title="held").block("/INIVEL/TRA/1", (*START, 3, 0), title="start")
    deck.block("/RBODY/1", (51, 0, 0, 0, 0.0, 4, 0, 0, 0), (0.0, 0.0, 0.0), title="head")
    deck.block("/GRAV/1", (0, "         Z", 0, 0, 0, None, 1.0, GRAVITY), title="g")
    return deck.write(path / "deck_0000.rad")


def abaqus(path):
    deck = InputDeck().nodes(NODES).elastic("steel", DENSITY, YOUNG, POISSON)
    deck.elements("S4R", "plate", PLATE).shell("plate", PLATE_THICKNESS)
    deck.elements("S4R", "lid", LID).shell("lid", LID_THICKNESS).elements("C3D8R", "block", BLOCK).solid("block")
    deck.elements("SPRINGA", "spring", SPRING).block("SPRING, ELSET=spring", "", (STIFFNESS,))
    deck.elements("DASHPOTA", "dashpot", {21: SPRING[20]}).block("DASHPOT, ELSET=dashpot", "", (DAMPING,))
    deck.block("NSET, NSET=edge", "61, 62").block("NSET, NSET=corners", "31, 32, 33, 34").block(
        "NSET, NSET=end", "3, 6"
    )
    options = ", ADJUST=NO, NO THICKNESS, POSITION TOLERANCE="
    deck.block("SURFACE, NAME=skin", "block,")
    deck.tie("edge", "skin", f"{options}0.01", "glue").tie("corners", "plate", f"{options}0.2", "lid")
    deck.elements("MASS", "points", {30: (21,), 31: (22,)}).block("MASS, ELSET=points", (POINT_MASS,))
    deck.block("BOUNDARY", "21, 1, 6", "22, ENCASTRE")
    deck.block("INITIAL CONDITIONS, TYPE=VELOCITY", *[(2, k + 1, START[k]) for k in range(3)])
    deck.block("SURFACE, NAME=end, TYPE=NODE", "end").block("COUPLING, CONSTRAINT NAME=head, REF NODE=51, SURFACE=end")
    deck.block("KINEMATIC", "1, 6").block("DLOAD", f", GRAV, {-GRAVITY}, 0., 0., -1.")
    return deck.write(path / "deck.inp")


def dyna(path):
    deck = DynaDeck().nodes(NODES).elastic(1, DENSITY, YOUNG, POISSON).shell(1, PLATE_THICKNESS).solid(3)
    deck.shell(2, LID_THICKNESS).part(1, 1, title="plate").part(2, 2).part(3, 3).part(4, 4, 2).part(5, 4, 3)
    deck.block("SECTION_DISCRETE", ("ir", 4, 0.0), ("rr", 0.0, 0.0))
    deck.block("MAT_SPRING_ELASTIC", ("ir", 2, STIFFNESS)).block("MAT_DAMPER_VISCOUS", ("ir", 3, DAMPING))
    deck.elements("SHELL", 1, PLATE).elements("SHELL", 2, LID).elements("SOLID", 3, BLOCK)
    deck.block("ELEMENT_DISCRETE", ("IIII", 20, 4, *SPRING[20]), ("IIII", 21, 5, *SPRING[20]))
    deck.list_of("NODE", 1, [61, 62]).list_of("NODE", 2, [31, 32, 33, 34]).list_of("NODE", 3, [2])
    deck.list_of("NODE", 4, [3, 6])
    kind = "TIED_SHELL_EDGE_TO_SURFACE_CONSTRAINED_OFFSET"
    deck.tie(1, 3, (4, 3), 1, "glue", kind, (round(-0.01 / 0.6, 7), 0.0))  # 0.6 |SST|
    deck.tie(2, 1, (4, 3), 2, "lid", kind, (round(-0.2 / 0.6, 7), 0.0))
    deck.block("ELEMENT_MASS", ("IIR", 30, 21, POINT_MASS), ("IIR", 31, 22, POINT_MASS))
    deck.block("BOUNDARY_SPC_NODE", ("i" * 8, 21, 0, *[1] * 6), ("i" * 8, 22, 0, *[1] * 6))
    deck.block("INITIAL_VELOCITY", ("i", 3), ("rrr", *START))
    deck.block("CONSTRAINED_NODAL_RIGID_BODY_TITLE", "head", ("iiii", 9, 0, 4, 51))
    deck.block("LOAD_BODY_Z", ("ir", 1, -GRAVITY)).block("DEFINE_CURVE", ("i", 1), ("QQ", 0.0, 1.0), ("QQ", 1.0, 1.0))
    return deck.write(path / "deck.k")


LANGUAGES = {"abaqus": abaqus, "dyna": dyna}
PLATE_NAMES = {"radioss": "part 1", "abaqus": "plate", "dyna": "plate"}  # what --free calls the plate


def springs(found) -> dict:
    """Stiffness and damping between each two nodes: a language may need two springs where another has one."""
    total: dict = {}
    for table in found.scene.tables["spring"]:
        assert table["kind"] == "axial"
        stiffness, damping = total.get(tuple(table["nodes"]), (0.0, 0.0))
        total[tuple(table["nodes"])] = (stiffness + table["stiffness"], damping + table["damping"])
    return total


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_same_scene(tmp_path, language, free):
    one = decks.read(radioss(tmp_path), free=(PLATE_NAMES["radioss"],) if free else ())
    other = decks.read(LANGUAGES[language](tmp_path), free=(PLATE_NAMES[language],) if free else ())
    assert one.deck.language != other.deck.language
    assert other.scene.node_id.tolist() == one.scene.node_id.tolist()
    assert other.scene.position == pytest.approx(one.scene.position, rel=1e-13)
    for key, values in one.scene.columns.items():
        if values.dtype.kind == "f":
            assert other.scene.columns[key] == pytest.approx(values, rel=1e-12), key
        else:
            assert other.scene.columns[key].tolist() == values.tolist(), key
    assert springs(other) == springs(one)
    assert len(other.scene.tables["tie"]) == len(one.scene.tables["tie"]) == 2
    for a, b in zip(one.scene.tables["tie"], other.scene.tables["tie"]):
        assert b == a | {"search_distance": pytest.approx(a["search_distance"], rel=1e-5)}
        assert np.array_equal(other.scene.node_sets[b["slaves"]], one.scene.node_sets[a["slaves"]])
        corners = [
            {frozenset(row[row > 0].tolist()) for row in each.scene.segments[np.isin(each.scene.segment_id, ids)]}
            for each, ids in (
                (one, one.scene.segment_sets[a["segments"]]),
                (other, other.scene.segment_sets[b["segments"]]),
            )
        ]
        assert corners[0] == corners[1]
    for key in ("initial", "interface", "model"):
        assert key in one.scene.tables, key
    assert other.scene.tables["model"]["gravity"] == pytest.approx(one.scene.tables["model"]["gravity"])
    for table, same in zip(one.scene.tables["initial"], other.scene.tables["initial"], strict=True):
        assert same["v"] == pytest.approx(table["v"])
        assert np.array_equal(other.scene.node_sets[same["nodes"]], one.scene.node_sets[table["nodes"]])
    for port, same in zip(
        one.scene.tables["interface"]["ports"], other.scene.tables["interface"]["ports"], strict=True
    ):
        assert same["name"] == port["name"] and same["at"] == pytest.approx(port["at"])
        assert np.array_equal(other.scene.node_sets[same["nodes"]], one.scene.node_sets[port["nodes"]])
