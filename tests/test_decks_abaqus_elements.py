"""Abaqus and CalculiX: mass, inertia and nodal stiffness of every kind of element, against numbers worked out by
hand."""

import numpy as np
import pytest
from deck_checks import by_node
from input_deck import InputDeck
from tiefmu.decks import abaqus

E, NU, RHO = 2.0e11, 0.25, 8000.0
A11, G, BULK = E / (1 - NU**2), E / 2.5, E / 1.5
C2 = (BULK + 4 * G / 3) / RHO
SQUARE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}  # 2 m by 1 m
TIE = {9001: (0, 0, 50), 9002: (9, 0, 50), 9003: (0, 9, 50), 9004: (1, 1, 50)}  # a deck must have a tie


def read(deck: InputDeck, tmp_path, nodes: dict, said: list | None = None):
    """The deck with a tie to surface elements far away; returns values by node id."""
    deck.nodes(nodes | TIE).elements("SFM3D3", "skin", {9999: (9001, 9002, 9003)}).elastic("steel", RHO, E, NU)
    deck.block("NSET, NSET=pin", (9004,)).tie("pin", "skin")
    found = abaqus.read(deck.write(tmp_path / "deck.inp"), "deck.inp")
    if said is not None:
        said += found.warnings
    else:
        assert found.warnings == [
            "deck.inp: names no units; m, kg, s are taken, in which material 'steel' has 8000 kg/m3 and 2e+11 Pa"
        ]
    return by_node(found)


def close(found: dict, **wanted):
    for key, value in wanted.items():
        assert found[key] == pytest.approx(value, rel=1e-9, abs=1e-300), key


def shells(kind: str, rows: dict, thickness=0.1, options="") -> InputDeck:
    return InputDeck().elements(kind, "e", rows).shell("e", thickness, options=options)


@pytest.mark.parametrize("kind", ["S4R", "S4RS", "S4R5", "s4r"])
def test_reduced_quads(tmp_path, kind):
    found = read(shells(kind, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    m, k = 8000 * 0.1 * 2 / 4, 5 / 4 * 0.1 * A11 / 2
    for node in SQUARE:
        close(found[node], m=m, j=m * (2 / 9 + 0.01 / 12), k=k, kr=k * (0.01 + 2) / 12)
        assert found[node]["rotates"]


def test_full_quads(tmp_path):
    found = read(shells("S4", {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    f2 = 0.78 + 0.22 * (3.413 * 0.2929) ** 3  # as for QBAT in test_decks_elements.py
    length = 2 / np.sqrt(2 * 1.25 * f2 * 4 / 3 * 1.25)
    m, k = 400.0, 0.5 * 0.1 * 2 * A11 / length**2
    close(found[3], m=m, j=m * (2 / 12 + 0.01 / 12), k=k, kr=k * 0.01 / 12)


def test_distorted_quads_by_shape_functions(tmp_path):
    """By hand: a trapezium with parallel sides 3 and 1, height 1: the integral of N over [-1, 1]^2 with the Jacobian
    (2 - s) / 4: lower corners 7/12 each, upper ones 5/12."""
    nodes = {1: (0, 0, 0), 2: (3, 0, 0), 3: (2, 1, 0), 4: (1, 1, 0)}
    found = read(shells("S4R", {1: (1, 2, 3, 4)}), tmp_path, nodes)
    for node, share in {1: 7, 2: 7, 3: 5, 4: 5}.items():
        close(found[node], m=8000 * 0.1 * share / 12)


@pytest.mark.parametrize("kind, corners", [("S3", (1, 2, 3)), ("S3R", (1, 2, 3)), ("S4R", (1, 2, 3, 3))])
def test_triangles_get_thirds(tmp_path, kind, corners):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0)}
    found = read(shells(kind, {1: corners}), tmp_path, nodes)
    for node in nodes:
        close(found[node], m=8000 * 0.1 * 0.5 / 3)
    if kind != "S4R":
        k = 0.1 * 0.5 * A11 * 2 / 1.0  # t A A11 / L^2, L = 2 A / sqrt(2)
        close(found[2], k=k, j=8000 * 0.05 / 3 * (0.5 / 4.5 + 0.01 / 12), kr=k * (0.01 / 12 + 0.5 * G / (2 * A11)))


def test_offset_of_the_reference_surface(tmp_path):
    for options, z0 in ((", OFFSET=SPOS", 0.5), (", OFFSET=SNEG", -0.5), (", offset=0.25", 0.25)):
        found = read(shells("S4R", {1: (1, 2, 3, 4)}, options=options), tmp_path, SQUARE)
        close(found[1], j=400 * (2 / 9 + 0.01 * (1 / 12 + z0 * z0)))


@pytest.mark.parametrize("kind", ["M3D4", "M3D4R"])
def test_membranes_do_not_turn(tmp_path, kind):
    deck = InputDeck().elements(kind, "e", {1: (1, 2, 3, 4)}).block("MEMBRANE SECTION, ELSET=e, MATERIAL=STEEL", "0.1")
    found = read(deck, tmp_path, SQUARE)
    close(found[1], m=400.0, j=0.0, k=5 / 4 * 0.1 * A11 / 2, kr=0.0)
    assert not found[1]["rotates"]


@pytest.mark.parametrize("kind", ["R3D4", "SFM3D4R"])
def test_rigid_and_surface_elements_weigh_nothing(tmp_path, kind):
    found = read(InputDeck().elements(kind, "e", {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    close(found[1], m=0.0, j=0.0, k=0.0, kr=0.0)


CUBE = {
    1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0), 5: (0, 0, 3), 6: (2, 0, 3), 7: (2, 1, 3), 8: (0, 1, 3),
}  # fmt: skip


def solids(kind: str, rows: dict) -> InputDeck:
    return InputDeck().elements(kind, "e", rows).solid("e")


@pytest.mark.parametrize("kind", ["C3D8", "C3D8R", "C3D8I", "C3D8RT"])
def test_bricks(tmp_path, kind):
    found = read(solids(kind, {1: tuple(range(1, 9))}), tmp_path, CUBE)
    q = 0.05 * np.sqrt(C2)
    dt = 6.0 / 6.0 / (q + np.sqrt(q * q + C2))
    for node in CUBE:
        close(found[node], m=RHO * 6 / 8, j=0.0, k=RHO * 6 / (4 * dt * dt), kr=0.0)
        assert not found[node]["rotates"]


def test_distorted_bricks_by_shape_functions(tmp_path):
    """A frustum over the trapezium of test_distorted_quads: constant along z, so its corners get half its shares."""
    plan = [(0, 0), (3, 0), (2, 1), (1, 1)]
    nodes = {k + 1: (*plan[k % 4], 2.0 * (k // 4)) for k in range(8)}
    found = read(solids("C3D8R", {1: tuple(range(1, 9))}), tmp_path, nodes)
    for node in nodes:
        close(found[node], m=RHO * 2 * (7 if node % 4 in (1, 2) else 5) / 12 / 2)


def test_continuum_shells_are_solids(tmp_path):
    found = read(shells("SC8R", {1: tuple(range(1, 9))}), tmp_path, CUBE)
    close(found[1], m=RHO * 6 / 8, j=0.0)


@pytest.mark.parametrize("kind, corners", [("C3D6", (1, 2, 3, 5, 6, 7)), ("C3D8R", (1, 2, 3, 3, 5, 6, 7, 7))])
def test_wedges(tmp_path, kind, corners):
    nodes = {number: CUBE[number] for number in (1, 2, 3, 5, 6, 7)}
    found = read(solids(kind, {1: corners}), tmp_path, nodes)
    for node in nodes:
        close(found[node], m=RHO * 3 / 6)


def test_pyramids(tmp_path):
    """Row sums of a brick with four corners in the apex: by hand 3/16 of the mass at each corner of the base."""
    nodes = {1: (-1, -1, 0), 2: (1, -1, 0), 3: (1, 1, 0), 4: (-1, 1, 0), 5: (0, 0, 1.5)}
    found = read(solids("C3D5", {1: (1, 2, 3, 4, 5)}), tmp_path, nodes)
    for node in (1, 2, 3, 4):
        close(found[node], m=RHO * 2 * 3 / 16)
    close(found[5], m=RHO * 2 / 4)


def test_tetrahedra(tmp_path):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2)}
    found = read(solids("C3D4", {1: (1, 2, 3, 4)}), tmp_path, nodes)
    length, q = 1 / np.sqrt(1.5), 0.05 * np.sqrt(C2)
    dt = length / (q + np.sqrt(q * q + C2))
    for node in nodes:
        close(found[node], m=RHO * 4 / 6 / 4, k=RHO * 4 / 6 / (2 * dt * dt))


# second order: straight elements, whose shares are known numbers


def middles(corners: dict, pairs, start: int) -> dict:
    return {start + i: tuple(np.mean([corners[a], corners[b]], axis=0)) for i, (a, b) in enumerate(pairs)}


@pytest.mark.parametrize("kind", ["C3D10", "C3D10M", "C3D10HS"])
def test_ten_node_tetrahedra(tmp_path, kind):
    corners = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2)}
    nodes = corners | middles(corners, [(1, 2), (2, 3), (3, 1), (1, 4), (2, 4), (3, 4)], 5)
    found = read(solids(kind, {1: tuple(range(1, 11))}), tmp_path, nodes)
    length, q = 1 / np.sqrt(1.5), 0.05 * np.sqrt(C2)
    dt = length / (q + np.sqrt(q * q + C2)) / np.sqrt(6)
    for node in nodes:
        m = RHO * 4 / 6 * (1 / 36 if node < 5 else 4 / 27)
        close(found[node], m=m, k=2 * m / dt**2)


HEX_EDGES = [(1, 2), (2, 3), (3, 4), (4, 1), (5, 6), (6, 7), (7, 8), (8, 5), (1, 5), (2, 6), (3, 7), (4, 8)]


@pytest.mark.parametrize("kind", ["C3D20", "C3D20R", "C3D20RI"])
def test_twenty_node_bricks(tmp_path, kind):
    nodes = CUBE | middles(CUBE, HEX_EDGES, 9)
    found = read(solids(kind, {1: tuple(range(1, 21))}), tmp_path, nodes)
    for node in nodes:
        close(found[node], m=RHO * 6 * (7 if node < 9 else 16) / 248)


def test_fifteen_node_wedges(tmp_path):
    """The shares of the wedge are not in tables: by the integrals of its shape functions, written out."""
    line, weight = np.polynomial.legendre.leggauss(8)
    total, found = 0.0, np.zeros(3)
    for i, j, k in np.ndindex(8, 8, 8):
        a, b, t = (line[i] + 1) / 2, (line[j] + 1) / 2, line[k]
        area = np.array([1 - a, a * (1 - b), a * b])
        corner = area * (1 - t) * (2 * area - 2 - t) / 2
        edge = 2 * area * np.roll(area, -1) * (1 - t)
        upright = area * (1 - t**2)
        w = weight[i] * weight[j] * weight[k] * a
        total += w * (2 * (corner**2).sum() + 2 * (edge**2).sum() + (upright**2).sum())
        found += w * np.array([corner[0] ** 2, edge[0] ** 2, upright[0] ** 2])
    corner, edge, upright = found / total
    corners = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0), 4: (0, 0, 2), 5: (1, 0, 2), 6: (0, 1, 2)}
    pairs = [(1, 2), (2, 3), (3, 1), (4, 5), (5, 6), (6, 4), (1, 4), (2, 5), (3, 6)]
    nodes = corners | middles(corners, pairs, 7)
    found = read(solids("C3D15", {1: tuple(range(1, 16))}), tmp_path, nodes)
    for node, share in ((1, corner), (6, corner), (8, edge), (12, edge), (13, upright)):
        close(found[node], m=RHO * share)


@pytest.mark.parametrize("kind", ["S8R", "S8R5", "S8"])
def test_eight_node_shells(tmp_path, kind):
    nodes = SQUARE | middles(SQUARE, [(1, 2), (2, 3), (3, 4), (4, 1)], 5)
    found = read(shells(kind, {1: tuple(range(1, 9))}), tmp_path, nodes)
    for node in nodes:
        share = (3 if node < 5 else 16) / 76
        k = 6 * share * 4 * (5 / 4 * 0.1 * A11 / 2)
        close(found[node], m=1600 * share, j=1600 * share * (2 / 36 + 0.01 / 12), k=k)
        assert found[node]["rotates"]


@pytest.mark.parametrize("kind", ["STRI65", "S6"])
def test_six_node_shells(tmp_path, kind):
    corners = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0)}
    nodes = corners | middles(corners, [(1, 2), (2, 3), (3, 1)], 4)
    found = read(shells(kind, {1: tuple(range(1, 7))}), tmp_path, nodes)
    for node in nodes:
        close(found[node], m=8000 * 0.05 * (1 if node < 4 else 16 / 3) / 19)


def test_the_step_of_a_quadratic_bar():
    """1 / sqrt(6) of the linear bar's: the eigenvalues of three nodes with masses 1/6, 2/3, 1/6."""
    k = np.array([[7, -8, 1], [-8, 16, -8], [1, -8, 7]]) / 3
    largest = np.linalg.eigvals(np.diag([6, 1.5, 6]) @ k).real.max()
    assert 2 / np.sqrt(largest) == pytest.approx(1 / np.sqrt(6))


LINE = {1: (0, 0, 0), 2: (0, 3, 4)}  # 5 m


def test_trusses(tmp_path):
    deck = InputDeck().elements("T3D2", "e", {1: (1, 2)}).block("SOLID SECTION, ELSET=e, MATERIAL=steel", "0.01")
    close(read(deck, tmp_path, LINE)[1], m=RHO * 0.01 * 5 / 2, j=0.0, k=E * 0.01 / 5)
    deck = InputDeck().elements("T3D3", "e", {1: (1, 3, 2)}).block("SOLID SECTION, ELSET=e, MATERIAL=steel", "0.01")
    found = read(deck, tmp_path, LINE | {3: (0, 1.5, 2)})
    close(found[1], m=RHO * 0.01 * 5 / 4)
    close(found[3], m=RHO * 0.01 * 5 / 2)


@pytest.mark.parametrize(
    "shape, sizes, area, moments",
    [
        ("RECT", "0.1, 0.2", 0.02, (0.1 * 0.2**3 / 12, 0.2 * 0.1**3 / 12)),
        ("CIRC", "0.1", np.pi * 0.01, (np.pi * 1e-4 / 4,) * 2),
        ("PIPE", "0.1, 0.02", np.pi * (0.01 - 0.0064), (np.pi * (1e-4 - 0.08**4) / 4,) * 2),
        ("BOX", "0.1, 0.2, 0.01, 0.01, 0.01, 0.01", 0.02 - 0.08 * 0.18,
         ((0.1 * 0.2**3 - 0.08 * 0.18**3) / 12, (0.2 * 0.1**3 - 0.18 * 0.08**3) / 12)),
        ("I", "0.1, 0.2, 0.1, 0.1, 0.01, 0.01, 0.02", 2 * 0.001 + 0.18 * 0.02,
         ((0.1 * 0.2**3 - 0.08 * 0.18**3) / 12, (2 * 0.01 * 0.1**3 + 0.18 * 0.02**3) / 12)),
    ],
)  # fmt: skip
def test_beams(tmp_path, shape, sizes, area, moments):
    deck = InputDeck().elements("B31", "e", {1: (1, 2)})
    deck.block(f"BEAM SECTION, SECTION={shape}, ELSET=e, MATERIAL=steel", sizes, "1., 0., 0.")
    found = read(deck, tmp_path, LINE)
    m, i = RHO * area * 5 / 2, max(moments)
    d = 0.01 * np.sqrt(2)
    short = 5 * (np.sqrt(1 + d * d) - d) ** 2
    slenderness = area * 25 / i / 12
    shear = 1.2 * 2.5 / slenderness
    phi = max(1, (4 + shear) / (1 + shear) / (1 + slenderness))
    close(found[1], m=m, j=m * 25 / 12 + RHO * 2.5 * i, k=E * area / short, kr=phi * E * i / short)
    assert found[1]["rotates"]


def test_beams_of_a_general_section_and_of_three_nodes(tmp_path):
    deck = InputDeck().elements("B32", "e", {1: (1, 3, 2)})
    deck.block(
        "BEAM GENERAL SECTION, SECTION=GENERAL, ELSET=e, DENSITY=7000.", "0.01, 1e-5, 0., 2e-5, 3e-5", "1.,0.,0."
    )
    deck.block("NSET, NSET=x", "1").lines.insert(-2, "1e11, 4e10")
    found = read(deck, tmp_path, LINE | {3: (0, 1.5, 2)})
    close(found[1], m=7000 * 0.01 * 5 / 4)
    close(found[3], m=7000 * 0.01 * 5 / 2)


# sections and materials


def test_composites_are_summed(tmp_path):
    deck = InputDeck().elements("S4R", "e", {1: (1, 2, 3, 4)}).elastic("skin", 1000.0, 1e11, 0.25)
    deck.block("SHELL SECTION, ELSET=e, COMPOSITE", "0.02, 3, skin, 0.", "0.05, 3, Steel, 90.", "0.02, 3, skin, 0.")
    said: list = []
    found = read(deck, tmp_path, SQUARE, said)
    close(found[1], m=2 / 4 * (0.04 * 1000 + 0.05 * 8000), k=5 / 4 * 0.09 * A11 / 2)
    assert any("is a composite" in line and "'steel'" in line for line in said)


def test_a_shell_given_by_its_stiffness_has_the_mass_per_area(tmp_path):
    deck = InputDeck().elements("S4R", "e", {1: (1, 2, 3, 4)})
    deck.block("SHELL GENERAL SECTION, ELSET=e, DENSITY=12.", "1e9, 0., 1e9")
    said: list = []
    close(read(deck, tmp_path, SQUARE, said)[1], m=12 * 2 / 4, k=0.0)
    assert any("line 5: *SHELL GENERAL SECTION: is given by its stiffness" in line for line in said)


def test_varying_thickness_is_warned_of(tmp_path):
    said: list = []
    read(shells("S4R", {1: (1, 2, 3, 4)}, options=", NODAL THICKNESS"), tmp_path, SQUARE, said)
    assert any("NODALTHICKNESS" in line and "0.1 is taken everywhere" in line for line in said)


@pytest.mark.parametrize(
    "options, rows, young, poisson",
    [
        (", TYPE=ENGINEERING CONSTANTS", ["1e11, 2e11, 5e10, 0.1, 0.2, 0.3, 4e10, 4e10", "4e10"], 2e11, 0.3),
        (", TYPE=LAMINA", ["1e11, 1e10, 0.3, 4e9, 4e9, 4e9"], 1e11, 0.3),
        (", TYPE=ORTHOTROPIC", ["1e11, 3e10, 3e11, 3e10, 3e10, 2e11, 4e9, 4e9", "4e9"], 3e11, 0.0),
    ],
)
def test_materials_that_are_not_isotropic(tmp_path, options, rows, young, poisson):
    deck = InputDeck().elements("S4R", "e", {1: (1, 2, 3, 4)}).shell("e", 0.1, "wood")
    deck.block("MATERIAL, NAME=Wood").block("DENSITY", "500.,").block(f"ELASTIC{options}", *rows)
    said: list = []
    found = read(deck, tmp_path, SQUARE, said)
    close(found[1], m=500 * 0.1 * 2 / 4, k=5 / 4 * 0.1 * young / (1 - poisson**2) / 2)
    assert any("material 'Wood' is not isotropic" in line for line in said)


def test_rubber(tmp_path):
    deck = InputDeck().elements("C3D8R", "e", {1: tuple(range(1, 9))}).solid("e", "rubber")
    deck.block("MATERIAL, NAME=rubber").block("DENSITY", "1000.").block("HYPERELASTIC, NEO HOOKE", "5e5, 1e-8")
    found = read(deck, tmp_path, CUBE)
    c2 = (2 / 1e-8 + 4 / 3 * 1e6) / 1000
    q = 0.05 * np.sqrt(c2)
    close(found[1], k=1000 * 6 / (4 * (1 / (q + np.sqrt(q * q + c2))) ** 2))


def test_what_has_no_stiffness_keeps_its_mass(tmp_path):
    deck = InputDeck().elements("C3D8R", "e", {1: tuple(range(1, 9))}).solid("e", "foam")
    deck.block("MATERIAL, NAME=foam").block("DENSITY", "1000.").block("HYPERFOAM, N=2", "1,2,3,4")
    said: list = []
    close(read(deck, tmp_path, CUBE, said)[1], m=750.0, k=0.0)
    assert any("*HYPERFOAM: material 'foam'" in line and "it has mass only" in line for line in said)


def test_elements_without_a_section_and_of_unread_types_are_said(tmp_path):
    said: list = []
    deck = InputDeck().elements("S4R", "e", {1: (1, 2, 3, 4)}).elements("CONN3D2", "c", {7: (1, 2)})
    close(read(deck, tmp_path, SQUARE, said)[1], m=0.0)
    assert (
        "deck.inp: line 3: *ELEMENT: 1 elements of type S4R have no section; they add no mass and no stiffness" in said
    )
    assert (
        "deck.inp: line 5: *ELEMENT: 1 elements of type CONN3D2 are not read; they add no mass and no stiffness" in said
    )


def test_point_masses_and_inertias(tmp_path):
    deck = InputDeck().elements("MASS", "m", {1: (1,), 2: (1,)}).block("MASS, ELSET=m", "0.5")
    deck.elements("ROTARYI", "j", {3: (2,)}).block("ROTARY INERTIA, ELSET=j", "2., 2., 2.")
    found = read(deck, tmp_path, SQUARE)
    close(found[1], m=1.0, j=0.0)  # two elements at one node
    close(found[2], m=0.0, j=2.0)
    assert found[2]["rotates"] and not found[1]["rotates"]


def test_masses_of_nodes_are_masses_of_elements(tmp_path):
    n = 4
    number = {p: i for i, p in enumerate(np.ndindex(n + 1, n + 1, n + 1), 1)}
    rng = np.random.default_rng(3)
    nodes = {i: tuple(np.array(p) + rng.uniform(-0.2, 0.2, 3)) for p, i in number.items()}
    bricks, tets = {}, {}
    for cell in np.ndindex(n, n, n):
        steps = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        c = [number[tuple(np.add(cell, d))] for d in steps]
        if cell[2] % 2:
            bricks[len(bricks) + 1] = tuple(c)
        else:
            for a, b in [(1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1)]:
                tets[len(tets) + 1001] = (c[0], c[6], c[a], c[b])
    deck = InputDeck().elements("C3D8R", "b", bricks).elements("C3D4", "t", tets).solid("b").solid("t")
    found = read(deck, tmp_path, nodes)
    x = {i: np.array(p) for i, p in nodes.items()}
    total = 0.0
    for corners in tets.values():
        p = [x[i] for i in corners]
        total += RHO * abs(np.linalg.det([p[1] - p[0], p[2] - p[0], p[3] - p[0]])) / 6
    line, weight = np.polynomial.legendre.leggauss(4)  # more points than are needed
    signs = np.array([[-1, 1, 1, -1, -1, 1, 1, -1], [-1, -1, 1, 1, -1, -1, 1, 1], [-1, -1, -1, -1, 1, 1, 1, 1]]).T
    for corners in bricks.values():
        p = np.array([x[i] for i in corners])
        for i, j, k in np.ndindex(4, 4, 4):
            u = np.array([line[i], line[j], line[k]])
            f = 1 + signs * u
            slopes = np.stack([signs[:, a] * f[:, (a + 1) % 3] * f[:, (a + 2) % 3] for a in range(3)]) / 8
            total += RHO * weight[i] * weight[j] * weight[k] * np.linalg.det(slopes @ p)
    assert sum(one["m"] for one in found.values()) == pytest.approx(total, rel=1e-12)


def test_masses_without_value_and_elements_of_two_sections_are_named(tmp_path):
    deck = shells("S4R", {1: (1, 2, 3, 4)}).elements("MASS", "lumps", {7: (1,), 8: (2,)})
    deck.elements("ROTARYI", "turns", {9: (1,)}).block("NSET, NSET=x", "1")
    deck.block("ELSET, ELSET=one", "7").block("MASS, ELSET=one", (0.5,)).shell("e", 0.2)
    said: list[str] = []
    read(deck, tmp_path, SQUARE, said)
    assert any("1 elements of type MASS, the first is 8, have no mass given" in line for line in said)
    assert any("1 elements of type ROTARYI, the first is 9, have no inertia given" in line for line in said)
    assert any("1 of its elements have a section already, in " in line for line in said)
