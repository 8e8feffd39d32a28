"""Abaqus and CalculiX: how decks are written, parts and instances, what holds, moves, loads and joins nodes."""

import re
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from input_deck import InputDeck
from test_decks_scene import run_in_fmpy
from tiefmu import decks
from tiefmu.decks import abaqus
from tiefmu.decks.abaqus import keywords, loads
from tiefmu.decks.element_properties import nodal
from tiefmu.report import report

PLATE = {1: (0, 0, 0), 2: (2, 0, 0), 3: (2, 1, 0), 4: (0, 1, 0)}
PIN = {11: (0.5, 0.5, 0.1), 12: (0.5, 0.5, 0.4), 13: (1.5, 0.5, 0.1)}


def deck(options="") -> InputDeck:
    """A plate; 11 is tied to it, and whatever a test adds hangs on 11."""
    made = InputDeck().nodes(PLATE | PIN).elastic().elements("S4R", "plate", {1: (1, 2, 3, 4)}).shell("plate")
    made.mass(900, 11, 0.5).block("NSET, NSET=pin", "11")
    return made.tie("pin", "plate", f", ADJUST=NO, POSITION TOLERANCE=0.5{options}")


def read(made, tmp_path, **options):
    text = made if isinstance(made, str) else made.text()
    (tmp_path / "deck.inp").write_text(text)
    return decks.read(tmp_path / "deck.inp", **options)


def column(found, key) -> dict:
    return dict(zip(found.scene.node_id.tolist(), found.scene.columns[key].tolist()))


def refused(made, tmp_path) -> str:
    with pytest.raises(decks.SceneError) as error:
        decks.compiled(read(made, tmp_path))
    found = str(error.value)
    assert "\n" not in found and found.startswith(f"{tmp_path}/deck.inp: ")
    return found.removeprefix(f"{tmp_path}/deck.inp: ")


# how decks are written


def test_case_blanks_comments_and_continuations(tmp_path):
    plain = read(deck(), tmp_path).scene
    text = deck().text().replace("*SHELL SECTION", "*ShellSection").replace("*NODE", "** nodes\r\n*Node")
    text = text.replace("POSITION TOLERANCE", "\n  PositionTolerance").replace("*ELASTIC", "*Elastic,\n**\n")
    text = text.replace("MATERIAL=steel", 'material = "STEEL"').replace("ELSET=plate", "elset= Plate ")
    text = text.replace("3, 2.0, 1.0, 0.0", " 3 , 2.D0 , 1. ,\n\n**")
    other = read("\ufeff" + text.replace("\n", "\r\n"), tmp_path).scene
    assert other.tables == plain.tables
    for key, values in plain.columns.items():
        assert np.array_equal(other.columns[key], values), key


def test_includes(tmp_path):
    lines = deck().lines
    start = lines.index("*NODE")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "nodes.inc").write_text("\n".join(lines[start + 1 : start + 5]))
    end = next(k for k, line in enumerate(lines) if line.startswith("*TIE"))
    (tmp_path / "ties.inc").write_text("\n".join(lines[end:]))
    main = [
        *lines[: start + 1],
        "*INCLUDE, INPUT=parts/nodes.inc",
        *lines[start + 5 : end],
        "*include,input=ties.inc",
        "",
    ]
    found = read("\n".join(main), tmp_path)
    assert len(found.deck.node_id) == 7 and len(found.deck.ties) == 1
    main[start + 1] = "*INCLUDE, INPUT=parts\\nodes.inc"  # as on Windows
    assert len(read("\n".join(main), tmp_path).deck.node_id) == 7
    (tmp_path / "ties.inc").write_text("\n".join(lines[end:]).replace("plate", "plat"))
    with pytest.raises(decks.SceneError, match=r"^ties.inc: line 2: \*TIE: there is no surface or set 'plat'$"):
        read("\n".join(main), tmp_path)


def test_ids_in_the_millions(tmp_path):
    text = deck().text()
    for number in (1, 2, 3, 4, 11, 12, 13):
        text = re.sub(rf"(?m)^{number}, ", f"{number + 12_345_600}, ", text)
    text = text.replace("12345601, 1, 2, 3, 4", "7654321, 12345601, 12345602, 12345603, 12345604")
    text = text.replace("900, 11", "98765432, 12345611").replace("NSET=pin\n11", "NSET=pin\n12345611")
    assert read(text, tmp_path).scene.node_id.tolist() == [12345601, 12345602, 12345603, 12345604, 12345611]


PARTS = """*HEADING
two parts
*PART, NAME=Plate
*NODE
1, 0., 0., 0.
2, 2., 0., 0.
3, 2., 1., 0.
4, 0., 1., 0.
*ELEMENT, TYPE=S4R
1, 1, 2, 3, 4
*NSET, NSET=all, GENERATE
1, 4, 1
*ELSET, ELSET=all
1
*SHELL SECTION, ELSET=all, MATERIAL=steel
0.001
*END PART
*ASSEMBLY, NAME=whole
*INSTANCE, NAME=low, PART=plate
*END INSTANCE
*INSTANCE, NAME=high, PART=plate
0.5, 0.25, 0.01
0.5, 0.25, 0.01, 0.5, 0.25, 1., 90.
*END INSTANCE
*ELSET, ELSET=_s, INTERNAL, INSTANCE=high
1
*SURFACE, NAME=under
_s, SNEG
*SURFACE, NAME=over
low.all, SPOS
*NSET, NSET=corner, INSTANCE=high
1
*TIE, NAME=weld, ADJUST=NO, POSITION TOLERANCE=0.02
corner, over
*END ASSEMBLY
*MATERIAL, NAME=STEEL
*DENSITY
7800.
*ELASTIC
2.1E11, 0.3
*BOUNDARY
high.2, ENCASTRE
*STEP
*BOUNDARY
low.all, 1, 6
*END STEP
"""


def test_parts_are_placed_and_weigh_once_for_each_instance(tmp_path):
    found = read(PARTS, tmp_path)
    assert nodal(found.deck).mass.sum() == pytest.approx(2 * 7800 * 2 * 1e-3)
    assert len(found.deck.elements["shell4"].id) == 2 and len(found.deck.parts) == 2
    at = dict(zip(found.deck.node_id.tolist(), found.deck.position.tolist()))
    assert at[11] == pytest.approx([0.5, 0.25, 0.01]) and at[12] == pytest.approx([0.5, 2.25, 0.01])
    assert at[3] == [2, 1, 0]
    assert found.scene.columns["motion"].tolist() == ["fixed"] * 4 + [""]


def test_turned_instances_tie_where_they_are(tmp_path):
    """A turn by 30 degrees of both instances about one axis changes nothing but the frame."""
    plain = report(decks.compiled(read(PARTS, tmp_path)))["slaves"][0]
    turn = "0., 0., 0., 1., 2., 3., 30."
    from scipy.spatial.transform import Rotation

    axis = np.array([1, 2, 3]) / np.sqrt(14)
    rotation = Rotation.from_rotvec(np.radians(30) * axis)
    first = Rotation.from_rotvec([0, 0, np.pi / 2])
    both = (rotation * first).as_rotvec()
    angle = np.linalg.norm(both)
    direction = both / angle
    text = PARTS.replace("NAME=low, PART=plate\n", f"NAME=low, PART=plate\n0., 0., 0.\n{turn}\n")
    # moved by shift, then turned about an axis through the origin
    shift = (rotation * first).inv().apply(rotation.apply([0.5, 0.25, 0.01]))
    text = text.replace(
        "0.5, 0.25, 0.01\n0.5, 0.25, 0.01, 0.5, 0.25, 1., 90.",
        ", ".join(f"{v:.16g}" for v in shift) + "\n0., 0., 0., " + ", ".join(f"{v:.16g}" for v in direction)
        + f", {np.degrees(angle):.16g}",
    )  # fmt: skip
    turned = report(decks.compiled(read(text, tmp_path)))["slaves"][0]
    for key in ("xi", "eta", "distance"):
        assert turned[key] == pytest.approx(plain[key], abs=1e-12), key


@pytest.mark.parametrize("name", ["low", "LOW.all", "all", "plate"])
def test_free_by_instance_set_and_part(tmp_path, name):
    text = PARTS.replace("low.all, 1, 6", "low.all, 1, 1, 0.5")  # moved, hence driven
    found = read(text, tmp_path, free=(name,))
    assert column(found, "motion")[1] == "driven"
    found = read(PARTS.replace("low.all, 1, 6", "corner, 3"), tmp_path, free=(name,))
    assert [column(found, "motion")[node] for node in (1, 2, 3, 4)] == ["free"] * 4


def test_free_that_is_not_there(tmp_path):
    with pytest.raises(decks.SceneError, match="--free: the deck has no part or node set called 'lid'"):
        read(PARTS, tmp_path, free=("lid",))


# boundary conditions


@pytest.mark.parametrize("name", loads.NAMED)
def test_named_conditions(tmp_path, name):
    found = read(deck().block("BOUNDARY", f"1, {name}"), tmp_path).deck.fixed[-1]
    held = [*found.translations, *found.rotations]
    assert tuple(k + 1 for k in range(6) if held[k]) == loads.NAMED[name]


@pytest.mark.parametrize(
    "rows, options, expected",
    [
        (["1, 1, 6"], "", "fixed"),
        (["1, 1, 6, 0."], "", "fixed"),
        (["1, ENCASTRE"], "", "fixed"),
        (["1, 1, 3"], "", "driven"),
        (["1, 1, 3", "1, 4, 4", "1, 5, 6"], "", "fixed"),
        (["1, 1,, 0.1", "1, 2, 6"], "", "driven"),
        (["1, 1, 6"], ", TYPE=VELOCITY", "fixed"),
        (["1, 1, 1, 2."], ", TYPE=VELOCITY, AMPLITUDE=a", "driven"),
        (["1, 11, 11, 20."], "", "driven"),
    ],
)
def test_conditions(tmp_path, rows, options, expected):
    assert column(read(deck().block(f"BOUNDARY{options}", *rows), tmp_path), "motion")[1] == expected


def test_conditions_of_later_steps_are_left_aside_and_said(tmp_path):
    made = deck().block("STEP").block("STATIC").block("BOUNDARY", "1, 1, 6").block("END STEP")
    made.block("STEP").block("STATIC").block("BOUNDARY", "2, 1, 6").block("END STEP")
    found = read(made, tmp_path)
    assert column(found, "motion") == {1: "fixed", 2: "driven", 3: "driven", 4: "driven", 11: ""}
    assert any("1 later ones are left aside" in line for line in found.deck.notes)


def test_slaves_that_are_held_too_are_said(tmp_path):
    found = read(deck().block("BOUNDARY", "pin, PINNED"), tmp_path)
    assert any("1 slaves, the first is node 11, are held by boundary conditions too" in w for w in found.deck.warnings)


# rigid bodies


RIGID = {90: (1, 0.5, -1)}


def rigid(*blocks) -> InputDeck:
    made = deck().nodes(RIGID).block("NSET, NSET=left", "1, 4").block("NSET, NSET=ref", "90")
    for keyword, *rows in blocks:
        made.block(keyword, *rows)
    return made


@pytest.mark.parametrize(
    "blocks, nodes",
    [
        ([("RIGID BODY, REF NODE=90, ELSET=plate",)], [1, 2, 3, 4]),
        ([("RIGID BODY, REF NODE=ref, TIE NSET=left",)], [1, 4]),
        ([("RIGID BODY, REF NODE=ref, NSET=left",)], [1, 4]),
        ([("SURFACE, NAME=s, TYPE=NODE", "left"), ("COUPLING, CONSTRAINT NAME=c, REF NODE=90, SURFACE=s",),
          ("KINEMATIC",)], [1, 4]),
        ([("SURFACE, NAME=s", "plate, E1"), ("COUPLING, CONSTRAINT NAME=c, REF NODE=ref, SURFACE=s",),
          ("KINEMATIC", "1, 6")], [1, 2]),
        ([("SURFACE, NAME=s", "plate, E1"), ("COUPLING, CONSTRAINT NAME=c, REF NODE=ref, SURFACE=s",),
          ("KINEMATIC", "1, 1", "2, 2", "3, 3")], [1, 2]),
        ([("KINEMATIC COUPLING, REF NODE=90", "left, 1, 6", "2")], [1, 2, 4]),
        ([("MPC", "BEAM, 1, 90", "BEAM, left, ref")], [1, 4]),
    ],
)  # fmt: skip
def test_rigid_bodies_are_ports(tmp_path, blocks, nodes):
    found = read(rigid(*blocks), tmp_path)
    (port,) = found.scene.tables["interface"]["ports"]
    assert found.scene.node_sets[port["nodes"]].tolist() == nodes and port["at"] == [1, 0.5, -1]
    assert all(column(found, "rotations")[node] == "true" for node in nodes)
    assert [column(found, "motion")[node] for node in nodes] == ["driven"] * len(nodes)
    decks.compiled(found)


@pytest.mark.parametrize(
    "blocks, words",
    [
        ([("EQUATION", "2", "1, 1, 1., 2, 1, -1.")], "*EQUATION: is not read; its nodes are treated as if it were not"),
        ([("MPC", "TIE, 1, 2")], "*MPC: type TIE is not read"),
        ([("MPC", "LINEAR, 1, 2, 3")], "*MPC: type LINEAR is not read"),
        ([("COUPLING, CONSTRAINT NAME=c, REF NODE=90, SURFACE=left",), ("DISTRIBUTING",)], "*DISTRIBUTING: is not"),
        ([("COUPLING, CONSTRAINT NAME=c, REF NODE=90, SURFACE=left",), ("KINEMATIC", "1, 1")],
         "*KINEMATIC: couples some directions only"),
        ([("TRANSFORM, NSET=left, TYPE=C", "0,0,0,0,0,1")], "*TRANSFORM: is not read"),
        ([("NONSTRUCTURAL MASS, ELSET=plate, UNITS=TOTAL MASS", "3.")], "*NONSTRUCTURAL MASS: is not read; its mass"),
        ([("NODAL THICKNESS", "left, 2.")], "*NODAL THICKNESS: is not read; thicknesses are those of the sections"),
        ([("CONNECTOR BEHAVIOR, NAME=b",)], "*CONNECTOR BEHAVIOR: connectors are not read"),
        ([("FANCY THING, NEW",)], "*FANCY THING: is not understood and is left aside"),
        ([("CLOAD", "11, 3, -5.")], "*CLOAD: loads 1 slaves; their loads are inputs of the FMU, slave[j].f"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named_with_its_line(tmp_path, blocks, words):
    made = rigid(*blocks)
    keyword = words[1:].split(":")[0]
    line = next(k for k, text in enumerate(made.lines, 1) if text.split(",")[0] == f"*{keyword}")
    assert any(re.search(rf"deck.inp: line {line + (keyword == 'MPC')}: ", one) and words in one
               for one in read(made, tmp_path).deck.warnings)  # fmt: skip


# start and gravity


def test_start_velocities_of_single_directions_make_vectors(tmp_path):
    made = deck().block("NSET, NSET=left", "1, 4")
    made.block("INITIAL CONDITIONS, TYPE=VELOCITY", "left, 1, 3.", "left, 3, -2.", "2, 1, 3.", "pin, 1, 9.")
    found = read(made, tmp_path)
    tables = {tuple(found.scene.node_sets[t["nodes"]]): t["v"] for t in found.scene.tables["initial"]}
    assert tables == {(1, 4): [3, 0, -2], (2,): [3, 0, 0]}
    made = deck().block("INITIAL CONDITIONS, TYPE=ROTATING VELOCITY", "left, 1., 0.,0.,0.", "0.,0.,1.")
    assert any("its start velocities are not taken" in line for line in read(made, tmp_path).deck.warnings)


def test_gravity(tmp_path):
    found = read(
        deck().block("STEP").block("DYNAMIC, EXPLICIT", ", 1.").block("DLOAD", ", GRAV, 9.81, 0., 0., -2."), tmp_path
    )
    assert found.scene.tables["model"]["gravity"] == pytest.approx([0, 0, -9.81])
    found = read(deck().block("DLOAD, AMPLITUDE=ramp", ", GRAV, 9.81, 0., 0., -1."), tmp_path)
    assert "model" not in found.scene.tables and any("(ramp) and is not taken" in line for line in found.deck.warnings)
    made = deck().elements("S3", "flap", {2: (2, 13, 3)}).shell("flap")
    both = ["plate, GRAV, 9.81, 0., 0., -1.", "flap, Grav, 9.81, 0., 0., -1."]
    found = read(made.block("DLOAD", *both), tmp_path)  # set by set is once everywhere
    assert found.scene.tables["model"]["gravity"] == pytest.approx([0, 0, -9.81])
    assert not any("gravity is" in line for line in found.deck.warnings)
    found = read(made.block("DLOAD", both[0]), tmp_path)
    assert any("gravity is not the same everywhere" in line for line in found.deck.warnings)


# the whole way


LAP_JOINT = Path(__file__).parent / "decks" / "lap_joint.inp"


def test_a_deck_of_the_repository_runs_in_fmpy(tmp_path):
    decks.import_deck(LAP_JOINT, tmp_path / "scene.toml")
    one, two = (report(tiefmu.load(path)) for path in (tmp_path / "scene.toml", LAP_JOINT))
    assert one["slaves"] == two["slaves"] and len(one["slaves"]) == 10
    run_in_fmpy(LAP_JOINT, tmp_path)
    run_in_fmpy(LAP_JOINT, tmp_path, free=("Block-1",))


def test_the_command_line(tmp_path, command):
    (tmp_path / "job.inp").write_text(LAP_JOINT.read_text())
    found = command("import", "job.inp", "--tie", "weld", "--tie", "GLUE", "-o", "weld.toml")
    assert found.returncode == 0, found.stderr
    assert "weld.toml: 2 ties, 15 nodes, 2 segments, 0 springs" in found.stdout
    for words in (("info", "job.inp"), ("build", "job.inp"), ("run", "job.inp", "--stop-time", "0.001")):
        found = command(*words)
        assert found.returncode == 0 and "Traceback" not in found.stderr, found.stderr
    found = command("import", "job.inp", "--tie", "wel")
    assert found.returncode == 2 and "no tie is called 'wel'; did you mean 'weld'?" in found.stderr
    (tmp_path / "job.inp").write_text(LAP_JOINT.read_text().replace("material=Steel", "material=Steal", 1))
    found = command("build", "job.inp")
    assert found.returncode == 2 and found.stderr.count("\n") == 1
    assert "job.inp: line 32: *SOLID SECTION: material 'Steal' is not in the deck" in found.stderr


def test_a_mesh_file_of_a_scene_is_read_as_before(tmp_path):
    (tmp_path / "job.inp").write_text(LAP_JOINT.read_text())
    tables = {
        "mesh": {"file": str(tmp_path / "job.inp")},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"segments": "Top", "slaves": "foot", "search_distance": 0.001}],
        "units": {"length": "mm"},
    }
    with pytest.raises(tiefmu.SceneError, match=r"no segment found within search_distance 0.001 mm"):
        tiefmu.load(tables)
    tables["tie"][0]["search_distance"] = 0.3
    assert [row["id"] for row in report(tiefmu.load(tables))["slaves"]] == [301]


# refusals, pages


def test_parameters_are_refused_by_name(tmp_path):
    made = InputDeck().block("PARAMETER", "t = 0.1")
    made.lines += deck().lines
    assert refused(made, tmp_path) == "line 3: *PARAMETER: its values stand where numbers are read; write them out"
    made = InputDeck().block("NGEN", "1, 5, 1")
    made.lines += deck().lines
    assert refused(made, tmp_path).startswith("line 3: *NGEN: makes or moves nodes")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("1, 1, 2, 3, 4", "1, 1, 2, 3, 44", "*ELEMENT: element 1: node 44 is not in the deck (ids 1..13)"),
        ("1, 1, 2, 3, 4", "1, 1, 2", "*ELEMENT: element 1 has 2 nodes, its type has 4"),
        ("1, 1, 2, 3, 4", "1, 1, 2, 3, x", "*ELEMENT: expected a whole number, found 'x'"),
        ("1, 1, 2, 3, 4", "1, 1, 2, 3, 4\n1, 1, 2, 3, 4", "*ELEMENT: element 1 is repeated"),
        ("3, 2.0, 1.0, 0.0\n4, 0.0, 1.0, 0.0", "3, 3., 0.\n4, 4., 0.", "*SHELL SECTION: section 'plate': element 1: "),
        ("3, 2.0, 1.0, 0.0", "3, 2.0, nan, 0.0", "*NODE: node 3: a coordinate is not a finite number"),
        ("3, 2.0, 1.0, 0.0", "3, 2.0, 1_0, 0.0", "*NODE: expected a number, found '1_0'"),
        ("3, 2.0, 1.0, 0.0", "4, 2.0, 1.0, 0.0", "*NODE: node 4 is repeated"),
        ("MATERIAL=steel", "MATERIAL=stel", "*SHELL SECTION: material 'stel' is not in the deck"),
        ("ELSET=plate, MATERIAL", "ELSET=plat, MATERIAL", "*SHELL SECTION: 'plat' is neither an id nor a set"),
        ("0.001, 5", "-0.001, 5", "*SHELL SECTION: expected its thickness, found -0.001"),
        ("0.001, 5\n", "", "*SHELL SECTION: expected its thickness"),
        ("7800.0", "", "*DENSITY: material 'steel': expected a density"),
        ("210000000000.0, 0.3", "2e11, 0.7", "*ELASTIC: material 'steel': a modulus of 2e+11 with a Poisson's"),
        ("pin, plate", "pin", "*TIE: tie 'weld': expected two surfaces"),
        ("*NSET, NSET=pin", "*NSET", "*NSET: parameter NSET is missing"),
    ],
)  # fmt: skip
def test_damage_is_named_by_line(tmp_path, old, new, words):
    text = deck().text()
    assert old in text
    found = refused(text.replace(old, new, 1), tmp_path)
    assert words in found
    if "coordinate" not in words:
        assert re.match(r"line \d+: \*", found), found


def test_the_page_names_every_keyword():
    page = (Path(__file__).parents[1] / "docs/decks_abaqus.md").read_text()
    named = set(re.findall(r"`\*([A-Z0-9 -]+)", page))
    known = keywords.USED | set().union(*keywords.SAFE.values()) | set(keywords.MATTERS) | set(keywords.REFUSED)
    generators = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM"}
    assert named - {"CONNECTOR BEHAVIOR"} == known | generators


def test_keywords_are_told_apart():
    every = [keywords.plain(name) for name in (*keywords.USED, *keywords.MATTERS, *keywords.REFUSED)]
    every += [keywords.plain(name) for names in keywords.SAFE.values() for name in names]
    assert len(every) == len(set(every)) and set(every) >= abaqus.CALCULIX
