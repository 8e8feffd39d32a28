"""The example host_and_tie.ssp: well-formed, the same bytes again, and run by the importers that read SSP."""

import importlib.util
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import get_connections, read_ssd
from tool_cases import EXAMPLE, call, coupled_case, plain, program, run_tool, same_bits

specification = importlib.util.spec_from_file_location("build_ssp", EXAMPLE / "build_ssp.py")
build_ssp = importlib.util.module_from_spec(specification)
specification.loader.exec_module(build_ssp)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("ssp")


@pytest.fixture(scope="module")
def ssp(folder) -> str:
    return str(build_ssp.build(folder / "host_and_tie.ssp"))


@pytest.fixture(scope="module")
def case(ssp, folder) -> dict:
    """The FMUs of the system, coupled as the system says; nothing else drives them: the part drops into its springs."""
    with zipfile.ZipFile(ssp) as archive:
        archive.extractall(folder)
    case = coupled_case(str(folder / "resources" / "host.fmu"), str(folder / "resources" / "tie.fmu"))
    case["inputs"] = {}
    return case


def test_the_same_bytes_again(ssp, folder):
    again = build_ssp.build(folder / "again.ssp")
    assert again.read_bytes() == Path(ssp).read_bytes()


def test_the_structure_is_valid_and_complete(ssp, case):
    """FMPy validates it against the schemas of SSP 1.0."""
    system = read_ssd(ssp, validate=True).system
    assert [part.name for part in system.elements] == ["host", "tie"]
    found = {(a.parent.name, a.name, b.parent.name, b.name) for a, b in get_connections(system)}
    assert found == set(map(tuple, case["connections"]))


def test_omsimulator_finds_its_step(ssp):
    """Its command line aborts without; where it stands is what OMSimulator writes itself. Not run here."""
    with zipfile.ZipFile(ssp) as archive:
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    names = {"ssd": build_ssp.SSP1 + "Description", "ssc": build_ssp.SSP1 + "Common", "oms": build_ssp.OMS}
    path = (
        "ssd:System/ssd:Annotations/ssc:Annotation[@type='org.openmodelica']/oms:Annotations/oms:SimulationInformation"
    )
    master = root.find(f"{path}/oms:FixedStepMaster", names)
    assert float(master.get("stepSize")) == build_ssp.STEP


def test_fmpy_runs_it(ssp, case):
    rows = simulate_ssp(ssp, stop_time=case["steps"] * case["step"], step_size=case["step"])
    found = {part: np.transpose([rows[f"{part}.{name}"] for name in names]) for part, names in case["outputs"].items()}
    same_bits(found, plain(case, exchange_first=False))


@pytest.mark.parametrize("tool, order", [("libcosim", {}), ("ecos", {"read_last": True})])
def test_importers_run_it(tool, order, ssp, case, folder):
    same_bits(run_tool(tool, {**case, "ssp": ssp, "connections": []}, folder), plain(case, **order))


def test_a_container_of_it_runs(ssp, case, folder):
    """The FMU Manipulation Toolbox packs the system into one FMU, which shows the connected values."""
    call(
        program("importers", "fmucontainer"),
        "-container",
        f"host_and_tie.ssp:{case['step']}",
        "-fmu-directory",
        folder,
        cwd=folder,
    )
    sources = [(part, name) for part, name, _, _ in case["connections"]]
    found = plain(
        {
            **case,
            "fmus": {"both": str(folder / "host_and_tie.fmu")},
            "connections": [],
            "outputs": {"both": [f"{part}.{name}" for part, name in sources]},
        }
    )
    expected = plain(case)
    same_bits(
        found, {"both": np.transpose([expected[part][:, case["outputs"][part].index(name)] for part, name in sources])}
    )
