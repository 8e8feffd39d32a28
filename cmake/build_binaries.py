"""Builds the FMU's library for other systems, with the compiler of the PyPI wheel `ziglang`: see `make binaries`.

python cmake/build_binaries.py ZIG PLATFORM...

ZIG: the folder of the package `ziglang`. Writes build/binaries/PLATFORM. What is there already and made from the same
sources stays.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from tiefmu.binaries import BUILT, CHECKOUT, is_stale, source_hash
from tiefmu.platforms import BY_FOLDER, library_of

# What each library holds of the compiler's own parts.
LICENSES = {"libcxx.txt": "lib/libcxx/LICENSE.TXT", "libunwind.txt": "lib/libunwind/LICENSE.TXT"}
WINDOWS_LICENSES = {"mingw-w64.txt": "lib/libc/mingw/COPYING"}


def main(zig: Path, names: list[str]) -> int:
    unknown = [name for name in names if name not in BY_FOLDER]
    if unknown:
        return fail(f"platform '{unknown[0]}' is unknown; known: {', '.join(BY_FOLDER)}")
    zig = zig.resolve()
    compiler = zig / ("zig.exe" if os.name == "nt" else "zig")
    if not compiler.is_file():
        return fail(f"{compiler}: no such file; the package ziglang brings it")
    for name in names:
        if not is_stale(name):
            print(f"{name}: as it is in {BUILT / name}")
        elif status := build(name, zig, compiler):
            return status
    return 0


def build(name: str, zig: Path, compiler: Path) -> int:
    platform, began = BY_FOLDER[name], time.perf_counter()
    folder = CHECKOUT / "build" / "zig" / name
    setting_up = ["cmake", "-S", CHECKOUT, "-B", folder, "-G", "Ninja"]
    setting_up += [f"-DCMAKE_TOOLCHAIN_FILE={CHECKOUT / 'cmake' / 'zig.cmake'}", f"-DTIEFMU_ZIG={compiler}"]
    setting_up += [f"-DTIEFMU_TARGET={platform.target}", "-DTIEFMU_PYTHON=OFF", "-DCMAKE_BUILD_TYPE=Release"]
    setting_up += [f"-DPython_EXECUTABLE={sys.executable}"]
    for command in (
        setting_up,
        ["cmake", "--build", folder, "--target", "tiefmu_fmu", "-j", os.environ.get("JOBS", "2")],
    ):
        if (status := subprocess.run(list(map(str, command))).returncode) != 0:
            return fail(f"{name}: cmake ended with status {status}")
    library = folder / f"tiefmu{platform.suffix}"
    system, machines = library_of(library.read_bytes())
    assert system == platform.system and platform.machine in machines, f"{library}: for {system}, {machines}"
    target = BUILT / name
    shutil.rmtree(target, ignore_errors=True)
    (target / "licenses").mkdir(parents=True)
    shutil.copy(library, target)
    for file, source in (LICENSES | (WINDOWS_LICENSES if system == "windows" else {})).items():
        shutil.copyfile(zig / source, target / "licenses" / file)
    (target / "made-from").write_text(source_hash() + "\n")  # last: it says that all is there
    print(f"{name}: {library.stat().st_size / 1e6:.2f} MB in {time.perf_counter() - began:.0f} s, in {target}")
    return 0


def fail(message: str) -> int:
    print(f"error: {message}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
