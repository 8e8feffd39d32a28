"""Other people's tools on FMI 3.0 FMUs, bit by bit against FMPy's calls."""

import json
import math

import fmpy
import numpy as np
import pytest
import tiefmu
from fmpy.fmi3 import FMU3Slave
from tool_cases import EXAMPLE, ROOT, STEP, call, program

STEPS = 100


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmi3")


@pytest.fixture(scope="module")
def fmus(folder) -> dict[str, str]:
    return {
        name: str(tiefmu.build(tiefmu.load(EXAMPLE / f"{name}.toml", expose=["energy"]), folder / f"{name}.fmu", fmi=3))
        for name in ("host", "tie")
    }


class Slave:
    """By FMPy, arrays by name."""

    def __init__(self, path: str, validate=True):
        description = fmpy.read_model_description(path, validate=validate)
        self.array = {v.name: v for v in description.modelVariables}
        self.fmu = FMU3Slave(
            instanceName="slave",
            guid=description.instantiationToken,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate()
        self.fmu.enterInitializationMode()

    def get(self, name: str) -> list[float]:
        array = self.array[name]
        return self.fmu.getFloat64([array.valueReference], nValues=int(np.prod(array.shape or ())))

    def set(self, name: str, values) -> None:
        self.fmu.setFloat64([self.array[name].valueReference], values)

    def free(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def force(k: int) -> list[float]:
    return [50 * math.sin(0.1 * k), 0.0, 20.0]


@pytest.mark.parametrize("scene", ["host", "tie"])
def test_the_checks_of_the_toolbox(fmus, folder, scene):
    said = call(program("importers", "fmutool"), "-input", fmus[scene], "-check", cwd=folder)
    assert "compliant with FMI-3.0" in said and "No semantic error" in said
    assert "ERROR" not in said and "WARNING" not in said


def test_a_container_of_the_toolbox(fmus, folder):
    """Arrays connected to arrays: host and tie as one FMU of FMI 3.0, whose own description breaks the schema where an
    input is an array."""
    pair = {
        "name": "pair.fmu",
        "step_size": STEP,
        "fmu": ["host.fmu", "tie.fmu"],
        "link": [["host.fmu", "master.v", "tie.fmu", "master.v"], ["tie.fmu", "master.f", "host.fmu", "master.f_ext"]],
        "input": [["f", "tie.fmu", "slave.f"]],
        "output": [["tie.fmu", "slave.v", "out_v"]],
    }
    (folder / "pair.json").write_text(json.dumps(pair))
    words = ["-container", "pair.json", "-fmu-directory", folder, "-fmi", 3]
    quiet = ["-no-auto-link", "-no-auto-input", "-no-auto-output"]
    call(program("importers", "fmucontainer"), *words, *quiet, cwd=folder)
    container = Slave(str(folder / "pair.fmu"), validate=False)
    host, tie = (Slave(fmus[name]) for name in ("host", "tie"))

    def exchange():
        v, f = host.get("master.v"), tie.get("master.f")
        tie.set("master.v", v), host.set("master.f_ext", f)

    exchange()  # values pass at initialisation too
    for slave in (container, host, tie):
        slave.fmu.exitInitializationMode()
    found, expected = [], []
    for k in range(STEPS):
        container.set("f", force(k)), tie.set("slave.f", force(k))
        for slave in (container, host, tie):
            slave.fmu.doStep(k * STEP, STEP)
        found.append(container.get("out_v")), expected.append(tie.get("slave.v"))
        exchange()
    assert np.ptp(expected, axis=0)[[0, 2]].min() > 0
    np.testing.assert_array_equal(found, expected)
    for slave in (container, host, tie):
        slave.free()


def test_fmuloader(fmus, folder):
    """It sets arrays and gets scalars; its own get takes one value a variable."""
    answer = folder / "answer.json"
    case = {"fmu": fmus["host"], "array": "slave.f", "values": [force(k) for k in range(STEPS)], "step": STEP}
    case["scalars"] = ["energy.kinetic", "energy.strain", "stable_time_step"]
    (folder / "case.json").write_text(json.dumps(case))
    script = ROOT / "tests" / "tools" / "run_fmuloader_fmi3.py"
    call(program("importers", "python"), script, folder / "case.json", answer, cwd=folder)
    host, rows = Slave(fmus["host"]), []
    host.fmu.exitInitializationMode()
    for k in range(STEPS):
        host.set("slave.f", force(k))
        host.fmu.doStep(k * STEP, STEP)
        rows.append([host.get(name)[0] for name in case["scalars"]])
    host.free()
    assert np.ptp(rows, axis=0)[:2].min() > 0
    assert json.loads(answer.read_text()) == rows
