"""The systems that an FMU's library is built for, their names in an FMU, and what a library file says of itself."""

import platform
import re
import struct
import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class Platform:
    """folder: below binaries/ (FMI 2.0.4, section 2.3: Linux and Windows on x86-64 have names of their own, `darwin64`
    is macOS on x86-64, all others are named by the platform tuples of FMI 3.0, which has no others). targets: zig's
    names of the system; of several, for one file that holds the library for each. kept: where that file is kept, folder
    of build/binaries."""

    folder: str
    suffix: str
    system: str
    machine: str
    targets: tuple[str, ...]
    kept: str

    def folder_of(self, fmi: int) -> str:
        """fmi: 2 or 3."""
        return self.folder if fmi == 2 else f"{self.machine}-{self.system}"


MACOS = ("x86_64-macos.11.0", "aarch64-macos.11.0")
PLATFORMS = (
    Platform("linux64", ".so", "linux", "x86_64", ("x86_64-linux-gnu.2.17",), "linux64"),
    Platform("win64", ".dll", "windows", "x86_64", ("x86_64-windows-gnu",), "win64"),
    Platform("aarch64-linux", ".so", "linux", "aarch64", ("aarch64-linux-gnu.2.17",), "aarch64-linux"),
    Platform("darwin64", ".dylib", "darwin", "x86_64", MACOS, "darwin64"),
    Platform("aarch64-darwin", ".dylib", "darwin", "aarch64", MACOS, "darwin64"),
)
BY_FOLDER = {each.folder: each for each in PLATFORMS}


def here() -> Platform:
    """The one that this process runs on; for one that is not in the list a name by the same rule."""
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    for each in PLATFORMS:
        if (each.system, each.machine) == (system, machine):
            return each
    suffix = {"windows": ".dll", "darwin": ".dylib"}.get(system, ".so")
    name = f"{machine}-{system}"
    return Platform(name, suffix, system, machine, (), name)


class LibraryError(ValueError):
    """A file that is no shared library, or not all of one. The message goes on after the file's name."""


def library_of(data: bytes) -> tuple[str, set[str]]:
    """System and processors of a shared library, from its headers: ("linux", {"x86_64"}).

    A library that is shorter than its headers say is refused: loading it would end the process. Raises LibraryError.
    """
    for magic, read in READERS:
        if data.startswith(magic):
            try:
                system, machines, size = read(data)
            except (struct.error, OverflowError):
                raise LibraryError("is cut short") from None
            if size > len(data):
                raise LibraryError(f"is cut short: {len(data)} of {size} bytes")
            return system, machines
    raise LibraryError("is no shared library")


ELF_MACHINES = {62: "x86_64", 183: "aarch64", 3: "x86", 40: "aarch32"}
PE_MACHINES = {0x8664: "x86_64", 0xAA64: "aarch64", 0x14C: "x86"}
MACH_MACHINES = {0x01000007: "x86_64", 0x0100000C: "aarch64", 7: "x86"}


def elf(data: bytes) -> tuple[str, set[str], int]:
    """Size: where the last segment, or the table of sections, ends."""
    wide, big = struct.unpack_from("BB", data, 4)
    order = ">" if big == 2 else "<"
    (machine,) = struct.unpack_from(order + "H", data, 18)
    name = ELF_MACHINES.get(machine, f"processor {machine}")
    if wide != 2:
        return "linux", {name}, len(data)
    programs, sections = struct.unpack_from(order + "QQ", data, 32)
    size, count, section_size, section_count = struct.unpack_from(order + "HHHH", data, 54)
    ends = [sections + section_size * section_count]
    for k in range(count):
        (offset,) = struct.unpack_from(order + "Q", data, programs + size * k + 8)
        (length,) = struct.unpack_from(order + "Q", data, programs + size * k + 32)
        ends.append(offset + length)
    return "linux", {name}, max(ends)


def pe(data: bytes) -> tuple[str, set[str], int]:
    (start,) = struct.unpack_from("<I", data, 60)
    signature, machine, count = struct.unpack_from("<4sHH", data, start)
    if signature != b"PE\0\0":
        raise LibraryError("is no shared library")
    (optional,) = struct.unpack_from("<H", data, start + 20)
    ends = [0]
    for k in range(count):
        length, offset = struct.unpack_from("<II", data, start + 24 + optional + 40 * k + 16)
        ends.append(offset + length)
    return "windows", {PE_MACHINES.get(machine, f"processor {machine}")}, max(ends)


def mach(data: bytes) -> tuple[str, set[str], int]:
    (machine,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<I", data, 16)
    place, ends = 32, [0]
    for _ in range(count):
        kind, length = struct.unpack_from("<II", data, place)
        if kind == 0x19:  # a segment
            ends.append(sum(struct.unpack_from("<QQ", data, place + 40)))
        if length < 8:
            raise LibraryError("is no shared library")
        place += length
    return "darwin", {MACH_MACHINES.get(machine, f"processor {machine}")}, max(ends)


def universal(data: bytes) -> tuple[str, set[str], int]:
    """A file of several, for several processors."""
    (count,) = struct.unpack_from(">I", data, 4)
    parts = [struct.unpack_from(">IIII", data, 8 + 20 * k) for k in range(count)]
    machines = {MACH_MACHINES.get(machine, f"processor {machine}") for machine, *_ in parts}
    return "darwin", machines, max((offset + size for _, _, offset, size in parts), default=0)


READERS = ((b"\x7fELF", elf), (b"MZ", pe), (b"\xcf\xfa\xed\xfe", mach), (b"\xca\xfe\xba\xbe", universal))


def glibc_floor(data: bytes) -> tuple[int, int] | None:
    """The least version of glibc that a Linux library asks for: that of the newest function it imports."""
    found = re.findall(rb"\0GLIBC_(\d+)\.(\d+)(?:\.\d+)?(?=\0)", data)
    return max(((int(major), int(minor)) for major, minor in found), default=None)
