"""The FMU's libraries that there are: in a wheel those of all systems, in a checkout that of this one and those that
`make binaries` built."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from . import _core
from .errors import UsageError
from .platforms import BY_FOLDER, LibraryError, Platform, glibc_floor, here, library_of

INSTALLED = Path(_core.__file__).parent / "binaries"  # tiefmu.SUFFIX; in a wheel instead what BUILT holds
CHECKOUT = Path(__file__).parents[2]
BUILT = CHECKOUT / "build" / "binaries"  # FOLDER/tiefmu.SUFFIX, FOLDER/made-from, licenses/*.txt
USUAL = ("linux64", "win64")  # what an FMU carries if nothing else is asked for
SOURCES = (
    "CMakeLists.txt",
    "cmake/zig*",
    "cmake/requirements.txt",
    "src/*",
    "modelDescription/*",
    "fmu/*",
    "pyproject.toml",
)


@dataclass(frozen=True)
class Library:
    platform: Platform
    data: bytes
    licenses: dict[str, bytes]  # file name -> text, of what was compiled in beyond what every library holds

    @property
    def text(self) -> str:
        """How `tiefmu build` names it."""
        floor = glibc_floor(self.data) if self.platform.system == "linux" else None
        return self.platform.folder + (f" (glibc {floor[0]}.{floor[1]} or later)" if floor else "")


def source_hash(root: Path = CHECKOUT) -> str:
    """Of everything that the libraries are made from."""
    digest = hashlib.sha256()
    for path in sorted(path for pattern in SOURCES for path in root.glob(pattern) if path.is_file()):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def libraries(wanted: list[str] | None = None) -> list[Library]:
    """Of the platforms wanted (names of folders), by default the usual ones that there are and that of this system.

    Raises UsageError for an unknown platform and for one whose library is missing or made from other sources.
    """
    for name in wanted or ():
        if name not in BY_FOLDER:
            raise UsageError(f"platform '{name}' is unknown; known: {', '.join(BY_FOLDER)}")
    mine = here()
    found = []
    for name in dict.fromkeys(wanted or (*USUAL, mine.folder)):
        library = built(name) or (local() if name == mine.folder else None)
        if library is None and wanted:
            raise UsageError(f"platform '{name}': {missing(name)}")
        if library is not None:
            found.append(library)
    return found


def folder_of(name: str) -> Path:
    """Where the library for a platform is, if there is one."""
    kept = BY_FOLDER[name].kept
    return INSTALLED / kept if (INSTALLED / kept).is_dir() else BUILT / kept


def built(name: str) -> Library | None:
    """One that came with the wheel, or that `make binaries` has made from the sources as they are."""
    if name not in BY_FOLDER or not folder_of(name).is_dir() or is_stale(name):
        return None
    platform, folder = BY_FOLDER[name], folder_of(name)
    path = folder / f"tiefmu{platform.suffix}"
    try:
        data = path.read_bytes()
        system, machines = library_of(data)
    except (OSError, LibraryError) as error:
        raise UsageError(f"{path}: {getattr(error, 'strerror', None) or error}; {again(folder)}") from None
    if system != platform.system or platform.machine not in machines:
        raise UsageError(f"{path}: is a library for {system}, {', '.join(sorted(machines))}; {again(folder)}")
    return Library(platform, data, {file.name: file.read_bytes() for file in (folder / "licenses").glob("*.txt")})


def again(folder: Path) -> str:
    return "install tiefmu again" if folder.parent == INSTALLED else "run `make binaries` again"


def is_stale(name: str) -> bool:
    """Whether one that `make binaries` built is missing or made from other sources."""
    folder = folder_of(name)
    if folder.parent == INSTALLED:
        return False
    made_from = folder / "made-from"
    return not made_from.is_file() or made_from.read_text().strip() != source_hash()


def stale() -> list[str]:
    """Platforms whose libraries are there, but made from other sources than those of this checkout."""
    return [name for name in BY_FOLDER if folder_of(name).is_dir() and is_stale(name)]


def missing(name: str) -> str:
    folder = folder_of(name)
    if folder.is_dir():
        return f"{folder} was made from other sources; run `make binaries` again"
    return f"there is no library for it; `make binaries PLATFORMS={name}` builds it"


def local() -> Library:
    """The one that was installed with the solver's module."""
    files = sorted(INSTALLED.glob("tiefmu.*"))
    if not files:
        raise UsageError(f"{INSTALLED}: the FMU's binary is not installed; install tiefmu again")
    return Library(here(), files[0].read_bytes(), {})
