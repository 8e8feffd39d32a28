"""Libraries of an FMU: what their headers say, what `build` takes, and what `run` refuses to load."""

import json
import shutil
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from tiefmu import binaries, platforms
from tiefmu.cli import main
from tiefmu.platforms import BY_FOLDER, LibraryError, glibc_floor, here, library_of

OWN = binaries.local()


def repacked(fmu: Path, to: Path, library: bytes | None, folder: str | None = None) -> Path:
    """The FMU with other bytes as its library (None: without one), in another folder below binaries/."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(to, "w") as new:
        for name in old.namelist():
            if not name.startswith("binaries/"):
                new.writestr(name, old.read(name))
            elif name.startswith(f"binaries/{here().folder}/") and library is not None:
                new.writestr(name.replace(here().folder, folder or here().folder), library)
    return to


# ------------------------------------------------------------------------------------------------------ what files say


def test_headers_of_this_systems_library():
    assert library_of(OWN.data) == (here().system, {here().machine})


def test_a_library_is_cut_short_wherever_it_is_cut():
    for length in [*range(4, 64), *np.linspace(64, len(OWN.data) - 1, 50).astype(int).tolist()]:
        with pytest.raises(LibraryError, match="cut short"):
            library_of(OWN.data[:length])
    beyond = bytearray(OWN.data)
    beyond[32:40] = b"\xff" * 8  # where the program headers are
    with pytest.raises(LibraryError, match="cut short"):
        library_of(bytes(beyond))
    for data in (b"", b"\x7fE", b"#!/bin/sh\n", b"PK\3\4" * 40):
        with pytest.raises(LibraryError, match="is no shared library"):
            library_of(data)


def test_damaged_headers_are_refused_or_harmless():
    rng = np.random.default_rng(1)
    headers = [OWN.data[:4096], windows(), macos(), b"\xca\xfe\xba\xbe" + struct.pack(">I", 2) + bytes(80)]
    for data in headers:
        for _ in range(300):
            changed = bytearray(data)
            for at in rng.integers(4, min(len(data), 400), 3):
                changed[at] = rng.integers(256)
            try:
                library_of(bytes(changed))
            except LibraryError as error:
                assert "\n" not in str(error)


def windows(machine=0x8664, length=512) -> bytes:
    """The headers of a DLL with one section of `length` bytes, and that section."""
    head = bytearray(512)
    head[:2], head[60:64] = b"MZ", struct.pack("<I", 128)
    struct.pack_into("<4sHH", head, 128, b"PE\0\0", machine, 1)
    struct.pack_into("<H", head, 148, 64)
    struct.pack_into("<II", head, 128 + 24 + 64 + 16, length, 512)
    return bytes(head) + bytes(length)


def macos(machine=0x0100000C) -> bytes:
    """The headers of a library of one segment, and that segment."""
    head = bytearray(512)
    struct.pack_into("<IIIIII", head, 0, 0xFEEDFACF, machine, 0, 6, 1, 72)
    struct.pack_into("<II", head, 32, 0x19, 72)
    struct.pack_into("<QQ", head, 32 + 40, 0, 1024)
    return bytes(head) + bytes(512)


def test_libraries_of_other_systems_are_told_apart():
    assert library_of(windows()) == ("windows", {"x86_64"})
    assert library_of(windows(0xAA64)) == ("windows", {"aarch64"})
    assert library_of(macos()) == ("darwin", {"aarch64"})
    both = b"\xca\xfe\xba\xbe" + struct.pack(">I", 2)
    both += struct.pack(">IIIII", 0x01000007, 3, 4096, 1024, 12) + struct.pack(">IIIII", 0x0100000C, 0, 8192, 1024, 12)
    both = both.ljust(4096, b"\0") + macos(0x01000007).ljust(4096, b"\0") + macos()
    assert library_of(both) == ("darwin", {"x86_64", "aarch64"})
    for whole in (windows(), macos(), both):
        with pytest.raises(LibraryError, match="cut short"):
            library_of(whole[:-1])


def test_libraries_for_both_processors_of_macos_become_one_file(monkeypatch):
    monkeypatch.syspath_prepend(str(binaries.CHECKOUT / "cmake"))
    from build_binaries import universal

    parts = [macos(0x01000007) + b"tail", macos(0x0100000C)]
    both = universal(parts)
    assert library_of(both) == ("darwin", {"x86_64", "aarch64"})
    for k, part in enumerate(parts):
        _, _, offset, size, power = struct.unpack_from(">IIIII", both, 8 + 20 * k)
        assert both[offset : offset + size] == part and offset % 2**power == 0 and 2**power == 16384


def test_the_floor_of_glibc_is_that_of_the_symbol_table():
    if here().system != "linux":
        pytest.skip("of Linux only")
    path = next(binaries.INSTALLED.glob("tiefmu.*"))
    table = subprocess.run(["objdump", "-T", path], capture_output=True, text=True, check=True).stdout
    versions = {tuple(map(int, word.strip("()")[6:].split("."))) for word in table.split() if "GLIBC_2" in word}
    assert glibc_floor(OWN.data) == max(versions)[:2]


# ------------------------------------------------------------------------------------------------------------ building


def test_a_build_on_arm_is_not_called_that_of_another_processor(monkeypatch):
    """FMI 2.0.4: linux64 and darwin64 are those of x86-64."""
    names = {
        ("linux", "aarch64"): "aarch64-linux",
        ("linux", "x86_64"): "linux64",
        ("darwin", "arm64"): "aarch64-darwin",
    }
    names |= {("win32", "AMD64"): "win64", ("darwin", "x86_64"): "darwin64", ("linux", "riscv64"): "riscv64-linux"}
    for (system, machine), folder in names.items():
        monkeypatch.setattr(sys, "platform", system)
        monkeypatch.setattr(platforms.platform, "machine", lambda machine=machine: machine)
        assert here().folder == folder


@pytest.fixture
def built(tmp_path, monkeypatch):
    """A folder as `make binaries` leaves it, with this system's own library."""

    def make(folder, data=None, made_from=None):
        target = tmp_path / "binaries" / folder
        (target / "licenses").mkdir(parents=True, exist_ok=True)
        (target / f"tiefmu{BY_FOLDER[folder].suffix}").write_bytes(windows() if data is None else data)
        (target / "licenses" / "part.txt").write_text("terms of a part")
        (target / "made-from").write_text(made_from or binaries.source_hash())

    monkeypatch.setattr(binaries, "BUILT", tmp_path / "binaries")
    return make


def test_what_was_built_goes_into_every_fmu(weld, built, scene_file, capsys):
    name = scene_file(weld)
    assert main(["build", name, "-o", "alone.fmu"]) == 0
    assert f", for {OWN.text}\n" in capsys.readouterr().out
    built("win64")
    assert main(["build", name]) == 0
    assert ", for win64, " + OWN.text in capsys.readouterr().out.replace(
        f"for {OWN.text}, win64", f"for win64, {OWN.text}"
    )
    alone, both = (zipfile.ZipFile(f) for f in ("alone.fmu", "weld.fmu"))
    assert both.read("binaries/win64/weld.dll") == windows()
    assert both.read("documentation/licenses/part.txt") == b"terms of a part"
    assert both.read("modelDescription.xml") == alone.read("modelDescription.xml")
    assert set(both.namelist()) - set(alone.namelist()) == {
        "binaries/win64/weld.dll",
        "documentation/licenses/part.txt",
    }
    assert main(["build", name, "--platforms", "win64"]) == 0
    assert [f for f in zipfile.ZipFile("weld.fmu").namelist() if f.startswith("bin")] == ["binaries/win64/weld.dll"]
    assert main(["build", name, "--platforms", "win64", "--platforms", here().folder]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith(f", for win64, {OWN.text}")


def test_a_library_made_from_other_sources_is_left_out(weld, built, scene_file, capsys):
    built("win64", made_from="0" * 64)
    name = scene_file(weld)
    assert main(["build", name]) == 0
    said = capsys.readouterr()
    assert said.err.splitlines()[-1] == (
        "warning: libraries for win64 are left out: they were made from other sources; run `make binaries` again"
    )
    assert "win64" not in said.out
    assert main(["build", name, "--platforms", "win64"]) == 2
    assert capsys.readouterr().err == (
        f"error: platform 'win64': {binaries.BUILT / 'win64'} was made from other sources; run `make binaries` again\n"
    )
    built(here().folder, made_from="0" * 64)  # the local one takes its place
    assert main(["build", name, "--platforms", here().folder]) == 0
    said = capsys.readouterr()
    assert said.err.splitlines()[-1].startswith(f"warning: libraries for {here().folder} are left out: ")
    assert said.out.splitlines()[-1].endswith(f", for {OWN.text}")


def test_a_wheel_brings_the_libraries_of_all_systems(weld, built, tmp_path, monkeypatch, scene_file, capsys):
    """Beside its module; what lies in a checkout does not count."""
    both = b"\xca\xfe\xba\xbe" + struct.pack(">I", 2)
    both += struct.pack(">IIIII", 0x01000007, 3, 48, 4, 2) + struct.pack(">IIIII", 0x0100000C, 0, 52, 4, 2) + bytes(8)
    for folder, data in {"linux64": OWN.data, "win64": windows(), "darwin64": both}.items():
        built(folder, data, made_from="0" * 64)
    monkeypatch.setattr(binaries, "INSTALLED", binaries.BUILT)
    monkeypatch.setattr(binaries, "BUILT", tmp_path / "nowhere")
    assert main(["build", scene_file(weld)]) == 0
    said = capsys.readouterr()
    assert ", for linux64 (" in said.out and said.out.rstrip().endswith(", win64") and "warning: lib" not in said.err
    assert main(["build", "weld.toml", "--platforms", "darwin64,aarch64-darwin"]) == 0
    with zipfile.ZipFile("weld.fmu") as archive:
        for folder in ("darwin64", "aarch64-darwin"):
            assert archive.read(f"binaries/{folder}/weld.dylib") == both
    (binaries.INSTALLED / "win64" / "tiefmu.dll").write_bytes(windows()[:-1])
    capsys.readouterr()
    assert main(["build", "weld.toml"]) == 2
    assert capsys.readouterr().err.endswith("tiefmu.dll: is cut short: 1023 of 1024 bytes; install tiefmu again\n")


@pytest.mark.parametrize(
    "platform, data, line",
    [
        ("win65", None, "platform 'win65' is unknown; known: linux64, win64, "),
        ("darwin64", None, "platform 'darwin64': there is no library for it; `make binaries PLATFORMS=darwin64`"),
        ("win64", windows()[:-1], "is cut short: 1023 of 1024 bytes; run `make binaries` again"),
        ("win64", macos(), "is a library for darwin, aarch64; run `make binaries` again"),
        ("win64", b"", "is no shared library; run `make binaries` again"),
    ],
)
def test_platforms_that_there_is_no_library_for(weld, built, scene_file, capsys, platform, data, line):
    if data is not None:
        built(platform, data)
    assert main(["build", scene_file(weld), "--platforms", platform]) == 2
    said = capsys.readouterr().err
    assert line in said and said.count("\n") == 1
    assert not Path("weld.fmu").exists()


def test_make_binaries_says_what_is_unknown_or_missing(tmp_path):
    script = binaries.CHECKOUT / "cmake" / "build_binaries.py"
    for platforms_asked, line in (
        (["win64", "win65"], "error: platform 'win65' is unknown; known: linux64, win64, "),
        (["win64"], f"error: {tmp_path / 'zig'}: no such file; the package ziglang brings it"),
    ):
        done = subprocess.run([sys.executable, script, tmp_path, *platforms_asked], capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(line) and done.stderr.count("\n") == 1


# ------------------------------------------------------------------------------------------------------------- running


RUNS = """
import contextlib, io, json, sys
from tiefmu.cli import main
for name in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as error:
        status = main(["run", name, "--stop-time", "0.01"])
    print(json.dumps([name, status, out.getvalue(), error.getvalue()]), flush=True)
"""


def test_run_refuses_a_library_that_it_cannot_load(weld, tmp_path):
    """In a process of their own, which such a library would end."""
    fmu = tiefmu.build(tiefmu.load(weld), tmp_path / "good.fmu")
    place = f"binaries/{here().folder}/scene{here().suffix}"
    own = f"{here().system} on {here().machine}"
    other = struct.pack("<H", 183 if here().machine != "aarch64" else 62)
    foreign = "aarch64" if here().machine != "aarch64" else "x86_64"
    expected = {}
    for k, (library, folder, line) in enumerate(
        (
            (OWN.data[: len(OWN.data) // 2], None, f"{place}: is cut short: {len(OWN.data) // 2} of "),
            (OWN.data[:40], None, f"{place}: is cut short"),
            (b"", None, f"{place}: is no shared library"),
            (b"hello", None, f"{place}: is no shared library"),
            (windows(), None, f"{place}: is a library for windows on x86_64, this is {own}"),
            (
                OWN.data[:18] + other + OWN.data[20:],
                None,
                f"{place}: is a library for linux on {foreign}, this is {own}",
            ),
            (OWN.data, "win32", f"holds no library for this system ({place}); found win32"),
            (None, None, f"holds no library for this system ({place}); found none"),
        )
    ):
        expected[repacked(fmu, tmp_path / f"bad{k}.fmu", library, folder).name] = line
    good = repacked(fmu, tmp_path / "same.fmu", OWN.data).name
    done = subprocess.run([sys.executable, "-c", RUNS, *expected, good], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    *refused, taken = map(json.loads, done.stdout.splitlines())
    assert [name for name, *_ in refused] == list(expected)
    for name, status, out, error in refused:
        assert (status, out) == (2, ""), name
        assert error.startswith(f"error: {name}: {expected[name]}") and error.count("\n") == 1, error
    assert taken[:2] == [good, 0]


def test_a_library_without_the_functions_of_fmi_is_refused(weld, command, tmp_path):
    other = next((Path(shutil.__file__).parent / "lib-dynload").glob("_json*.so"), None)
    if other is None:
        pytest.skip("this Python has no library to take")
    fmu = tiefmu.build(tiefmu.load(weld), tmp_path / "good.fmu")
    repacked(fmu, tmp_path / "bad.fmu", other.read_bytes())
    done = command("run", "bad.fmu", "--stop-time", "0.01")
    assert done.returncode == 2 and done.stderr.startswith("error: bad.fmu: ") and done.stderr.count("\n") == 1
