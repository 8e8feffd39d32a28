"""The FMU's functions in a program of their own (tests/calls), built with sanitizers: the first report ends it.

The builds stay in build/sanitizers and build/threads. They take minutes: `make sanitize` runs this, and CI, but not
`make test`.
"""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from fmi3_calls import functions
from fmu_calls import MODEL_EXCHANGE
from fmu_scenes import ALL_FREE, DRIVEN, MIXED, SETTINGS, scene
from port_scenes import ported

pytestmark = pytest.mark.sanitizers
ROOT = Path(__file__).resolve().parents[1]
SEQUENCES = int(os.environ.get("TIEFMU_SEQUENCES", 2000))
# Of FMI 3.0: what this FMU has none of, and what is an empty call for that reason.
ABSENT = (
    "ConfigurationMode Interval Shift DiscreteStates EventMode StepMode ContinuousTime Integrator SetTime Partition"
)
TYPES = ["Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "UInt64", "Boolean", "Binary", "Clock"]
EMPTY = {f"fmi3{access}{kind}" for access in ("Get", "Set") for kind in TYPES} | {"fmi3SetInt64", "fmi3SetString"}
NEVER_ALLOWED = {
    2: {"fmi2" + name for name in ["CancelStep", *MODEL_EXCHANGE]},
    3: {
        name
        for name in functions()
        if any(word in name for word in [*ABSENT.split(), "ContinuousState", "EventIndicators"])
    },
}
NEVER_REFUSED = {2: {"fmi2Reset"}, 3: {"fmi3Reset", "fmi3GetNumberOfVariableDependencies"} | EMPTY - {"fmi3SetInt32"}}
FUNCTIONS = {2: 40, 3: len(functions()) - 5}  # but those that make an instance or free it, and the version
SHARE = {2: 2, 3: 8}  # of the sequences, so that both take about as long


def program(preset: str) -> Path:
    bin = Path(sys.executable).parent
    settings = {
        "cwd": ROOT,
        "env": os.environ | {"PATH": f"{bin}{os.pathsep}{os.environ['PATH']}"},
        "capture_output": True,
        "text": True,
    }
    for command in (
        [bin / "cmake", "--preset", preset, f"-DPython_EXECUTABLE={sys.executable}"],
        [bin / "cmake", "--build", "--preset", preset],
    ):
        done = subprocess.run(command, **settings)
        assert done.returncode == 0, done.stdout + done.stderr
    return ROOT / "build" / preset / "tiefmu_calls"


def packed(folder: Path, made: dict) -> Path:
    """A packed scene, as the FMU finds it."""
    folder.mkdir()
    model = tiefmu.load(made).model
    (folder / "scene.bin").write_bytes(model.resource(f"{{{folder.name}}}"))
    return folder


@pytest.fixture
def folders(tmp_path) -> list[Path]:
    return [
        *(
            packed(tmp_path / name, scene(np.random.default_rng(1), *settings))
            for name, settings in (("mixed", MIXED), ("free", ALL_FREE), ("driven", DRIVEN))
        ),
        ports(tmp_path),
    ]


def ports(folder: Path) -> Path:
    settings = ("default", True, "consistent", "split", "finite")
    return packed(folder / "ports", ported(np.random.default_rng(1), settings, motions="mixed"))


def run(program: Path, *arguments) -> str:
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, f"{program.name} {' '.join(map(str, arguments))}: {done.stderr[-4000:]}"
    return done.stdout


def test_addresses_and_undefined_behaviour(folders, tmp_path):
    calls = program("sanitizers")
    corpus = ROOT / "tests" / "fuzz" / "corpus"
    run(calls, "resources", *sorted((corpus / "resource").iterdir()))
    run(calls, "serialised", corpus.parent / "scene.bin", *sorted((corpus / "state").iterdir()))
    for fmi in (2, 3):
        run(calls, "states", fmi, *folders)
        run(calls, "failures", fmi, *(folders if fmi == 2 else folders[2:]))
        run(calls, "leaks", fmi, 500, *folders)
    scenes = [
        packed(tmp_path / str(number), scene(np.random.default_rng(1), *settings))
        for number, settings in enumerate(SETTINGS)
    ] + [folders[-1]]
    for fmi in (2, 3):
        table = list(csv.DictReader(run(calls, "sequences", fmi, SEQUENCES // SHARE[fmi], 1, *scenes).splitlines()))
        assert len(table) == FUNCTIONS[fmi]
        for row in table:  # sequences that get nowhere would prove nothing
            name = row["function"]
            assert (int(row["good"]) > 0) == (name not in NEVER_ALLOWED[fmi]), row
            assert (int(row["refused"]) > 0) == (name not in NEVER_REFUSED[fmi]), row
        print(f"{SEQUENCES // SHARE[fmi]} sequences by FMI {fmi}", *(",".join(row.values()) for row in table), sep="\n")


def test_two_instances_in_two_threads(folders):
    calls = program("threads")
    for fmi in (2, 3):
        run(calls, "threads", fmi, *folders)
