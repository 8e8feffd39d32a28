"""What holds, moves, joins and loads nodes in LS-DYNA decks; springs; nothing in silence; from the deck to the FMU."""

import fmpy
import fmpy.validation
import pytest
import tiefmu
from dyna_cards import DynaDeck
from tiefmu import decks
from tiefmu.package import build
from tiefmu.report import report

PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.05), 12: (0.5, 0.5, 0.4), 13: (1.5, 0.5, 0.05)}


def deck() -> DynaDeck:
    """A plate; 11 is tied to it, and whatever a test adds hangs on 11."""
    made = DynaDeck().nodes(PLATE | PIN).elastic().shell().part().elements("SHELL", 1, {1: (1, 2, 3, 4)})
    made.list_of("NODE", 1, [11]).tie(1, 1, name="TIED_SHELL_EDGE_TO_SURFACE_CONSTRAINED_OFFSET")
    return made.block("ELEMENT_MASS", ("IIR", 1, 11, 0.5))


def read(made: DynaDeck, tmp_path, **options):
    return decks.read(made.write(tmp_path / "deck.k"), **options)


def column(found, key) -> dict:
    return dict(zip(found.scene.node_id.tolist(), found.scene.columns[key].tolist()))


# what holds and moves nodes


def test_masters_are_driven(tmp_path):
    found = read(deck(), tmp_path)
    assert column(found, "motion") == {1: "driven", 2: "driven", 3: "driven", 4: "driven", 11: ""}


@pytest.mark.parametrize("name", ["part 1", "PART 1", "1", "corner", "both", "8"])
def test_free(tmp_path, name):
    made = deck().block("SET_NODE_LIST_TITLE", "corner", ("i", 9), ("iiii", 1, 2, 3, 4))
    made.block("SET_PART_LIST_TITLE", "both", ("i", 8), ("i", 1))
    assert [column(read(made, tmp_path, free=(name,)), "motion")[node] for node in (1, 2, 3, 4)] == ["free"] * 4
    with pytest.raises(decks.SceneError, match="--free: the deck has no part or node set called 'part 7'"):
        read(made, tmp_path, free=("part 7",))


def test_conditions(tmp_path):
    made = deck().list_of("NODE", 2, [1]).list_of("NODE", 3, [2])
    made.block(
        "BOUNDARY_SPC_SET_ID",
        "         1all six",
        ("i" * 8, 2, 0, 1, 1, 1, 1, 1, 1),
        "         2moved too",
        ("i" * 8, 3, 0, *[1] * 6),
    )
    made.block("BOUNDARY_SPC_NODE", ("iiiii", 3, 0, 1, 0, 0), ("i" * 5, 11, 0, 1, 1, 1))
    made.block("BOUNDARY_PRESCRIBED_MOTION_SET", ("iiiir", 3, 1, 2, 5, 1.0))
    found = read(made, tmp_path, free=("part 1",))
    assert column(found, "motion") == {1: "fixed", 2: "driven", 3: "free", 4: "free", 11: ""}
    text = "\n".join(found.deck.warnings)
    assert "1 slaves, the first is node 11, are held by boundary conditions too; the tie wins" in text
    assert "1 free nodes, the first is node 3, are held in some directions only" in text
    assert "starter" not in text


def test_codes_of_nodes(tmp_path):
    made = deck()
    row = "       4             0.0             1.0             0.0"
    assert made.lines.count(made.card("IRRR", 4, 0.0, 1.0, 0.0)) == 1
    made.lines[made.lines.index(made.card("IRRR", 4, 0.0, 1.0, 0.0))] = row + "       7      7."
    assert column(read(made, tmp_path, free=("part 1",)), "motion")[4] == "fixed"
    made.lines[made.lines.index(row + "       7      7.")] = row + "       7       0"
    assert column(read(made, tmp_path, free=("part 1",)), "motion")[4] == "free"


def test_a_driven_node_beats_a_fixed_one(tmp_path):
    made = deck().block("BOUNDARY_SPC_NODE", ("i" * 8, 1, 0, *[1] * 6))
    made.block("BOUNDARY_PRESCRIBED_MOTION_NODE_ID", "         3pulled", ("iiiir", 1, 9, 2, 5, 1.0), ("rr", 0.0, 0.0))
    assert column(read(made, tmp_path), "motion")[1] == "driven"


# rigid bodies


def rigid_deck(*con) -> DynaDeck:
    """Two more shells beside the plate, of rigid parts 5 and 6, and a loose node."""
    made = deck().nodes({21: (4, 0, 0), 22: (4, 1, 0), 23: (6, 0, 0), 24: (6, 1, 0), 90: (1, 0.5, -1)})
    made.block("MAT_RIGID", ("irrr", 5, 7800.0, 2e11, 0.3), ("rrr", *(con or (0.0, 0.0, 0.0))))
    made.part(5, 1, 5, "arm").part(6, 1, 5, "hand").elements("SHELL", 5, {5: (2, 21, 22, 3)})
    return made.elements("SHELL", 6, {6: (21, 23, 24, 22)})


def test_a_rigid_part_is_a_port(tmp_path):
    found = read(rigid_deck(), tmp_path, free=("part 1",))
    (port,) = found.scene.tables["interface"]["ports"]
    assert port["name"] == "arm" and found.scene.node_sets[port["nodes"]].tolist() == [2, 3]
    assert column(found, "motion")[2] == "driven" and column(found, "motion")[1] == "free"
    assert any("2 masters, the first is node 2, belong to rigid bodies" in line for line in found.deck.warnings)


def test_extra_nodes_and_merged_parts(tmp_path):
    made = rigid_deck().list_of("NODE", 7, [1]).block("CONSTRAINED_EXTRA_NODES_SET", ("ii", 6, 7))
    made.block("CONSTRAINED_EXTRA_NODES_NODE", ("ii", 5, 4)).block("CONSTRAINED_RIGID_BODIES", ("ii", 6, 5))
    (port,) = read(made, tmp_path).scene.tables["interface"]["ports"]
    assert port["name"] == "hand"
    made = rigid_deck().list_of("NODE", 7, [1]).block("CONSTRAINED_EXTRA_NODES_SET", ("ii", 6, 7))
    assert len(read(made, tmp_path).scene.tables["interface"]["ports"]) == 2


@pytest.mark.parametrize(
    "con, motion", [((1.0, 7.0, 7.0), "fixed"), ((-1.0, 0.0, 111111.0), "fixed"), ((1.0, 7.0, 0.0), "driven")]
)
def test_a_rigid_part_that_is_held(tmp_path, con, motion):
    assert column(read(rigid_deck(*con), tmp_path), "motion")[2] == motion


def test_a_rigid_part_that_is_moved(tmp_path):
    made = rigid_deck(1.0, 7.0, 7.0).block("BOUNDARY_PRESCRIBED_MOTION_RIGID", ("iiiir", 5, 1, 2, 5, 1.0))
    assert column(read(made, tmp_path), "motion")[2] == "driven"


def test_nodal_rigid_bodies(tmp_path):
    made = deck().nodes({90: (1, 0.5, -1)}).list_of("NODE", 2, [1, 2])
    made.block("CONSTRAINED_NODAL_RIGID_BODY_TITLE", "head / mass", ("iiii", 33, 0, 2, 90))
    found = read(made, tmp_path)
    (port,) = found.scene.tables["interface"]["ports"]
    assert port["name"] == "head / mass" and port["at"] == [1, 0.5, -1]
    made = (
        deck()
        .list_of("NODE", 2, [1, 2])
        .block("CONSTRAINED_NODAL_RIGID_BODY_SPC", ("iii", 33, 0, 2), ("rrr", 1.0, 7.0, 7.0))
    )
    assert column(read(made, tmp_path), "motion")[1] == "fixed"


def test_a_slave_in_a_rigid_body(tmp_path):
    made = deck().list_of("NODE", 2, [11, 12]).block("CONSTRAINED_NODAL_RIGID_BODY", ("iii", 33, 0, 2))
    text = "\n".join(read(made, tmp_path).deck.warnings)
    assert "1 slaves, the first is node 11, belong to rigid bodies, to which LS-DYNA ties by penalty only" in text
    assert "rigid body 'rigid body 33' holds slaves, the first is node 11; the tie wins" in text


# springs


def with_spring(tmp_path, material, fields, a=11, b=12, section=(0.0,), element=(), blocks=()):
    made = deck().block("SECTION_DISCRETE", ("ir", 2, *section), ("rr", 0.0, 0.0)).part(2, 2, 2)
    made.block(f"MAT_{material}", ("i" + "r" * len(fields), 2, *fields))
    made.block("ELEMENT_DISCRETE", ("IIIIIR"[: 4 + len(element)], 5, 2, a, b, *element))
    for keyword, *cards in blocks:
        made.block(keyword, *cards)
    return read(made, tmp_path)


def springs(found) -> list:
    return found.scene.tables.get("spring", [])


def test_springs_and_dampers(tmp_path):
    expected = {"nodes": [11, 12], "kind": "axial", "stiffness": 1e6, "damping": 0.0}
    assert springs(with_spring(tmp_path, "SPRING_ELASTIC", (1e6,))) == [expected]
    assert springs(with_spring(tmp_path, "S01", (1e6,))) == [expected]
    assert springs(with_spring(tmp_path, "SPRING_ELASTIC", (1e6,), element=(0, 2.5)))[0]["stiffness"] == 2.5e6
    damper = springs(with_spring(tmp_path, "DAMPER_VISCOUS", (30.0,)))[0]
    assert (damper["stiffness"], damper["damping"]) == (0.0, 30.0)
    assert springs(with_spring(tmp_path, "SPRING_ELASTIC", (1e6,), a=13)) == []  # the host's


def test_springs_along_a_direction(tmp_path):
    blocks = [("DEFINE_SD_ORIENTATION", ("iirrr", 4, 0, 0.0, 2.0, 0.0))]
    (one,) = springs(with_spring(tmp_path, "SPRING_ELASTIC", (1e6,), element=(4,), blocks=blocks))
    assert one["kind"] == "bushing" and one["stiffness"] == pytest.approx([0, 1e6, 0]) and one["nodes"] == [11, 12]
    (one,) = springs(with_spring(tmp_path, "SPRING_ELASTIC", (1e6,), b=0, element=(4,), blocks=blocks))
    assert one["ground"] == [11] and one["stiffness"] == pytest.approx([0, 1e6, 0])
    blocks = [("DEFINE_SD_ORIENTATION", ("iirrrii", 4, 2, 0.0, 0.0, 0.0, 1, 2))]
    (one,) = springs(with_spring(tmp_path, "SPRING_ELASTIC", (1e6,), element=(4,), blocks=blocks))
    assert one["stiffness"] == pytest.approx([1e6, 0, 0])
    found = with_spring(tmp_path, "SPRING_ELASTIC", (5e2,), section=(1.0,), element=(4,), blocks=blocks)
    assert springs(found)[0]["rotational_stiffness"] == pytest.approx([5e2, 0, 0])


def test_springs_that_cannot_be_taken_are_said(tmp_path):
    found = with_spring(tmp_path, "SPRING_ELASTIC", (1e6,), b=0)
    assert not springs(found) and any("springs to the ground without orientation" in w for w in found.deck.warnings)
    found = with_spring(tmp_path, "SPRING_ELASTIC", (5e2,), section=(1.0,))
    assert any("are of a type that is not understood" in w for w in found.deck.warnings)
    found = with_spring(tmp_path, "SPRING_NONLINEAR_ELASTIC", (7.0,))
    assert any("only their linear part is taken" in w for w in found.deck.warnings)


def test_discrete_beams(tmp_path):
    made = deck().block("MAT_066", ("irrrrrrr", 2, 7800.0, 1e4, 2e4, 3e4, 5e2, 6e2, 7e2), ("r", 1.0))
    made.block("SECTION_BEAM", ("ii", 2, 6), ("rr", 1e-5, 0.02)).part(2, 2, 2)
    found = read(made.block("ELEMENT_BEAM", ("I" * 4, 5, 2, 11, 12)), tmp_path)
    (one,) = springs(found)
    assert one["kind"] == "bushing" and one["stiffness"] == [1e4, 2e4, 3e4] and one["damping"] == [1.0, 0, 0]
    assert column(found, "mass")[12] == pytest.approx(7800 * 1e-5 / 2)


# start and gravity


def test_start_velocities(tmp_path):
    made = deck().list_of("NODE", 2, [1]).list_of("NODE", 3, [2])
    made.block("INITIAL_VELOCITY", ("i", 0), ("r" * 6, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    made.block("INITIAL_VELOCITY", ("i", 2), ("r" * 6, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0))
    made.block("INITIAL_VELOCITY_NODE", ("irrr", 3, 5.0, 0.0, 0.0), ("irrr", 4, 5.0, 0.0, 0.0))
    made.block("INITIAL_VELOCITY_GENERATION", ("iirrrr", 3, 3, 0.0, 7.0, 0.0, 0.0), ("r", 0.0))
    made.block("INITIAL_VELOCITY_GENERATION", ("iir", 1, 2, 9.0), ("r", 0.0))
    found = read(made, tmp_path)
    tables = [
        (t.get("v"), t.get("w"), found.scene.node_sets[t["nodes"]].tolist()) for t in found.scene.tables["initial"]
    ]
    assert tables == [
        ([1, 2, 3], None, [1, 2, 3, 4]),
        ([0, 0, 0], None, [1]),
        (None, [0, 0, 4], [1]),
        ([5, 0, 0], None, [3, 4]),
        ([7, 0, 0], None, [2]),
    ]
    assert any("start velocities that turn are not taken" in line for line in found.deck.warnings)


def test_gravity_acts_against_the_acceleration_of_the_base(tmp_path):
    made = (
        deck()
        .block("LOAD_BODY_Z", ("ir", 5, 2.0))
        .block("DEFINE_CURVE", ("iirr", 5, 0, 1.0, 4.905), ("QQ", 0.0, 1.0), ("QQ", 1.0, 1.0))
    )
    assert read(made, tmp_path).scene.tables["model"]["gravity"] == pytest.approx([0, 0, -9.81])
    made = (
        deck()
        .block("LOAD_BODY_Z", ("ir", 5, 2.0))
        .block("DEFINE_CURVE_TITLE", "ramp", ("i", 5), ("QQ", 0.0, 0.0), ("QQ", 1.0, 1.0))
    )
    found = read(made, tmp_path)
    assert "model" not in found.scene.tables and any("changes with time" in line for line in found.deck.warnings)


# nothing in silence


def test_keywords_that_are_not_understood_are_named_with_their_line(tmp_path):
    made = deck().block("NEWTHING_OF_SORTS", ("i", 1)).block("CONSTRAINED_INTERPOLATION", ("i", 1))
    made.block("DATABASE_BINARY_D3PLOT", ("r", 1.0)).block("ELEMENT_SEATBELT", ("I", 1)).block("PART_DUPLICATE", "x")
    made.block("INCLUDE_NASTRAN", "x.nas").block("CONTROL_TERMINATION", ("r", 1.0)).block("MAT_ADD_EROSION", ("i", 1))
    made.block("PART_MODES", ("i", 1)).block("DEFINE_BOX_ADAPTIVE", ("i", 1), ("r", 1.0))
    made.block("ELEMENT_MASS_MATRIX_NODE_SET", ("I", 1)).block("NODE_MERGE", ("i", 1)).block("LOAD_BODY_RX", ("i", 1))
    found = read(made, tmp_path).deck
    text = "\n".join(found.warnings)
    line = made.lines.index("*NEWTHING_OF_SORTS") + 1
    assert f"line {line}: *NEWTHING_OF_SORTS: is not understood and is left aside" in text
    for name, why in (
        ("CONSTRAINED_INTERPOLATION", "its nodes are treated as if it were not there"),
        ("ELEMENT_SEATBELT", "its elements add no mass"),
        ("PART_DUPLICATE", "its copies are left out"),
        ("INCLUDE_NASTRAN", "its file is not read"),
        ("ELEMENT_MASS_MATRIX_NODE_SET", "its elements add no mass"),
        ("NODE_MERGE", "is not read"),
        ("PART_MODES", "its parts are left out"),
        ("LOAD_BODY_RX", "its acceleration is not taken"),
    ):
        assert f"*{name}: is not read; {why}" in text
    assert (
        found.ignored["*DATABASE"][1] == 1 and found.ignored["*CONTROL"][1] == 1 and found.ignored["*MAT_ADD"][1] == 1
    )


# the files and the FMU


def everything() -> DynaDeck:
    made = rigid_deck().block("SECTION_DISCRETE", ("ir", 2, 0.0), ("rr", 0.0, 0.0)).part(2, 2, 2)
    made.block("MAT_SPRING_ELASTIC", ("ir", 2, 5e3)).block("ELEMENT_DISCRETE", ("IIII", 5, 2, 11, 12))
    return made.block("INITIAL_VELOCITY", ("i", 0), ("r" * 6, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0)).block("NEWTHING", ("i", 7))


def test_the_written_scene_is_the_deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    everything().write(tmp_path / "deck.k")
    decks.import_deck(tmp_path / "deck.k", tmp_path / "weld.toml")
    one, two = report(tiefmu.load(tmp_path / "weld.toml")), report(tiefmu.load(tmp_path / "deck.k"))
    for key in ("slaves", "masters", "variables", "stable_time_step", "nodal_time_step"):
        assert one[key] == two[key], key
    text = " ".join((tmp_path / "weld.toml").read_text().replace("#  ", "").split())
    assert "# Ties of deck.k (LS-DYNA)" in text and "tolerance per pair" in text and "*NEWTHING: is not" in text


def test_the_command_line(tmp_path, command):
    everything().write(tmp_path / "deck.k")
    found = command("import", "deck.k", "--tie", "weld", "--free", "part 1", "-o", "weld.toml")
    assert found.returncode == 0, found.stderr
    assert "weld.toml: 1 tie, 6 nodes, 1 segment, 1 spring; with weld.mesh.npz and weld.nodes.csv" in found.stdout
    assert "warning: deck.k: line" in found.stderr and "Traceback" not in found.stderr
    for words in (
        ("info", "deck.k"),
        ("info", "weld.toml"),
        ("build", "deck.k"),
        ("run", "deck.k", "--stop-time", "1e-4"),
    ):
        found = command(*words)
        assert found.returncode == 0, found.stderr
    assert (tmp_path / "deck.fmu").is_file()
    found = command("import", "deck.k", "--tie", "wel")
    assert found.returncode == 2 and "did you mean 'weld'" in found.stderr and "Traceback" not in found.stderr


def test_the_fmu_in_fmpy(tmp_path):
    """A driven plate lifts the pin with it: a rigid motion of the masters is one of the slave."""
    fmu = build(decks.load(deck().write(tmp_path / "deck.k")), tmp_path / "deck.fmu")
    assert fmpy.validation.validate_fmu(str(fmu)) == []
    start = {f"master[{i}].v[3]": 0.5 for i in range(1, 5)}
    names = [variable.name for variable in fmpy.read_model_description(str(fmu)).modelVariables]
    assert "slave[1].v[3]" in names and set(start) <= set(names)
    found = fmpy.simulate_fmu(str(fmu), stop_time=0.01, step_size=1e-3, start_values=start, output=["slave[1].v[3]"])
    assert found["slave[1].v[3]"][-1] == pytest.approx(0.5, rel=1e-9)
