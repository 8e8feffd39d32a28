"""What becomes of a deck's ties: motions, springs, masses, ports, start, gravity; the files; the FMU."""

import csv
from pathlib import Path

import fmpy
import fmpy.validation
import numpy as np
import pytest
import tiefmu
from deck_cards import RadiossDeck
from tiefmu import decks
from tiefmu.cli import main
from tiefmu.package import build
from tiefmu.report import report

HERE = Path(__file__).parent
FOLDERS = (HERE / "decks", HERE.parent / "scenes")
DECKS = sorted(path for folder in FOLDERS for path in folder.iterdir() if decks.is_deck(path))
PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.1), 12: (0.5, 0.5, 0.4), 13: (1.5, 0.5, 0.1)}


def deck(**options) -> RadiossDeck:
    """A plate; 11 is tied to it, and whatever a test adds hangs on 11."""
    made = RadiossDeck(**options).nodes(PLATE | PIN).elastic().shell().part().elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.node_group(1, [11], "pin").surface(1, "PART", [1]).tie(1, 1, 1, 0, 1, 0, 0.5)
    return made.block("/ADMAS/5/1", (0.5, 11), title="pin")


def read(made: RadiossDeck, tmp_path, **options):
    return decks.read(made.write(tmp_path / "deck_0000.rad"), **options)


def column(found, key) -> dict:
    return dict(zip(found.scene.node_id.tolist(), found.scene.columns[key].tolist()))


def with_spring(tmp_path, a=11, b=12, **spring):
    made = deck().spring(2, **spring).part(2, 2, 0)
    return read(made.elements("SPRING", 2, {5: (a, b)}), tmp_path)


# motions


def test_masters_are_driven_and_slaves_have_no_motion_of_their_own(tmp_path):
    found = read(deck(), tmp_path)
    assert column(found, "motion") == {1: "driven", 2: "driven", 3: "driven", 4: "driven", 11: ""}
    assert column(found, "rotations") == {1: "true", 2: "true", 3: "true", 4: "true", 11: "false"}
    assert any("the host moves driven ones" in line for line in found.deck.notes)


@pytest.mark.parametrize("name", ["part 1", "PART 1", "1", "corner"])
def test_free(tmp_path, name):
    made = deck().node_group(9, [1, 2, 3, 4], "corner")
    found = read(made, tmp_path, free=(name,))
    assert [column(found, "motion")[node] for node in (1, 2, 3, 4)] == ["free"] * 4


def test_free_that_is_not_there(tmp_path):
    with pytest.raises(decks.SceneError, match="--free: the deck has no part or node set called 'part 7'"):
        read(deck(), tmp_path, free=("part 7",))


def test_held_nodes_are_fixed_and_imposed_ones_driven(tmp_path):
    made = deck().node_group(2, [1]).node_group(3, [2]).node_group(4, [3]).node_group(5, [11])
    made.block("/BCS/1", ("   111 111", 0, 2), title="all six").block("/BCS/2", ("   100 000", 0, 4), title="x only")
    made.block("/FUNCT/1", (0.0, 1.0), (1.0, 1.0), title="one")
    made.block("/IMPVEL/1", (1, "         X", 0, 0, 3), (1.0, 1.0), title="pulled")
    made.block("/BCS/3", ("   111 000", 0, 5), title="tied too")
    found = read(made, tmp_path, free=("part 1",))
    assert column(found, "motion") == {1: "fixed", 2: "driven", 3: "free", 4: "free", 11: ""}
    text = "\n".join(found.deck.warnings)
    assert "1 slaves, the first is node 11, are held by boundary conditions too; the tie wins" in text
    assert "1 free nodes, the first is node 3, are held in some directions only" in text


def test_translations_alone_do_not_fix_a_node_that_turns(tmp_path):
    made = deck().node_group(2, [1]).block("/BCS/1", ("   111 000", 0, 2), title="pinned")
    assert column(read(made, tmp_path), "motion")[1] == "driven"


def test_three_translations_fix_a_node_that_cannot_turn(tmp_path):
    nodes = {1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 1, 0), 4: (0, 0, -1), 11: (0.2, 0.2, 0)}
    made = RadiossDeck().nodes(nodes).elastic().solid().part().elements("TETRA4", 1, {1: (1, 2, 3, 4)})
    made.node_group(1, [11]).surface(1, "PART/EXT", [1]).tie(1, 1, 1).node_group(2, [1]).node_group(3, [2])
    made.block("/BCS/1", ("   111 000", 0, 2), ("   111 100", 0, 3), title="held")
    found = column(read(made, tmp_path), "motion")
    assert (found[1], found[2], found[3]) == ("fixed", "fixed", "driven")


def test_what_is_moved_is_not_fixed(tmp_path):
    made = deck().node_group(2, [1]).block("/BCS/1", ("   111 111", 0, 2), title="all six")
    made.block("/FUNCT/1", (0.0, 1.0), (1.0, 1.0), title="one")
    made.block("/IMPDISP/1", (1, "         X", 0, 0, 2), (1.0, 1.0), title="pulled")
    assert column(read(made, tmp_path), "motion")[1] == "driven"


def test_a_rigid_body_is_a_port(tmp_path):
    made = (
        deck()
        .nodes({90: (1, 0.5, -1)})
        .node_group(2, [1, 2])
        .block("/RBODY/3", (90, 0, 0, 0, 7.0, 2, 0, 0, 0), (0.0, 0.0, 0.0), title="head / mass")
    )
    found = read(made, tmp_path, free=("part 1",))
    (port,) = found.scene.tables["interface"]["ports"]
    assert port["name"] == "head / mass" and port["at"] == [1, 0.5, -1]
    assert found.scene.node_sets[port["nodes"]].tolist() == [1, 2]
    assert column(found, "motion")[1] == "driven" and column(found, "motion")[3] == "free"
    assert "head / mass" in str(decks.compiled(found).start.variables)


# springs


def test_axial_spring(tmp_path):
    found = with_spring(tmp_path, kind=4, mass=0.2, k=(1e6,), c=(10.0,))
    assert found.scene.tables["spring"] == [{"nodes": [11, 12], "kind": "axial", "stiffness": 1e6, "damping": 10.0}]
    assert column(found, "stiffness")[12] == 0 and column(found, "mass")[11] == 0.5 + 0.1
    assert column(found, "motion")[12] == "driven"


def test_per_length(tmp_path):
    found = with_spring(tmp_path, kind=4, mass=0.2, k=(1e6,), per_length=1)
    assert found.scene.tables["spring"][0]["stiffness"] == pytest.approx(1e6 / 0.3)
    assert column(found, "mass")[12] == pytest.approx(0.2 * 0.3 / 2)


def test_general_spring_is_a_bushing(tmp_path):
    k, c = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    (table,) = with_spring(tmp_path, kind=8, k=k, c=c).scene.tables["spring"]
    assert table == {
        **{"nodes": [11, 12], "kind": "bushing", "stiffness": [1, 2, 3], "damping": [0.1, 0.2, 0.3]},
        **{"rotational_stiffness": [4, 5, 6], "rotational_damping": [0.4, 0.5, 0.6]},
    }


def test_beam_spring_stands_along_z(tmp_path):
    (table,) = with_spring(tmp_path, kind=13, k=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)).scene.tables["spring"]
    assert table == {
        **{"nodes": [11, 12], "kind": "beam", "stiffness": [1, 2, 3], "rotational_stiffness": [4, 5, 6]},
        "orientation": [0, 1, 0],
    }


def test_slanted_beam_spring(tmp_path):
    """Its y axis is on the side of that of its skew; the same stiffness across needs no axis."""
    made = deck().nodes({14: (0.9, 0.8, 0.1)}).spring(2, 13, k=(5.0, 2.0, 2.0, 3.0, 3.0, 3.0)).part(2, 2, 0)
    (table,) = read(made.elements("SPRING", 2, {5: (11, 14)}), tmp_path).scene.tables["spring"]
    assert table["stiffness"] == [5, 2, 2] and table["kind"] == "beam" and "orientation" not in table
    made = deck().nodes({14: (0.9, 0.8, 0.1)}).spring(2, 13, k=(1.0, 2.0, 6.0, 3.0, 3.0, 3.0), skew=4).part(2, 2, 0)
    made.block("/SKEW/FIX/4", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), title="y' = z, z' = x")
    (table,) = read(made.elements("SPRING", 2, {5: (11, 14)}), tmp_path).scene.tables["spring"]
    assert table["stiffness"] == [1, 2, 6] and table["orientation"] == pytest.approx([0, 0, 1])


def test_axes_that_a_scene_cannot_have_are_averaged_with_a_warning(tmp_path):
    made = deck().spring(2, 8, k=(1.0, 2.0, 6.0, 3.0, 3.0, 3.0), skew=4).part(2, 2, 0)
    made.block("/SKEW/FIX/4", (0.0, 0.0, 0.0), (0.0, 1.0, 1.0), (0.0, -1.0, 1.0), title="slanted")
    found = read(made.elements("SPRING", 2, {5: (11, 12)}), tmp_path)
    assert found.scene.tables["spring"][0]["stiffness"] == [3, 3, 3]
    assert any("the mean of its three stiffnesses" in line for line in found.deck.warnings)


def test_skew_of_a_general_spring(tmp_path):
    made = deck().spring(2, 8, k=(1.0, 2.0, 3.0, 0.0, 0.0, 0.0), skew=4).part(2, 2, 0)
    made.block("/SKEW/FIX/4", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), title="y' = z, z' = x")
    found = read(made.elements("SPRING", 2, {5: (11, 12)}), tmp_path)
    assert found.scene.tables["spring"][0]["stiffness"] == pytest.approx([3, 1, 2])


def test_functions_of_springs_are_warned_of(tmp_path):
    found = with_spring(tmp_path, kind=4, mass=0.2, k=(1e6,), function=7)
    assert any("1 springs follow function 7; only their linear part is taken" in line for line in found.deck.warnings)


def test_springs_elsewhere_are_the_hosts(tmp_path):
    found = with_spring(tmp_path, a=13, b=12, kind=4, mass=0.2, k=(1e6,))
    assert "spring" not in found.scene.tables and set(found.scene.node_id) == {1, 2, 3, 4, 11}
    made = deck().spring(2, 4, 0.2, k=(1e6,)).part(2, 2, 0).elements("SPRING", 2, {5: (1, 12)})
    assert column(read(made, tmp_path), "stiffness")[1] > 1e6  # of a driven master it counts in its stiffness
    assert read(made, tmp_path, free=("part 1",)).scene.tables["spring"][0]["nodes"] == [1, 12]


def test_rigid_body_of_masters_that_hold_no_slave(tmp_path):
    """A clamp on the part whose surface is tied elsewhere: it is no port, and the FMU is built all the same."""
    far = {21: (2, 0, 3), 22: (3, 0, 3), 23: (3, 1, 3), 24: (2, 1, 3)}
    made = (
        deck().nodes(far).elements("SHELL", 1, {2: tuple(far)}).node_group(8, [21, 22], "clamp").node_group(9, [1, 2])
    )
    made.block("/RBODY/3", (0, 0, 0, 0, 0.0, 8), title="clamp").block("/RBODY/4", (0, 0, 0, 0, 0.0, 9), title="frame")
    found = read(made, tmp_path)
    assert [port["name"] for port in found.scene.tables["interface"]["ports"]] == ["frame"]
    assert any("1 rigid bodies, the first is 'clamp': no ports" in line for line in found.deck.notes)
    assert len(decks.compiled(found).model.report()["ports"]) == 1


# masses, start, gravity


def test_added_masses(tmp_path):
    made = deck().node_group(2, [1, 2]).block("/ADMAS/0/2", (3.0, 2), title="each")
    made.block("/ADMAS/1/3", (3.0, 2), title="in all").block("/ADMAS/2/4", (10.0, 1), title="per area")
    made.block("/ADMAS/5/5", (7.0, 3), (9.0, 4), title="single")
    own = 7800 * 2 * 1e-3 / 4
    expected = {1: own + 3 + 1.5 + 5, 2: own + 3 + 1.5 + 5, 3: own + 5 + 7, 4: own + 5 + 9, 11: 0.5}
    assert column(read(made, tmp_path), "mass") == pytest.approx(expected)


@pytest.mark.parametrize("kind, mass", [(3, 6.0), (4, 6.0 + 23.4), (6, 6.0), (7, 6.0 + 23.4)])
def test_masses_spread_over_parts(tmp_path, kind, mass):
    """6 kg on two shells of 15.6 kg and 7.8 kg: by their own masses within a part, and among the parts of a group. A
    final mass counts what is there."""
    made = deck().nodes({14: (3, 0, 0), 15: (3, 1, 0)}).part(2).elements("SHELL", 2, {2: (2, 14, 15, 3)})
    if kind < 5:
        made.block("/GRPART/PART/7", (1, 2), title="both").block(f"/ADMAS/{kind}/6", (mass, 7, 0), title="on both")
        on_first, on_second = 4.0, 2.0
    else:
        shift = 0.0 if kind == 6 else 15.6, 0.0 if kind == 6 else 7.8
        made.block(f"/ADMAS/{kind}/6", (4.0 + shift[0], 1, 0), (2.0 + shift[1], 2, 0), title="on each")
        on_first, on_second = 4.0, 2.0
    found = column(read(made, tmp_path), "mass")
    assert found[1] == pytest.approx((15.6 + on_first) / 4)
    assert found[2] == pytest.approx((15.6 + on_first + 7.8 + on_second) / 4)


def test_final_mass_below_that_of_the_part(tmp_path):
    made = deck().block("/ADMAS/7/6", (1.0, 1, 0), title="too little")
    with pytest.raises(
        tiefmu.SceneError, match=r"/ADMAS/7/6: its final mass 1 is not more than that of its parts, 15\.6"
    ):
        read(made, tmp_path)


def test_start_velocities(tmp_path):
    made = deck().block("/INIVEL/TRA/1", (1.0, 2.0, 3.0, 0, 0), title="all move")
    made.node_group(2, [1]).block("/INIVEL/ROT/2", (0.0, 0.0, 4.0, 2, 0), title="one turns")
    tables = read(made, tmp_path).scene
    assert [(t.get("v"), t.get("w")) for t in tables.tables["initial"]] == [([1, 2, 3], None), (None, [0, 0, 4])]
    assert tables.node_sets[tables.tables["initial"][1]["nodes"]].tolist() == [1]


def test_gravity(tmp_path):
    made = deck().block("/FUNCT/1", (0.0, 1.0), (1.0, 1.0), title="one")
    made.block("/GRAV/1", (1, "         Z", 0, 0, 0, None, 1.0, -9.81), title="down")
    assert read(made, tmp_path).scene.tables["model"]["gravity"] == [0, 0, -9.81]
    made = deck().block("/FUNCT/1", (0.0, 0.0), (1.0, 1.0), title="ramp")
    made.block("/GRAV/1", (1, "         Z", 0, 0, 0, None, 1.0, -9.81), title="down")
    found = read(made, tmp_path)
    assert "model" not in found.scene.tables and any("changes with time" in line for line in found.deck.warnings)


def test_slaves_that_turn_over_solids_lose_their_rotations_in_a_default_tie(tmp_path):
    cube = dict(zip(range(1, 9), [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]))
    pin = {21: (0.2, 0.2, 1), 22: (0.8, 0.2, 1), 23: (0.8, 0.8, 1)}
    for spotflag, kept in ((0, False), (1, True)):
        made = RadiossDeck().nodes(cube | pin).elastic().solid().part().shell(2).part(2, 2)
        made.elements("BRICK", 1, {1: tuple(cube)}).elements("SH3N", 2, {2: (21, 22, 23)})
        made.node_group(1, list(pin)).surface(1, "PART/EXT", [1]).tie(1, 1, 1, 0, spotflag)
        found = read(made, tmp_path)
        assert (column(found, "rotations")[21] == "true") == kept == (column(found, "inertia")[21] > 0)
        assert any("Spotflag 1" in line for line in found.deck.warnings) != kept


# nothing in silence


def test_keywords_that_are_not_understood_are_named_with_their_line(tmp_path):
    made = deck().block("/NEWTHING/7", (1,), title="what is it").block("/RBE3/1", (1,), title="rigid")
    made.block("/TH/NODE/1", (1,), title="history").block("/INTER/TYPE7/4", (1, 1), title="contact")
    made.block("/INTER/LAGMUL/TYPE2/5", (1, 1), title="multipliers")
    found = read(made, tmp_path).deck
    text = "\n".join(found.warnings)
    line = made.lines.index("/NEWTHING/7") + 1
    assert f"line {line}: /NEWTHING/7: is not understood and is left aside" in text
    assert "/RBE3/1: is not read; its nodes are treated as if it were not there" in text
    assert "ties by Lagrange multipliers are not imported" in text
    assert found.ignored["/TH"][1] == 1 and found.ignored["/INTER/TYPE7"][0] == "contacts are the host's"


# the files


def everything() -> RadiossDeck:
    made = deck().spring(2, 13, 0.2, 0.02, k=(5.0e3, 2.0e3, 2.0e3, 30.0, 30.0, 30.0)).part(2, 2, 0)
    made.elements("SPRING", 2, {5: (11, 12)}).nodes({90: (1, 0.5, -1)}).node_group(2, [1, 2])
    made.block("/RBODY/3", (90, 0, 0, 0, 7.0, 2, 0, 0, 0), (0.0, 0.0, 0.0), title="head")
    return made.block("/INIVEL/TRA/1", (1.0, 2.0, 3.0, 0, 0), title="all move").block("/NEWTHING/7", (1,), title="new")


def test_the_written_scene_is_the_deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    everything().write(tmp_path / "deck_0000.rad")
    decks.import_deck(tmp_path / "deck_0000.rad", tmp_path / "weld.toml")
    written, direct = tiefmu.load(tmp_path / "weld.toml"), tiefmu.load(tmp_path / "deck_0000.rad")
    one, two = report(written), report(direct)
    for key in ("slaves", "masters", "variables", "stable_time_step", "nodal_time_step"):
        assert one[key] == two[key], key
    text = (tmp_path / "weld.toml").read_text()
    assert "# Decided:" in text and "Isearch 2 (default): box" in text and "# Look at:" in text
    assert "/NEWTHING/7: is not understood" in " ".join(text.replace("#  ", "").split())
    assert str(tmp_path) not in text
    with (tmp_path / "weld.nodes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["id"] for row in rows] == ["1", "2", "3", "4", "11", "12"]
    assert any("NEWTHING" in line for line in direct.warnings) and any("Spotflag" in line for line in direct.notes)
    assert str(tmp_path) not in str([direct.warnings, direct.notes])  # which the FMU holds
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        *("deck_0000.rad", "weld.mesh.npz", "weld.nodes.csv", "weld.toml")
    ]


def test_nothing_is_written_where_the_scene_cannot_be_built(tmp_path):
    text = (
        deck()
        .text()
        .replace("/INTER/TYPE2/1\nweld\n" + f"{1:>10}{1:>10}", "/INTER/TYPE2/1\nweld\n" + f"{7:>10}{1:>10}")
    )
    (tmp_path / "deck_0000.rad").write_text(text)
    with pytest.raises(decks.SceneError, match="GRNOD 7 is not in the deck"):
        decks.import_deck(tmp_path / "deck_0000.rad", tmp_path / "weld.toml")
    assert [p.name for p in tmp_path.iterdir()] == ["deck_0000.rad"]


def test_import_on_the_command_line(tmp_path, command):
    everything().write(tmp_path / "deck_0000.rad")
    found = command("import", "deck_0000.rad", "--tie", "weld", "--free", "part 1", "-o", "weld.toml")
    assert found.returncode == 0, found.stderr
    assert "weld.toml: 1 tie, 6 nodes, 1 segment, 1 spring; with weld.mesh.npz and weld.nodes.csv" in found.stdout
    assert "warning: deck_0000.rad: line" in found.stderr and "Traceback" not in found.stderr
    assert command("info", "weld.toml").returncode == 0
    found = command("build", "deck_0000.rad")
    assert found.returncode == 0, found.stderr
    assert (tmp_path / "deck_0000.fmu").is_file()
    found = command("import", "deck_0000.rad", "--tie", "wel")
    assert found.returncode != 0 and "did you mean 'weld'" in found.stderr and "Traceback" not in found.stderr


def run_in_fmpy(path, tmp_path, **options):
    fmu = build(decks.load(path, **options), tmp_path / "deck.fmu")
    assert fmpy.validation.validate_fmu(str(fmu)) == []
    result = fmpy.simulate_fmu(str(fmu), stop_time=1e-3, output_interval=1e-4)
    assert all(np.isfinite(result[name]).all() for name in result.dtype.names)


def test_a_built_deck_runs_in_fmpy(tmp_path):
    run_in_fmpy(everything().write(tmp_path / "deck_0000.rad"), tmp_path)


@pytest.mark.parametrize("path", DECKS)
def test_decks_of_the_repository_run_in_fmpy(tmp_path, path):
    decks.import_deck(path, tmp_path / "scene.toml")
    assert report(tiefmu.load(tmp_path / "scene.toml"))["slaves"] == report(tiefmu.load(path))["slaves"]
    run_in_fmpy(path, tmp_path)
    if path.suffix != ".inp":  # whose parts have names
        run_in_fmpy(path, tmp_path, free=("1", "2"))


# what weighs or holds nothing


@pytest.mark.parametrize(
    "change, word",
    [
        ({"thickness": 0.0}, "have no thickness; they add no mass and no stiffness"),
        ({"density": 0.0}, "have a material without density; they add no mass"),
        ({"young": 0.0}, "have a material without Young's modulus; they add no stiffness"),
    ],
)
def test_shells_that_weigh_or_hold_nothing_are_named(tmp_path, change, word):
    """A card in a wrong place reads as 0. A triangle too, whose formulas divide by the modulus."""
    made = RadiossDeck().nodes(PLATE | PIN | {5: (3, 0, 0)})
    made.elastic(**{key: value for key, value in change.items() if key != "thickness"})
    made.shell(thickness=change.get("thickness", 1e-3)).part()
    made.elements("SHELL", 1, {1: (1, 2, 3, 4)}).elements("SH3N", 1, {2: (2, 5, 3)})
    made.node_group(1, [11]).surface(1, "PART", [1]).tie(1, 1, 1, 0, 1, 0, 0.5)
    found = read(made.block("/ADMAS/5/1", (0.5, 11), title="pin"), tmp_path)
    assert any("/PART/1: part 1: 1 elements at the ties " + word in line for line in found.deck.warnings)


def test_a_beam_without_cross_section_is_named(tmp_path):
    made = deck().block("/PROP/TYPE3/2", (0,), (0.0, 0.0), (0.0, 1e-9, 1e-9, 2e-9), title="rod").part(2, 2, 1)
    found = read(made.elements("BEAM", 2, {5: (11, 12, 1)}), tmp_path)
    assert any("part 2: 1 elements at the ties have no cross-section" in line for line in found.deck.warnings)


def test_the_import_says_which_slaves_find_nothing(tmp_path, capsys):
    made = deck().node_group(7, [11, 12], "two").tie(2, 7, 1, 1, 1, 0, 0.2, "other")
    file, scene = made.write(tmp_path / "deck_0000.rad"), tmp_path / "scene.toml"
    assert main(["import", str(file), "--tie", "other", "-o", str(scene)]) == 0
    line = "tie 'other': slave 12: no segment found within search_distance 0.2"
    assert line in capsys.readouterr().err
    assert f"deck_0000.rad: {line}"[:60] in " ".join(scene.read_text().split("\n#   "))


def test_springs_and_masses_that_cannot_be_are_refused_by_element_and_node(tmp_path):
    def refused(made):
        with pytest.raises(tiefmu.SceneError) as error:
            decks.compiled(read(made, tmp_path))
        return str(error.value)

    def springs(kind, k, nodes, moved=None):
        made = deck().nodes(moved or {}).spring(2, kind=kind, k=k).part(2, 2, 0)
        return made.elements("SPRING", 2, {5: nodes})

    where = "/PROP/TYPE{}/2: element 5: "
    assert where.format(13) + "both of its ends are node 11" in refused(springs(13, [1.0] * 6, (11, 11)))
    assert where.format(13) + "a stiffness or damping of -3 is negative" in refused(
        springs(13, [1.0, -3.0, 1.0, 1.0, 1.0, 1.0], (11, 12))
    )
    same = springs(4, [3.0], (11, 14), {14: PIN[11]})
    assert where.format(4) + "its nodes 11 and 14 are at one place" in refused(same)
    light = deck().block("/ADMAS/5/2", (-0.7, 11), title="wrong sign")
    assert "deck_0000.rad: node 11: its mass would be -0.2" in refused(light)
