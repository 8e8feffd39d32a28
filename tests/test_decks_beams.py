"""Beams and trusses of decks at tied nodes: what [[spring]] they become, worked by hand; the FMU holds them."""

import fmpy
import numpy as np
import pytest
from deck_cards import RadiossDeck
from dyna_cards import DynaDeck
from input_deck import InputDeck
from tiefmu import decks
from tiefmu.package import build

LOWER = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
UPPER = {5: (0, 0, 0.02), 6: (2, 0, 0.02), 7: (2, 1, 0.02), 8: (0, 1, 0.02)}
WELD = {11: (0.5, 0.5, 0.0), 12: (0.5, 0.5, 0.02)}
SIDE = {13: (1.5, 0.5, 0.0)}
RHO, E, NU, D = 7850.0, 2.1e11, 0.3, 0.006
G = E / (2 * (1 + NU))
AREA, BENDING = np.pi * D**2 / 4, np.pi * D**4 / 64
LENGTH = 0.02


def dyna(section, *cards, option="", element=(11, 12, 0), material="SPOTWELD", tie="SPOTWELD") -> DynaDeck:
    """Two plates, a beam between them whose ends are tied. section: cards of *SECTION_BEAM."""
    made = DynaDeck().nodes(LOWER | UPPER | WELD | SIDE).elastic().shell(1, 1e-2)
    made.part(1).part(2).elements("SHELL", 1, {1: (1, 2, 3, 4)}).elements("SHELL", 2, {2: (5, 6, 7, 8)})
    made.elastic(2, RHO, E, NU, material).block("SECTION_BEAM", *section).part(3, 2, 2)
    made.block(f"ELEMENT_BEAM{option}", ("I" * 5, 3, 3, *element), *cards)
    made.list_of("PART", 9, [1, 2])
    return made.tie(3, 9, (3, 2), name=tie)


ROUND = (("iirrr", 2, 9, 1.0, 2.0, 1.0), ("rrrr", D, D, 0.0, 0.0))


def read(made, tmp_path, **options):
    return decks.read(made.write(tmp_path / "deck.k"), **options)


def column(found, key) -> dict:
    return dict(zip(found.scene.node_id.tolist(), found.scene.columns[key].tolist()))


def test_spot_weld(tmp_path):
    """*MAT_SPOTWELD, ELFORM 9: one integration point, shear factor 1. Its mass and inertia stay at its ends, its
    stiffness goes to the [[spring]]."""
    found = read(dyna(ROUND), tmp_path)
    (table,) = found.scene.tables["spring"]
    assert (
        table["nodes"] == [11, 12]
        and table["kind"] == "beam"
        and set(table) == {*("nodes", "kind", "stiffness", "rotational_stiffness")}
    )
    assert table["stiffness"] == pytest.approx([E * AREA / LENGTH, G * AREA / LENGTH, G * AREA / LENGTH])
    bend = E * BENDING / LENGTH
    assert table["rotational_stiffness"] == pytest.approx([2 * G * BENDING / LENGTH, bend, bend])
    assert column(found, "mass")[11] == pytest.approx(RHO * AREA * LENGTH / 2)
    assert column(found, "inertia")[11] > 0 and column(found, "stiffness")[11] == 0
    assert column(found, "rotational_stiffness")[12] == 0 and column(found, "rotations")[12] == "true"
    assert any(line.startswith("1 beams at slaves or free nodes are in the scene") for line in found.deck.notes)
    assert not any("host's: their masses" in line for line in found.deck.notes)


@pytest.mark.parametrize(
    "option, orientation", [("", [1, 0, 0]), ("_ORIENTATION", [0, 1, 0]), ("_PID_ORIENTATION", [0, 1, 0])]
)
def test_rectangular_beam(tmp_path, option, orientation):
    """ELFORM 1, 4 mm along s and 8 mm along t: bending about s is that of t. s is on the side of N3, or of a vector."""
    section = ("iirrr", 2, 1, 0.8333333, 2.0, 0.0), ("rrrr", 0.004, 0.004, 0.008, 0.008)
    cards = [("ii", 1, 2)] * ("PID" in option) + [("rrr", 0.0, 2.0, 5.0)] * bool(option)
    made = dyna(section, *cards, option=option, element=(11, 12, 13), material="ELASTIC")
    (table,) = read(made, tmp_path).scene.tables["spring"]
    area, about_s, about_t = 3.2e-5, 0.004 * 0.008**3 / 12, 0.008 * 0.004**3 / 12
    shear = 0.8333333 * G * area / LENGTH
    assert table["stiffness"] == pytest.approx([E * area / LENGTH, shear, shear])
    assert table["rotational_stiffness"] == pytest.approx(
        [G * (about_s + about_t) / LENGTH, E * about_s / LENGTH, E * about_t / LENGTH]
    )
    assert table["orientation"] == pytest.approx(orientation)


@pytest.mark.parametrize("shear_area", [0.0, 3e-5])
def test_resultant_beam(tmp_path, shear_area):
    """ELFORM 2: shear along s bends about t. Without SA no shear deformation."""
    about_s, about_t, torsion = 2e-10, 3e-10, 4e-10
    section = ("ii", 2, 2), ("rrrrr", 4e-5, about_s, about_t, torsion, shear_area)
    (table,) = read(dyna(section, element=(11, 12, 13), material="ELASTIC"), tmp_path).scene.tables["spring"]
    more = LENGTH / (G * shear_area) if shear_area else 0.0
    aside = [1 / (LENGTH**3 / (12 * E * i) + more) for i in (about_t, about_s)]
    assert table["stiffness"] == pytest.approx([E * 4e-5 / LENGTH, *aside])
    assert table["rotational_stiffness"] == pytest.approx(
        [G * torsion / LENGTH, E * about_s / LENGTH, E * about_t / LENGTH]
    )


def test_truss_is_axial(tmp_path):
    (table,) = read(dyna((("ii", 2, 3), ("r", 4e-5)), material="ELASTIC"), tmp_path).scene.tables["spring"]
    assert table == {"nodes": [11, 12], "kind": "axial", "stiffness": pytest.approx(E * 4e-5 / LENGTH), "damping": 0.0}


def test_ends_that_cannot_turn_leave_the_axial_part(tmp_path):
    """A tie of translations alone leaves the ends of the beam hinged."""
    found = read(dyna(ROUND, tie="TIED_NODES_TO_SURFACE"), tmp_path)
    (table,) = found.scene.tables["spring"]
    assert table["kind"] == "axial" and table["stiffness"] == pytest.approx(E * AREA / LENGTH)
    assert any("1 of its elements end at nodes that cannot turn" in line for line in found.deck.warnings)


def test_beams_elsewhere_are_the_hosts(tmp_path):
    """A beam between masters counts in their nodal stiffness, and is a spring where they are free."""
    made = dyna(ROUND).block("ELEMENT_BEAM", ("I" * 5, 4, 3, 1, 5, 0))
    made.list_of("NODE", 7, [11, 12])
    text = made.text().replace("         3         9         3         2", "         7         9         4         2")
    path = tmp_path / "deck.k"
    path.write_text(text)
    found = decks.read(path)
    assert [table["nodes"] for table in found.scene.tables["spring"]] == [[11, 12]]
    assert column(found, "stiffness")[1] > column(found, "stiffness")[2] + E * AREA / LENGTH
    free = decks.read(path, free=("part 1",))
    assert sorted(table["nodes"] for table in free.scene.tables["spring"]) == [[1, 5], [11, 12]]


def test_beam_of_a_rigid_body_has_no_stiffness(tmp_path):
    made = dyna(ROUND).list_of("NODE", 5, [11, 12]).block("CONSTRAINED_NODAL_RIGID_BODY", ("iii", 50, 0, 5))
    found = read(made, tmp_path)
    assert "spring" not in found.scene.tables and column(found, "stiffness")[11] > 0


def test_mass_per_length(tmp_path):
    """NSM of ELFORM 1; it does not count for spot welds."""
    first, second = ("iirrrrr", 2, 1, 1.0, 2.0, 1.0, 0.0, 3.0), ROUND[1]
    own = RHO * AREA * LENGTH / 2
    assert column(read(dyna((first, second), material="ELASTIC"), tmp_path), "mass")[11] == pytest.approx(
        own + 3 * LENGTH / 2
    )
    spot = (("iirrrrr", 2, 9, *first[3:]), second)
    assert column(read(dyna(spot), tmp_path), "mass")[11] == pytest.approx(own)


def test_what_beams_leave_aside_is_said(tmp_path):
    made = dyna(ROUND, ("r" * 6, *[0.0] * 6), option="_OFFSET")
    made.block("ELEMENT_BEAM", ("I" * 9, 5, 3, 11, 12, 0, 0, 7, 0, 0))
    warnings = read(made, tmp_path).deck.warnings
    assert any("offsets of beams are left aside" in line for line in warnings)
    assert any("1 beams let go of directions at an end (RT, RR)" in line for line in warnings)


def test_solid_spot_welds_are_said(tmp_path):
    cube = {
        20 + i: (x, y, z) for i, (x, y, z) in enumerate(
            [(a, b, c) for c in (0.0, 0.02) for a, b in ((0.5, 0.5), (0.6, 0.5), (0.6, 0.6), (0.5, 0.6))]
        )
    }  # fmt: skip
    made = DynaDeck().nodes(LOWER | UPPER | cube).elastic().shell(1, 1e-2).part(1).part(2)
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).elements("SHELL", 2, {2: (5, 6, 7, 8)})
    made.elastic(2, RHO, E, NU, "SPOTWELD").solid(2).part(3, 2, 2).elements("SOLID", 3, {3: tuple(cube)})
    found = read(made.list_of("PART", 9, [1, 2]).tie(3, 9, (3, 2)), tmp_path)
    assert any("1 solids of spot welds are at slaves" in line for line in found.deck.warnings)
    assert column(found, "mass")[20] == pytest.approx(RHO * 0.1 * 0.1 * 0.02 / 8)


def test_discrete_beam_along_its_line(tmp_path):
    """SCOOR 2: the r axis lies along the beam; 3: along the global axes."""
    for system, kind, stiffness in ((2.0, "beam", [1e4, 2e4, 3e4]), (3.0, "bushing", [1e4, 2e4, 3e4])):
        made = dyna((("iirrrr", 2, 6, 0.0, 0.0, 0.0, system), ("rr", 1e-9, 1e-9)), element=(11, 12, 13))
        text = made.text()
        old = "\n".join(DynaDeck(bare=True).elastic(2, RHO, E, NU, "SPOTWELD").lines)
        new = DynaDeck(bare=True).block("MAT_066", ("irrrrrrr", 2, RHO, 1e4, 2e4, 3e4, 5.0, 6.0, 7.0))
        assert old in text
        path = tmp_path / "deck.k"
        path.write_text(text.replace(old, "\n".join(new.lines)))
        (table,) = decks.read(path).scene.tables["spring"]
        assert (table["kind"], table["stiffness"]) == (kind, stiffness)


def test_no_force_in_rigid_motion_and_the_fmu_runs(tmp_path):
    """Both plates turn and move as one body: what the weld does to them adds up to nothing."""
    found = read(dyna(ROUND), tmp_path)
    scene = decks.compiled(found)
    simulation = scene.simulation()
    w = np.array([0.0, 0.0, 40.0])
    names, values = [], []
    for number, (_, x) in enumerate(sorted((LOWER | UPPER).items()), 1):
        for k, value in enumerate(np.cross(w, x), 1):
            names.append(f"master[{number}].v[{k}]")
            values.append(value)
        for k, value in enumerate(w, 1):
            names.append(f"master[{number}].w[{k}]")
            values.append(value)
    simulation.set_values(names, np.array(values))
    simulation.initialise(0.0)
    simulation.step(1e-9)  # the velocities are exact at the start alone
    forces = [f"master[{n}].{what}[{k}]" for n in range(1, 9) for what in "ft" for k in (1, 2, 3)]
    scale = E * AREA * 40 * 1e-9
    assert np.abs(simulation.get_values(forces)).max() < 1e-4 * scale
    fmu = build(scene, tmp_path / "deck.fmu")
    result = fmpy.simulate_fmu(str(fmu), stop_time=1e-5, output_interval=1e-6)
    assert np.isfinite(np.array(result.tolist())).all()


# Radioss


def radioss(prop, element=(11, 12)) -> RadiossDeck:
    made = RadiossDeck().nodes(LOWER | UPPER | WELD | SIDE).elastic().shell(thickness=1e-2).part()
    made.elements("SHELL", 1, {1: (1, 2, 3, 4), 2: (5, 6, 7, 8)})
    made.block("/MAT/LAW1/2", (RHO,), (E, NU), title="weld").block("/PROP/TYPE3/2", *prop, title="weld")
    made.part(2, 2, 2).elements("BEAM", 2, {5: element})
    made.node_group(1, [11, 12], "ends").surface(1, "PART", [1])
    return made.tie(1, 1, 1, 0, 0, 0, 0.005)


@pytest.mark.parametrize("third, orientation", [((), [0, 1, 0]), ((13,), [1, 0, 0])])
def test_radioss_beam(tmp_path, third, orientation):
    """A Timoshenko beam of the shear area 5/6 A; its y axis on the side of the third node."""
    area, iyy, izz, ixx = 4e-5, 2e-10, 3e-10, 4e-10
    prop = [(0,), (0.0, 0.0), (area, iyy, izz, ixx), (0,)]
    (table,) = read(radioss(prop, (11, 12, *third)), tmp_path).scene.tables["spring"]
    aside = [1 / (LENGTH**3 / (12 * E * i) + LENGTH / (G * 5 / 6 * area)) for i in (izz, iyy)]
    assert table["kind"] == "beam" and table["stiffness"] == pytest.approx([E * area / LENGTH, *aside])
    assert table["rotational_stiffness"] == pytest.approx([G * ixx / LENGTH, E * iyy / LENGTH, E * izz / LENGTH])
    assert table["orientation"] == pytest.approx(orientation)


# Abaqus


@pytest.mark.parametrize("second, orientation", [((), [0, -1, 0]), (("1., 0., 0.",), [1, 0, 0])])
def test_abaqus_beam(tmp_path, second, orientation):
    """RECT, a = 4 mm along the first and b = 8 mm along the second axis: I11 = a b^3/12 counts about n1. The default
    n1 = -z lies along this beam, and the side of y is taken."""
    made = (
        InputDeck().nodes(LOWER | UPPER | WELD).elastic().elements("S4R", "plates", {1: (1, 2, 3, 4), 2: (5, 6, 7, 8)})
    )
    made.block("SHELL SECTION, ELSET=plates, MATERIAL=steel", "0.01")
    made.elements("B31", "weld", {3: (11, 12)})
    made.block("BEAM SECTION, ELSET=weld, MATERIAL=steel, SECTION=RECT", "0.004, 0.008", *second)
    made.block("SURFACE, NAME=sheets", "plates").block("NSET, NSET=ends", "11, 12")
    made.block("SURFACE, NAME=pins, TYPE=NODE", "ends").block(
        "TIE, NAME=weld, ADJUST=NO, POSITION TOLERANCE=0.005", "pins, sheets"
    )
    (table,) = decks.read(made.write(tmp_path / "deck.inp")).scene.tables["spring"]
    i11, i22 = 0.004 * 0.008**3 / 12, 0.008 * 0.004**3 / 12
    assert table["rotational_stiffness"][1:] == pytest.approx([2.1e11 * i11 / LENGTH, 2.1e11 * i22 / LENGTH])
    assert np.abs(table["orientation"]) == pytest.approx(np.abs(orientation))
