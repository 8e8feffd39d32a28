"""Documentation, picture, terminals, licences and reference results of an FMU."""

import io
import re
import subprocess
import sys
import zipfile
from html.parser import HTMLParser
from pathlib import Path

import fmpy
import numpy as np
import pytest
import tiefmu
from fmu_calls import OK, Fmu, Instance
from lxml import etree
from tiefmu.content import reference_results

SCENES = sorted((Path(__file__).parents[1] / "scenes").glob("*.toml"))
VOID = {"meta", "img", "br"}


@pytest.fixture(scope="module", params=SCENES, ids=lambda path: path.stem)
def files(request, tmp_path_factory):
    """Scene, description, and path in the archive -> bytes."""
    scene = tiefmu.load(request.param)
    path = tiefmu.build(scene, tmp_path_factory.mktemp("fmu") / "scene.fmu")
    with zipfile.ZipFile(path) as archive:
        return scene, fmpy.read_model_description(str(path)), {name: archive.read(name) for name in archive.namelist()}


class Balanced(HTMLParser):
    """Complains of a tag that is closed out of turn; collects text and the addresses that the page refers to."""

    def __init__(self, text):
        super().__init__()
        self.open, self.text, self.links = [], "", []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.links += [value for key, value in attributes if key in ("href", "src")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        pass

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_the_page_shows_the_scene(files):
    scene, _, found = files
    text = found["documentation/index.html"].decode()
    page = Balanced(text)
    assert scene.title in page.text
    report = tiefmu.report(scene)
    for row in report["ties"]:
        assert row["name"] in page.text and row["formulation"] in page.text
    assert text.count("<svg") == 1 and text.count('<path d="M') == len(report["slaves"]) + len(
        {row["segment"] for row in report["slaves"]}
    )
    for row in report["slaves"][:200]:
        assert f"<td>{row['number']}</td><td>{row['id']}</td>" in text
    assert "slave[j].f" in page.text and "master[i].f" in page.text and "inertial frame" in page.text
    for link in page.links:
        assert f"documentation/{link}" in found


def test_a_title_cannot_break_the_page(weld, tmp_path):
    weld["title"] = '<b>A & "B"</b> ü'
    weld["tie"][0]["name"] = "<i>"
    with zipfile.ZipFile(tiefmu.build(tiefmu.load(weld), tmp_path / "a.fmu")) as archive:
        page = Balanced(archive.read("documentation/index.html").decode())
    assert weld["title"] in page.text and "<i>" in page.text


def test_the_picture_is_a_png_of_the_scene(files):
    from matplotlib import image  # an independent reader

    _, _, found = files
    pixels = image.imread(io.BytesIO(found["model.png"]), format="png")
    assert pixels.shape == (360, 480, 3)
    dark = pixels.sum(axis=2) < 2.9
    assert 0.005 < dark.mean() < 0.9
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    assert columns[-1] - columns[0] > 400 or rows[-1] - rows[0] > 280  # fills the frame
    assert min(rows[0], 359 - rows[-1], columns[0], 479 - columns[-1]) > 10  # and stays inside
    red = pixels[..., 0] > pixels[..., 2] + 0.3
    assert red.sum() > 20  # slaves


def schema() -> etree.XMLSchema:
    """FMI 2.0.4 takes terminals and icons from FMI 3.0."""
    return etree.XMLSchema(etree.parse(str(Path(fmpy.__file__).parent / "schema/fmi3/fmi3TerminalsAndIcons.xsd")))


def test_one_terminal_for_each_master_and_slave(files):
    _, description, found = files
    root = etree.fromstring(found["terminalsAndIcons/terminalsAndIcons.xml"])
    valid = schema()
    assert valid.validate(root), valid.error_log
    expected = {}
    for variable in description.modelVariables:
        match = re.fullmatch(r"((?:master|slave)\[\d+\])\.(.+)", variable.name)
        if match:
            expected.setdefault(match[1], {})[match[2]] = variable.name
    terminals = {
        terminal.get("name"): {m.get("memberName"): m.get("variableName") for m in terminal}
        for terminal in root.iter("Terminal")
    }
    assert terminals == expected and len(terminals) == len(root.findall("Terminals/Terminal"))
    described = {variable.name: variable.description for variable in description.modelVariables}
    for terminal in root.iter("Terminal"):
        node = terminal.get("description").split(", ")[1]
        assert all(described[member.get("variableName")].endswith(f"({node})") for member in terminal)
        assert terminal.get("matchingRule") == "plug"


def test_licences_name_what_is_compiled_in(files):
    _, _, found = files
    text = found["documentation/licenses/license.txt"].decode()
    for part in ("tiefmu", "Eigen", "cereal", "FMI", "libstdc++"):
        assert part in text
    for name in re.findall(r"\w+\.txt", text):
        assert b"Copyright" in found[f"documentation/licenses/{name}"]
    assert found["documentation/licenses/tiefmu.txt"] == (Path(__file__).parents[1] / "LICENSE").read_bytes()


def table(data: bytes) -> np.ndarray:
    return np.genfromtxt(io.BytesIO(data), delimiter=",", names=True, deletechars="", replace_space=" ")


def whole(scene, folder: Path) -> Fmu:
    """With reference results."""
    return Fmu(tiefmu.build(tiefmu.load(scene), folder / "scene.fmu"), folder)


@pytest.mark.parametrize(
    "path",
    [p for p in SCENES if p.stem in ("spotweld", "rivet", "heavy_slave_split", "spinning")],
    ids=lambda path: path.stem,
)
def test_reference_results_are_what_the_fmu_answers(path, tmp_path):
    fmu = whole(path, tmp_path)
    inputs, outputs = (
        table((fmu.folder / "extra" / "tiefmu" / f"reference_{what}.csv").read_bytes()) for what in ("in", "out")
    )
    assert set(inputs.dtype.names[1:]) == set(fmu.names("input"))
    assert set(outputs.dtype.names[1:]) == set(fmu.names("output"))
    experiment = fmu.description.defaultExperiment
    step, rows = float(experiment.stepSize), np.array(inputs.tolist())
    np.testing.assert_array_equal(inputs["time"], outputs["time"])
    assert inputs["time"][0] == 0 and inputs["time"][-1] == pytest.approx(float(experiment.stopTime), rel=1e-12)
    each = round(inputs["time"][1] / step)
    instance = Instance(fmu).start(values=dict(zip(inputs.dtype.names[1:], rows[0, 1:])))
    names = outputs.dtype.names[1:]
    np.testing.assert_array_equal(instance.get(names), outputs[0].tolist()[1:])
    for n in range(each * (len(rows) - 1)):
        row, k = divmod(n, each)
        values = rows[row] + k / each * (rows[row + 1] - rows[row])
        assert instance.set(dict(zip(inputs.dtype.names[1:], values[1:]))) == OK
        assert instance.step(n * step, step) == OK, instance.log
        if k == each - 1:
            np.testing.assert_array_equal(instance.get(names), outputs[row + 1].tolist()[1:])
    assert any(np.ptp(outputs[name]) > 0 for name in names)
    instance.free()


@pytest.mark.parametrize("name", ["rivet", "heavy_slave", "spotweld"])
def test_reference_results_are_those_of_another_importer(name, tmp_path):
    """FMPy interpolates the inputs itself. Then they are held for as long again, which must do no harm."""
    fmu = whole(next(path for path in SCENES if path.stem == name), tmp_path)
    inputs, outputs = (
        table((fmu.folder / "extra" / "tiefmu" / f"reference_{what}.csv").read_bytes()) for what in ("in", "out")
    )
    experiment = fmu.description.defaultExperiment
    step, stop = float(experiment.stepSize), float(experiment.stopTime)
    result = fmpy.simulate_fmu(
        str(fmu.folder), stop_time=2 * stop, output_interval=step, input=inputs, output=outputs.dtype.names[1:]
    )
    each = round(outputs["time"][1] / step)
    for column in outputs.dtype.names[1:]:
        own = outputs[column]
        found = result[column][: each * len(own) : each]
        np.testing.assert_allclose(found[1:], own[1:], rtol=0, atol=1e-6 * np.abs(own).max() + 1e-12, err_msg=column)
        assert np.abs(result[column]).max() <= 10 * np.abs(own).max() + 1e-12, column


def test_reference_inputs_are_motions_and_loads_that_a_part_could_see(files):
    """From rest to rest; velocities add up to no way, and a turn by hundredths of a radian."""
    scene, description, found = files
    if len(description.modelVariables) > 2000:
        return  # has none: see test_large_scenes_have_no_reference_results
    inputs, outputs = (table(found[f"extra/tiefmu/reference_{what}.csv"]) for what in ("in", "out"))
    step = inputs["time"][1]
    for name in inputs.dtype.names[1:]:
        values = inputs[name] - (inputs[name][0] if ".r[" in name else 0)
        assert values[0] == values[-1] == 0 and np.ptp(values) > 0, name
        if ".v[" in name or ".w[" in name:
            assert abs(values.sum() * step) < 1e-3 * np.abs(values).sum() * step, name
    for name in outputs.dtype.names[1:]:
        if ".w[" in name and "spinning" not in scene.name:
            assert np.abs(outputs[name]).sum() * step < 0.5, name
    _ = description


def test_the_default_experiment_brings_no_warning(files, tmp_path):
    scene, description, _ = files
    fmu = Fmu(next(path for path in SCENES if path.stem == scene.name), tmp_path)
    instance = Instance(fmu, logging=True).start()
    assert instance.step(0.0, float(description.defaultExperiment.stepSize)) == OK
    assert [message for message in instance.log if message[2] != OK and message[3] == "logStability"] == []
    instance.free()


def test_large_scenes_have_no_reference_results(files):
    _, description, found = files
    assert ("extra/tiefmu/reference_in.csv" in found) == (len(description.modelVariables) <= 2000)


def test_a_scene_that_takes_many_substeps_has_no_reference_results(weld, monkeypatch):
    """Something spins there, and building would take minutes."""
    weld["node"][0]["motion"] = "free"
    weld["node"].append({"nodes": [1], "motion": "fixed"})
    weld["spring"] = [{"nodes": [1, 3], "stiffness": 1e4}]
    scene = tiefmu.load(weld)
    assert reference_results.reference(scene, 1e-3)
    assert reference_results.reference(scene, 10.0) == {}
    simulation, one = scene.simulation(), scene.simulation()
    with monkeypatch.context() as patch:
        patch.setattr(scene, "simulation", lambda: simulation)
        assert reference_results.reference(scene, 100.0) == {}
    one.initialise(0.0)
    one.step(100.0)
    assert simulation.evaluations < 1.1 * one.evaluations  # it has given up in the first step
    monkeypatch.setattr(reference_results, "MOST_EVALUATIONS", np.inf)
    assert reference_results.reference(scene, 10.0)


def test_a_build_imports_nothing_slow(weld, scene_file):
    code = (
        "import sys, tiefmu; tiefmu.build(tiefmu.load(sys.argv[1]), 'a.fmu'); "
        "print([m for m in ('matplotlib', 'fmpy', 'tqdm') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, scene_file(weld)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_scenes_that_cannot_be_run_have_no_reference_results(tmp_path):
    """At 9.2e18 m/s the face is stretched until a step would take 2e17 substeps."""
    scene = next(path for path in SCENES if path.stem == "spinning").read_text()
    assert scene.count("v = [1.0, 1.0, -0.2]") == 1
    (tmp_path / "fast.toml").write_text(scene.replace("v = [1.0, 1.0, -0.2]", "v = [9223372036854775808, 1.0, -0.2]"))
    fmu = tiefmu.build(tiefmu.load(tmp_path / "fast.toml"), tmp_path / "fast.fmu")
    assert not any("reference" in name for name in zipfile.ZipFile(fmu).namelist())


def test_ports_that_lose_their_motion_on_the_way_have_no_reference_results(tmp_path, monkeypatch):
    """The trial run moves so far that the places of the port's slaves are one place to rounding."""
    monkeypatch.setattr("tiefmu.content.reference_results.TRAVEL", 1e25)
    ports = Path(__file__).parent / "fuzz" / "corpus" / "scene" / "ports.toml"
    fmu = tiefmu.build(tiefmu.load(ports), tmp_path / "ports.fmu")
    assert not any("reference" in name for name in zipfile.ZipFile(fmu).namelist())
    monkeypatch.undo()
    fmu = tiefmu.build(tiefmu.load(ports), tmp_path / "ports.fmu")
    assert any("reference" in name for name in zipfile.ZipFile(fmu).namelist())
