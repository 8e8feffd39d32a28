"""The packed FMU where it should not be, or not as it was packed: a message and no instance, or it just works."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
import tiefmu
from fmu_calls import ERROR, OK, Fmu, Instance


@pytest.fixture
def resources(fmu, tmp_path) -> Path:
    """A copy of the resource folder."""
    return Path(shutil.copytree(fmu.folder / "resources", tmp_path / "resources"))


def refused(fmu, folder: Path) -> str:
    instance = Instance(fmu, location=folder.as_uri())
    assert instance.component is None
    assert [message[2:4] for message in instance.log] == [(ERROR, "logStatusError")]
    assert "\n" not in instance.log[0][5]
    return instance.log[0][5]


def test_missing_folder(fmu, tmp_path):
    assert refused(fmu, tmp_path / "nowhere") == f"fmi2Instantiate: cannot read '{tmp_path / 'nowhere' / 'scene.bin'}'"


@pytest.mark.parametrize(
    "length, why",
    [
        (0, "not a scene of tiefmu"),
        (12, "not a scene of tiefmu"),
        (13, "cut short"),
        (30, "cut short"),
        (-1, " bytes instead of "),
    ],
)
def test_truncated_resource(fmu, resources, length, why):
    data = (resources / "scene.bin").read_bytes()
    (resources / "scene.bin").write_bytes(data[:length])
    assert why in refused(fmu, resources)


def test_swapped_resource(fmu, weld, tmp_path):
    other = Fmu(weld, tmp_path)
    message = refused(fmu, other.folder / "resources")
    assert fmu.description.guid in message and other.description.guid in message
    assert Instance(fmu, guid=other.description.guid).component is None


def test_another_file_in_place_of_the_resource(fmu, resources):
    (resources / "scene.bin").write_bytes(fmu.path.read_bytes())
    assert refused(fmu, resources).endswith("not a scene of tiefmu")


def test_a_folder_in_place_of_the_resource(fmu, resources):
    (resources / "scene.bin").unlink()
    (resources / "scene.bin").mkdir()
    refused(fmu, resources)


def test_what_an_instance_does_not_read_may_be_missing(fmu, resources):
    for file in resources.iterdir():
        if file.name != "scene.bin":
            file.unlink()
    instance = Instance(fmu, location=resources.as_uri()).start()
    assert instance.step(0, 0.01) == OK
    instance.free()


# A process of its own: it loses its folder, or the right to write.
RUN = """
import os, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from fmu_calls import OK, Fmu, Instance
fmu, where = Fmu(Path(sys.argv[2]), Path.cwd()), sys.argv[3]
if where == "deleted":
    os.mkdir("gone"); os.chdir("gone"); os.rmdir("../gone")
if where == "read-only":
    for path in [*fmu.folder.rglob("*"), fmu.folder]:
        path.chmod(0o555 if path.is_dir() else 0o444)
before = sorted(fmu.folder.rglob("*"))
instance = Instance(fmu).start()
assert instance.step(0, 0.01) == OK, instance.log
print(instance.get(fmu.names("output")).tolist())
instance.free()
assert sorted(fmu.folder.rglob("*")) == before, "wrote to its folder"
for path in [fmu.folder, *fmu.folder.rglob("*")]:
    path.chmod(0o755)
"""


@pytest.mark.parametrize("where", ["deleted", "read-only"])
def test_current_folder_deleted_or_nothing_to_write_to(fmu, where, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(Path(__file__).parent), str(fmu.path), where],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    instance = Instance(fmu).start()
    assert instance.step(0, 0.01) == OK
    assert json.loads(done.stdout) == instance.get(fmu.names("output")).tolist()
    instance.free()


@pytest.mark.parametrize("name", ["with blank", "100% %41 %zz", "Träger_ß_橋", "a#b?c=d&e", "plus+tilde~", "'quote\""])
def test_names_of_folders(weld, name, tmp_path):
    """Built into, unpacked by FMPy into, and run from a folder of that name."""
    folder = tmp_path / name
    folder.mkdir()
    path = tiefmu.build(tiefmu.load(weld), folder / f"{name}.fmu")
    unpacked = fmpy.extract(str(path), unzipdir=str(folder / "unpacked"))
    result = fmpy.simulate_fmu(
        unpacked, stop_time=0.01, output_interval=0.005, start_values={"master[1].v[3]": 1.0}, output=["slave[1].v[3]"]
    )
    assert (result["slave[1].v[3]"] > 0.1).all() and np.isfinite(result["slave[1].v[3]"]).all()
