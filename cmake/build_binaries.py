"""Builds the FMU's library for other systems, with the compiler of the PyPI wheel `ziglang`: see `make binaries`.

python cmake/build_binaries.py ZIG PLATFORM...

ZIG: the folder of the package `ziglang`. Writes build/binaries/PLATFORM. What is there already and made from the same
sources stays.
"""

import os
import shutil
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

from tiefmu.binaries import BUILT, CHECKOUT, is_stale, source_hash
from tiefmu.platforms import BY_FOLDER, Platform, library_of

# What each library holds of the compiler's own parts.
LICENSES = {"zig.txt": "LICENSE", "libcxx.txt": "lib/libcxx/LICENSE.TXT", "libunwind.txt": "lib/libunwind/LICENSE.TXT"}
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
            print(f"{name}: as it is in {BUILT / BY_FOLDER[name].kept}")
        elif status := build(BY_FOLDER[name], zig, compiler):
            return status
    return 0


def build(platform: Platform, zig: Path, compiler: Path) -> int:
    began, worked, made_from = time.perf_counter(), processor_time(), source_hash()
    libraries = []
    for target in platform.targets:
        folder = CHECKOUT / "build" / "zig" / target
        for command in commands(target, folder, compiler):
            if (status := subprocess.run(list(map(str, command))).returncode) != 0:
                return fail(f"{target}: cmake ended with status {status}")
        libraries.append((folder / f"tiefmu{platform.suffix}").read_bytes())
    data = libraries[0] if len(libraries) == 1 else universal(libraries)
    system, machines = library_of(data)
    assert system == platform.system and platform.machine in machines, f"a library for {system}, {machines}"
    target = BUILT / platform.kept
    shutil.rmtree(target, ignore_errors=True)
    (target / "licenses").mkdir(parents=True)
    (target / f"tiefmu{platform.suffix}").write_bytes(data)
    for file, source in (LICENSES | (WINDOWS_LICENSES if system == "windows" else {})).items():
        shutil.copyfile(zig / source, target / "licenses" / file)
    (target / "made-from").write_text(made_from + "\n")  # last: it says that all is there
    size = f"{len(data) / 1e6:.2f} MB, {len(zlib.compress(data, 3)) / 1e6:.2f} MB in an FMU"
    spent = f"{time.perf_counter() - began:.0f} s, {processor_time() - worked:.0f} s of processor time"
    print(f"{platform.kept}: {size}, in {spent}; in {target}", flush=True)
    return 0


def processor_time() -> float:
    """Of what this process has started and waited for."""
    times = os.times()
    return times.children_user + times.children_system


def commands(target: str, folder: Path, compiler: Path) -> list[list]:
    # Fresh: flags that an older toolchain file gave would stay.
    setting_up = ["cmake", "--fresh", "-S", CHECKOUT, "-B", folder, "-G", "Ninja"]
    setting_up += [f"-DCMAKE_TOOLCHAIN_FILE={CHECKOUT / 'cmake' / 'zig.cmake'}", f"-DTIEFMU_ZIG={compiler}"]
    setting_up += [f"-DTIEFMU_TARGET={target}", "-DTIEFMU_PYTHON=OFF", "-DCMAKE_BUILD_TYPE=Release"]
    setting_up += [f"-DPython_EXECUTABLE={sys.executable}"]
    return [setting_up, ["cmake", "--build", folder, "--target", "tiefmu_fmu", "-j", os.environ.get("JOBS", "2")]]


def universal(libraries: list[bytes]) -> bytes:
    """One file of macOS libraries for several processors, each from a multiple of the largest page of them."""
    page = 2**14
    head, body = struct.pack(">II", 0xCAFEBABE, len(libraries)), b""
    for data in libraries:
        body += bytes(-len(body) % page)
        kind = struct.unpack_from("<II", data, 4)
        head += struct.pack(">IIIII", *kind, page + len(body), len(data), page.bit_length() - 1)
        body += data
    return head.ljust(page, b"\0") + body


def fail(message: str) -> int:
    print(f"error: {message}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
