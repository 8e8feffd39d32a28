"""`tiefmu sweep`: cases, rows against single runs, any number of workers, wrong sweeps."""

import json
import os
from pathlib import Path
from typing import get_args

import numpy as np
import pyarrow.parquet
import pytest
import sweep_files
import tiefmu
from sweep_files import SCENE, SWEEP, in_this_process, rows
from tiefmu.cli import main
from tiefmu.run import run
from tiefmu.sweep import design, table


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweep_files.write()
    return tmp_path


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
    for row, alone in zip(two, in_this_process(SWEEP), strict=True):
        assert {key: row[key] for key in alone} == alone
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


def test_fmus_of_both_standards_in_place_of_a_scene(folder):
    """FMI 3.0 by the command line. There a start value is an element of an array, and others of it keep theirs."""
    text = SWEEP.replace('scene = "node[2].mass"', 'start = "master[1].f_ext[3]"')
    for fmi in (2, 3):
        tiefmu.build(tiefmu.load("plate.toml"), folder / f"{fmi}.fmu", fmi=fmi)
    expected = in_this_process(text.replace("plate.toml", "2.fmu"))
    Path("sweep.toml").write_text(text.replace("plate.toml", "3.fmu"))
    assert main(["sweep", "sweep.toml", "-o", "out.parquet", "--workers", "1"]) == 0
    for row, other in zip(rows(), expected, strict=True):
        assert {key: row[key] for key in other} == other
    assert len({row["peak"] for row in expected}) == 12


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
