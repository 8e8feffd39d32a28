"""Cases for the importers of tests/tools, and what a plain sequence of calls answers to them.

A case is what tests/tools/runner.py reads: FMUs, connections, inputs of every step, outputs, communication step.
"""

import json
import math
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import tiefmu
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

ROOT = Path(__file__).resolve().parents[1]
TOOLS = ROOT / "build" / "tools"
EXAMPLE = ROOT / "examples" / "host_and_tie"
STEP = 2**-9  # s: 1953125 ns, so that every clock, also one that counts nanoseconds, holds all times exactly
NODES = [(i, k) for i in range(1, 5) for k in range(1, 4)]


# FMPy's own callbacks hand messages to whatever logger was set last in this process, also when that is gone.
CALLBACKS = fmi2CallbackFunctions(
    fmi2CallbackLoggerTYPE(lambda *message: None),
    defaultCallbacks.allocateMemory,
    defaultCallbacks.freeMemory,
    defaultCallbacks.stepFinished,
    None,
)


def program(environment: str, name: str) -> str:
    """A program that `make test` has installed below build/tools. Raises where it has not."""
    path = TOOLS / environment / "bin" / name
    assert path.exists() and (TOOLS / environment / "installed").exists(), f"{path} is missing: run `make tools`"
    return str(path)


def call(*command, cwd=None, timeout=120) -> str:
    """Runs a command; its output. A failure shows the last lines."""
    done = subprocess.run([str(word) for word in command], cwd=cwd, capture_output=True, text=True, timeout=timeout)
    said = done.stdout + done.stderr
    assert done.returncode == 0, f"exit status {done.returncode}:\n" + "\n".join(said.splitlines()[-30:])
    return said


def run_tool(tool: str, case: dict, folder: Path) -> dict[str, np.ndarray]:
    """FMU -> outputs at the end of every step, as tests/tools/run_TOOL.py gets them."""
    question, answer = folder / f"{tool}.case.json", folder / f"{tool}.result.json"
    question.write_text(json.dumps(case))
    answer.unlink(missing_ok=True)
    environment = "cofmupy" if tool == "cofmupy" else "importers"
    call(program(environment, "python"), ROOT / "tests" / "tools" / f"run_{tool}.py", question, answer, cwd=folder)
    return {name: np.array(rows) for name, rows in json.loads(answer.read_text()).items()}


def plain(case: dict, exchange_first=True, read_last=False) -> dict[str, np.ndarray]:
    """FMU -> outputs at the end of every step of a plain sequence of calls: all FMUs step with the inputs of the
    communication point, then the connected values are passed on.

    exchange_first: values are also passed on during initialisation. read_last: outputs are read after the values are
    passed on, so that they belong to the new inputs.
    """
    slaves, references = {}, {}
    for name, path in case["fmus"].items():
        description = fmpy.read_model_description(path)
        references[name] = {v.name: v.valueReference for v in description.modelVariables}
        slaves[name] = FMU2Slave(
            instanceName=name,
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        slaves[name].instantiate(callbacks=CALLBACKS)
        slaves[name].setupExperiment(startTime=0.0)
        slaves[name].enterInitializationMode()
    rows = {name: [] for name in case["outputs"]}

    def exchange():
        values = [slaves[source].getReal([references[source][here]]) for source, here, _, _ in case["connections"]]
        for (_, _, target, there), value in zip(case["connections"], values):
            slaves[target].setReal([references[target][there]], value)

    def read():
        for name, outputs in case["outputs"].items():
            rows[name].append(slaves[name].getReal([references[name][v] for v in outputs]))

    if exchange_first:
        exchange()
    for slave in slaves.values():
        slave.exitInitializationMode()
    for k in range(case["steps"]):
        for name, inputs in case["inputs"].items():
            slaves[name].setReal([references[name][v] for v in inputs], [values[k] for values in inputs.values()])
        for name, slopes in case.get("derivatives", {}).items():
            slaves[name].setRealInputDerivatives(
                [references[name][v] for v in slopes], [1] * len(slopes), [values[k] for values in slopes.values()]
            )
        for slave in slaves.values():
            slave.doStep(k * case["step"], case["step"])
        if not read_last:
            read()
        exchange()
        if read_last:
            read()
    for slave in slaves.values():
        slave.terminate()
        slave.freeInstance()
    return {name: np.array(values) for name, values in rows.items()}


def same_bits(found: dict, expected: dict):
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert np.ptp(values, axis=0).min() > 0  # every output moves, so that zeros cannot pass
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def build(name: str, folder: Path) -> str:
    """The FMU of a scene of the example."""
    return str(tiefmu.build(tiefmu.load(EXAMPLE / f"{name}.toml"), folder / f"{name}.fmu"))


def python_host(folder: Path) -> str:
    """The host written in Python, packed by PythonFMU."""
    call(
        program("importers", "pythonfmu"),
        "build",
        "-f",
        ROOT / "tests" / "tools" / "sprung_host.py",
        "-d",
        folder,
        "--no-external-tool",
    )
    return str(folder / "SprungHost.fmu")


def tie_case(tie: str, steps=150) -> dict:
    """The tie alone: its masters' velocities and the force on its slave are given."""
    inputs = {f"master[{i}].v[{k}]": [math.sin(0.11 * n * k + i) for n in range(steps)] for i, k in NODES}
    inputs["slave[1].f[3]"] = [40.0 * math.cos(0.07 * n) for n in range(steps)]
    return {
        "fmus": {"tie": tie},
        "connections": [],
        "inputs": {"tie": inputs},
        "outputs": {"tie": [f"master[{i}].f[{k}]" for i, k in NODES] + [f"slave[1].v[{k}]" for k in (1, 2, 3)]},
        "step": STEP,
        "steps": steps,
    }


def coupled_case(host: str, tie: str, steps=150) -> dict:
    """Host and tie: velocities go one way, loads the other; a force pulls the slave to and fro."""
    return {
        "fmus": {"host": host, "tie": tie},
        "connections": [["host", f"master[{i}].v[{k}]", "tie", f"master[{i}].v[{k}]"] for i, k in NODES]
        + [["tie", f"master[{i}].f[{k}]", "host", f"master[{i}].f_ext[{k}]"] for i, k in NODES],
        "inputs": {"tie": {"slave[1].f[1]": [50.0 * math.sin(0.1 * n) for n in range(steps)]}},
        "outputs": {
            "host": [f"master[{i}].v[{k}]" for i, k in NODES],
            "tie": [f"master[{i}].f[{k}]" for i, k in NODES] + [f"slave[1].v[{k}]" for k in (1, 2, 3)],
        },
        "step": STEP,
        "steps": steps,
    }
