"""What `make binaries` builds, on the systems that it is for: the same bits as on this one.

make test-linux, test-debian11 (with its C library), test-windows (under wine), test-arm (under qemu-user), test-macos
(only what the library says of itself).
"""

import os
import re
import shutil
import struct
import subprocess
import zipfile
from pathlib import Path

import fmi3_calls
import numpy as np
import pytest
import tiefmu
from fmu_calls import OK, Fmu, Instance
from test_threads import panel
from tiefmu import binaries
from tiefmu.content.reference_results import signals
from tiefmu.platforms import BY_FOLDER, glibc_floor, library_of

pytestmark = pytest.mark.elsewhere

ROOT = Path(__file__).parents[1]
SCENES = [path for path in sorted((ROOT / "scenes").iterdir()) if path.suffix in (".toml", ".rad")]
DEBIAN_11 = ROOT / "build" / "debian11" / "lib" / "x86_64-linux-gnu"
EMULATORS = {
    "linux64": [],
    "debian11": [DEBIAN_11 / "ld-linux-x86-64.so.2", "--library-path", DEBIAN_11],
    "win64": ["wine"],
    "aarch64-linux": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
}
FOLDERS = {"debian11": "linux64"}  # of the library, where it is not called like the system
SYSTEMS = list(EMULATORS)


@pytest.fixture(scope="module")
def host(request):
    """system -> command that runs tests/host/host.c there."""

    def command(system: str) -> list:
        folder = FOLDERS.get(system, system)
        assert binaries.built(folder), binaries.missing(folder)
        program = ROOT / "build" / "zig" / f"host-{folder}{'.exe' if folder == 'win64' else ''}"
        source = Path(__file__).parent / "host" / "host.c"
        if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
            import fmpy

            zig = ROOT / "build" / "zig" / "wheel" / "ziglang" / "zig"
            words = [
                zig,
                "cc",
                "-target",
                BY_FOLDER[folder].targets[0],
                "-O1",
                "-I",
                Path(fmpy.__file__).parent / "c-code",
            ]
            subprocess.run([*words, "-o", program, source], check=True)
        return [*EMULATORS[system], program]

    return command


def case(fmu: Fmu, names: list[str], values: np.ndarray, step: float) -> str:
    """What the host reads behind library, GUID and location."""

    def bits(numbers):
        return " ".join(
            f"{word:x}" for word in struct.unpack(f"<{len(numbers)}Q", struct.pack(f"<{len(numbers)}d", *numbers))
        )

    outputs = fmu.names("output")
    return "\n".join(
        [
            f"{bits([step])} {len(values)} {len(names)} {len(outputs)}",
            " ".join(str(fmu.reference[name]) for name in names),
            " ".join(str(fmu.reference[name]) for name in outputs),
            *(bits(row) for row in values.tolist()),
        ]
    )


def answer_here(fmu: Fmu, names: list[str], values: np.ndarray, step: float) -> np.ndarray:
    instance = Instance(fmu).start(values=dict(zip(names, values[0].tolist())))
    rows = []
    for k, row in enumerate(values.tolist()):
        assert not names or instance.set(dict(zip(names, row))) == OK
        assert instance.step(k * step, step) == OK, instance.log
        rows.append(instance.get(fmu.names("output")))
    instance.free()
    return np.array(rows)


def answer_there(command, folder: Path, lines: list[str], rest: str, columns: int) -> np.ndarray:
    question, answer = folder / "case.txt", folder / "answer.bin"
    question.write_text("\n".join([*lines, rest]), encoding="utf-8")
    environment = os.environ | {"LC_ALL": "C.UTF-8", "WINEDEBUG": "-all", "WINEPREFIX": str(ROOT / "build" / "wine")}
    done = subprocess.run([*command, question.name, answer.name], cwd=folder, env=environment, capture_output=True)
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    return np.fromfile(answer).reshape(-1, columns)


def unpacked(fmu: Path, folder: Path, system: str) -> Path:
    """The FMU unpacked; its library for the system."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return next((folder / "binaries" / FOLDERS.get(system, system)).iterdir())


def built_here(scene: tiefmu.Scene, folder: Path, monkeypatch) -> Fmu:
    """With the library of the local compiler, not that of `make binaries`."""
    with monkeypatch.context() as patch:
        patch.setattr(binaries, "BUILT", folder / "nowhere")
        return Fmu(tiefmu.build(scene, folder / "here.fmu"), folder)


def path_there(system: str, path: Path) -> str:
    return "Z:" + str(path).replace("/", "\\") if system == "win64" else str(path)


def uri_there(system: str, path: Path) -> str:
    return path.as_uri().replace("file:///", "file:///Z:/") if system == "win64" else path.as_uri()


THREADED = panel("optimized", True, "free", integrator={"threads": 2}, interface={"hide": []})


@pytest.mark.parametrize(
    "scene", [*SCENES, THREADED], ids=lambda each: each.stem if isinstance(each, Path) else "threads"
)
@pytest.mark.parametrize("system", SYSTEMS)
def test_the_same_bits(system, scene, host, tmp_path, monkeypatch):
    loaded = tiefmu.load(scene)
    path = tiefmu.build(loaded, tmp_path / "there.fmu", platforms=[FOLDERS.get(system, system)])
    fmu = built_here(loaded, tmp_path, monkeypatch)
    step = float(fmu.description.defaultExperiment.stepSize)
    inputs = signals(loaded, 1000 * step)
    names = list(inputs)
    steps = 10 if isinstance(scene, dict) else 50
    values = np.array(list(inputs.values())).reshape(len(names), -1).T[1 : steps + 1]
    library = unpacked(path, tmp_path / "there", system)
    lines = [path_there(system, library), fmu.description.guid, uri_there(system, tmp_path / "there" / "resources")]
    found = answer_there(host(system), tmp_path, lines, case(fmu, names, values, step), len(fmu.names("output")))
    expected = answer_here(fmu, names, values, step)
    assert np.abs(expected).max() > 0
    np.testing.assert_array_equal(found, expected)


DRIVES = ["file:///Z:{}", "file://Z:{}", "FILE:///z:{}", "file:/Z:{}", "file://localhost/Z:{}", "Z:{}", "{}"]


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("name", ["with blank", "fm üs 漢", "100% #1", "long"])
def test_names_of_folders(system, name, host, weld, tmp_path, monkeypatch):
    """Also of more than the 260 characters that Windows once took."""
    folder = tmp_path / name
    if name == "long":
        folder = tmp_path.joinpath(*["a folder whose name is rather long " + str(k) for k in range(8)])
        assert len(str(folder)) > 300
    folder.mkdir(parents=True)
    path = tiefmu.build(tiefmu.load(weld), tmp_path / "weld.fmu", platforms=[FOLDERS.get(system, system)])
    library = unpacked(path, folder, system)
    if name == "long":  # the importer's own matter, and our host's LoadLibrary does not
        library = Path(shutil.copy(library, tmp_path))
    fmu = built_here(tiefmu.load(weld), tmp_path, monkeypatch)
    names, values = ["slave[1].f[3]", "master[1].v[3]"], np.arange(20.0).reshape(10, 2)
    rest, columns = case(fmu, names, values, 0.01), len(fmu.names("output"))
    expected = answer_here(fmu, names, values, 0.01)
    quoted = (folder / "resources").as_uri().removeprefix("file://")
    locations = [uri_there(system, folder / "resources"), path_there(system, folder / "resources")]
    if system == "win64":
        locations += [
            form.format(quoted if form.lower().startswith("file:") else folder / "resources") for form in DRIVES
        ]
    for location in locations:
        found = answer_there(
            host(system), tmp_path, [path_there(system, library), fmu.description.guid, location], rest, columns
        )
        np.testing.assert_array_equal(found, expected, err_msg=location)


@pytest.mark.parametrize("system", list(BY_FOLDER))
def test_what_a_library_asks_for_and_shows(system):
    """No more than every such system has, and the functions of FMI only."""
    library = binaries.built(system)
    assert library, binaries.missing(system)
    found, machines = library_of(library.data)
    assert found == BY_FOLDER[system].system and BY_FOLDER[system].machine in machines
    {"linux": linux, "windows": windows, "darwin": darwin}[found](library.data)


def linux(data: bytes):
    import lief

    assert glibc_floor(data) <= (2, 17)
    file = lief.ELF.parse(list(data))
    names = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
    assert set(file.libraries) <= names
    versions = {v.name for need in file.symbols_version_requirement for v in need.get_auxiliary_symbols()}
    assert versions and max(tuple(map(int, v[6:].split("."))) for v in versions if v.startswith("GLIBC_")) <= (2, 17)
    shows(symbol.name for symbol in file.exported_symbols)


def windows(data: bytes):
    import lief

    file = lief.PE.parse(list(data))
    names = {each.name.lower() for each in file.imports}
    assert "kernel32.dll" in names
    assert all(re.fullmatch(r"(kernel32|ucrtbase|msvcrt|api-ms-win-crt-[\w-]+)\.dll", name) for name in names), names
    shows(entry.name for entry in file.get_export().entries)


def darwin(data: bytes):
    import lief

    parts = lief.MachO.parse(list(data))
    assert {part.header.cpu_type.name for part in parts} == {"X86_64", "ARM64"}
    for part in parts:
        name, *libraries = [each.name for each in part.libraries]
        assert name == "@rpath/tiefmu.dylib" and set(libraries) <= {"/usr/lib/libSystem.B.dylib"}
        assert tuple(part.build_version.minos) == (11, 0, 0)
        assert part.has_code_signature or part.header.cpu_type.name == "X86_64"  # Arm loads nothing unsigned
        # Two marks of zig's linker beside.
        shown = {symbol.name for symbol in part.symbols if symbol.has_export_info}
        shows(name.removeprefix("_") for name in shown - {"__mh_dylib_header", "___dso_handle"})


def shows(names):
    names = set(names)
    assert not [name for name in names if not name.startswith(("fmi2", "fmi3"))]
    assert len(names) == 44 + len(fmi3_calls.functions())
