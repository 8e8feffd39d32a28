"""The wheels that `make wheels` builds: what they hold, and the demo in a fresh environment (make test-wheels)."""

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import tiefmu
from tiefmu.platforms import BY_FOLDER, PLATFORMS, here, library_of

pytestmark = pytest.mark.elsewhere

ROOT = Path(__file__).parents[1]
VERSION = re.search(r'^version = "(.+)"', (ROOT / "pyproject.toml").read_text(), re.M)[1]
WHEELS = sorted((ROOT / "dist").glob(f"tiefmu-{VERSION}-*.whl"))
TAGS = {"manylinux_2_17_x86_64": "linux64", "manylinux_2_17_aarch64": "aarch64-linux", "win_amd64": "win64"}
LOCAL = [path for path in WHEELS if here().folder == TAGS[path.stem.split("-")[4]]]
SCENES = sorted(path.stem for path in (ROOT / "scenes").iterdir() if path.suffix in (".toml", ".rad"))


def test_there_is_a_wheel_for_every_system():
    assert {path.stem.split("-")[4] for path in WHEELS} == set(TAGS)


@pytest.mark.parametrize("wheel", WHEELS, ids=lambda path: path.stem)
def test_content(wheel):
    python, abi, tag = wheel.stem.split("-")[2:]
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        assert len(set(names)) == len(names)
        for platform in PLATFORMS:
            data = archive.read(f"tiefmu/binaries/{platform.kept}/tiefmu{platform.suffix}")
            system, machines = library_of(data)
            assert system == platform.system and platform.machine in machines
            for part in ("libcxx", "libunwind", "zig"):
                assert f"tiefmu/binaries/{platform.kept}/licenses/{part}.txt" in names
        assert "tiefmu/binaries/win64/licenses/mingw-w64.txt" in names
        assert {Path(name).stem for name in names if re.fullmatch(r"tiefmu/scenes/\w+\.(toml|rad)", name)} == set(
            SCENES
        )
        assert not [name for name in names if "made-from" in name or name.endswith((".pyc", "binaries/tiefmu.so"))]
        module = [name for name in names if re.match(r"tiefmu/_core\.", name)]
        platform = BY_FOLDER[TAGS[tag]]
        own = {"windows": "_core.pyd"}.get(
            platform.system,
            "_core.abi3.so" if abi == "abi3" else f"_core.cpython-{python[2:]}-{platform.machine}-linux-gnu.so",
        )
        assert module == [f"tiefmu/{own}"]
        assert library_of(archive.read(module[0])) == (platform.system, {platform.machine})
        metadata = archive.read(f"tiefmu-{VERSION}.dist-info/WHEEL").decode()
        assert f"Tag: {python}-{abi}-{tag}\n" in metadata.replace("\r", "")
    if platform.system == "linux":
        done = subprocess.run([sys.executable, "-m", "auditwheel", "show", wheel], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        said = " ".join(done.stdout.split())
        assert f'consistent with the following platform tag: "{tag}"' in said, said
    if abi == "abi3":
        done = subprocess.run([sys.executable, "-m", "abi3audit", "--strict", "--report", wheel], capture_output=True)
        assert done.returncode == 0, done.stdout
        (found,) = json.loads(done.stdout)["specs"].values()
        assert found["wheel"] and not [each for each in found["wheel"] if not each["result"]["is_abi3"]]


def pythons(wheel: Path) -> list[str]:
    """Interpreters here that it is for."""
    python, abi, _ = wheel.stem.split("-")[2:]
    minors = range(12, 20) if abi == "abi3" else [int(python[3:])]
    found = [shutil.which(f"python3.{minor}") for minor in minors]
    return [
        path
        for path in found
        if path and subprocess.run([path, "-c", ""], stderr=subprocess.DEVNULL).returncode == 0  # pyenv's may not
    ]


# The GUID is a hash of nearly all; the reference results are what the wheel's own module computed.
SAME = ["modelDescription.xml", "resources/scene.bin", "resources/report.json", "extra/tiefmu/reference_out.csv"]


def held(path: Path) -> dict[str, bytes]:
    """Large scenes have no reference results."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in SAME if name in archive.namelist()}


def path_of(scene: str) -> Path:
    return next(path for path in (ROOT / "scenes").glob(f"{scene}.*") if path.suffix in (".toml", ".rad"))


@pytest.mark.parametrize("wheel", LOCAL, ids=lambda path: path.stem)
def test_demo_in_a_fresh_environment(wheel, tmp_path):
    """Without a compiler in reach, and away from the checkout. The FMUs are those that the checkout builds, but for the
    libraries of further systems."""
    able = pythons(wheel)
    assert able, f"no Python for {wheel.name}"
    for k, python in enumerate(able):
        room = tmp_path / str(k)
        subprocess.run([python, "-m", "venv", room], check=True)
        environment = {"PATH": str(room / "bin"), "HOME": str(tmp_path), "LANG": "C.UTF-8"}
        environment |= {key: value for key, value in os.environ.items() if key.lower().endswith(("proxy", "index_url"))}

        def run(*words, room=room, environment=environment) -> str:
            done = subprocess.run(words, cwd=room, env=environment, capture_output=True, text=True)
            assert done.returncode == 0, done.stdout + done.stderr
            return done.stdout

        run(room / "bin" / "python", "-m", "pip", "install", "--quiet", "--only-binary", ":all:", wheel)
        said = run(room / "bin" / "tiefmu", "demo", "--out", "out")
        assert said.splitlines()[-1] == "all checks held; FMUs, results and pictures are in out"
        assert [line.split()[0] for line in said.splitlines()[1:-1]] == SCENES
        for name in SCENES:
            here_built = tiefmu.build(tiefmu.load(path_of(name)), tmp_path / "here.fmu")
            assert held(room / "out" / f"{name}.fmu") == held(here_built)
        every = ",".join(platform.folder for platform in PLATFORMS)
        scene = next((room / "lib").glob("python3*/site-packages/tiefmu/scenes/spotweld.toml"))
        run(room / "bin" / "tiefmu", "build", scene, "-o", "all.fmu", "--platforms", every)
        for file, folders in (("out/spotweld.fmu", {"linux64", "win64"}), ("all.fmu", set(BY_FOLDER))):
            with zipfile.ZipFile(room / file) as archive:
                found = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
            assert found == folders
