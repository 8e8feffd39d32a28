"""Reference results: the default experiment with every input moving, for those who want to check an importer.

Only sums and products of doubles here: the same bytes on every machine, which NumPy's sines are not.
"""

import numpy as np

from ..scene import Scene

MOST_VARIABLES = 2000
ROWS = 50
STEPS = 20  # communication steps of the default experiment between two rows
MOST_EVALUATIONS = 100  # for a communication step, on average; for a single one, those of all between two rows
TRAVEL = 0.01  # of driven nodes, in parts of the scene's size; also their turn, rad
FOLDER = "extra/tiefmu"


def reference(scene: Scene, step: float) -> dict[str, bytes]:
    """reference_in.csv and reference_out.csv, or nothing where they would be large, the run fails, or it takes
    so many substeps that building would take minutes: something spins there, and no importer would be checked by it.

    step: communication step of the default experiment, s, which is ROWS * STEPS of it long. The inputs are linear
    between their rows, those of a communication point set before the step from there. The outputs are what the FMU
    answers at the end of the step that reaches their time; those of time 0 belong to the inputs of time 0.
    """
    variables = scene.start.variables
    if sum(len(block["numbers"]) * block["components"] for block in variables) > MOST_VARIABLES:
        return {}
    inputs = signals(scene, ROWS * STEPS * step)
    names, table = list(inputs), np.array(list(inputs.values())).reshape(len(inputs), -1).T
    outputs = [
        name
        for number, block in enumerate(variables)
        if block["causality"] == "output"
        for name in scene.start.variable_names(number)
    ]
    simulation = scene.simulation()
    try:
        if names:
            simulation.set_values(names, table[0])
        simulation.initialise(0.0)
        rows = [simulation.get_values(outputs)]
        for row in range(ROWS):
            for k in range(STEPS):
                if names:
                    simulation.set_values(names, table[row] + k / STEPS * (table[row + 1] - table[row]))
                before = simulation.evaluations
                simulation.step(step)
                if simulation.evaluations > min(MOST_EVALUATIONS * ROWS * STEPS, before + MOST_EVALUATIONS * STEPS):
                    return {}
            rows.append(simulation.get_values(outputs))
    except RuntimeError:  # Diverged, or more substeps than any run could make
        return {}
    times = STEPS * step * np.arange(ROWS + 1)
    return {
        f"{FOLDER}/reference_in.csv": csv(times, names, table),
        f"{FOLDER}/reference_out.csv": csv(times, outputs, np.array(rows)),
    }


def signals(scene: Scene, duration: float) -> dict[str, np.ndarray]:
    """Name -> values at the rows: a pulse of its own for each node and direction, from rest to rest. Positions,
    velocities and accelerations are each other's derivatives. Loads would move a mean mass by about TRAVEL of the
    scene's size, and turn a mean inertia by TRAVEL, if nothing held them."""
    nodes, slaves = (scene.model.report()[what] for what in ("nodes", "slaves"))
    size = float(np.ptp(nodes["position"], axis=0).max()) or 1.0
    mass, inertia = (float(np.append(nodes[key], slaves[key]).mean()) for key in ("mass", "inertia"))
    force = 5 * mass * TRAVEL * size / duration**2 or 1.0
    amplitude = {"f": force, "t": 5 * inertia * TRAVEL / duration**2 or 0.1 * force * size}
    for kind, order in (("r", 0), ("v", 1), ("a", 2)):
        amplitude[kind] = TRAVEL * size / duration**order
    for kind, order in (("w", 1), ("z", 2)):
        amplitude[kind] = TRAVEL / duration**order
    found = {}
    for number, block in enumerate(scene.start.variables):
        if block["causality"] != "input":
            continue
        names = scene.start.variable_names(number)
        kind = block["name"].removeprefix(block["prefix"] + ".").removesuffix("_ext")
        start = scene.start.get_values(names) if kind == "r" else np.zeros(3 * len(block["numbers"]))
        for k, name in enumerate(names):
            which = 3 * int(block["numbers"][k // 3]) + k % 3
            found[name] = start[k] + amplitude[kind] * pulse(which)[{"v": 1, "a": 2, "w": 1, "z": 2}.get(kind, 0)]
    return found


def pulse(which: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """gain (4 s (1 - s))^4 (1 + skew (2 s - 1)) at the rows, s from 0 to 1, and its first two derivatives by s."""
    gain = (1 if which % 2 else -1) * (0.5 + (53 * which % 11) / 20)
    skew = (37 * which % 21 - 10) / 10
    s = np.arange(ROWS + 1) / ROWS
    q, dq, tilt = 4 * s * (1 - s), 4 - 8 * s, 1 + skew * (2 * s - 1)
    return (
        gain * (q * q * q * q * tilt),
        gain * (4 * q * q * q * dq * tilt + 2 * skew * q * q * q * q),
        gain * (12 * q * q * dq * dq * tilt - 32 * q * q * q * tilt + 16 * skew * q * q * q * dq),
    )


def csv(times: np.ndarray, header: list[str], values: np.ndarray) -> bytes:
    """Every number reads back to the same double."""
    lines = [",".join(["time", *header])]
    for time, row in zip(times.tolist(), values.tolist() or [[]] * len(times)):
        lines.append(",".join(map(repr, [time, *row])))
    return ("\n".join(lines) + "\n").encode()
