"""What `[model] solver_tolerance` costs: the two tables of docs/accuracy.md.

python bench/solver_tolerance.py [--seconds S]   S: how long each time of a step is looked for
"""

import argparse
import time

import numpy as np
import tiefmu

FORMS = {
    "default": {"formulation": "default", "rotations": False},
    "rotations": {"formulation": "default", "rotations": True},
    "optimized": {"formulation": "optimized", "rotations": False},
}
TOLERANCES = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8]


def panel(form: str, side: int, each: int, slave_mass: float, model: dict, apart: bool = False) -> dict:
    """side x side quads of 1 m, masters of 1 kg, `each` slaves a quad. apart: the quads share no node."""
    i, j = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    masters = np.stack([i, j, 0.1 * ((i + j) % 2)], axis=-1).reshape(-1, 3).astype(float)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.stack([corner, corner + 1, corner + side + 2, corner + side + 1], axis=-1)
    if apart:
        masters = masters[quads].reshape(-1, 3)
        quads = np.arange(len(masters)).reshape(-1, 4)
    i, j = np.meshgrid(np.arange(side), np.arange(side))
    height = np.full(side * side, 0.05 if form == "default" else 0.35)
    places = [
        np.stack([i.ravel() + 0.3 + 0.4 * (k % 2), j.ravel() + 0.3 + 0.4 * (k // 2), height], -1) for k in range(each)
    ]
    position = np.vstack([masters, np.stack(places, axis=1).reshape(-1, 3)])
    ids, m = np.arange(1, len(position) + 1), len(masters)
    inertia = 0.0 if form == "default" else 0.1
    rotations = FORMS[form]["rotations"]
    return {
        "mesh": {
            "nodes": [[int(number), *map(float, p)] for number, p in zip(ids, position)],
            "segments": [[k + 1, *map(int, ids[quad])] for k, quad in enumerate(quads)],
        },
        "node": [
            {"nodes": ids[:m].tolist(), "motion": "free", "rotations": rotations, "mass": 1.0, "inertia": inertia},
            {"nodes": ids[m:].tolist(), "mass": slave_mass, "inertia": inertia * slave_mass},
        ],
        "tie": [
            {
                "name": "panel",
                "segments": "all",
                "slaves": ids[m:].tolist(),
                "formulation": FORMS[form]["formulation"],
                "search_distance": 1.5,
            }
        ],
        "model": model,
    }


def tumbling(form: str, ratio: float, tolerance: float, step: float | None = None) -> tiefmu.Scene:
    """A panel of 12 x 12 quads on springs along its edges and diagonals. ratio: slaves of a quad over a node."""
    model = {"inertia": "consistent", "solver_tolerance": tolerance}
    scene = panel(form, 12, 4, ratio / 4, model)
    ids = scene["node"][0]["nodes"]
    place = {row[0]: np.array(row[1:]) for row in scene["mesh"]["nodes"]}
    n, row = len(ids), 13
    pairs = [
        *([a, a + 1] for a in range(n) if (a + 1) % row),
        *([a, a + row] for a in range(n - row)),
        *([a, a + row + 1] for a in range(n - row) if (a + 1) % row),
        *([a, a + row - 1] for a in range(n - row) if a % row),
    ]
    scene["spring"] = [{"nodes": [ids[a], ids[b]], "stiffness": 100.0} for a, b in pairs]
    centre, spin = np.mean([place[k] for k in ids], axis=0), np.array([0.2, -0.1, 0.3])
    turning = {"w": spin.tolist()} if FORMS[form]["rotations"] else {}
    scene["initial"] = [
        {
            "nodes": [k],
            "v": (
                np.cross(spin, place[k] - centre) + 0.3 * np.sin(np.array([0.5, 1.0, 1.5]) * (place[k] @ [1, 0.7, 0.3]))
            ).tolist(),
        }
        | turning
        for k in ids
    ]
    scene["integrator"] = {"time_step": step} if step else {}
    scene["interface"] = {"expose": ["energy"]}
    return tiefmu.load(scene)


def motion(form: str, ratio: float, tolerance: float, step: float, end: float) -> tuple[np.ndarray, float]:
    """(velocities at twenty times, largest change of the energy over its start)"""
    run = tiefmu.Simulation(tumbling(form, ratio, tolerance, step).model)
    run.initialise(0.0)

    def energy() -> float:
        return run.get_values(["energy.kinetic", "energy.strain"]).sum()

    start, velocity, drift = energy(), [], 0.0
    for _ in range(20):
        run.step(end / 20)
        velocity.append(run.get("velocity").copy())
        drift = max(drift, abs(energy() / start - 1))
    return np.array(velocity), drift


def errors() -> str:
    columns = [(form, ratio) for form in ("rotations", "optimized") for ratio in (1.0, 4.0)]
    rows = {f"{tolerance:.0e}".replace("e-0", "e-"): [] for tolerance in TOLERANCES}
    own, drift, loose, looser = [], [], [], []
    for form, ratio in columns:
        step = 0.3 * tumbling(form, ratio, 1e-12).start.integrator_limit
        end = 400 * step
        exact, kept = motion(form, ratio, 1e-12, step, end)
        fine, _ = motion(form, ratio, 1e-12, step / 2, end)
        size = np.linalg.norm(exact)
        own.append(np.linalg.norm(exact - fine) * 4 / 3 / size)  # of second order
        drift.append(kept)
        for row, tolerance in zip(rows.values(), TOLERANCES):
            velocity, lost = motion(form, ratio, tolerance, step, end)
            row.append(np.linalg.norm(velocity - exact) / size)
            if tolerance == 1e-4:
                loose.append(lost)
            if tolerance == 1e-2:
                looser.append(lost)
    rows |= {"the step's own error": own, "drift at 1e-12": drift, "drift at 1e-4": loose, "drift at 1e-2": looser}
    head = [f"{form}, r = {ratio:.0f}" for form, ratio in columns]
    return table(["`solver_tolerance`", *head], [[name, *(f"{x:.1e}" for x in row)] for name, row in rows.items()])


class Cycle:
    """A step and its outputs, with loads that stay or change sign before every step."""

    def __init__(self, scene: dict, jumping: bool):
        scene["integrator"] = {"time_step": 1e-6}
        self.run = tiefmu.Simulation(tiefmu.load(scene).model)
        force, loads = self.run.get("slave_force"), self.run.get("node_force")
        self.run.set("slave_force", (1e-3 * (np.arange(force.size) % 7)).reshape(force.shape))
        self.loads = (1e-4 * (np.arange(loads.size) % 5)).reshape(loads.shape)
        self.jumping = jumping
        self.run.set("node_force", self.loads)
        self.run.initialise(0.0)

    def __call__(self) -> float:
        if self.jumping:
            self.loads = -self.loads
            self.run.set("node_force", self.loads)
        start = time.process_time()
        self.run.step(1e-6)
        self.run.update_outputs()
        return time.process_time() - start


def ratio(seconds: float, jumping: bool, tolerance: float, *shape, **options) -> float:
    """Least time over that of lumped inertia, taken in turns."""
    models = [{"inertia": "lumped"}, {"inertia": "consistent", "solver_tolerance": tolerance}]
    cycles = [Cycle(panel(*shape, model, **options), jumping) for model in models]
    best, end = [np.inf, np.inf], time.monotonic() + seconds
    while time.monotonic() < end:
        best = [min(least, cycle()) for least, cycle in zip(best, cycles)]
    return best[1] / best[0]


def times(seconds: float) -> str:
    rows = []
    for each in (1, 4):
        side = round(np.sqrt(4000 / each))
        for jumping, word in ((False, "smooth"), (True, "jumping")):
            found = [ratio(seconds, jumping, 1e-4, form, side, each, 1.0, apart=True) for form in FORMS]
            rows.append([f"segments apart, {each} slaves each, {word}", *(f"{x:.2g}" for x in found)])
    for tolerance, jumping, word in ((1e-4, False, "smooth"), (1e-4, True, "jumping"), (1e-12, True, "jumping")):
        found = [[ratio(seconds, jumping, tolerance, form, 32, 4, mass) for mass in (0.25, 1.0)] for form in FORMS]
        rows.append(
            [f"surface, r = 1 and 4, {tolerance:.0e}, {word}", *(f"{one:.2g}, {four:.2g}" for one, four in found)]
        )
    return table(["", *FORMS], rows)


def table(head: list[str], rows: list[list[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0)
    options = parser.parse_args()
    print(errors(), times(options.seconds), sep="\n\n")


if __name__ == "__main__":
    main()
