"""The command line: what it prints, where it writes, how it ends."""

import csv
import json
import signal
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import tiefmu
from conftest import toml
from tiefmu import cli, package
from tiefmu.cli import main


@pytest.fixture
def free(weld) -> dict:
    """The masters free on ground springs, everything a demo checks exposed."""
    weld["node"] = [{"nodes": "all", "motion": "free", "mass": 1.0}, {"nodes": [101], "mass": 0.7}]
    weld["tie"][0]["formulation"] = "optimized"
    weld["spring"] = [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 1000.0}]
    weld["interface"] = {"expose": ["energy", "drift", "power_residual"]}
    return weld


def rows(path) -> tuple[list[str], np.ndarray]:
    with open(path, newline="") as file:
        header, *values = csv.reader(file)
    return header, np.array(values, float)


WARNING = (  # of the scene `weld`
    "warning: weld.toml: tie 'weld': slave 101: offset d = 0.04 m from segment 1, whose nodes have no rotations: the "
    'offset never turns and the moment d x F is lost; formulation = "optimized" carries both\n'
)


def test_run_warns_as_build_does(weld, scene_file, capsys):
    name = scene_file(weld)
    assert main(["build", name]) == 0
    assert capsys.readouterr().err == WARNING
    assert main(["run", name, "--stop-time", "0.01"]) == 0
    assert capsys.readouterr().err == WARNING


def test_build_counts_its_notes_and_says_where_they_are(weld, scene_file, capsys):
    weld["mesh"]["segments"].append([9, 1, 2, 1])
    weld["tie"][0]["segments"] = [1]
    name = scene_file(weld)
    assert main(["build", name]) == 0
    notes = tiefmu.report(tiefmu.load(name))["notes"]
    assert len(notes) == 1
    assert capsys.readouterr().out.splitlines()[1] == "1 note on the scene: tiefmu info weld.toml"


def test_errors_of_the_command_line_are_not_those_of_a_scene(free, tmp_path):
    scene = tiefmu.load(free)
    assert not issubclass(tiefmu.UsageError, tiefmu.SceneError)
    with pytest.raises(tiefmu.UsageError):
        tiefmu.build(scene, tmp_path / "no" / "weld.fmu")
    simulation = scene.simulation()
    simulation.initialise(0.0)
    with pytest.raises(tiefmu.StepTooLong):
        simulation.step(1e300)
    assert {tiefmu.Diverged, tiefmu.StepTooLong} <= set(RuntimeError.__subclasses__())


def test_build_names_the_fmu_after_the_scene(weld, scene_file, capsys, tmp_path):
    (tmp_path / "scenes").mkdir()
    name = scene_file(weld, "scenes/weld.toml")
    assert main(["build", name]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("weld.fmu: 1 tie, 1 slave, 4 masters, 0 points, 0 springs, ")
    assert said.err.startswith(f"warning: {name}: tie 'weld': slave 101: offset d = 0.04 m")
    assert zipfile.is_zipfile("weld.fmu")
    assert main(["build", name, "-o", "other.fmu"]) == 0
    assert (tmp_path / "other.fmu").read_bytes() == (tmp_path / "weld.fmu").read_bytes()


def test_build_of_many_variables_names_ports_as_the_cure(weld, scene_file, capsys):
    def said_with(slaves):
        ids = list(range(101, 101 + slaves))
        weld["mesh"]["nodes"][4:] = [[i, 0.1 * k / slaves, 0.05, 0.0] for k, i in enumerate(ids)]
        weld["tie"][0]["slaves"] = ids
        assert main(["build", scene_file(weld)]) == 0
        return capsys.readouterr()

    said = said_with(1662)  # 6 variables a slave, 7 a master
    assert ", 10000 variables, " in said.out and "ports" not in said.err
    said = said_with(1663)
    assert ", 10006 variables, " in said.out
    [line] = [line for line in said.err.splitlines() if "variables" in line]
    assert line.startswith("warning: weld.toml: interface: 10006 variables") and "'ports' in [interface]" in line


def test_build_shows_ten_warnings_of_a_kind(weld, scene_file, capsys):
    """40 slaves 0.003 beyond the edge of a square of 0.1, that is xi = 1.06."""
    ids = list(range(101, 141))
    weld["mesh"]["nodes"][4:] = [[i, 0.103, 0.1 * k / 40, 0.0] for k, i in enumerate(ids)] + [[900, 0.05, 0.05, 0.01]]
    weld["tie"][0]["slaves"] = [*ids, 900]
    name = scene_file(weld)
    assert main(["build", name]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert all("lies outside segment 1 (xi = 1.06" in line for line in lines[:10])
    assert lines[10] == "warning: weld.toml: 30 more like these: tiefmu info weld.toml --json"
    assert len(lines) == 12 and "slave 900: offset d = 0.01 m" in lines[11]
    assert main(["info", name]) == 0
    said = capsys.readouterr().out
    assert said.count("lies outside segment 1") == 20
    assert "\nwarning: 20 more like these (--json lists all)\nwarning: tie 'weld': slave 900: offset" in said
    assert main(["info", name, "--json"]) == 0
    assert capsys.readouterr().out.count("lies outside segment 1") == 40


def test_info_of_a_scene_and_of_its_fmu_are_the_same(weld, scene_file, capsys):
    name = scene_file(weld)
    assert main(["build", name]) == 0
    capsys.readouterr()
    assert main(["info", name, "--json"]) == main(["info", "weld.fmu", "--json"]) == 0
    one, two = map(json.loads, capsys.readouterr().out.splitlines())
    assert one == two == tiefmu.report(tiefmu.load(name))
    assert main(["info", "weld.fmu"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("weld.fmu: Spot weld on a quarter panel\n1 tie, 1 slave, 4 masters")
    for needed in (
        "tie 'weld': default formulation, search 'box' within 0.1 m",
        "-0.40000",
        "0.28000 -> 1: 0.196, 0",
        "stable  no limit",
        "nodal   no limit",
        "freedoms: 12 translations, 0 rotations",
        "warning: ",
    ):
        assert needed in text


@pytest.mark.parametrize("arguments", [["run", "weld.toml"], ["run", "weld.fmu"]])
def test_run_writes_csv_and_picture(weld, scene_file, capsys, tmp_path, arguments):
    main(["build", scene_file(weld)])
    (tmp_path / "in.csv").write_text("time,slave[1].f[3],master[1].v[3]\n0,0,1\n1,100,1\n")
    capsys.readouterr()
    assert main([*arguments, "--input", "in.csv", "--step", "0.25", "--output", "out.csv", "--plot", "out.png"]) == 0
    first, *figures = capsys.readouterr().out.splitlines()
    assert first == f"{arguments[1]}: 4 steps to t = 1 s, 15 outputs, wrote out.csv, wrote out.png"
    # the slave's 75 N at xi = -0.4, eta = 0.2: the fourth master has (1 - xi)(1 + eta)/4 = 0.42 of it
    assert figures[:4] == [
        "  largest reaction  31.5 N at master[4].f (node 4), t = 1 s",
        '  energy balance    not shown: expose = ["energy"] in [interface]',
        '  drift             not shown: expose = ["drift"] in [interface]',
        "  substeps          1 a step, by the limit at the start",
    ]
    assert figures[4].startswith("  wall time ") and len(figures) == 5
    header, values = rows("out.csv")
    assert header[0] == "time" and set(header[1:]) == {f"slave[1].v[{k}]" for k in (1, 2, 3)} | {
        f"master[{i}].f[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)
    }
    table = dict(zip(header, values.T))
    assert table["time"].tolist() == [0, 0.25, 0.5, 0.75, 1.0]
    # row k answers the inputs of the start of step k
    assert table["slave[1].v[3]"] == pytest.approx([0.28] * 5, abs=1e-14)
    assert table["master[1].f[3]"] == pytest.approx([0, 0, 7, 14, 21], abs=1e-12)
    assert sum(table[f"master[{i}].f[3]"] for i in (1, 2, 3, 4)) == pytest.approx([0, 0, 25, 50, 75], abs=1e-12)
    assert (tmp_path / "out.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_run_prints_a_summary_without_output_files(weld, scene_file, capsys):
    assert main(["run", scene_file(weld), "--stop-time", "0.01", "--step", "0.001"]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("weld.toml: 10 steps to t = 0.01 s, 15 outputs\n")
    assert "slave[1].v[1]" in said.out
    assert said.err == WARNING


def test_run_takes_the_default_experiment_of_the_fmu(free, scene_file, capsys):
    import fmpy

    main(["build", scene_file(free)])
    experiment = fmpy.read_model_description("weld.fmu").defaultExperiment
    assert main(["run", "weld.fmu", "--output", "out.csv"]) == 0
    values = rows("out.csv")[1]
    assert values[-1, 0] == pytest.approx(float(experiment.stopTime), rel=1e-12)
    assert values[1, 0] == pytest.approx(float(experiment.stepSize), rel=1e-12)


def test_a_time_given_twice_is_a_jump(weld, scene_file, tmp_path):
    (tmp_path / "in.csv").write_text("time,slave[1].f[3]\n0,0\n0.5,0\n0.5,100\n1,100\n")
    assert main(["run", scene_file(weld), "--input", "in.csv", "--step", "0.25", "--output", "out.csv"]) == 0
    header, values = rows("out.csv")
    force = sum(values[:, header.index(f"master[{i}].f[3]")] for i in (1, 2, 3, 4))
    assert dict(zip(values[:, 0], force.round(9))) == {0: 0, 0.25: 0, 0.5: 0, 0.75: 100, 1: 100}


INPUTS = {
    "unknown column": (
        "time,slave[1].g[3]\n0,0\n",
        "in.csv: column 'slave[1].g[3]': no such variable; did you mean 'slave[1].f[3]'?",
    ),
    "output": ("time,slave[1].v[3]\n0,0\n", "in.csv: column 'slave[1].v[3]' is no input but of causality output"),
    "repeated column": ("time,slave[1].f[3],slave[1].f[3]\n0,0,0\n", "in.csv: column 'slave[1].f[3]' is repeated"),
    "no time": ("t,slave[1].f[3]\n0,0\n", "in.csv: has no column 'time'; found t, slave[1].f[3]"),
    "time goes back": (
        "time,slave[1].f[3]\n0,0\n1,0\n\n0.5,0\n",
        "in.csv: line 5: time goes back from 1 to 0.5 s; times must not decrease",
    ),
    "text": ("time,slave[1].f[3]\n0,x\n", "in.csv: line 2: slave[1].f[3]: expected a number, found 'x'"),
    "nan": ("time,slave[1].f[3]\n0,nan\n", "in.csv: line 2: slave[1].f[3]: nan is not a finite number"),
    "short row": ("time,slave[1].f[3]\n0,0\n1\n", "in.csv: line 3: expected 2 values, found 1"),
    "empty": ("", "in.csv: is empty; expected a header with 'time' and names of columns"),
    "header only": ("time\n", "in.csv: has no values below its header"),
    "ends at the start": ("time,slave[1].f[3]\n0,0\n", "in.csv: stop time 0 s is not after start time 0 s"),
    "missing": (None, "in.csv: no such file"),
}


@pytest.mark.parametrize("case", INPUTS)
def test_wrong_inputs(weld, scene_file, capsys, tmp_path, case):
    text, line = INPUTS[case]
    name = scene_file(weld)
    if text is not None:
        (tmp_path / "in.csv").write_text(text)
    assert main(["run", name, "--input", "in.csv", "--output", "out.csv"]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", f"{WARNING}error: {line}\n")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    "arguments, line",
    [
        (["run", "no.fmu"], "no.fmu: no such file"),
        (["info", "no.fmu"], "no.fmu: no such file"),
        (["advise", "text.fmu"], "text.fmu: is an FMU; give the scene that it was built from"),
        (["info", "text.fmu"], "text.fmu: not an FMU (a zip archive)"),
        (["run", "text.fmu"], "text.fmu: not an FMU that FMPy can read: File is not a zip file"),
        (["info", "foreign.fmu"], "foreign.fmu: holds no resources/report.json, so it was not made by tiefmu"),
        (["info", "list.fmu"], "list.fmu: its resources/report.json is none of tiefmu"),
        (["info", "cut.fmu"], "cut.fmu: its resources/report.json is damaged"),
        (["info", "damaged.fmu"], "damaged.fmu: not an FMU (a zip archive)"),
        (["run", "damaged.fmu"], "damaged.fmu: cannot be unpacked: Bad CRC-32 for file 'resources/report.json'"),
        (["run", "weld.toml", "--output", "no/out.csv"], "no/out.csv: folder no does not exist"),
        (["run", "weld.toml", "--plot", "no/out.png"], "no/out.png: folder no does not exist"),
        (
            ["run", "weld.toml", "--output", "out.txt"],
            "out.txt: results are written as .csv, .parquet, .h5, .hdf5; the ending chooses",
        ),
        (["run", "weld.toml", "--plot", "out.gif"], "out.gif: pictures are written as .png, .svg; the ending chooses"),
        (["run", "exchange.fmu"], "exchange.fmu: not an FMU for co-simulation by FMI 2.0 or 3.0"),
        (["build", "weld.toml", "-o", "no/weld.fmu"], "no/weld.fmu: folder no does not exist"),
        (["build", "weld.toml", "-o", "folder"], "folder: is a folder"),
        (["demo", "--scenes", "folder"], "folder: no scenes here; give the folder with --scenes"),
    ],
)
def test_wrong_files(weld, scene_file, capsys, tmp_path, arguments, line):
    scene_file(weld)
    (tmp_path / "folder").mkdir()
    (tmp_path / "text.fmu").write_text("no archive")
    with zipfile.ZipFile(tmp_path / "foreign.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    with zipfile.ZipFile(tmp_path / "exchange.fmu", "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="m" guid="1"><ModelExchange modelIdentifier="m"/>'
            "<ModelVariables/><ModelStructure/></fmiModelDescription>",
        )
    with zipfile.ZipFile(tmp_path / "list.fmu", "w") as archive:
        archive.writestr("resources/report.json", "[]")
    with zipfile.ZipFile(tmp_path / "cut.fmu", "w") as archive:
        archive.writestr("resources/report.json", '{"slaves": [')
    xml = package.contents(tiefmu.load(weld))["modelDescription.xml"]
    with zipfile.ZipFile(tmp_path / "damaged.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.writestr("resources/report.json", '{"slaves": []}')
    (tmp_path / "damaged.fmu").write_bytes((tmp_path / "damaged.fmu").read_bytes().replace(b'{"slaves', b'{"salves'))
    before = sorted(tmp_path.rglob("*"))
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.splitlines()[-1]) == ("", f"error: {line}")
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "option, value",
    [("--step", "0"), ("--step", "-1"), ("--step", "x"), ("--stop-time", "nan"), ("--stop-time", "inf")],
)
def test_steps_and_times_must_be_positive(weld, scene_file, capsys, option, value):
    with pytest.raises(SystemExit) as stop:
        main(["run", scene_file(weld), f"{option}={value}"])
    assert stop.value.code == 2
    assert f"argument {option}: '{value}' is not a positive number" in capsys.readouterr().err


def test_a_run_that_diverges_says_where(free, scene_file, capsys):
    free["integrator"] = {"time_step": 1.0, "safety": 1.0}
    free["initial"] = [{"nodes": [1], "v": [0, 0, 1e12]}]
    assert main(["run", scene_file(free), "--stop-time", "1e3", "--step", "1"]) == 2
    said = capsys.readouterr()
    lines = [line for line in said.err.splitlines() if not line.startswith("warning: ")]
    assert len(lines) == 1 and lines[0].startswith("error: weld.toml: stopped at t = ")


def test_exit_statuses_of_the_process(weld, scene_file, process):
    name = scene_file(weld)
    good = process("build", name)
    assert good.returncode == 0 and good.stdout.startswith("weld.fmu: ")
    weld["tie"][0]["slaves"] = [999]
    bad = process("build", scene_file(weld))
    assert (bad.returncode, bad.stdout, bad.stderr) == (
        2,
        "",
        "error: weld.toml: tie 'weld': slaves: node 999 is not in the mesh (ids 1..101)\n",
    )
    nothing = process()
    assert nothing.returncode == 2 and "COMMAND" in nothing.stderr and "Traceback" not in nothing.stderr


def test_version(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"tiefmu {tiefmu.__version__}\n"


def test_interrupt_ends_quietly(monkeypatch, capsys):
    def interrupted(options):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "run_build", interrupted)
    assert main(["build", "weld.toml"]) == 130
    assert capsys.readouterr() == ("", "")


def test_interrupt_of_a_running_simulation(weld, scene_file, monkeypatch, capsys, tmp_path):
    import tqdm

    monkeypatch.setattr(tqdm.tqdm, "update", lambda bar, amount: signal.raise_signal(signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a test runner may ignore it in its workers
    try:
        assert main(["run", scene_file(weld), "--output", "out.csv"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr() == ("", WARNING)
    assert [path.name for path in tmp_path.iterdir()] == ["weld.toml"]


def test_reader_that_stops_reading(weld, scene_file, tmp_path):
    """As in `tiefmu info weld.toml --json | head -0`."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tiefmu.cli", "info", scene_file(weld), "--json"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 0


def test_demo(free, tmp_path, capsys):
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "free.toml").write_text(toml(free))
    (scenes / "free.csv").write_text("time,slave[1].f[3]\n0,10\n0.5,10\n")
    assert main(["demo", "--scenes", str(scenes), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "free" in said and "all checks held" in said
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["free.csv", "free.fmu", "free.png"]
    assert rows(tmp_path / "out" / "free.csv")[1][-1, 0] == pytest.approx(0.5)


def test_demo_says_in_words_what_it_checks():
    from tiefmu.demo import check
    from tiefmu.results import Kept

    def said(rows):
        names = ["slave[1].v[1]", "drift"]
        kept = Kept(names, dict.fromkeys(names, "1"), len(rows))
        kept.write(np.array(rows))
        return list(map(str, check(kept.result(0.0))))

    assert said([(0, 1, 1e-15), (1, 2, 2e-15)]) == ["finite values: yes", "offsets keep their length: yes (2.0e-15 m)"]
    assert said([(0, 1, 1e-15), (1, np.nan, 2e-15)])[0] == "finite values: NO, FAILED"
    assert said([(0, 1, 1e-15), (1, 1, 1e-3)])[1] == "offsets keep their length: NO, FAILED (1.0e-03 m)"


def test_demo_fails_where_a_check_fails(free, tmp_path, capsys, monkeypatch):
    from tiefmu import demo

    (tmp_path / "free.toml").write_text(toml(free))
    monkeypatch.setattr(demo, "check", lambda result: [demo.Check("finite values", False)])
    assert main(["demo", "--scenes", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "A CHECK FAILED" in capsys.readouterr().out


@pytest.mark.parametrize("version", [2, 3])
def test_many_variables_are_warned_of_where_they_are_scalars(weld, scene_file, monkeypatch, capsys, version):
    monkeypatch.setattr(sys.modules["tiefmu.report"], "MANY_VARIABLES", 10)
    scene_file(weld)
    assert main(["build", "weld.toml", "--fmi", str(version)]) == 0
    error = capsys.readouterr().err
    assert ("many importers and masters take minutes" in error, "'tiefmu build --fmi 3' makes arrays" in error) == (
        version == 2,
        version == 2,
    )
