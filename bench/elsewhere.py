"""Libraries of `make binaries` beside that of the local compiler: python bench/elsewhere.py [SYSTEM ...]

SYSTEM: linux64, debian11, win64 (under wine), aarch64-linux (under qemu-user, slow by its nature). The tests' host runs
panels of 8192 slaves on each, in turns. Prints ns of processor time per slave and cycle, best of the repeats, and in
brackets its ratio to the first. What it takes to start drops out: each run is taken with 2 steps and with 12.
"""

import resource
import sys
import tempfile
from pathlib import Path

import numpy as np
import tiefmu
from tiefmu import binaries

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from elsewhere import DEBIAN_11, answer_there, case, folder_of, path_there, unpacked, uri_there
from fmu_calls import Fmu
from test_threads import panel

REPEATS = 5
CYCLES = 100  # a step
RUNS = 4  # of each step, by the host
SLAVES = 8192
CYCLE = 1e-5  # s; nothing else limits it
PANELS = {
    name: panel(formulation, rotations, "free", integrator={"time_step": CYCLE}, model={"inertia": inertia})
    for name, formulation, rotations, inertia in (
        ("default", "default", False, "lumped"),
        ("default, rotations", "default", True, "lumped"),
        ("optimized", "optimized", True, "lumped"),
        ("default, consistent", "default", False, "consistent"),
    )
}


def main(systems: list[str]) -> None:
    print(f"{'ns per slave and cycle':<24}" + "".join(f"{name:>17}" for name in ["local", *systems]))
    for name, tables in PANELS.items():
        best = times(tiefmu.load(tables), systems)
        print(f"{name:<24}" + "".join(f"{each:>9.1f} ({each / best[0]:.2f})" for each in best), flush=True)


def times(scene: tiefmu.Scene, systems: list[str]) -> list[float]:
    room = DEBIAN_11 / "tmp" if "debian11" in systems else None
    with tempfile.TemporaryDirectory(dir=room) as text:
        folder = Path(text)
        kept, binaries.BUILT = binaries.BUILT, folder / "nowhere"
        fmu = Fmu(tiefmu.build(scene, folder / "local.fmu"), folder)
        binaries.BUILT = kept
        runs = [("linux64", fmu.binary)]
        for system in systems:
            built = tiefmu.build(scene, folder / f"{system}.fmu", platforms=[folder_of(system)])
            runs.append((system, unpacked(built, folder / system, system)))

        def seconds(system: str, library: Path, steps: int) -> float:
            place = path_there(system, library), uri_there(system, fmu.folder / "resources")
            lines = [place[0], fmu.description.guid, place[1]]
            outputs = fmu.names("output")[:3]
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            answer_there(system, folder, lines, case(fmu, [], np.empty((steps, 0)), CYCLES * CYCLE, outputs), 3)
            return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        found = [[seconds(*run, 12) - seconds(*run, 2) for run in runs] for _ in range(REPEATS)]
    return [1e9 * min(each) / (10 * RUNS * CYCLES * SLAVES) for each in zip(*found)]


if __name__ == "__main__":
    main(sys.argv[1:] or ["linux64"])
