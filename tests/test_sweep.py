"""`tiefmu sweep`: cases, rows against single runs, any number of workers, workers that die, going on."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import get_args

import numpy as np
import pyarrow.parquet
import pytest
import tiefmu
from tiefmu.cli import main
from tiefmu.run import run
from tiefmu.sweep import command, design, table, worker

SCENE = """
[mesh]
nodes = [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0], [9, 0.03, 0.06, 0.04]]
segments = [[1, 1, 2, 3, 4]]
[[node]]
nodes = "all"
motion = "free"
rotations = true
mass = 1.0
inertia = 1.0e-3
[[node]]
nodes = [9]
mass = 0.3
[[tie]]
name = "weld"
segments = "all"
slaves = [9]
[[spring]]
ground = [1, 2, 3, 4]
kind = "bushing"
stiffness = 1.0e5
rotational_stiffness = 1.0e6
"""
CRITERIA = """
[[limit]]
name = "peak"
signal = "slave[1].v"
at_most = 0.05
[[limit]]
name = "force"
signal = "master[*].f"
combine = "sum"
at_most = 1e9
"""
SWEEP = """
scene = "plate.toml"
criteria = "criteria.toml"
signals = ["slave[1].v[3]"]
[run]
input = "in.csv"
step = 1e-4
[[parameter]]
name = "mass"
scene = "node[2].mass"
values = [0.1, 0.3]
[[parameter]]
start = "integrator.safety"
from = 0.5
to = 0.9
count = 2
[[parameter]]
name = "load"
input = "slave[1].f[3]"
values = [0.5, 1.0, 2.0]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("plate.toml").write_text(SCENE)
    Path("criteria.toml").write_text(CRITERIA)
    Path("sweep.toml").write_text(SWEEP)
    Path("in.csv").write_text("time,slave[1].f[3]\n0,0\n0.005,100\n0.01,0\n")
    return tmp_path


def rows(path="out.parquet"):
    return pyarrow.parquet.read_table(path).to_pylist()


# --------------------------------------------------------------------------------------------------------------- cases


def case_values(text, folder) -> list[list]:
    (folder / "sweep.toml").write_text(text)
    return [case.values for case in design.cases(design.read(folder / "sweep.toml"), "sweep.toml")]


HEAD = 'scene = "plate.toml"\ncriteria = "criteria.toml"\n'
TWO = '[[parameter]]\nstart = "a"\nvalues = [1, 2]\n[[parameter]]\nstart = "b"\nfrom = 1\nto = 100\nscale = "log"\n'


def test_a_grid_and_a_list(folder):
    assert case_values(f"{HEAD}{TWO}count = 3\n", folder) == [
        [1, 1], [1, 10], [1, 100], [2, 1], [2, 10], [2, 100],
    ]  # fmt: skip
    assert case_values(f'{HEAD}[design]\nkind = "list"\n{TWO}count = 2\n', folder) == [[1, 1], [2, 100]]


def test_a_latin_hypercube_has_one_case_in_each_layer(folder):
    text = f'{HEAD}[design]\nkind = "latin-hypercube"\nsamples = 40\nseed = 7\n{TWO}'
    values = np.array(case_values(text, folder))
    assert values.tolist() == case_values(text, folder)
    assert np.sort(np.floor(np.log(values[:, 1]) / np.log(100) * 40)).tolist() == list(range(40))
    assert sorted(values[:, 0].tolist()) == [1] * 20 + [2] * 20
    assert values.tolist() != case_values(text.replace("seed = 7", "seed = 8"), folder)


# ---------------------------------------------------------------------------------------------------------------- rows


def test_rows_are_single_runs_for_any_number_of_workers(folder, capsys):
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "2"]) == 0
    assert "12 cases, " in capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == [
        "criteria.toml", "in.csv", "out.parquet", "plate.toml", "sweep.toml",
    ]  # fmt: skip
    two = rows()
    assert main(["sweep", "sweep.toml", "-o", "one.parquet", "--workers", "1"]) == 0
    assert Path("one.parquet").read_bytes() == Path("out.parquet").read_bytes()
    assert [row["case"] for row in two] == list(range(12))
    for row in (two[1], two[10]):  # built, loaded and run by hand
        scene = SCENE.replace("mass = 0.3", f"mass = {row['mass']}") + (
            f"[integrator]\nsafety = {row['integrator.safety']}\n"
        )
        Path("one.toml").write_text(scene)
        Path("one.csv").write_text(f"time,slave[1].f[3]\n0,0\n0.005,{100 * row['load']}\n0.01,0\n")
        fmu = tiefmu.build(tiefmu.load("one.toml"), "one.fmu")
        result, _ = run(fmu, None, 1e-4, Path("one.csv"))
        assert row["slave[1].v[3]"] == result["slave[1].v[3]"].tolist()
        assert row["time"] == result["time"].tolist()
        speed = np.sqrt(sum(result[f"slave[1].v[{k}]"] ** 2 for k in (1, 2, 3))).max()
        assert row["peak"] == pytest.approx(speed, rel=1e-14)
        assert row["passed"] == (speed <= 0.05)
        assert row["message"] == ""
    assert len({row["peak"] for row in two}) == 12
    assert {row["passed"] for row in two} == {True, False}


def in_this_process(text) -> list[dict]:
    """The rows without dask, batch after batch."""
    Path("sweep.toml").write_text(text)
    sweep = design.read(Path("sweep.toml"))
    todo = design.cases(sweep, "sweep.toml")
    task = command.shared(sweep, Path(), "sweep.toml")
    raw, files = command.scene_of(sweep, Path())
    found = {}
    for batch in command.batched(sweep, todo):
        data = raw
        if isinstance(raw, dict):
            data = worker.build_variant(design.variant(raw, sweep, batch[0].values), files)
        found |= dict(worker.run_batch(data, task, [(case.number, case.values) for case in batch]))
    return [found[case.number] for case in todo]


def test_a_case_that_diverges_is_a_row_with_its_message(folder):
    """And those after it are as if it had not been."""
    text = SWEEP.replace("[0.5, 1.0, 2.0]", "[0.5, 1e300, 2.0]")
    found = in_this_process(text)
    messages = [row["message"] for row in found]
    assert [bool(message) for message in messages] == [False, True, False] * 4
    assert messages[1].startswith("FMU: stopped at t = ")
    for clean, row in zip(in_this_process(SWEEP), found):
        assert row["message"] or row == clean


def test_a_variant_that_cannot_be_built_is_a_row_with_its_message(folder):
    found = in_this_process(SWEEP.replace("[0.1, 0.3]", "[0.1, -1.0]"))
    assert [row["message"] for row in found[6:]] == [
        "scene: node table 2: mass: -1 is negative; it must be 0 or more"
    ] * 6
    assert not any(row["message"] for row in found[:6])


def test_files_of_the_mesh_may_lie_anywhere(folder, tmp_path_factory):
    """Beside the sweep or not, and as what varies; workers write nothing outside their own folders."""
    far = tmp_path_factory.mktemp("far")
    plate = "*NODE\n1,0,0,0\n2,%s,0,0\n3,%s,0.1,0\n4,0,0.1,0\n9,0.03,0.06,0.04\n*ELEMENT, TYPE=S4\n1,1,2,3,4\n"
    (far / "plate.inp").write_text(plate % (0.1, 0.1))
    Path("wide.inp").write_text(plate % (0.2, 0.2))
    scene = SCENE.replace(SCENE[SCENE.index("nodes = [[") : SCENE.index("[[node]]")], 'file = "plate.inp"\n')
    Path("plate.toml").write_text(scene)
    before = {path: path.read_bytes() for path in [far / "plate.inp", Path("wide.inp")]}
    up = f"../{os.path.relpath(far, folder.parent)}/plate.inp"
    text = SWEEP.replace('"node[2].mass"', '"mesh.file"').replace(
        "[0.1, 0.3]", json.dumps([up, str(far / "plate.inp")])
    )
    same = in_this_process(text)
    assert not any(row["message"] for row in same)
    assert same[:6] == same[6:]
    wide = in_this_process(text.replace(json.dumps(up), '"wide.inp"'))
    assert wide[6:] == same[6:] and wide[0]["peak"] != same[0]["peak"]
    assert before == {path: path.read_bytes() for path in before}


def test_a_first_variant_that_cannot_be_built(folder, capsys):
    """Is a row as any other; that none of the first can be built is said at once."""
    Path("sweep.toml").write_text(SWEEP.replace("[0.1, 0.3]", "[-1.0, 0.3]"))
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1"]) == 0
    assert "12 cases, 4 failed their criteria, 6 stopped" in capsys.readouterr().out
    assert ["mass: -1 is negative" in row["message"] for row in rows()] == [True] * 6 + [False] * 6


def test_columns_of_several_types(tmp_path):
    """Numbers stay numbers, words words; what mixes them, and lists, are text that JSON reads back."""
    parameters = {"m": [1, 0.5], "w": ["a", "b"], "b": [True, False], "mixed": ["a", 1], "k": [[1, 2, 3], 4.0]}
    table.write(tmp_path / "out.parquet", parameters, [{"message": "", "x": 1.0}, {"message": "stopped"}])
    found = pyarrow.parquet.read_table(tmp_path / "out.parquet").to_pydict()
    assert (found["m"], found["w"], found["b"], found["x"]) == ([1.0, 0.5], ["a", "b"], [True, False], [1.0, None])
    assert [json.loads(text) for text in found["mixed"] + found["k"]] == ["a", 1, [1, 2, 3], 4.0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_in_place_of_a_scene(folder, fmi):
    tiefmu.build(tiefmu.load("plate.toml"), folder / "plate.fmu", fmi=fmi)
    text = SWEEP.replace("plate.toml", "plate.fmu").replace('scene = "node[2].mass"', 'start = "master[1].f_ext[3]"')
    found = in_this_process(text)
    assert len({row["peak"] for row in found}) == 12


def test_fmus_of_both_standards_give_the_same_table(folder):
    """By the command line. Of FMI 3.0 a start value is an element of an array, and others of it keep theirs."""
    text = SWEEP.replace('scene = "node[2].mass"', 'start = "master[1].f_ext[3]"')
    for fmi in (2, 3):
        tiefmu.build(tiefmu.load("plate.toml"), folder / f"{fmi}.fmu", fmi=fmi)
        Path("sweep.toml").write_text(text.replace("plate.toml", f"{fmi}.fmu"))
        assert main(["sweep", "sweep.toml", "-o", f"{fmi}.parquet", "--workers", "1"]) == 0
    tables = [pyarrow.parquet.read_table(f"{fmi}.parquet") for fmi in (2, 3)]
    assert tables[0].equals(tables[1])
    assert tables[0].num_rows == 12 and len(set(tables[0]["peak"].to_pylist())) == 12


def test_what_a_sweep_asks_of_an_fmu_of_arrays(folder, capsys):
    tiefmu.build(tiefmu.load("plate.toml"), folder / "plate.fmu", fmi=3)
    text = SWEEP.replace("plate.toml", "plate.fmu").replace('scene = "node[2].mass"', 'start = "master.f_ext"')
    Path("sweep.toml").write_text(text)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: sweep.toml: start 'master.f_ext': no input or parameter of the FMU; did you mean")
    assert "'master[" in said and said.count("\n") == 1
    Path("sweep.toml").write_text(SWEEP.replace("plate.toml", "plate.fmu"))
    assert main(["sweep", "sweep.toml", "-o", "out.parquet"]) == 2
    assert "an FMU has no scene" in capsys.readouterr().err


# ------------------------------------------------------------------------------------------------ going on, and death


def test_going_on_after_an_interruption(folder, monkeypatch, capsys):
    assert main(["sweep", "sweep.toml", "-o", "whole.parquet", "--workers", "1"]) == 0
    add = command.Journal.add

    def interrupted(journal, found):
        add(journal, found)
        if len(journal.rows) >= 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(command.Journal, "add", interrupted)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1"]) == 130
    journal = Path(".out.parquet.journal")
    done = len(journal.read_text().splitlines()) - 1
    assert 5 <= done < 12 and not Path("out.parquet").exists()
    journal.write_text(journal.read_text() + '[11, {"pe')  # cut in the middle of a line
    seen = []

    def counted(journal, found):
        seen.extend(found)
        add(journal, found)

    monkeypatch.setattr(command.Journal, "add", counted)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1", "--resume"]) == 0
    assert len(seen) == 12 - done
    assert Path("out.parquet").read_bytes() == Path("whole.parquet").read_bytes()
    assert not journal.exists()
    journal.write_text(json.dumps({"sweep": "another"}) + "\n")
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--resume"]) == 2
    assert "is of another sweep" in capsys.readouterr().err


def test_ctrl_c_says_how_to_go_on(folder):
    """As a terminal does it: to all processes of the sweep. One line, no traceback of a worker."""
    Path("sweep.toml").write_text(SWEEP.replace("[0.5, 1.0, 2.0]", str([0.1 * k for k in range(1, 601)])))
    sweep = subprocess.Popen(
        [sys.executable, "-m", "tiefmu.cli", "sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in a job in the background
    )
    try:
        wait_for(lambda: journal_rows() > 10 or sweep.poll() is not None)
        os.killpg(sweep.pid, signal.SIGINT)
        out, error = sweep.communicate(timeout=120)
    finally:
        if sweep.poll() is None:
            os.killpg(sweep.pid, signal.SIGKILL)
    assert (sweep.returncode, out) == (130, "")
    done = journal_rows()
    assert error == f"out.parquet: interrupted, {done} of 2400 cases are finished; --resume goes on with the others\n"


def test_finished_cases_are_not_thrown_away(folder, capsys):
    """Without --resume, with a damaged journal."""
    journal = Path(".out.parquet.journal")
    journal.write_text('{"sweep": "x"}\n[0, {"peak": 1.0, "message": ""}]\n')
    before = journal.read_bytes()
    assert main(["sweep", "sweep.toml", "-o", "out.parquet"]) == 2
    assert capsys.readouterr().err == (
        "error: .out.parquet.journal: holds 1 finished cases of an interrupted sweep; --resume goes on with them, "
        "without this file it starts anew\n"
    )
    for damaged in (b"\xff\n", b"[]\n", b"7\n", b'["x", {}]\n', b'[1, "x"]\n'):
        sweep = design.read(Path("sweep.toml"))
        raw, files = command.scene_of(sweep, Path())
        todo = design.cases(sweep, "sweep.toml")
        key = command.digest(command.shared(sweep, Path(), "sweep.toml"), raw, files, todo)
        journal.write_bytes(json.dumps({"sweep": key}).encode() + b"\n" + damaged)
        assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--resume"]) == 2
        assert capsys.readouterr().err == (
            "error: .out.parquet.journal: line 2: is damaged; remove it to lose but its case\n"
        )
        assert journal.read_bytes().endswith(damaged)
    journal.write_bytes(before)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--resume"]) == 2
    assert "is of another sweep" in capsys.readouterr().err
    assert journal.read_bytes() == before


def test_a_worker_that_is_killed_in_mid_sweep(folder):
    """Scheduler and workers are processes of their own; one worker dies at its first rows."""
    Path("sweep.toml").write_text(SWEEP.replace("[0.5, 1.0, 2.0]", str([0.1 * k for k in range(1, 61)])))
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    processes = [
        subprocess.Popen([*dask, "--port", "0", "--no-dashboard", "--scheduler-file", "scheduler.json"], **quiet)
    ]
    try:
        wait_for(lambda: Path("scheduler.json").exists() and Path("scheduler.json").read_text().endswith("}"))
        address = json.loads(Path("scheduler.json").read_text())["address"]
        start = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
        workers = [subprocess.Popen([*start, "--no-nanny"], **quiet) for _ in range(2)]
        processes += workers
        sweep = subprocess.Popen(
            [sys.executable, "-m", "tiefmu.cli", "sweep", "sweep.toml", "-o", "out.parquet", "--scheduler", address],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(sweep)
        wait_for(lambda: journal_rows() > 10)
        workers[0].send_signal(signal.SIGKILL)
        assert journal_rows() < 240 and sweep.poll() is None
        out, error = sweep.communicate(timeout=120)
        assert sweep.returncode == 0, error
        assert "240 cases" in out
    finally:
        for process in processes:
            process.kill()
            process.wait()
    found = rows()
    assert not any(row["message"] for row in found)
    for row, expected in zip(found, in_this_process(Path("sweep.toml").read_text())):
        assert {key: row[key] for key in expected} == expected


def journal_rows() -> int:
    path = Path(".out.parquet.journal")
    return len(path.read_text().splitlines()) - 1 if path.exists() else 0


def wait_for(holds, seconds=120.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_the_page_names_every_key():
    text = (Path(__file__).resolve().parents[1] / "docs" / "sweep.md").read_text()
    for model in (design.Sweep, *design.TABLES.values()):
        for key, field in model.model_fields.items():
            assert f"`{field.alias or key}`" in text, key
            for value in get_args(field.annotation):
                assert not isinstance(value, str) or f'`"{value}"`' in text, value


# --------------------------------------------------------------------------------------------------------------- errors

FIRST = '[[parameter]]\nstart = "integrator.safety"\n'
WRONG = [
    (HEAD, "holds no parameter; give at least one [[parameter]]"),
    (f'scene = "plate.toml"\n{FIRST}values = [1]', "gives no numbers; name criteria or signals"),
    (f"{HEAD}{FIRST}", "parameter 1: give values, or from and to"),
    (f"{HEAD}{FIRST}values = []", "parameter 1: values: is empty"),
    (f"{HEAD}{FIRST}values = ['x']", "parameter 1: values: expected numbers; only keys of the scene take words"),
    (f'{HEAD}{FIRST}input = "*"\nvalues = [1]', "parameter 1: give one of scene, start and input: what varies"),
    (f'{HEAD}{FIRST}from = 0\nto = 1\nscale = "log"', "parameter 1: scale = 'log': from must be more than 0"),
    (
        f"{HEAD}{FIRST}from = 0.1\nto = 1",
        "parameter 'integrator.safety': count: is missing; from and to need it, save in a Latin hypercube",
    ),
    (f"{HEAD}{FIRST}vales = [1]", "parameter 1: unknown key 'vales'; did you mean 'values'?"),
    (
        f"{HEAD}{FIRST}values = [1]\n{FIRST}values = [1]",
        "parameter 'integrator.safety': is given twice; name one of them otherwise",
    ),
    (
        f'{HEAD}[design]\nkind = "list"\n{TWO}count = 3',
        "design: a list needs as many values of each parameter, found a 2, b 3",
    ),
    (f'{HEAD}[design]\nkind = "latin-hypercube"\n{TWO}', "design: samples: is missing; a Latin hypercube needs their "
     "number"),
    (
        f'{HEAD}[[parameter]]\nscene = "node[3].mass"\nvalues = [1]',
        "parameter 'node[3].mass': no such table; known: 1, 2",
    ),
    (
        f'{HEAD}[[parameter]]\nscene = "node.mass"\nvalues = [1]',
        "parameter 'node.mass': there are 2 tables [[node]]; say which, as node[1].mass",
    ),
    (
        f'{HEAD}[[parameter]]\nscene = "mass"\nvalues = [1]',
        "parameter 'mass': expected TABLE.KEY or TABLE[NUMBER].KEY, as in node[2].mass",
    ),
    (
        f'{HEAD}[[parameter]]\nstart = "integrator.safty"\nvalues = [1]',
        "start 'integrator.safty': no input or parameter of the FMU; did you mean 'integrator.safety'?",
    ),
    (
        f'{HEAD}[run]\ninput = "in.csv"\n[[parameter]]\ninput = "slave[1].f[2]"\nvalues = [1]',
        "input 'slave[1].f[2]': no column of the input; did you mean 'slave[1].f[3]'?",
    ),
    (
        f'{HEAD}[[parameter]]\ninput = "*"\nvalues = [1, 2]',
        "input '*': there is no input to vary; name one in [run]",
    ),
    (
        f'scene = "plate.toml"\nsignals = ["slaves[1].v[3]"]\n{FIRST}values = [1]',
        "signals: 'slaves[1].v[3]': no such output; did you mean 'slave[1].v[3]'?",
    ),
    (
        f'{HEAD}[[parameter]]\nscene = "node[2].mass"\nvalues = [-1]',
        "case 0: scene: node table 2: mass: -1 is negative; it must be 0 or more",
    ),
    (
        f'{HEAD}{FIRST}name = "peak"\nvalues = [1]',
        "criterion 'peak': the table has a parameter of that name; name it otherwise",
    ),
    (
        f'{HEAD}{FIRST}name = "message"\nvalues = [1]',
        "parameter 'message': the table has a column of that name; name it otherwise",
    ),
    (
        f'{HEAD}signals = ["slave[1].v[3]"]\n{FIRST}name = "slave[1].v[3]"\nvalues = [1]',
        "parameter 'slave[1].v[3]': the table has a signal of that name; name it otherwise",
    ),
    (f'scene = "no.toml"\nsignals = ["x"]\n{FIRST}values = [1]', "no.toml: no such file beside it"),
]  # fmt: skip


@pytest.mark.parametrize("text, line", WRONG)
def test_wrong_sweeps(folder, capsys, text, line):
    Path("wrong.toml").write_text(text)
    before = sorted(folder.iterdir())
    assert main(["sweep", "wrong.toml", "-o", "out.parquet"]) == 2
    assert capsys.readouterr() == ("", f"error: wrong.toml: {line}\n")
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    "arguments, line",
    [
        (["no.toml", "-o", "out.parquet"], "no.toml: no such file"),
        (["sweep.toml", "-o", "out.txt"], "out.txt: a sweep is written as .parquet, .csv; the ending chooses"),
        (["sweep.toml", "-o", "out.csv"], "out.csv: signals over time need .parquet"),
        (["sweep.toml", "-o", "no/out.csv"], "no/out.csv: folder no does not exist"),
    ],
)
def test_wrong_files(folder, capsys, arguments, line):
    assert main(["sweep", *arguments]) == 2
    assert capsys.readouterr().err == f"error: {line}\n"


def test_a_missing_package_is_named_with_its_extra(folder, capsys, monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["sweep", "sweep.toml", "-o", "out.parquet"]) == 2
    assert (
        capsys.readouterr().err == "error: tiefmu sweep: needs the package distributed: pip install 'tiefmu[sweep]'\n"
    )
