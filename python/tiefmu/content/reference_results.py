"""Reference results: a short run of the scene with every input moving, for those who want to check an importer."""

import math

import numpy as np

from ..scene import Scene

MOST_VARIABLES = 2000
STEPS = 20
TRAVEL = 0.01  # of driven nodes, in parts of the scene's size; also their turn, rad
FOLDER = "extra/tiefmu"


def reference(scene: Scene, step: float) -> dict[str, bytes]:
    """reference_in.csv and reference_out.csv, or nothing where they would be large or the run fails. Row k of the
    inputs is set at its time; row k + 1 of the outputs is what the FMU answers after the step from there to the
    next."""
    variables = scene.start.variables
    if sum(len(block["numbers"]) * block["components"] for block in variables) > MOST_VARIABLES:
        return {}
    times = step * np.arange(STEPS + 1)
    inputs = signals(scene, times)
    outputs = [
        name
        for number, block in enumerate(variables)
        if block["causality"] == "output"
        for name in scene.start.variable_names(number)
    ]
    simulation = scene.simulation()
    answer = None
    rows = []
    try:
        for k in range(STEPS + 1):
            if inputs:
                simulation.set_values(list(inputs), np.array([values[k] for values in inputs.values()]))
            if k == 0:
                simulation.initialise(0.0)
            rows.append(simulation.get_values(outputs) if k == 0 else answer)
            if k < STEPS:
                simulation.step(step)
                answer = simulation.get_values(outputs)
    except RuntimeError:  # Diverged, or more substeps than any run could make
        return {}
    return {
        f"{FOLDER}/reference_in.csv": table(times, list(inputs), np.array(list(inputs.values())).T),
        f"{FOLDER}/reference_out.csv": table(times, outputs, np.array(rows)),
    }


def signals(scene: Scene, times: np.ndarray) -> dict[str, np.ndarray]:
    """Name -> values over time: a sine with a phase of its own for each node and direction; positions, velocities and
    accelerations are each other's derivatives."""
    nodes, slaves = (scene.model.report()[what] for what in ("nodes", "slaves"))
    size = float(np.ptp(nodes["position"], axis=0).max()) or 1.0
    mass = float(np.append(nodes["mass"], slaves["mass"]).mean())
    omega = 2 * math.pi / times[-1]
    force = mass * TRAVEL * size * omega**2 or 1.0
    amplitude = {
        "r": TRAVEL * size,
        "v": TRAVEL * size * omega,
        "a": TRAVEL * size * omega**2,
        "w": TRAVEL * omega,
        "z": TRAVEL * omega**2,
        "f": force,
        "t": force * size,
    }
    found = {}
    for number, block in enumerate(scene.start.variables):
        if block["causality"] != "input":
            continue
        names = scene.start.variable_names(number)
        kind = block["name"].removeprefix(block["prefix"] + ".").removesuffix("_ext")
        ahead = {"r": 0, "v": 1, "a": 2, "w": 1, "z": 2}.get(kind, 0) * math.pi / 2  # derivatives run ahead
        start = scene.simulation().get_values(names) if kind == "r" else np.zeros(3 * len(block["numbers"]))
        for k, name in enumerate(names):
            phase = 0.7 * (3 * int(block["numbers"][k // 3]) + k % 3) + ahead
            still = math.sin(phase) if kind == "r" else 0.0
            found[name] = start[k] + amplitude[kind] * (np.sin(omega * times + phase) - still)
    return found


def table(times: np.ndarray, header: list[str], values: np.ndarray) -> bytes:
    """CSV; every number reads back to the same double."""
    lines = [",".join(["time", *header])]
    for time, row in zip(times.tolist(), values.tolist() or [[]] * len(times)):
        lines.append(",".join(map(repr, [time, *row])))
    return ("\n".join(lines) + "\n").encode()
