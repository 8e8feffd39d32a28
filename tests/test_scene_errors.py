"""Every mistake in a scene file ends in one line on stderr, exit status 2, and nothing written."""

import pytest
import tiefmu
from conftest import toml
from scene_lines import IDS, INF, MISSING, NAN, NOT_FOUND, changed, line_of
from tiefmu.cli import main

CASES = {
    # unknown keys
    "unknown table": (("ties",), [], "unknown key 'ties'; did you mean 'tie'?"),
    "unknown key of a tie": (("tie", 0, "slave"), [1], "tie 'weld': unknown key 'slave'; did you mean 'slaves'?"),
    "unknown key of a node table": (
        ("node", 0, "motions"),
        "free",
        "node table 1: unknown key 'motions'; did you mean 'motion'?",
    ),
    "unknown key of the mesh": (("mesh", "fil"), "a.inp", "mesh: unknown key 'fil'; did you mean 'file'?"),
    "unknown key nothing like it": (("units", "force"), "N", "units: unknown key 'force'; known: length, mass, time"),
    # missing
    "no mesh": (("mesh",), MISSING, "mesh: is missing"),
    "no nodes": (("mesh", "nodes"), MISSING, "mesh: has no nodes; give nodes = [[id, x, y, z], ...] or file"),
    "no segments": (("mesh", "segments"), MISSING, "tie 'weld': segments: the mesh has no segments"),
    "no slaves": (("tie", 0, "slaves"), MISSING, "tie 'weld': slaves: is missing"),
    "node table without nodes": (("node", 1, "nodes"), MISSING, "node table 2: nodes: is missing"),
    "no tie": (("tie",), [], "the scene has neither a tie nor a spring; give at least one [[tie]]"),
    # wrong types
    "mesh is no table": (("mesh",), [], "mesh: expected a table, found []"),
    "tie is no array": (("tie",), {"slaves": [101]}, "tie: expected tables written [[tie]], found a table"),
    "tie is no table": (("tie", 0), 5, "tie 1: expected a table, found 5"),
    "mass is text": (("node", 0, "mass"), "1", "node table 1: mass: expected a number, found '1'"),
    "mass is a bool": (("node", 0, "mass"), True, "node table 1: mass: expected a number, found true"),
    "rotations is a number": (("node", 0, "rotations"), 1, "node table 1: rotations: expected true or false, found 1"),
    "name is a number": (("tie", 0, "name"), 5, "tie 1: name: expected a text, found 5"),
    "name is empty": (("tie", 0, "name"), "", "tie 1: name: is empty"),
    "file is a number": (("mesh", "file"), 3, "mesh: file: expected a text, found 3"),
    "gravity is a number": (("model", "gravity"), 9.81, "model: gravity: expected [x, y, z], found 9.81"),
    "gravity has two entries": (("model", "gravity"), [0, 0], "model: gravity: expected [x, y, z], found [0, 0]"),
    "expose is text": (("interface", "expose"), "slave.r", "interface: expose: expected a list, found 'slave.r'"),
    "slaves is a number": (
        ("tie", 0, "slaves"),
        101,
        "tie 'weld': slaves: expected a list of ids, a set name or 'all', found 101",
    ),
    "slave id is text": (("tie", 0, "slaves"), ["101"], f"tie 'weld': slaves: {IDS}, found '101'"),
    "slave id is a fraction": (("tie", 0, "slaves"), [101.0], f"tie 'weld': slaves: {IDS}, found 101.0"),
    "slave id is a bool": (("tie", 0, "slaves"), [True], f"tie 'weld': slaves: {IDS}, found true"),
    "slave id is too large": (("tie", 0, "slaves"), [10**30], f"tie 'weld': slaves: {IDS}, found 1{'0' * 30}"),
    "node has two coordinates": (
        ("mesh", "nodes", 0),
        [1, 0, 0],
        "mesh: node 1: expected [id, x, y, z], found [1, 0, 0]",
    ),
    "node has four coordinates": (
        ("mesh", "nodes", 0),
        [1, 0, 0, 0, 0],
        "mesh: node 1: expected [id, x, y, z], found [1, 0, 0, 0, 0]",
    ),
    "node is a number": (("mesh", "nodes", 0), 5, "mesh: nodes: row 1: expected [id, x, y, z], found 5"),
    "node id is a fraction": (
        ("mesh", "nodes", 0),
        [1.0, 0, 0, 0],
        "mesh: nodes: row 1: id: expected a whole number, found 1.0",
    ),
    "node id is zero": (
        ("mesh", "nodes", 0),
        [0, 0, 0, 0],
        "mesh: nodes: row 1: id: 0 is too small; it must be at least 1",
    ),
    "coordinate is text": (("mesh", "nodes", 0), [1, 0, "a", 0], "mesh: node 1: y: expected a number, found 'a'"),
    "coordinate is a bool": (("mesh", "nodes", 0), [1, True, 0, 0], "mesh: node 1: x: expected a number, found true"),
    "segment of two nodes": (
        ("mesh", "segments", 0),
        [1, 1, 2],
        "mesh: segment 1: expected [id, then three or four node ids], found [1, 1, 2]",
    ),
    "segment of five nodes": (
        ("mesh", "segments", 0),
        [1, 1, 2, 3, 4, 101],
        "mesh: segment 1: expected [id, then three or four node ids], found a list of 6 values",
    ),
    "segment node is a fraction": (
        ("mesh", "segments", 0),
        [1, 1, 2, 3.5, 4],
        "mesh: segment 1: node 3: expected a whole number, found 3.5",
    ),
    # choices
    "formulation": (
        ("tie", 0, "formulation"),
        "spot",
        "tie 'weld': formulation: 'spot' is not one of 'default', 'optimized'",
    ),
    "search": (("tie", 0, "search"), "nearest", "tie 'weld': search: 'nearest' is not one of 'box', 'nearest-node'"),
    "unresolved": (("tie", 0, "unresolved"), "warn", "tie 'weld': unresolved: 'warn' is not one of 'error', 'drop'"),
    "motion": (("node", 0, "motion"), "Free", "node table 1: motion: 'Free' is not one of 'driven', 'free', 'fixed'"),
    "inertia": (("model", "inertia"), "lump", "model: inertia: 'lump' is not one of 'lumped', 'consistent'"),
    "reaction": (("model", "reaction"), "load", "model: reaction: 'load' is not one of 'loads', 'full', 'split'"),
    "geometry": (("model", "geometry"), "large", "model: geometry: 'large' is not one of 'finite', 'small'"),
    "position": (("model", "position"), "set", "model: position: 'set' is not one of 'integrated', 'input'"),
    "method": (
        ("integrator", "method"),
        "euler",
        "integrator: method: 'euler' is not one of 'central-difference', 'symplectic-euler', 'noh-bathe', 'rk4'",
    ),
    "kind": (
        ("spring",),
        [{"nodes": [1, 2], "kind": "rod"}],
        "spring 1: kind: 'rod' is not one of 'axial', 'bushing', 'beam'",
    ),
    "unit": (
        ("units", "length"),
        "inch",
        "units: length: 'inch' is not one of 'm', 'cm', 'mm', 'um', 'km', 'in', 'ft'",
    ),
    "split with lumped inertia": (
        ("model", "reaction"),
        "split",
        "model: reaction: 'split' needs inertia = 'consistent' (with lumped inertia it equals 'loads')",
    ),
    # ids and sets
    "slave is not in the mesh": (("tie", 0, "slaves"), [999], f"tie 'weld': slaves: node 999 {NOT_FOUND}"),
    "segment is not in the mesh": (
        ("tie", 0, "segments"),
        [7],
        "tie 'weld': segments: segment 7 is not in the mesh (ids 1..1)",
    ),
    "segment's node is not in the mesh": (
        ("mesh", "segments", 0),
        [1, 1, 2, 3, 9],
        f"mesh: segment 1: node 9 {NOT_FOUND}",
    ),
    "node table's node is not in the mesh": (("node", 1, "nodes"), [7], f"node table 2: nodes: node 7 {NOT_FOUND}"),
    "spring's node is not in the mesh": (("spring",), [{"nodes": [1, 99]}], f"spring 1: nodes: node 99 {NOT_FOUND}"),
    "initial's node is not in the mesh": (
        ("initial",),
        [{"nodes": [5], "v": [0, 0, 1]}],
        f"initial 1: nodes: node 5 {NOT_FOUND}",
    ),
    "no such set": (
        ("tie", 0, "slaves"),
        "top",
        "tie 'weld': slaves: the mesh has no set 'top'; it has no sets of nodes: give ids or 'all'",
    ),
    "empty slaves": (("tie", 0, "slaves"), [], "tie 'weld': slaves: the list is empty; give at least one id"),
    "empty set name": (("tie", 0, "slaves"), "", "tie 'weld': slaves: the name of the set is empty"),
    "repeated node": (("mesh", "nodes", 0), [2, 0, 0, 0], "mesh: node 2 is repeated"),
    "repeated segment": (("mesh", "segments", 1), [1, 1, 2, 3], "mesh: segment 1 is repeated"),
    "repeated slave": (("tie", 0, "slaves"), [101, 101], "tie 'weld': slaves: id 101 is repeated"),
    "repeated tie": (("tie", 1), {"name": "weld", "slaves": [2]}, "tie 'weld': this name is repeated"),
    # not finite, negative
    "coordinate is nan": (("mesh", "nodes", 0), [1, 0, 0, NAN], "mesh: node 1: z: nan is not a finite number"),
    "coordinate is infinite": (
        ("mesh", "nodes", 4),
        [101, -INF, 0, 0],
        "mesh: node 101: x: -inf is not a finite number",
    ),
    "mass is infinite": (("node", 0, "mass"), INF, "node table 1: mass: inf is not a finite number"),
    "mass is negative": (("node", 0, "mass"), -1, "node table 1: mass: -1 is negative; it must be 0 or more"),
    "inertia is negative": (
        ("node", 1, "inertia"),
        -1.5,
        "node table 2: inertia: -1.5 is negative; it must be 0 or more",
    ),
    "stiffness is negative": (
        ("node", 0, "stiffness"),
        -2,
        "node table 1: stiffness: -2 is negative; it must be 0 or more",
    ),
    "search distance is nan": (
        ("tie", 0, "search_distance"),
        NAN,
        "tie 'weld': search_distance: nan is not a finite number",
    ),
    "search distance is negative": (
        ("tie", 0, "search_distance"),
        -1,
        "tie 'weld': search_distance: -1 is negative; it must be 0 or more",
    ),
    "gravity is nan": (("model", "gravity"), [0, 0, NAN], "model: gravity: nan is not a finite number"),
    "time step is negative": (
        ("integrator", "time_step"),
        -1e-3,
        "integrator: time_step: -0.001 is negative; it must be 0 or more",
    ),
    "safety is zero": (("integrator", "safety"), 0, "integrator: safety: 0 is too small; it must be more than 0"),
    # springs
    "spring without ends": (
        ("spring",),
        [{"stiffness": 1}],
        "spring 1: give either nodes = [a, b] or ground = [ids], found neither",
    ),
    "spring with nodes and ground": (
        ("spring",),
        [{"nodes": [1, 2], "ground": [1]}],
        "spring 1: give either nodes = [a, b] or ground = [ids], not both",
    ),
    "spring of one node": (("spring",), [{"nodes": [1]}], "spring 1: nodes: expected two node ids, found [1]"),
    "spring on itself": (("spring",), [{"nodes": [1, 1]}], "spring 1: nodes: id 1 is repeated"),
    "axial with a vector": (
        ("spring",),
        [{"nodes": [1, 2], "stiffness": [1, 2, 3]}],
        "spring 1: stiffness: an axial spring takes one number, found [1, 2, 3]",
    ),
    "axial with a moment": (
        ("spring",),
        [{"nodes": [1, 2], "rotational_stiffness": 1}],
        "spring 1: rotational_stiffness: an axial spring has none; use kind = 'bushing'",
    ),
    "axial to ground": (
        ("spring",),
        [{"ground": [1]}],
        'spring 1: node 1: an axial spring to its own start position has no direction; use kind = "bushing"',
    ),
    "beam to ground": (
        ("spring",),
        [{"ground": [1], "kind": "beam"}],
        'spring 1: node 1: a beam to its own start position has no direction; use kind = "bushing"',
    ),
    "beam along its orientation": (
        ("spring",),
        [{"nodes": [1, 2], "kind": "beam", "orientation": [2, 0, 0]}],
        "spring 1: its orientation is parallel to the line between nodes 1 and 2",
    ),
    "orientation without length": (
        ("spring",),
        [{"nodes": [1, 2], "kind": "beam", "orientation": [0, 0, 0]}],
        "spring 1: orientation: [0, 0, 0] is no direction",
    ),
    "orientation of a bushing": (
        ("spring",),
        [{"nodes": [1, 2], "kind": "bushing", "orientation": [0, 0, 1]}],
        "spring 1: orientation: only a beam has one; found kind 'bushing'",
    ),
    "bushing with two entries": (
        ("spring",),
        [{"nodes": [1, 2], "kind": "bushing", "stiffness": [1, 2]}],
        "spring 1: stiffness: expected a number or [x, y, z], found [1, 2]",
    ),
    "spring is negative": (
        ("spring",),
        [{"nodes": [1, 2]}, {"nodes": [1, 3], "damping": -2}],
        "spring 2: damping: -2 is negative; it must be 0 or more",
    ),
    "bushing is nan": (
        ("spring",),
        [{"ground": "all", "kind": "bushing", "stiffness": [1, 2, NAN]}],
        "spring 1: stiffness: nan is not a finite number",
    ),
    # who moves what
    "slave is fixed": (
        ("node", 1, "motion"),
        "fixed",
        "tie 'weld': slave 101: constrained twice, by the tie and by "
        "motion = 'fixed' in node table 2; take it out of one",
    ),
    "slave is a master": (
        ("tie", 0, "slaves"),
        [4],
        "tie 'weld': slave 4: is also a master, on segment 1 of tie 'weld'; take it out of one of them",
    ),
    "slave in two ties": (
        ("tie", 1),
        {"name": "glue", "slaves": [101]},
        "tie 'glue': slave 101: is already a slave of tie 'weld'; a node can follow one tie only",
    ),
    "slave out of reach": (
        ("tie", 0, "search_distance"),
        1e-3,
        "tie 'weld': slave 101: no segment found within search_distance 0.001 m; the nearest is segment 1 at 0.04 m",
    ),
    "initial velocity of a slave": (
        ("initial",),
        [{"nodes": [101], "v": [0, 0, 1]}],
        "initial 1: nodes: node 101 is a slave: its motion comes from its tie",
    ),
    "initial of nothing": (("initial",), [{"nodes": [1]}], "initial 1: give v = [x, y, z] or w = [x, y, z]"),
    "initial spin without rotations": (
        ("initial",),
        [{"nodes": [1], "w": [0, 0, 1]}],
        "initial 1: w: node 1 has no rotations; set rotations = true in a node table, or leave w out",
    ),
    "initial velocity is text": (
        ("initial",),
        [{"nodes": [1], "v": [0, 0, "x"]}],
        "initial 1: v: expected [x, y, z], found [0, 0, 'x']",
    ),
    # interface
    "expose nothing known": (
        ("interface", "expose"),
        ["slave.x"],
        "interface: expose: unknown name 'slave.x'; known: "
        "energy, power_residual, drift, master.r, master.stiffness, slave.r, slave.a, "
        "slave.mass, slave.inertia, point.r",
    ),
    "port of a set that is not there": (
        ("interface", "ports"),
        ["flange"],
        "interface: port 'flange': the mesh has no set 'flange'; it has no sets of nodes: give ids or 'all'",
    ),
    "port of a node that is not there": (
        ("interface", "ports"),
        [{"name": "a", "nodes": [7]}],
        f"interface: port 'a': node 7 {NOT_FOUND}",
    ),
    "port without nodes": (
        ("interface", "ports"),
        [{"name": "a", "nodes": []}],
        "interface: ports: entry 1: nodes: the list is empty; give at least one id",
    ),
    "port named twice": (
        ("interface", "ports"),
        [{"name": "a", "nodes": [1]}, {"name": "a", "nodes": [2]}],
        "interface: port 'a': this name is repeated",
    ),
    "ports of one flat name": (
        ("interface",),
        {"names": "flat", "ports": [{"name": "a b", "nodes": [1]}, {"name": "a_b", "nodes": [2]}]},
        "interface: port 'a_b': its flat name is that of port 'a b'; give it another name",
    ),
    "node in two ports": (
        ("interface", "ports"),
        [{"name": "a", "nodes": [1, 2]}, {"name": "b", "nodes": [3, 2]}],
        "interface: port 'b': node 2: is already in port 'a'; a node can be in one port only",
    ),
    "port of slaves and masters": (
        ("interface", "ports"),
        [{"name": "a", "nodes": [1, 101]}],
        "interface: port 'a': holds slaves (node 101) and nodes that are none (node 1); make two ports of them",
    ),
    "port of all": (
        ("interface", "ports"),
        ["all"],
        "interface: port 'all': holds slaves (node 101) and nodes that are none (node 4); make two ports of them",
    ),
    "port of a slave that cannot turn": (
        ("interface", "ports"),
        [{"name": "a", "nodes": [101]}],
        "interface: port 'a': its only slave cannot turn, which leaves its rotation "
        'open; use formulation = "optimized" or rotations = true',
    ),
    "unknown key of a port": (
        ("interface", "ports"),
        [{"name": "a", "node": [1]}],
        "interface: ports: entry 1: unknown key 'node'; did you mean 'nodes'?",
    ),
    "port without a name": (("interface", "ports"), [{"nodes": [1]}], "interface: ports: entry 1: name: is missing"),
    "port with a bracket in its name": (
        ("interface", "ports"),
        ["a[1]"],
        "interface: ports: entry 1: 'a[1]' cannot name a port: letters, digits, spaces "
        "and _ - . : / can; give the set as nodes, with another name",
    ),
    "port with an odd place": (
        ("interface", "ports"),
        [{"name": "a", "nodes": [1], "at": [0, 0]}],
        "interface: ports: entry 1: at: expected [x, y, z], found [0, 0]",
    ),
    "expose a number": (("interface", "expose"), [3], "interface: expose: entry 1: expected a text, found 3"),
    # mesh file
    "no such mesh file": (("mesh", "file"), "panel.inp", "mesh: file: panel.inp: no such file"),
}


@pytest.mark.parametrize("name", CASES)
def test_line(name, weld, scene_file, capsys):
    path, value, line = CASES[name]
    assert line_of(scene_file, capsys, changed(weld, path, value)) == line


@pytest.mark.parametrize("name", CASES)
def test_same_line_from_a_dict(name, weld):
    path, value, line = CASES[name]
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(changed(weld, path, value))
    assert str(error.value) == f"scene: {line}"


def test_unknown_name_to_hide(weld, scene_file, capsys):
    line = line_of(scene_file, capsys, changed(weld, ("interface", "hide"), ["master.x"]))
    assert line.startswith("interface: hide: unknown name 'master.x'; known: ")
    assert "master.f_ext" in line


def test_fixed_node_with_initial_velocity(weld, scene_file, capsys):
    weld["node"].append({"nodes": [2], "motion": "fixed"})
    weld["initial"] = [{"nodes": "all", "v": [0, 0, 1]}, {"nodes": [1, 2], "v": [0, 0, 1]}]
    assert line_of(scene_file, capsys, weld) == "initial 2: nodes: node 2 is fixed"


def test_initial_spin_of_all_where_nothing_turns(weld, scene_file, capsys):
    weld["initial"] = [{"nodes": "all", "w": [0, 0, 1]}]
    assert (
        line_of(scene_file, capsys, weld)
        == "initial 1: w: no node has rotations; set rotations = true in a node table, or leave w out"
    )


def test_coincident_ends_of_an_axial_spring(weld, scene_file, capsys):
    weld["mesh"]["nodes"].append([5, 0, 0, 0])
    weld["spring"] = [{"nodes": [1, 5], "stiffness": 1.0}]
    assert (
        line_of(scene_file, capsys, weld)
        == "spring 1: nodes 1 and 5 are at the same place; an axial spring needs two distinct positions"
    )


def test_free_node_without_mass(weld, scene_file, capsys):
    weld["node"] = [{"nodes": "all", "motion": "free"}]
    assert (
        line_of(scene_file, capsys, weld)
        == "node 1: is free but has no mass of its own and gets none from its slaves; give it mass"
    )


def test_slave_with_inertia_that_no_master_can_carry(weld, scene_file, capsys):
    weld["node"][1]["inertia"] = 0.1
    assert (
        line_of(scene_file, capsys, weld)
        == "tie 'weld': slave 101: has rotary inertia, but the nodes of segment 1 have no rotations to carry it; "
        'use formulation = "optimized" or rotations = true'
    )


def test_optimized_tie_on_collinear_nodes(weld, scene_file, capsys):
    weld["mesh"]["nodes"][:4] = [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.2, 0, 0], [4, 0.3, 0, 0]]
    weld["tie"][0]["formulation"] = "optimized"
    assert (
        line_of(scene_file, capsys, weld)
        == "tie 'weld': slave 101: no segment found within search_distance 0.173205 m; "
        "without area and passed over: segment 1"
    )


def test_no_such_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["build", "weld.toml"]) == 2
    assert capsys.readouterr().err == "error: weld.toml: no such file\n"


def test_folder_in_place_of_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "weld.toml").mkdir()
    assert main(["info", "weld.toml"]) == 2
    assert capsys.readouterr().err == "error: weld.toml: Is a directory\n"


@pytest.mark.parametrize(
    "text, line",
    [
        ('title = "a"\nmesh = {\n', "line 2, column 9: not TOML: "),
        ('title = "a\n', "line 1, column 11: not TOML: "),
        ("title = 'a'\ntitle = 'b'\n", "line 2, column 12: not TOML: Cannot overwrite a value"),
        ("a = [1, 2", "end of file: not TOML: "),
    ],
)
def test_not_toml(scene_file, capsys, text, line):
    assert line_of(scene_file, capsys, text).startswith(line)


def test_not_text(tmp_path, scene_file, capsys):
    (tmp_path / "weld.toml").write_bytes(b'title = "\xff\xfe"')
    assert main(["build", "weld.toml"]) == 2
    assert capsys.readouterr().err == "error: weld.toml: not a text file (byte 9 is not UTF-8)\n"


@pytest.mark.parametrize(
    "words", [["build"], ["advise"], ["study", "speed-accuracy"], ["study", "coupling"]], ids=" ".join
)
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_where_a_scene_is_asked_for(weld, tmp_path, monkeypatch, capsys, words, fmi):
    monkeypatch.chdir(tmp_path)
    tiefmu.build(tiefmu.load(weld), tmp_path / "weld.fmu", fmi=fmi)
    assert main([*words, "weld.fmu"]) == 2
    said = capsys.readouterr().err
    assert said == "error: weld.fmu: is an FMU; give the scene that it was built from\n"


def test_first_error_only(weld, scene_file, capsys):
    weld["node"][0]["mass"] = -1
    weld["tie"][0]["slaves"] = [999]
    assert line_of(scene_file, capsys, weld) == "node table 1: mass: -1 is negative; it must be 0 or more"


def test_file_is_called_as_the_caller_does(weld, tmp_path):
    path = tmp_path / "weld.toml"
    weld["tie"][0]["slaves"] = [999]
    path.write_text(toml(weld))
    for name in (path, str(path)):
        with pytest.raises(tiefmu.SceneError) as error:
            tiefmu.load(name)
        assert str(error.value) == f"{path}: tie 'weld': slaves: node 999 is not in the mesh (ids 1..101)"
