"""Programs that run an FMU on other systems: tests/host/host.c, compiled for each, under wine, under qemu-user or in
the root of another Debian."""

import os
import struct
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
from fmu_calls import Fmu
from tiefmu import binaries
from tiefmu.platforms import BY_FOLDER

ROOT = Path(__file__).parents[1]
DEBIAN_11 = ROOT / "build" / "debian11"
WINE = ROOT / "build" / "wine"
EMULATORS = {
    "linux64": [],
    "debian11": ["chroot", DEBIAN_11],
    "win64": ["wine"],
    "aarch64-linux": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
}
FOLDERS = {"debian11": "linux64"}  # of the library, where it is not called like the system
SYSTEMS = list(EMULATORS)


def folder_of(system: str) -> str:
    return FOLDERS.get(system, system)


def host(system: str) -> Path:
    """The program for a system."""
    folder = folder_of(system)
    assert binaries.built(folder), binaries.missing(folder)
    name = f"host-{folder}{'.exe' if folder == 'win64' else ''}"
    program = (DEBIAN_11 / "tmp" if system == "debian11" else ROOT / "build" / "zig") / name
    source = Path(__file__).parent / "host" / "host.c"
    if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
        zig = ROOT / "build" / "zig" / "wheel" / "ziglang" / "zig"
        headers = Path(fmpy.__file__).parent / "c-code"
        words = [zig, "cc", "-target", BY_FOLDER[folder].targets[0], "-O1", "-I", headers, "-o", program, source]
        subprocess.run(words, check=True)
    return program


def path_there(system: str, path: Path) -> str:
    if system == "win64":
        return "Z:" + str(path).replace("/", "\\")
    return "/" + str(path.relative_to(DEBIAN_11)) if system == "debian11" else str(path)


def uri_there(system: str, path: Path) -> str:
    if system == "win64":
        return path.as_uri().replace("file:///", "file:///Z:/")
    return Path(path_there(system, path)).as_uri()


def share(folder: Path):
    r"""The folder as \\server\share, in wine."""
    if not WINE.is_dir():
        subprocess.run(["wine", "wineboot", "--init"], env=environment(), check=True)
    link = WINE / "dosdevices" / "unc" / "server" / "share"
    link.parent.mkdir(parents=True, exist_ok=True)
    link.unlink(missing_ok=True)
    link.symlink_to(folder)


def environment() -> dict[str, str]:
    return os.environ | {"LC_ALL": "C.UTF-8", "WINEDEBUG": "-all", "WINEPREFIX": str(WINE)}


def unpacked(fmu: Path, folder: Path, system: str) -> Path:
    """The FMU unpacked; its library for the system."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return next((folder / "binaries" / folder_of(system)).iterdir())


def case(fmu: Fmu, names: list[str], values: np.ndarray, step: float, outputs: list[str] | None = None) -> str:
    """What the host reads behind library, GUID and location. names: of the inputs; outputs: all, if not given."""

    def bits(numbers):
        return " ".join(
            f"{word:x}" for word in struct.unpack(f"<{len(numbers)}Q", struct.pack(f"<{len(numbers)}d", *numbers))
        )

    outputs = outputs or fmu.names("output")
    return "\n".join(
        [
            f"{bits([step])} {len(values)} {len(names)} {len(outputs)}",
            " ".join(str(fmu.reference[name]) for name in names),
            " ".join(str(fmu.reference[name]) for name in outputs),
            *(bits(row) for row in values.tolist()),
        ]
    )


def answer_there(system: str, folder: Path, lines: list[str], rest: str, columns: int) -> np.ndarray:
    """lines: library, GUID and location as the system names them. Outputs after each step."""
    question, answer = folder / "case.txt", folder / "answer.bin"
    question.write_text("\n".join([*lines, rest]), encoding="utf-8")
    program = host(system) if system != "debian11" else path_there(system, host(system))
    words = [*EMULATORS[system], program, path_there(system, question), path_there(system, answer)]
    done = subprocess.run(words, env=environment(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    return np.fromfile(answer).reshape(-1, columns)
