"""Builds wheels of tiefmu for other systems, with the compiler of the PyPI wheel `ziglang`: see `make wheels`.

python cmake/build_wheels.py ZIG PYTHON...

ZIG: the folder of the package `ziglang`. PYTHON: interpreters with headers, e.g. python3.11. Those of 3.10 and 3.11
give a wheel for themselves, the first of 3.12 or later one for all from 3.12 on (the least stable ABI that nanobind can
use); for Windows there is only the latter. Each wheel holds the FMU libraries of all systems, which `make binaries` has
built. Writes dist/*.whl; the same sources and tools give the same bytes.
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from build_binaries import fail
from tiefmu.binaries import BUILT, CHECKOUT, is_stale, missing
from tiefmu.platforms import BY_FOLDER, PLATFORMS

TAGS = {"linux64": "manylinux_2_17_x86_64", "aarch64-linux": "manylinux_2_17_aarch64", "win64": "win_amd64"}
EPOCH = "315532800"  # 1980, the first date of an archive
WORK = CHECKOUT / "build" / "wheels"
STUBS = CHECKOUT / "build" / "python" / "stubs"  # from this system's module, as the others' cannot be run
VERSION = "import sys, sysconfig; print(sys.version_info[1], sysconfig.get_path('include'))"
BUILD = "import json, sys, scikit_build_core.build as b; b.build_wheel(sys.argv[1], json.loads(sys.argv[2]))"


def main(zig: Path, names: list[str]) -> int:
    if not (zig / "zig").is_file():
        return fail(f"{zig / 'zig'}: no such file; the package ziglang brings it")
    for platform in PLATFORMS:
        if is_stale(platform.folder):
            return fail(f"platform '{platform.folder}': {missing(platform.folder)}")
    pythons: dict[int, tuple[str, Path]] = {}  # minor version, 12 for all later -> program, headers
    for name in names:
        asked = subprocess.run([name, "-c", VERSION], capture_output=True, text=True) if shutil.which(name) else None
        if asked is None or asked.returncode != 0:
            print(f"{name}: not there, so no wheel for it")
            continue
        minor, include = asked.stdout.split(maxsplit=1)
        if not (Path(include.strip()) / "Python.h").is_file():
            print(f"{name}: without headers, so no wheel for it")
        elif int(minor) >= 10:
            pythons.setdefault(min(int(minor), 12), (name, Path(include.strip())))
    if not pythons:
        return fail(f"none of {', '.join(names)} is there with its headers")
    asked_for = [(folder, minor) for folder in TAGS for minor in sorted(pythons) if folder != "win64" or minor == 12]
    for folder, minor in asked_for:
        if status := build(folder, minor, *pythons[minor], zig.resolve()):
            return status
    return 0


def build(folder: str, minor: int, python: str, include: Path, zig: Path) -> int:
    platform = BY_FOLDER[folder]
    (target,) = platform.targets
    define = {
        "CMAKE_TOOLCHAIN_FILE": CHECKOUT / "cmake" / "zig.cmake",
        "TIEFMU_ZIG": zig / "zig",
        "TIEFMU_TARGET": target,
        "TIEFMU_PYTHON": "ON",
        "TIEFMU_BINARIES": BUILT,
        "TIEFMU_STUBS": STUBS,
        "Python_INCLUDE_DIR": include,
    }
    if platform.system == "windows":
        define |= for_windows(include, zig / "zig") | {"SKBUILD_SOSABI": ""}  # the module's name is without "abi3"
    # The folder of `make binaries`, where the solver is compiled already.
    settings = {"build-dir": f"build/zig/{target}", "wheel.reproducible": "true", "install.strip": "false"}
    if minor == 12:
        settings["wheel.py-api"] = "cp312"
    settings |= {f"cmake.define.{key}": str(value) for key, value in define.items()}
    environment = os.environ | {
        "_PYTHON_HOST_PLATFORM": TAGS[folder].replace("manylinux_2_17", "linux"),
        "SETUPTOOLS_EXT_SUFFIX": f".cpython-3{minor}-{platform.machine}-linux-gnu.so",
        "PYTHONPATH": os.pathsep.join([sysconfig.get_path("purelib"), str(WORK / "backports")]),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    made = WORK / "made"
    shutil.rmtree(made, ignore_errors=True)
    done = subprocess.run([python, "-c", BUILD, made, json.dumps(settings)], cwd=CHECKOUT, env=environment)
    if done.returncode != 0:
        return fail(f"{folder}, {python}: the build ended with status {done.returncode}")
    (wheel,) = made.glob("*.whl")
    retag = [sys.executable, "-m", "wheel", "tags", "--remove", "--platform-tag", TAGS[folder], wheel]
    subprocess.run(retag, check=True, env=os.environ | {"SOURCE_DATE_EPOCH": EPOCH})
    (CHECKOUT / "dist").mkdir(exist_ok=True)
    (wheel,) = made.glob("*.whl")
    shutil.move(wheel, CHECKOUT / "dist" / wheel.name)
    return 0


def for_windows(include: Path, compiler: Path) -> dict:
    """Headers as on Windows, and import libraries of python3.dll: the functions and variables of the stable ABI."""
    from abi3info import DATAS, FUNCTIONS

    work = WORK / "windows"
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(include, work / "include", ignore=shutil.ignore_patterns("pyconfig*.h"))
    shutil.copy(CHECKOUT / "cmake" / "windows" / "pyconfig.h", work / "include")
    names = [f"  {symbol.name}" for symbol in FUNCTIONS] + [f"  {symbol.name} DATA" for symbol in DATAS]
    (work / "python3.def").write_text("\n".join(["LIBRARY python3.dll", "EXPORTS", *sorted(names)]) + "\n")
    for library in ("python3.lib", "python312.lib"):  # the latter is only looked for
        words = [compiler, "dlltool", "-m", "i386:x86-64", "-d", work / "python3.def", "-l", work / library]
        subprocess.run(words, check=True)
    return {
        "Python_INCLUDE_DIR": work / "include",
        "Python_LIBRARY": work / "python312.lib",
        "Python_SABI_LIBRARY": work / "python3.lib",
    }


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
