"""What `make binaries` builds, on the systems that it is for: the same bits as on this one.

make test-linux, test-debian11 (with its C library), test-windows (under wine), test-arm (under qemu-user), test-macos
(only what the library says of itself).
"""

import re
import shutil
import tempfile
from pathlib import Path

import fmi3_calls
import numpy as np
import pytest
import tiefmu
from elsewhere import DEBIAN_11, ROOT, SYSTEMS, answer_there, case, folder_of, path_there, share, unpacked, uri_there
from fmu_calls import OK, Fmu, Instance
from test_threads import panel
from tiefmu import binaries
from tiefmu.content.reference_results import signals
from tiefmu.platforms import BY_FOLDER, glibc_floor, library_of

pytestmark = pytest.mark.elsewhere

SCENES = [path for path in sorted((ROOT / "scenes").iterdir()) if path.suffix in (".toml", ".rad")]


@pytest.fixture
def room(system, tmp_path):
    """An empty folder that the system sees."""
    if system != "debian11":
        yield tmp_path
    else:
        with tempfile.TemporaryDirectory(dir=DEBIAN_11 / "tmp") as folder:
            yield Path(folder)


def answer_here(fmu: Fmu, names: list[str], values: np.ndarray, step: float) -> np.ndarray:
    instance = Instance(fmu).start(values=dict(zip(names, values[0].tolist())))
    rows = []
    for k, row in enumerate(values.tolist()):
        assert not names or instance.set(dict(zip(names, row))) == OK
        assert instance.step(k * step, step) == OK, instance.log
        rows.append(instance.get(fmu.names("output")))
    instance.free()
    return np.array(rows)


def built_here(scene: tiefmu.Scene, folder: Path, monkeypatch) -> Fmu:
    """With the library of the local compiler, not that of `make binaries`."""
    with monkeypatch.context() as patch:
        patch.setattr(binaries, "BUILT", folder / "nowhere")
        return Fmu(tiefmu.build(scene, folder / "here.fmu"), folder)


THREADED = panel("optimized", True, "free", integrator={"threads": 2}, interface={"hide": []})


@pytest.mark.parametrize(
    "scene", [*SCENES, THREADED], ids=lambda each: each.stem if isinstance(each, Path) else "threads"
)
@pytest.mark.parametrize("system", SYSTEMS)
def test_the_same_bits(system, scene, room, tmp_path, monkeypatch):
    loaded = tiefmu.load(scene)
    path = tiefmu.build(loaded, tmp_path / "there.fmu", platforms=[folder_of(system)])
    fmu = built_here(loaded, tmp_path, monkeypatch)
    step = float(fmu.description.defaultExperiment.stepSize)
    inputs = signals(loaded, 1000 * step)
    names = list(inputs)
    steps = 10 if isinstance(scene, dict) else 50
    values = np.array(list(inputs.values())).reshape(len(names), -1).T[1 : steps + 1]
    library = unpacked(path, room / "there", system)
    lines = [path_there(system, library), fmu.description.guid, uri_there(system, room / "there" / "resources")]
    found = answer_there(system, room, lines, case(fmu, names, values, step), len(fmu.names("output")))
    expected = answer_here(fmu, names, values, step)
    assert np.abs(expected).max() > 0
    np.testing.assert_array_equal(found, expected)


DRIVES = ["file:///Z:{}", "file://Z:{}", "FILE:///z:{}", "file:/Z:{}", "file://localhost/Z:{}", "Z:{}", "{}"]
SHARES = ["file://server/share{}", "file:////server/share{}", "//server/share{}", "\\\\server\\share{}"]


def locations(system: str, folder: Path, room: Path) -> list[str]:
    """How importers may name the folder."""
    found = [uri_there(system, folder), path_there(system, folder)]
    if system == "win64":
        share(room)
        for forms, place in ((DRIVES, folder), (SHARES, Path("/") / folder.relative_to(room))):
            quoted = place.as_uri().removeprefix("file://")
            found += [form.format(quoted if form.lower().startswith("file:") else place) for form in forms]
    return found


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("name", ["with blank", "fm üs 漢", "100% #1", "long"])
def test_names_of_folders(system, name, room, weld, tmp_path, monkeypatch):
    """Also of more than the 260 characters that Windows once took, and on another computer."""
    folder = room / name
    if name == "long":
        folder = room.joinpath(*["a folder whose name is rather long " + str(k) for k in range(8)])
        assert len(str(folder)) > 300
    folder.mkdir(parents=True)
    path = tiefmu.build(tiefmu.load(weld), tmp_path / "weld.fmu", platforms=[folder_of(system)])
    library = unpacked(path, folder, system)
    if name == "long":  # the importer's own matter, and our host's LoadLibrary does not
        library = Path(shutil.copy(library, room))
    fmu = built_here(tiefmu.load(weld), tmp_path, monkeypatch)
    names, values = ["slave[1].f[3]", "master[1].v[3]"], np.arange(20.0).reshape(10, 2)
    rest, columns = case(fmu, names, values, 0.01), len(fmu.names("output"))
    expected = answer_here(fmu, names, values, 0.01)
    for location in locations(system, folder / "resources", room):
        lines = [path_there(system, library), fmu.description.guid, location]
        found = answer_there(system, room, lines, rest, columns)
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
