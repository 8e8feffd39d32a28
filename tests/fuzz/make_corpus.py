"""Writes the corpus of the fuzzers: small resources and serialised states. Run it when a format version is raised.

python tests/fuzz/make_corpus.py
"""

import sys
import tempfile
from ctypes import byref, c_size_t, create_string_buffer
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import tiefmu  # noqa: E402
from fmu_calls import OK, Fmu, Instance  # noqa: E402
from fmu_scenes import SETTINGS, scene  # noqa: E402
from port_scenes import ported  # noqa: E402

SMALL = {
    "mesh": {
        "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.3, 0.6, 0.2]],
        "segments": [[1, 1, 2, 3, 4]],
    },
    "node": [{"nodes": "all", "motion": "free", "rotations": True, "mass": 1.0, "inertia": 0.1}],
    "tie": [{"name": "tie", "slaves": [101]}],
    "spring": [{"ground": [1, 2, 3, 4], "kind": "bushing", "stiffness": 100.0}],
    "model": {"inertia": "consistent"},
}


def serialised(instance: Instance) -> bytes:
    state, size = instance.save(), c_size_t()
    assert instance.call("SerializedFMUstateSize", state, byref(size)) == OK
    data = create_string_buffer(size.value)
    assert instance.call("SerializeFMUstate", state, data, size) == OK
    return data.raw


def main():
    resources, states = HERE / "corpus" / "resource", HERE / "corpus" / "state"
    for folder in (resources, states):
        folder.mkdir(parents=True, exist_ok=True)
    for number in (0, 3, 9, 16):
        model = tiefmu.load(scene(np.random.default_rng(number), *SETTINGS[number])).model
        (resources / f"many_sided_{number}.bin").write_bytes(model.resource("{fuzz}"))
    made = ported(np.random.default_rng(1), ("default", True, "consistent", "split", "finite"), motions="mixed")
    (resources / "ports.bin").write_bytes(tiefmu.load(made).model.resource("{fuzz}"))
    (resources / "small.bin").write_bytes(tiefmu.load(SMALL).model.resource("{fuzz}"))
    with tempfile.TemporaryDirectory() as folder:
        fmu = Fmu(SMALL, Path(folder))
        (HERE / "scene.bin").write_bytes((fmu.folder / "resources" / "scene.bin").read_bytes())
        instance = Instance(fmu)
        (states / "instantiated.bin").write_bytes(serialised(instance))
        instance.start()
        (states / "start.bin").write_bytes(serialised(instance))
        assert instance.step(0.0, 0.01) == OK
        (states / "running.bin").write_bytes(serialised(instance))
        instance.free()


if __name__ == "__main__":
    main()
