"""What `tiefmu sweep` costs beside a plain loop over the same cases: python bench/sweep.py [--cases 10000]

The spot weld of scenes/ over factors of its load, 200 steps a case, with a limit as criterion: the loop in this
process (one instance, reset between cases), and the sweep on 1 and on 2 workers without starting the cluster. CPU time
is that of all processes, so it says what a case costs also where others use the machine; the last column is its
difference to the loop.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from tiefmu.sweep import command, design, worker
from tiefmu.sweep.journal import Journal

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SWEEP = """
scene = "spotweld.toml"
criteria = "criteria.toml"
[run]
input = "spotweld.csv"
step = 1e-5
[[parameter]]
input = "*"
from = 0.5
to = 1.5
count = {cases}
"""
CRITERIA = '[[limit]]\nname = "reaction"\nsignal = "master[*].f"\ncombine = "sum"\nat_most = 1e9\n'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    cases = parser.parse_args().cases
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in ("spotweld.toml", "spotweld.csv"):
            (folder / file).write_bytes((SCENES / file).read_bytes())
        (folder / "sweep.toml").write_text(SWEEP.format(cases=cases))
        (folder / "criteria.toml").write_text(CRITERIA)
        sweep = design.read(folder / "sweep.toml")
        todo = design.cases(sweep, "sweep.toml")
        task = command.shared(sweep, folder, "sweep.toml")
        raw, files = command.scene_of(sweep, folder)
        fmu = worker.build_variant(raw, files)
        pairs = [(case.number, case.values) for case in todo]
        worker.run_batch(fmu, task, pairs[:10])
        began, used = time.perf_counter(), time.process_time()
        rows = dict(worker.run_batch(fmu, task, pairs))
        wall, loop = time.perf_counter() - began, time.process_time() - used
        print(f"{cases} cases, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
        print(f"{'':<10} {'wall, s':>9} {'CPU, s':>9} {'ms a case':>9}")
        print(f"plain loop {wall:9.2f} {loop:9.2f} {1e3 * loop / cases:9.3f}")
        for workers in (1, 2):
            journal = Journal(folder / f"{workers}.journal", "bench", resume=False)
            with command.client(None, workers) as connected:
                command.run_cases(connected, sweep, task, raw, files, todo[:200], cases, journal)  # imports, builds
                began, used = time.perf_counter(), cpu(connected)
                command.run_cases(connected, sweep, task, raw, files, todo, cases, journal)
                wall, used = time.perf_counter() - began, cpu(connected) - used
            journal.close()
            assert journal.rows == rows
            name = f"{workers} worker{'s' if workers > 1 else ' '}"
            print(f"{name:<10} {wall:9.2f} {used:9.2f} {1e3 * used / cases:9.3f} {1e3 * (used - loop) / cases:+9.3f}")


def cpu(connected) -> float:
    """CPU time of client, scheduler and workers, s."""
    return time.process_time() + sum(connected.run(time.process_time).values())


if __name__ == "__main__":
    main()
