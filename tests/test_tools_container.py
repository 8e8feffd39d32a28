"""The FMU Manipulation Toolbox: its checks of an FMU, and FMUs packed into one."""

import json
import shutil
import zipfile

import numpy as np
import pytest
from tool_cases import EXAMPLE, NODES, STEP, build, call, plain, program, same_bits, tie_case

MOVED = [f"master[{i}].v[{k}]" for i, k in NODES]
ANSWERS = [f"master[{i}].f[{k}]" for i, k in NODES] + [f"slave[1].v[{k}]" for k in (1, 2, 3)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("container")


@pytest.mark.parametrize("scene", sorted(EXAMPLE.glob("*.toml"), key=str), ids=lambda path: path.stem)
def test_its_checks_pass(scene, folder):
    said = call(program("importers", "fmutool"), "-input", build(scene.stem, folder), "-check", cwd=folder)
    assert "compliant with FMI-2.0" in said and "No semantic error" in said
    assert "ERROR" not in said and "WARNING" not in said


def test_its_checks_fail_for_a_description_that_is_wrong(folder):
    """So that passing them means something: an output left out of the model structure."""
    good, bad = build("tie", folder), folder / "bad.fmu"
    with zipfile.ZipFile(good) as source, zipfile.ZipFile(bad, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "modelDescription.xml":
                start = data.index(b"<Unknown", data.index(b"<Outputs>"))
                data = data[:start] + data[data.index(b">", start) + 1 :]
            target.writestr(name, data)
    with pytest.raises(AssertionError, match="is not listed in <Outputs>"):
        call(program("importers", "fmutool"), "-input", bad, "-check", cwd=folder)


def packed(description: dict, folder) -> str:
    """The container that fmucontainer makes of FMUs in the folder."""
    (folder / "pair.json").write_text(json.dumps(description))
    call(
        program("importers", "fmucontainer"),
        "-container",
        "pair.json",
        "-fmu-directory",
        folder,
        "-no-auto-link",
        "-no-auto-input",
        "-no-auto-output",
        cwd=folder,
    )
    return str(folder / description["name"])


def test_a_container_of_two_ties(folder):
    """The slave of the first moves the masters of the second."""
    first, second = folder / "first.fmu", folder / "second.fmu"
    for fmu in (first, second):
        shutil.copy(build("tie", folder), fmu)
    alone = tie_case(str(first))
    inputs = alone["inputs"]["tie"]
    links = [(f"slave[1].v[{k}]", f"master[{i}].v[{k}]") for i, k in NODES]
    container = packed(
        {
            "name": "pair.fmu",
            "step_size": STEP,
            "fmu": [first.name, second.name],
            "link": [[first.name, here, second.name, there] for here, there in links],
            "input": [[name, first.name, name] for name in inputs],
            "output": [[fmu.name, name, f"{fmu.stem}_{name}"] for fmu in (first, second) for name in ANSWERS],
        },
        folder,
    )

    outputs = [f"{fmu.stem}_{name}" for fmu in (first, second) for name in ANSWERS]
    found = plain({**alone, "fmus": {"pair": container}, "inputs": {"pair": inputs}, "outputs": {"pair": outputs}})
    expected = plain(
        {
            **alone,
            "fmus": {"first": str(first), "second": str(second)},
            "inputs": {"first": inputs},
            "connections": [["first", here, "second", there] for here, there in links],
            "outputs": {"first": ANSWERS, "second": ANSWERS},
        }
    )
    same_bits(found, {"pair": np.hstack([expected["first"], expected["second"]])})
