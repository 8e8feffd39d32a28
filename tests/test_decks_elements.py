"""Every row of the table of elements: mass, inertia and nodal stiffness against numbers worked out by hand."""

import numpy as np
import pytest
from deck_cards import RadiossDeck
from deck_checks import by_node
from tiefmu.decks import radioss

E, NU, RHO = 2.0e11, 0.25, 8000.0
A11, G, BULK = E / (1 - NU**2), E / 2.5, E / 1.5
SQUARE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}  # 2 m by 1 m
TIE = {
    9001: (0, 0, 50),
    9002: (9, 0, 50),
    9003: (0, 9, 50),
    9004: (1, 1, 51),
}  # a deck must have a tie; it is out of the way


def read(deck: RadiossDeck, tmp_path, nodes: dict):
    """The deck with a tie of void shells far away; returns values by node id."""
    deck.nodes(nodes | TIE)
    deck.block("/MAT/VOID/99", (0.0,), title="void").shell(99, 1e-3).part(99, 99, 99)
    deck.elements("SH3N", 99, {9999: (9001, 9002, 9003)})
    deck.node_group(1, [9004]).surface(1, "PART", [99]).tie()
    found = radioss.read(deck.write(tmp_path / "deck_0000.rad"), "deck_0000.rad")
    return by_node(found)


def base(**shell) -> RadiossDeck:
    deck = RadiossDeck().elastic(1, RHO, E, NU)
    return (deck.shell(1, **shell) if shell else deck).part(1)


def close(found: dict, **wanted):
    for key, value in wanted.items():
        assert found[key] == pytest.approx(value, rel=1e-9, abs=1e-300), key


@pytest.mark.parametrize("ishell", [0, 1, 2, 3, 4])
def test_q4(tmp_path, ishell):
    t, area = 0.1, 2.0
    found = read(base(thickness=t, ishell=ishell).elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    m = 8000 * 0.1 * 2 / 4  # 400 kg
    k = 5 / 4 * t * A11 / area  # both diagonals squared are 5
    for node in SQUARE:
        close(found[node], m=m, j=m * (2 / 9 + 0.01 / 12), k=k, kr=k * (0.01 + 2) / 12)
        assert found[node]["rotates"]


def test_q4_damping_counts_for_laws_that_have_it(tmp_path):
    deck = RadiossDeck().elastic(1, RHO, E, NU, "LAW36").shell(1, 0.1, dm=0.1).part(1)
    found = read(deck.elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    v = np.sqrt(1.01) - 0.1
    close(found[1], k=5 / 4 * 0.1 * A11 / 2 / v**2)


@pytest.mark.parametrize("ishell, a, dn", [(12, 4 / 3, 0.0), (24, 5 / 4, 0.015)])
def test_full_shells(tmp_path, ishell, a, dn):
    t, area = 0.1, 2.0
    found = read(base(thickness=t, ishell=ishell).elements("SHELL", 1, {1: (1, 2, 3, 4)}), tmp_path, SQUARE)
    # by hand: half diagonals squared 5/4; crossed diagonals of a parallelogram: al2 = 0; sides 2 and 1: f1 = 1.25;
    # f2 = 0.78 + 0.22 (3.413 (1 - 0.7071))^3
    f2 = 0.78 + 0.22 * (3.413 * 0.2929) ** 3
    length = area / np.sqrt(2 * 1.25 * f2 * a * 1.25)
    v = np.sqrt(1 + dn * dn) - dn
    m = 400.0
    k = 0.5 * t * area * A11 / (v * length) ** 2
    close(found[3], m=m, j=m * (2 / 12 + 0.01 / 12), k=k, kr=k * 0.01 / 12)


def test_thickness_of_element_over_part_over_property(tmp_path):
    nodes = {i: (i % 4, i // 4, 0) for i in range(1, 17)}
    deck = RadiossDeck().elastic(1, RHO, E, NU).shell(1, 0.1).part(1).part(2, thickness=0.2)
    deck.elements("SHELL", 1, {1: (4, 5, 9, 8)}, {}).elements("SHELL", 2, {2: (6, 7, 11, 10), 3: (1, 2, 3, 12)})
    deck = RadiossDeck().elastic(1, RHO, E, NU).shell(1, 0.1).part(1).part(2, thickness=0.2)
    deck.elements("SHELL", 1, {1: (4, 5, 9, 8)}).elements(
        "SHELL", 2, {2: (6, 7, 11, 10), 3: (12, 13, 16, 15)}, {3: 0.4}
    )
    found = read(deck, tmp_path, nodes | {16: (4, 4, 0), 15: (3, 4, 0), 12: (3, 3, 0), 13: (4, 3, 0)})
    close(found[4], m=8000 * 0.1 / 4)
    close(found[6], m=8000 * 0.2 / 4)
    close(found[16], m=8000 * 0.4 / 4)


@pytest.mark.parametrize("ish3n", [0, 1, 2, 30])
def test_triangles(tmp_path, ish3n):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0)}
    t, area, longest = 0.1, 0.5, np.sqrt(2)
    found = read(base(thickness=t, ish3n=ish3n).elements("SH3N", 1, {1: (1, 2, 3)}), tmp_path, nodes)
    m, share = 8000 * t * area, {1: 0.5, 2: 0.25, 3: 0.25}  # right angle, 45 and 45 degrees of 180
    length = 2 * area / longest
    k = t * area * A11 / length**2
    kr = k * (t * t / 12 + area * G / (2 * A11))
    if ish3n == 30:
        k *= 1 + 0.6 * (1 + NU) * t * t / 1.0  # cdkderii.F lengthens the longest side by the thickness
        kr = k * t * t / 12
    for node in nodes:
        close(found[node], m=m * share[node], j=m * (0.5 / 4.5 + 0.01 / 12) * share[node], k=k, kr=kr)


def test_quads_with_a_repeated_node_give_it_two_quarters(tmp_path):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0)}
    for corners in ((1, 2, 3, 3), (1, 2, 3)):
        deck = base(thickness=0.1).elements("SHELL", 1, {1: corners})
        found = read(deck, tmp_path, nodes)
        m = 8000 * 0.1 * 0.5 / 4
        close(found[1], m=m)
        close(found[3], m=2 * m)


CUBE = {
    1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0), 5: (0, 0, 3), 6: (2, 0, 3), 7: (2, 1, 3), 8: (0, 1, 3),
}  # fmt: skip
C2 = (BULK + 4 * G / 3) / RHO


@pytest.mark.parametrize("qb, rotary", [(0.0, 0), (0.1, 1)])
def test_bricks(tmp_path, qb, rotary):
    deck = RadiossDeck().elastic(1, RHO, E, NU).solid(1, qb, rotary).part(1)
    found = read(deck.elements("BRICK", 1, {1: tuple(range(1, 9))}), tmp_path, CUBE)
    volume, largest = 6.0, 6.0  # faces 2, 3 and 6 m2; L = V over the largest: E G - F^2 is (4 A)^2
    q = (qb or 0.05) * np.sqrt(C2)
    dt = volume / largest / (q + np.sqrt(q * q + C2))
    m = RHO * volume / 8
    close(found[1], m=m, j=m * 6 ** (2 / 3) / 6 if rotary else 0.0, k=RHO * volume / (4 * dt * dt), kr=0.0)
    assert found[1]["rotates"] == bool(rotary)


def test_tetrahedra(tmp_path):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2)}
    deck = RadiossDeck().elastic(1, RHO, E, NU).solid(1).part(1)
    found = read(deck.elements("TETRA4", 1, {1: (1, 2, 3, 4)}), tmp_path, nodes)
    volume = 4 / 6
    length = 1 / np.sqrt(1 + 1 / 4 + 1 / 4)  # the gradient of N1 is (-1, -1/2, -1/2)
    q = 0.05 * np.sqrt(C2)
    dt = length / (q + np.sqrt(q * q + C2))
    for node in nodes:
        close(found[node], m=RHO * volume / 4, j=0.0, k=RHO * volume / (2 * dt * dt))
        assert not found[node]["rotates"]


def test_ten_node_tetrahedra(tmp_path):
    corners = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 2, 0), 4: (0, 0, 2)}
    pairs = [(1, 2), (2, 3), (3, 1), (1, 4), (2, 4), (3, 4)]
    middle = {5 + i: tuple(np.mean([corners[a], corners[b]], axis=0)) for i, (a, b) in enumerate(pairs)}
    deck = RadiossDeck().elastic(1, RHO, E, NU).solid(1).part(1)
    deck.elements("TETRA10", 1, {1: tuple(range(1, 11))})
    found = read(deck, tmp_path, corners | middle)
    close(found[1], m=RHO * 4 / 6 / 32)
    close(found[9], m=RHO * 4 / 6 * 7 / 48)
    deck = RadiossDeck().elastic(1, RHO, E, NU).solid(1).part(1)
    deck.elements("TETRA10", 1, {1: (1, 2, 3, 4, 0, 6, 7, 8, 9, 10)})  # the middle of 1-2 is missing
    found = read(deck, tmp_path, corners | middle)
    close(found[1], m=RHO * 4 / 6 * (1 / 32 + 7 / 96))
    close(found[5], m=0.0)


LINE = {1: (0, 0, 0), 2: (0, 3, 4)}  # 5 m


@pytest.mark.parametrize("c, per_length", [(0.0, 0), (30.0, 0), (30.0, 1)])
def test_axial_springs(tmp_path, c, per_length):
    deck = RadiossDeck().spring(1, 4, mass=0.2, k=[1e4], c=[c], per_length=per_length).part(1, material=0)
    found = read(deck.elements("SPRING", 1, {1: (1, 2)}), tmp_path, LINE)
    scale = 5.0 if per_length else 1.0
    m, k, d = 0.2 * scale, 1e4 / scale, c / scale
    close(found[1], m=m / 2, j=0.0, k=(np.sqrt(d * d + k * m) + d) ** 2 / m, kr=0.0)
    assert not found[1]["rotates"]


@pytest.mark.parametrize("kind", [8, 13])
def test_springs_with_six_freedoms(tmp_path, kind):
    k, c = (1e4, 2e4, 3e4, 5e2, 6e2, 7e2), (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)
    deck = RadiossDeck().spring(1, kind, mass=0.2, inertia=0.02, k=k, c=c).part(1, material=0)
    found = read(deck.elements("SPRING", 1, {1: (1, 2)}), tmp_path, LINE)
    kr, cr = (7e2, 0.3) if kind == 8 else (7e2 + 3e4 * 25, 0.3 + 3.0 * 25)
    close(
        found[2],
        m=0.1,
        j=0.01,
        k=(np.sqrt(9 + 3e4 * 0.2) + 3) ** 2 / 0.2,
        kr=(np.sqrt(cr * cr + kr * 0.02) + cr) ** 2 / 0.02,
    )
    assert found[2]["rotates"]


def test_trusses(tmp_path):
    deck = RadiossDeck().elastic(1, RHO, E, NU).block("/PROP/TYPE2/1", (0.01,), title="rod").part(1)
    found = read(deck.elements("TRUSS", 1, {1: (1, 2)}), tmp_path, LINE)
    close(found[1], m=RHO * 0.01 * 5 / 2, j=0.0, k=E * 0.01 / 5, kr=0.0)


def test_beams(tmp_path):
    deck = RadiossDeck().elastic(1, RHO, E, NU)
    deck.block("/PROP/TYPE3/1", (None, 0), (0.0, 0.0), (0.01, 1e-5, 2e-5, 3e-5), title="beam").part(1)
    found = read(deck.elements("BEAM", 1, {1: (1, 2)}), tmp_path, LINE)
    m = RHO * 0.01 * 5 / 2
    d = 0.01 * np.sqrt(2)
    short = 5 * (np.sqrt(1 + d * d) - d) ** 2
    close(found[1], m=m, j=m * 25 / 12 + RHO * 2.5 * 2e-5, k=E * 0.01 / short, kr=E * 2e-5 / short)
    assert found[1]["rotates"]


def test_void_shells_over_bricks_carry_no_mass(tmp_path):
    deck = RadiossDeck().elastic(1, RHO, E, NU).solid(1).part(1)
    deck.block("/MAT/VOID/2", (0.0,), title="skin").block("/PROP/TYPE0/2", (1e-3,), title="skin").part(2, 2, 2)
    deck.elements("BRICK", 1, {1: tuple(range(1, 9))}).elements("SHELL", 2, {2: (5, 6, 7, 8)})
    found = read(deck, tmp_path, CUBE)
    close(found[5], m=RHO * 6 / 8, j=0.0)
    assert not found[5]["rotates"]


def test_masses_of_nodes_are_masses_of_elements(tmp_path):
    n = 4
    number = {p: i for i, p in enumerate(np.ndindex(n + 1, n + 1, n + 1), 1)}
    rng = np.random.default_rng(3)
    nodes = {i: tuple(np.array(p) + rng.uniform(-0.2, 0.2, 3)) for p, i in number.items()}
    bricks, tets = {}, {}
    for cell in np.ndindex(n, n, n):
        c = [
            number[tuple(np.add(cell, d))]
            for d in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        ]
        if cell[2] % 2:
            bricks[len(bricks) + 1] = tuple(c)
        else:
            for a, b in [(1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1)]:
                tets[len(tets) + 1001] = (c[0], c[6], c[a], c[b])
    shells = {1: tuple(number[p] for p in [(0, 0, 4), (1, 0, 4), (1, 1, 4), (0, 1, 4)])}
    deck = RadiossDeck().elastic(1, RHO, E, NU).solid(1).shell(2, 0.1).part(1).part(2, 2)
    deck.elements("BRICK", 1, bricks).elements("TETRA4", 1, tets).elements("SHELL", 2, shells)
    found = read(deck, tmp_path, nodes)
    x = {i: np.array(p) for i, p in nodes.items()}
    total = 0.0
    for corners in tets.values():
        p = [x[i] for i in corners]
        total += RHO * abs(np.linalg.det([p[1] - p[0], p[2] - p[0], p[3] - p[0]])) / 6
    for corners in bricks.values():  # one Gauss point: 8 det of the Jacobian at the centre
        p = np.array([x[i] for i in corners])
        signs = np.array([[-1, 1, 1, -1, -1, 1, 1, -1], [-1, -1, 1, 1, -1, -1, 1, 1], [-1, -1, -1, -1, 1, 1, 1, 1]])
        total += RHO * 8 * abs(np.linalg.det(signs @ p / 8))
    p = [x[i] for i in shells[1]]
    total += RHO * 0.1 * np.linalg.norm(np.cross(p[2] - p[0], p[3] - p[1])) / 2
    assert sum(one["m"] for one in found.values()) == pytest.approx(total, rel=1e-12)
