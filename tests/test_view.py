"""VTK files: what they hold is what the report and the run say."""

import importlib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import fmpy
import meshio
import numpy as np
import pytest
import tiefmu
from tiefmu.cli import main
from tiefmu.report import of_fmu
from tiefmu.run import run
from tiefmu.view.geometry import Geometry

SCENES = Path(__file__).resolve().parents[1] / "scenes"


@pytest.mark.parametrize("name", ["bracket", "rivet", "spotweld", "spinning", "mesh_transition"])
def test_slaves_are_where_the_solver_has_them(name):
    """Against slave.r of the FMU's own outputs; feet lie in the planes that the distance says."""
    scene = tiefmu.load(SCENES / f"{name}.toml", expose=["slave.r", "master.r"])
    found = tiefmu.report(scene)
    geometry = Geometry(found)
    size = np.ptp(geometry.positions, axis=0).max()
    for prefix, rows, places in (
        ("slave", found["slaves"], geometry.slaves),
        ("master", found["masters"], geometry.positions[: len(found["masters"])]),
    ):
        names = [f"{prefix}[{row['number']}].r[{k}]" for row in rows for k in (1, 2, 3)]
        expected = np.reshape(scene.start.get_values(names), (-1, 3))
        np.testing.assert_allclose(places, expected, rtol=0, atol=1e-6 * size)
    inside = [
        row["xi"] + row["eta"] <= 1 and min(row["xi"], row["eta"]) >= 0
        if len(row["nodes"]) == 3
        else max(abs(row["xi"]), abs(row["eta"])) <= 1
        for row in found["slaves"]
    ]
    distances = np.linalg.norm(geometry.slaves - geometry.feet, axis=1)[inside]
    expected = np.array([row["distance"] for row in found["slaves"]])[inside]
    np.testing.assert_allclose(distances, expected, rtol=0, atol=2e-6 * size)
    assert len(distances) > 0


def test_places_are_rounded_but_not_lost_far_from_the_origin(weld):
    far = np.array([1e6, -2e6, 3e6])
    weld["mesh"]["nodes"] = [[row[0], *(np.array(row[1:]) + far)] for row in weld["mesh"]["nodes"]]
    found = tiefmu.report(tiefmu.load(weld))
    expected = np.array([row[1:] for row in weld["mesh"]["nodes"]])
    geometry = Geometry(found)
    np.testing.assert_allclose(geometry.positions, expected[:4], rtol=0, atol=1e-8)
    np.testing.assert_allclose(geometry.slaves, expected[4:], rtol=0, atol=1e-8)


@pytest.fixture(params=["scene", "fmu"])
def model(request, weld, scene_file):
    weld["mesh"]["nodes"] += [[5, 0.2, 0, 0], [102, 0.15, 0.03, 0.01]]
    weld["mesh"]["segments"].append([2, 2, 5, 3])
    weld["tie"].append({"name": "second", "segments": [2], "slaves": [102], "formulation": "optimized"})
    weld["tie"][0] |= {"segments": [1]}
    name = scene_file(weld)
    if request.param == "fmu":
        assert main(["build", name]) == 0
        return "weld.fmu"
    return name


def test_ties_in_a_vtu_file(model, capsys):
    assert main(["info", model, "--vtu", "ties.vtu"]) == 0
    assert capsys.readouterr().out.endswith("wrote ties.vtu\n")
    mesh = meshio.read("ties.vtu")
    assert [block.type for block in mesh.cells] == ["quad", "triangle", "vertex", "line"]
    found = of_fmu(model) if model.endswith(".fmu") else tiefmu.report(tiefmu.load(model))
    slaves = found["slaves"]
    assert [row["id"] for row in slaves] == [101, 102]
    for key in ("id", "distance", "xi", "eta", "clamped"):
        for block in (2, 3):
            assert mesh.cell_data[key][block].tolist() == [row[key] for row in slaves]
    assert [block.tolist() for block in mesh.cell_data["tie"]] == [[-1], [-1], [1, 2], [1, 2]]
    assert [block.tolist() for block in mesh.cell_data["id"]][:2] == [[1], [2]]
    assert mesh.cell_data["weights"][2].tolist() == [(row["weights"] + [0.0])[:4] for row in slaves]
    ids = mesh.point_data["id"]
    assert ids[mesh.cells[0].data].tolist() == [[1, 2, 3, 4]]
    assert ids[mesh.cells[1].data].tolist() == [[2, 5, 3]]
    np.testing.assert_allclose(
        mesh.points[mesh.cells[2].data[:, 0]], [[0.03, 0.06, 0.04], [0.15, 0.03, 0.01]], atol=1e-8
    )
    ends = mesh.points[mesh.cells[3].data]
    np.testing.assert_allclose(ends[:, 1], [[0.03, 0.06, 0], [0.15, 0.03, 0]], atol=1e-8)
    masters = {row["id"]: row for row in found["masters"]}
    for key, name in (("added_mass", "added_mass"), ("nodal_time_step", "nodal_step"), ("mass", "mass")):
        assert mesh.point_data[name][:5].tolist() == [masters[i][key] for i in ids[:5].tolist()]
    assert mesh.point_data["motion"].tolist() == [0] * 5 + [-1] * 4
    assert (Path("ties.vtu").read_bytes()).count(b"vtkZLibDataCompressor") == 1


def test_only_the_fields_that_are_asked_for(model, capsys):
    assert main(["info", model, "--vtu", "ties.vtu", "--fields", "distance", "added_mass"]) == 0
    mesh = meshio.read("ties.vtu")
    assert (list(mesh.cell_data), list(mesh.point_data)) == (["distance"], ["added_mass"])
    assert main(["info", model, "--vtu", "no.vtu", "--fields", "distnace"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == ("error: no.vtu: no field 'distnace'; did you mean 'distance'?")
    assert not Path("no.vtu").exists()


def test_a_run_as_a_moving_mesh(weld, scene_file):
    weld["node"][0] |= {"motion": "driven", "rotations": True}
    weld["node"].append({"nodes": [4], "motion": "free", "inertia": 1.0})
    name = scene_file(weld)
    Path("in.csv").write_text("time,slave[1].f[3],master[2].v[1]\n0,0,1\n0.01,100,3\n")
    arguments = ["run", name, "--input", "in.csv", "--step", "0.0005", "--pvd", "run.pvd", "--frames", "5"]
    assert main(arguments) == 0
    exposed = tiefmu.build(tiefmu.load(name, expose=["master.r", "slave.r"]), "exposed.fmu")
    result, _ = run(exposed, None, 0.0005, Path("in.csv"))
    sets = ElementTree.parse("run.pvd").getroot().findall("Collection/DataSet")
    assert [float(one.get("timestep")) for one in sets] == result["time"][::5].tolist()
    for k, one in zip(range(0, 21, 5), sets):
        mesh = meshio.read(one.get("file"))
        nodes = ["master[1]", "master[2]", "master[3]", "master[4]", "slave[1]"]
        row = [[result[f"{node}.r[{i}]"][k] for i in (1, 2, 3)] for node in nodes]
        assert mesh.points[:5].tolist() == row
        force = [[result[f"{node}.f[{i}]"][k] for i in (1, 2, 3)] for node in nodes[:4]]
        assert mesh.point_data["reaction"].tolist() == force + [[0, 0, 0]] * 2
        velocity = mesh.point_data["velocity"]
        assert velocity[1].tolist() == pytest.approx([1 + 200 * result["time"][k], 0, 0])
        for i in (3, 4):
            assert velocity[i].tolist() == [result[f"{nodes[i]}.v[{c}]"][k] for c in (1, 2, 3)]
    assert np.ptp(result["slave[1].r[1]"]) > 1e-3


@pytest.mark.parametrize("frames, rows", [(1, [0]), (2, [0, 20]), (4, [0, 7, 14, 20]), (6, [0, 4, 8, 12, 16, 20])])
def test_the_frames_of_a_run_go_to_its_end(weld, scene_file, frames, rows):
    arguments = ["run", scene_file(weld), "--stop-time", "0.02", "--step", "0.001", "--pvd", "run.pvd"]
    assert main([*arguments, "--frames", str(frames)]) == 0
    sets = ElementTree.parse("run.pvd").getroot().findall("Collection/DataSet")
    assert [float(one.get("timestep")) for one in sets] == pytest.approx([1e-3 * row for row in rows])


def test_an_fmu_that_shows_no_positions(weld, scene_file, capsys):
    scene = scene_file(weld)
    assert main(["build", scene]) == 0
    assert main(["run", "weld.fmu", "--pvd", "run.pvd"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        'error: run.pvd: the FMU shows no master[1].r; expose = ["master.r"] in [interface] of its scene'
    )
    assert not list(Path().glob("run*"))


def test_nothing_is_left_of_a_run_that_stops(weld, scene_file, capsys):
    name = scene_file(weld)
    Path("in.csv").write_text("time,master[1].v[3]\n0,0\n1,1e300\n")
    assert main(["run", name, "--input", "in.csv", "--pvd", "run.pvd"]) == 2
    assert sorted(path.name for path in Path().iterdir()) == ["in.csv", name]


def test_positions_cost_little(tmp_path, monkeypatch):
    """What the report carries for pictures stays below 200 kB of an FMU, and is left out of larger ones: bytes a node
    of a scene with 900."""
    reporting = importlib.import_module("tiefmu.report")  # the package has a function of this name
    quads = 29
    nodes, segments = [], []
    for i in range(quads + 1):
        for j in range(quads + 1):
            nodes.append([1 + i * (quads + 1) + j, 0.0123 * i, 0.00977 * j, 1e-3 * np.sin(i * j)])
    for i in range(quads):
        for j in range(quads):
            a = 1 + i * (quads + 1) + j
            segments.append([1 + len(segments), a, a + 1, a + quads + 2, a + quads + 1])
    slaves = []
    for k, (_, a, _, c, _) in enumerate(segments):
        middle = (np.array(nodes[a - 1][1:]) + nodes[c - 1][1:]) / 2
        slaves.append([20_000 + k, *middle])
    scene = tiefmu.load({
        "mesh": {"nodes": nodes + slaves, "segments": segments},
        "node": [{"nodes": "all", "mass": 1.0}],
        "tie": [{"segments": "all", "slaves": [row[0] for row in slaves]}],
    })  # fmt: skip
    assert len(tiefmu.report(scene)["masters"]) == 900
    with_places = tiefmu.build(scene, tmp_path / "a.fmu").stat().st_size
    most = reporting.MOST_PLACES
    monkeypatch.setattr(reporting, "MOST_PLACES", 899)
    without = tiefmu.build(scene, tmp_path / "b.fmu").stat().st_size
    with pytest.raises(tiefmu.UsageError, match="holds no positions"):
        Geometry(of_fmu(tmp_path / "b.fmu"))
    a_node = (with_places - without) / 900
    assert 1 < a_node < 200_000 / most
    assert fmpy.read_model_description(tmp_path / "a.fmu").guid == fmpy.read_model_description(tmp_path / "b.fmu").guid


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["info", "weld.toml", "--vtu", "weld.toml"], "weld.toml: is written as .vtu; give it that ending"),
        (["run", "weld.toml", "--pvd", "weld.toml"], "weld.toml: is written as .pvd; give it that ending"),
        (["report", "weld.toml", "-o", "weld.toml"], "weld.toml: is written as .html or .htm; give it that ending"),
        (["info", "weld.toml", "--fields", "tie"], "--fields: needs --vtu, the file whose fields they are"),
        (["run", "weld.toml", "--frames", "3"], "--frames: needs --pvd, the file whose frames they are"),
    ],
)
def test_files_of_another_kind(arguments, said, weld, scene_file, capsys):
    """A slip of the keyboard does not write over the scene."""
    scene_file(weld)
    before = Path("weld.toml").read_text()
    assert main(arguments) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"error: {said}"
    assert Path("weld.toml").read_text() == before
    assert [path.name for path in Path().iterdir()] == ["weld.toml"]


def test_more_nodes_than_an_fmu_says_places_of(weld, scene_file, monkeypatch):
    """Given the scene, its pictures have all of them."""
    monkeypatch.setattr(importlib.import_module("tiefmu.report"), "MOST_PLACES", 3)
    name = scene_file(weld)
    assert main(["info", name, "--vtu", "ties.vtu"]) == 0
    assert main(["run", name, "--stop-time", "0.01", "--pvd", "run.pvd", "--frames", "2"]) == 0
    for file in ("ties.vtu", "run_frames/000000.vtu"):
        np.testing.assert_allclose(
            meshio.read(file).points[:4, :2], [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]], atol=1e-8
        )


def test_a_moving_mesh_of_a_deck(tmp_path, monkeypatch):
    """A deck exposes its positions as a scene does."""
    monkeypatch.chdir(tmp_path)
    arguments = ["--input", str(SCENES / "pin_weld.csv"), "--stop-time", "0.001", "--frames", "4"]
    assert main(["run", str(SCENES / "pin_weld.rad"), *arguments, "--pvd", "deck.pvd"]) == 0
    assert main(["import", str(SCENES / "pin_weld.rad"), "-o", "weld.toml"]) == 0
    assert main(["run", "weld.toml", *arguments, "--pvd", "scene.pvd"]) == 0
    moved = []
    for name in ("deck", "scene"):
        frames = [meshio.read(f"{name}_frames/00000{k}.vtu") for k in range(4)]
        moved.append(np.array([frame.points for frame in frames]))
    np.testing.assert_array_equal(moved[0], moved[1])
    assert np.ptp(moved[0], axis=0).max() > 0
