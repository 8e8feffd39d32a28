"""What LS-DYNA elements, sections and materials give to nodes: against numbers worked out by hand."""

import numpy as np
import pytest
import tiefmu
from deck_checks import by_node
from dyna_cards import DynaDeck
from tiefmu import decks
from tiefmu.decks import dyna

E, NU, RHO = 2.0e11, 0.25, 8000.0
A11, G, BULK = E / (1 - NU**2), E / 2.5, E / 1.5
SQUARE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}  # 2 m by 1 m
TIE = {9001: (0, 0, 50), 9002: (9, 0, 50), 9003: (0, 9, 50), 9004: (1, 1, 51)}  # a deck must have a tie; it is far away


def read(made: DynaDeck, tmp_path, nodes: dict):
    """The deck with a tie far away; returns values by node id, and the deck."""
    made.nodes(nodes | TIE).segments(1, [(9001, 9002, 9003, 9003)]).list_of("NODE", 1, [9004]).tie(1, 1, (4, 0))
    deck = dyna.read(made.write(tmp_path / "deck.k"), "deck.k")
    found = by_node(deck)
    return found, deck


def base(section: str = "shell", **values) -> DynaDeck:
    made = DynaDeck().elastic(1, RHO, E, NU)
    return getattr(made, section)(1, **values).part()


def close(found: dict, **wanted):
    for key, value in wanted.items():
        assert found[key] == pytest.approx(value, rel=1e-9, abs=1e-300), key


@pytest.mark.parametrize("elform", [2, 16, 10, -16])
def test_shells(tmp_path, elform):
    t, area = 0.1, 2.0
    found, _ = read(base(thickness=t, elform=elform).elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    m, k = 8000 * 0.1 * 2 / 4, 5 / 4 * t * A11 / area  # 400 kg; both diagonals squared are 5
    for node in SQUARE:
        close(found[node], m=m, j=m * (2 / 9 + 0.01 / 12), k=k, kr=k * (0.01 + 2) / 12)
        assert found[node]["rotates"]


def test_the_step_of_a_square_shell_is_the_manuals(tmp_path):
    """L / c with L = A / longest side and c^2 = E / (rho (1 - nu^2)): Theory Manual, time step of shells."""
    square = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 2, 0), 4: (0, 2, 0)}
    found, _ = read(base(thickness=0.1).elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, square)
    assert np.sqrt(2 * found[1]["m"] / found[1]["k"]) == pytest.approx(2.0 / np.sqrt(A11 / RHO), rel=1e-12)


@pytest.mark.parametrize("corners", [(1, 2, 3, 3), (1, 2, 3), (1, 2, 3, 0)])
def test_triangles(tmp_path, corners):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0)}
    t, area = 0.1, 0.5
    found, _ = read(base(thickness=t).elements("SHELL", 1, {1: corners}), tmp_path, nodes)
    k = t * area * A11 / (2 * area / np.sqrt(2)) ** 2
    for node, share in {1: 0.5, 2: 0.25, 3: 0.25}.items():
        m = 8000 * t * area * share
        close(found[node], m=m, j=m * (0.5 / 4.5 + 0.01 / 12), k=k, kr=k * (t * t / 12 + area * G / (2 * A11)))


def test_thickness_of_elements_over_sections(tmp_path):
    nodes = {i: (i % 4, i // 4, 0) for i in range(16)} | {0: (0, 0, 0)}
    nodes = {number + 1: x for number, x in nodes.items()}
    made = base(thickness=0.1).block(
        "ELEMENT_SHELL_THICKNESS",
        *[
            ("I" * 6, 1, 1, 1, 2, 6, 5),
            ("RRRR", 0.2, 0.2, 0.4, 0.4),
            ("I" * 6, 2, 1, 3, 4, 8, 8),
            ("RRRR", 0.3, 0.3, 0.3, 9.0),
        ],
        *[("I" * 6, 3, 1, 9, 10, 14, 13), ("RRRR", 0.0, 0.0, 0.0, 0.0)],
    )
    made.block("ELEMENT_SHELL_BETA", ("I" * 6, 4, 1, 11, 12, 16, 15), ("RRRRR", 0.0, 0.0, 0.0, 0.0, 45.0))
    found, deck = read(made, tmp_path, nodes)
    close(found[1], m=8000 * 0.3 / 4)
    close(found[9], m=8000 * 0.1 / 4)
    close(found[11], m=8000 * 0.1 / 4)
    assert deck.elements["shell3"].thickness.tolist() == pytest.approx([0.3])


def test_mid_side_nodes_and_their_thickness_card(tmp_path):
    nodes = SQUARE | {5: (1, 0, 0), 6: (2, 0.5, 0), 7: (1, 1, 0), 8: (0, 0.5, 0)}
    made = base(thickness=0.1).block(
        "ELEMENT_SHELL_THICKNESS",
        *[("I" * 10, 1, 1, *range(1, 9)), ("RRRR", *[0.2] * 4), ("RRRR", *[0.3] * 4)],
        *[("I" * 6, 2, 1, 1, 2, 3, 4), ("RRRR", *[0.4] * 4)],
    )
    found, deck = read(made, tmp_path, nodes)
    close(found[1], m=8000 * (0.2 + 0.4) * 2 / 4)
    assert any("mid-side nodes are left aside" in line for line in deck.warnings)


def test_sections_of_shells(tmp_path):
    made = (
        DynaDeck()
        .elastic(1, RHO, E, NU)
        .block(
            "SECTION_SHELL_TITLE",
            *["layers at angles", ("iirrrri", 1, 2, 1.0, 9.0, 0.0, 0.0, 1), ("rrrrrr", 0.1, 0.2, 0.3, 0.4, 0.0, 50.0)],
            *[("r" * 8, *[45.0] * 8), ("r", 45.0), "second", ("ii", 2, 2), ("r", 0.5)],
        )
    )
    found, deck = read(made.part().elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    close(found[1], m=(8000 * 0.25 + 50) * 2 / 4)
    assert deck.properties[2].values["thickness"] == 0.5


CUBE = {
    1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0), 5: (0, 0, 3), 6: (2, 0, 3), 7: (2, 1, 3), 8: (0, 1, 3),
}  # fmt: skip
C2 = (BULK + 4 * G / 3) / RHO


def solid_stiffness(length: float, mass: float, share: int, qb: float = 0.05) -> float:
    q = qb * np.sqrt(C2)
    return mass / (share * (length / (q + np.sqrt(q * q + C2))) ** 2)


@pytest.mark.parametrize("two_cards", [False, True])
@pytest.mark.parametrize("keyword", ["SOLID", "SOLID_ORTHO", "TSHELL"])
def test_bricks(tmp_path, two_cards, keyword):
    made = DynaDeck().elastic(1, RHO, E, NU).part()
    made.block("SECTION_TSHELL" if keyword == "TSHELL" else "SECTION_SOLID", ("ii", 1, 1))
    cards = [("II", 1, 1), ("I" * 8, *range(1, 9))] if two_cards else [("I" * 10, 1, 1, *range(1, 9))]
    more = [("RRR", 1.0, 0.0, 0.0)] * 2 if keyword == "SOLID_ORTHO" else []
    found, _ = read(made.block(f"ELEMENT_{keyword}", *cards, *more), tmp_path, CUBE)
    close(found[1], m=RHO * 6 / 8, j=0.0, k=solid_stiffness(1.0, RHO * 6, 4), kr=0.0)
    assert not found[1]["rotates"]


def test_bulk_viscosity(tmp_path):
    made = base("solid").block("CONTROL_BULK_VISCOSITY", ("rr", 1.5, 0.1)).elements("SOLID", 1, {1: tuple(range(1, 9))})
    found, _ = read(made, tmp_path, CUBE)
    close(found[1], k=solid_stiffness(1.0, RHO * 6, 4, 0.1))


TET = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2)}


@pytest.mark.parametrize("nodes", [(1, 2, 3, 4, 4, 4, 4, 4), (1, 2, 3, 4), (1, 2, 3, 3, 4, 4, 4, 4)])
@pytest.mark.parametrize("elform", [10, 13, 1])
def test_tetrahedra(tmp_path, nodes, elform):
    found, _ = read(base("solid", elform=elform).elements("SOLID", 1, {1: nodes}), tmp_path, TET)
    k = solid_stiffness(1 / np.sqrt(1.5), RHO * 4 / 6, 2)
    for node in TET:
        close(found[node], m=RHO * 4 / 6 / 4, j=0.0, k=k)


def test_wedges_and_pyramids_share_as_bricks(tmp_path):
    wedge = {1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (0, 0, 1), 6: (0, 1, 1)}
    found, _ = read(base("solid", elform=15).elements("SOLID", 1, {1: (1, 2, 3, 4, 5, 5, 6, 6)}), tmp_path, wedge)
    assert found[1]["m"] == pytest.approx(RHO * 0.5 / 8) and found[5]["m"] == pytest.approx(RHO * 0.5 / 4)
    pyramid = {1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0), 5: (0.5, 0.5, 1)}
    found, _ = read(base("solid").elements("SOLID", 1, {1: (1, 2, 3, 4, 5, 5, 5, 5)}), tmp_path, pyramid)
    assert found[5]["m"] == pytest.approx(4 * found[1]["m"])


def test_ten_node_tetrahedra(tmp_path):
    pairs = [(1, 2), (2, 3), (3, 1), (1, 4), (2, 4), (3, 4)]
    middle = {5 + i: tuple(np.mean([TET[a], TET[b]], axis=0)) for i, (a, b) in enumerate(pairs)}
    made = base("solid", elform=16).block("ELEMENT_SOLID", ("II", 1, 1), ("I" * 10, *range(1, 11)))
    found, _ = read(made, tmp_path, TET | middle)
    close(found[1], m=RHO * 4 / 6 / 32)
    close(found[9], m=RHO * 4 / 6 * 7 / 48)


LINE = {1: (0, 0, 0), 2: (0, 3, 4), 3: (9, 0, 0)}  # 5 m


def beam_values(area, bending, torsion):
    """pmass.F, for slender beams: damping 0.01."""
    m, d = RHO * area * 5 / 2, 0.01 * np.sqrt(2)
    short = 5 * (np.sqrt(1 + d * d) - d) ** 2
    return {
        **{"m": m, "j": m * 25 / 12 + RHO * 2.5 * bending, "k": E * area / short},
        "kr": max(E * bending, G * torsion) / short,
    }


TUBE = np.pi / 4 * (0.1**2 - 0.06**2), np.pi / 64 * (0.1**4 - 0.06**4)


@pytest.mark.parametrize(
    "first, second, area, bending, torsion",
    [
        ((1, 0.0, 0.0, 0.0), ("rrrr", 0.1, 0.1, 0.2, 0.2), 0.02, 0.1 * 0.2**3 / 12, (0.1 * 0.2**3 + 0.2 * 0.1**3) / 12),
        ((9, 1.0, 0.0, 1.0), ("rrrr", 0.1, 0.1, 0.06, 0.06), TUBE[0], TUBE[1], 2 * TUBE[1]),
        ((2, 0.0, 0.0, 0.0), ("rrrr", 0.01, 1e-5, 2e-5, 3e-5), 0.01, 2e-5, 3e-5),
    ],
)
@pytest.mark.parametrize("option", ["", "_ORIENTATION"])
def test_beams(tmp_path, first, second, area, bending, torsion, option):
    made = DynaDeck().elastic(1, RHO, E, NU, "SPOTWELD").part()
    made.block("SECTION_BEAM", ("iirrr", 1, *first), second)
    more = [("rrr", 0.0, 0.0, 1.0)] if option else []
    found, _ = read(made.block(f"ELEMENT_BEAM{option}", ("I" * 5, 1, 1, 1, 2, 3), *more), tmp_path, LINE)
    close(found[1], **beam_values(area, bending, torsion))
    assert found[1]["rotates"] and found[3]["m"] == 0


def test_trusses(tmp_path):
    made = DynaDeck().elastic(1, RHO, E, NU).part().block("SECTION_BEAM", ("ii", 1, 3), ("r", 0.01))
    found, _ = read(made.block("ELEMENT_BEAM", ("I" * 4, 1, 1, 1, 2)), tmp_path, LINE)
    close(found[1], m=RHO * 0.01 * 5 / 2, j=0.0, k=E * 0.01 / 5, kr=0.0)


def test_discrete_beams(tmp_path):
    made = DynaDeck().block("MAT_LINEAR_ELASTIC_DISCRETE_BEAM", ("irrrrrrr", 1, RHO, 1e4, 2e4, 3e4, 5e2, 6e2, 7e2))
    made.block("SECTION_BEAM", ("ii", 1, 6), ("rr", 2.5e-5, 0.02)).part().block("ELEMENT_BEAM", ("I" * 4, 1, 1, 1, 2))
    found, _ = read(made, tmp_path, LINE)
    close(found[1], m=RHO * 2.5e-5 / 2, j=0.01, k=3e4, kr=7e2)


def test_added_masses(tmp_path):
    made = base(thickness=1e-3).elements("SHELL", 1, {1: (1, 2, 3, 4)}).list_of("NODE", 2, [1, 2])
    made.block("ELEMENT_MASS", ("IIR", 1, 3, 7.0), ("IIRI", 2, 4, 9.0, 1))
    made.block("ELEMENT_MASS_NODE_SET", ("IIR", 3, 2, 3.0))
    made.block("ELEMENT_MASS_PART", ("IRR", 1, 8.0, 0.0)).list_of("PART", 5, [1])
    made.block("ELEMENT_MASS_PART_SET", ("IRR", 5, 4.0, 0.0))
    made.block("ELEMENT_INERTIA", ("III", 4, 3, 0), ("r" * 7, 1.0, 0.0, 0.0, 2.0, 0.0, 3.0, 0.5))
    found, deck = read(made, tmp_path, SQUARE)
    own = 8000 * 2 * 1e-3 / 4 + 3
    assert [found[i]["m"] for i in range(1, 5)] == pytest.approx([own + 1.5, own + 1.5, own + 7.5, own + 9])
    assert found[3]["j"] - found[1]["j"] == pytest.approx(2.0)
    assert any("the mean of its moments of inertia, 2, is taken" in line for line in deck.warnings)


def test_final_mass(tmp_path):
    """A shell of 8000 * 2 * 1e-3 = 16 kg brought to 20 kg; less than its own is refused."""
    made = base(thickness=1e-3).elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.block("ELEMENT_MASS_PART", ("IRR", 1, 0.0, 20.0))
    found, _ = read(made, tmp_path, SQUARE)
    assert [found[i]["m"] for i in range(1, 5)] == pytest.approx([5.0] * 4)
    made = base(thickness=1e-3).elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.block("ELEMENT_MASS_PART", ("IRR", 1, 0.0, 15.0))
    with pytest.raises(tiefmu.SceneError, match="its FINMASS 15 is not more than the mass of its elements, 16"):
        read(made, tmp_path, SQUARE)


def test_total_mass(tmp_path):
    """The sum over nodes is the sum over elements: bricks, tetrahedra, wedges and shells in one mesh."""
    n, rng = 3, np.random.default_rng(3)
    number = {p: i for i, p in enumerate(np.ndindex(n + 1, n + 1, n + 1), 1)}
    nodes = {i: tuple(np.round(np.array(p) + rng.uniform(-0.2, 0.2, 3), 6)) for p, i in number.items()}
    solids, total = {}, 0.0
    for cell in np.ndindex(n, n, n):
        c = [
            number[tuple(np.add(cell, d))]
            for d in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        ]
        if cell[2] == 0:
            solids[len(solids) + 1] = tuple(c)
            x = np.array([nodes[i] for i in c])
            signs = [[-1, 1, 1, -1, -1, 1, 1, -1], [-1, -1, 1, 1, -1, -1, 1, 1], [-1, -1, -1, -1, 1, 1, 1, 1]]
            total += RHO * 8 * abs(np.linalg.det(np.array(signs) @ x / 8))
        elif cell[2] == 1:
            for a, b in [(1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1)]:
                solids[len(solids) + 1] = (c[0], c[6], c[a], c[b], c[b], c[b], c[b], c[b])
                p = [np.array(nodes[i]) for i in (c[0], c[6], c[a], c[b])]
                total += RHO * abs(np.linalg.det([p[1] - p[0], p[2] - p[0], p[3] - p[0]])) / 6
    made = base("solid").elements("SOLID", 1, solids).shell(2, 0.1).part(2, 2)
    corners = [number[p] for p in [(0, 0, 3), (1, 0, 3), (1, 1, 3), (0, 1, 3)]]
    p = [np.array(nodes[i]) for i in corners]
    total += RHO * 0.1 * np.linalg.norm(np.cross(p[2] - p[0], p[3] - p[1])) / 2
    found, _ = read(made.elements("SHELL", 2, {900: tuple(corners)}), tmp_path, nodes)
    assert sum(one["m"] for one in found.values()) == pytest.approx(total, rel=1e-12)


# materials


@pytest.mark.parametrize(
    "name, fields, density, young, poisson",
    [
        ("ELASTIC", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("001", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("24", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("PIECEWISE_LINEAR_PLASTICITY", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("PIECEWISE_LINEAR_PLASTICITY_LOG_INTERPOLATION", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("MODIFIED_PIECEWISE_LINEAR_PLASTICITY", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("RIGID", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("020", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("SPOTWELD_DAMAGE-FAILURE", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("LOW_DENSITY_FOAM", (50.0, 1e6, 7.0), 50.0, 1e6, 0.0),
        ("NULL", (8e3, 0.0, 0.0, 0.0, 0.0, 2e11, 0.3), 8e3, 0.0, 0.0),
        ("ORTHOTROPIC_ELASTIC", (8e3, 1e9, 3e9, 2e9, 0.2), 8e3, 3e9, 0.2),
        ("JOHNSON_COOK", (8e3, 8e10, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("JOHNSON_COOK", (8e3, 8e10), 8e3, 2.08e11, 0.3),
        ("VISCOELASTIC", (1e3, 1e9, 6e8, 2e8), 1e3, 1.5e9, 0.25),
        ("ISOTROPIC_ELASTIC_PLASTIC", (8e3, 8e10, 1e8, 0.0, 8e10), 8e3, 1.8e11, 0.125),
        ("MOONEY-RIVLIN_RUBBER", (1e3, 0.499, 1e6, 2e5), 1e3, 4 * 1.499 * 1.2e6, 0.499),
        ("HYPERELASTIC_RUBBER", (1e3, 0.5, 1.0), 1e3, 0.0, 0.0),
        ("UNHEARD_OF", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
        ("UNHEARD_OF", (8e3, 2e11, 7.0), 8e3, 0.0, 0.0),
        ("299", (8e3, 2e11, 0.25), 8e3, 2e11, 0.25),
    ],
)
@pytest.mark.parametrize("title", [False, True])
def test_materials(tmp_path, name, fields, density, young, poisson, title):
    made = DynaDeck().shell(1, 0.1).part().elements("SHELL", 1, {1: (1, 2, 3, 4)})
    rows = (["a title"] if title else []) + [("i" + "r" * len(fields), 1, *fields)]
    made.block(f"MAT_{name}{'_TITLE' if title else ''}", *rows)
    found, deck = read(made, tmp_path, SQUARE)
    material = deck.materials[1]
    assert (material.density, material.young, material.poisson) == pytest.approx((density, young, poisson))
    close(found[1], m=density * 0.1 * 2 / 4)
    text = "\n".join(deck.warnings)
    assert ("is not known" in text) == (name in ("UNHEARD_OF", "299") and young > 0)
    assert ("its elastic constants are not read" in text) == (not young and name != "NULL")
    assert found[1]["rotates"] or name == "NULL"


def test_composite_parts(tmp_path):
    made = DynaDeck().elastic(1, RHO, E, NU).elastic(2, RHO / 2, E / 2, 0.35)
    rows = [("ii", 1, 2), ("irrsirrs", 1, 0.1, 0.0, "", 2, 0.3, 0.0, ""), ("irr", 1, 0.1, 0.0)]
    made.block("PART_COMPOSITE", *rows, title="layers").elements("SHELL", 1, {1: (1, 2, 3, 4)})
    found, deck = read(made, tmp_path, SQUARE)
    close(found[1], m=(8000 * 0.2 + 4000 * 0.3) * 2 / 4)
    assert any("its 3 layers are taken as one" in line for line in deck.warnings)


def test_parts_with_options(tmp_path):
    made = DynaDeck().elastic(1, RHO, E, NU).shell(1, 0.1)
    one = [("iii", 3, 1, 1), ("rrrrii", 0.0, 0.0, 0.0, 5.0, 0, 2), ("r" * 6, *[1.0] * 6), ("r" * 6, *[0.0] * 6)]
    made.block("PART_INERTIA", "rigid", *one, "second", ("iii", 4, 1, 1), *one[1:])
    made.block(
        "PART_CONTACT", "thick", ("iii", 1, 1, 1), ("rrrrr", 0.1, 0.1, 0.0, 0.0, 0.5), "next", ("iii", 2, 1, 1), ""
    )
    found, deck = read(made.elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    assert {number: part.title for number, part in deck.parts.items()} == {
        3: "rigid",
        4: "second",
        1: "thick",
        2: "next",
    }
    close(found[1], m=400.0)


def test_sections_that_are_not_understood(tmp_path):
    made = DynaDeck().elastic(1, RHO, E, NU).part().block("SECTION_SPH", ("ii", 1, 2))
    found, deck = read(made.elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    close(found[1], m=0.0)
    assert any(
        "*SECTION_SPH: this section is not understood; 1 elements of part 1 add no mass" in w for w in deck.warnings
    )


@pytest.mark.parametrize("second", [("sr", "SECTION_01", 0.1), ("rrrr", 0.1, 0.1, 0.1, 0.1)])
def test_beam_sections_that_are_not_understood(tmp_path, second):
    made = DynaDeck().elastic(1, RHO, E, NU).part()
    made.block("SECTION_BEAM", ("iirrr", 1, 1 if second[0] == "rrrr" else 2, 1.0, 2.0, 2.0), second)
    found, deck = read(made.block("ELEMENT_BEAM", ("I" * 4, 1, 1, 1, 2)), tmp_path, LINE)
    close(found[1], m=0.0, k=0.0)
    assert any("this section is not understood" in line for line in deck.warnings)


def test_decks_module_reads_the_same(tmp_path):
    made = base(thickness=0.1).elements("SHELL", 1, {1: (1, 2, 3, 4)}).nodes(SQUARE | {11: (1, 0.5, 0)})
    made.list_of("NODE", 1, [11]).tie().block("ELEMENT_MASS", ("IIR", 9, 11, 0.5)).write(tmp_path / "deck.k")
    assert decks.read(tmp_path / "deck.k").scene.columns["mass"].tolist() == pytest.approx([400.0] * 4 + [0.5])
