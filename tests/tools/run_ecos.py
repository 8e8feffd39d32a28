"""Runs a case with Ecos: all FMUs step, then the connected values are passed on."""

import ctypes
import sys
from pathlib import Path

# Before ecospy, whose library needs it and would look for it in the system's folders only.
ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation, EcosSimulationStructure  # noqa: E402
from runner import main  # noqa: E402


def simulate(case):
    if "ssp" in case:
        return run(case, EcosSimulation(case["step"], ssp_path=case["ssp"]))
    with EcosSimulationStructure() as structure:
        for name, path in case["fmus"].items():
            structure.add_model(name, path)
        for source, here, target, there in case["connections"]:
            structure.make_real_connection(f"{source}::{here}", f"{target}::{there}")
        return run(case, EcosSimulation(case["step"], structure=structure))


def run(case, simulation):
    rows = {name: [] for name in case["outputs"]}
    with simulation:
        assert simulation.init()
        for k in range(case["steps"]):
            for name, inputs in case["inputs"].items():
                for variable, values in inputs.items():
                    simulation.set_real(f"{name}::{variable}", values[k])
            simulation.step()
            for name, outputs in case["outputs"].items():
                rows[name].append([simulation.get_real(f"{name}::{v}") for v in outputs])
        simulation.terminate()
    return rows


main(simulate)
