"""Runs a case with CoFMPy: all FMUs step, then the connected values are passed on (its method "jacobi")."""

import json
import sys
from pathlib import Path

from cofmupy import Coordinator
from runner import main


def simulate(case):
    connections = [
        {"source": {"id": source, "variable": here}, "target": [{"id": target, "variable": there}]}
        for source, here, target, there in case["connections"]
    ]
    for name, inputs in case["inputs"].items():
        for variable, values in inputs.items():
            stream = {
                "type": "literal",
                "interpolation": "previous",
                "values": {str(k * case["step"]): value for k, value in enumerate(values)},
            }
            connections.append({"source": stream, "target": [{"id": name, "variable": variable}]})
    config = Path(sys.argv[2]).with_suffix(".cofmupy.json")
    config.write_text(
        json.dumps(
            {
                "root": "",
                "cosim_method": "jacobi",
                "connections": connections,
                "fmus": [{"id": name, "path": path} for name, path in case["fmus"].items()],
            }
        )
    )
    coordinator = Coordinator()
    coordinator.start(str(config))
    rows = {name: [] for name in case["outputs"]}
    for _ in range(case["steps"]):
        coordinator.do_step(case["step"])
        answered = coordinator.master.get_outputs()
        for name, outputs in case["outputs"].items():
            rows[name].append([answered[name][v][0] for v in outputs])
    return rows


main(simulate)
