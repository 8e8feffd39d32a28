"""A small sweep in files, and what it gives."""

from pathlib import Path

import pyarrow.parquet
from tiefmu.sweep import command, design, worker

SCENE = """
[mesh]
nodes = [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0], [9, 0.03, 0.06, 0.04]]
segments = [[1, 1, 2, 3, 4]]
[[node]]
nodes = "all"
motion = "free"
rotations = true
mass = 1.0
inertia = 1.0e-3
[[node]]
nodes = [9]
mass = 0.3
[[tie]]
name = "weld"
segments = "all"
slaves = [9]
[[spring]]
ground = [1, 2, 3, 4]
kind = "bushing"
stiffness = 1.0e5
rotational_stiffness = 1.0e6
"""
CRITERIA = """
[[limit]]
name = "peak"
signal = "slave[1].v"
at_most = 0.05
[[limit]]
name = "force"
signal = "master[*].f"
combine = "sum"
at_most = 1e9
"""
SWEEP = """
scene = "plate.toml"
criteria = "criteria.toml"
signals = ["slave[1].v[3]"]
[run]
input = "in.csv"
step = 1e-4
[[parameter]]
name = "mass"
scene = "node[2].mass"
values = [0.1, 0.3]
[[parameter]]
start = "integrator.safety"
from = 0.5
to = 0.9
count = 2
[[parameter]]
name = "load"
input = "slave[1].f[3]"
values = [0.5, 1.0, 2.0]
"""


def write() -> None:
    """Into the current folder."""
    Path("plate.toml").write_text(SCENE)
    Path("criteria.toml").write_text(CRITERIA)
    Path("sweep.toml").write_text(SWEEP)
    Path("in.csv").write_text("time,slave[1].f[3]\n0,0\n0.005,100\n0.01,0\n")


def rows(path="out.parquet"):
    return pyarrow.parquet.read_table(path).to_pylist()


def in_this_process(text) -> list[dict]:
    """The rows without dask, batch after batch."""
    Path("sweep.toml").write_text(text)
    sweep = design.read(Path("sweep.toml"))
    todo = design.cases(sweep, "sweep.toml")
    task = command.shared(sweep, Path(), "sweep.toml")
    raw, files = command.scene_of(sweep, Path())
    found = {}
    for batch in command.batched(sweep, todo):
        data = raw
        if isinstance(raw, dict):
            data = worker.build_variant(design.variant(raw, sweep, batch[0].values), files)
        found |= dict(worker.run_batch(data, task, [(case.number, case.values) for case in batch]))
    return [found[case.number] for case in todo]
