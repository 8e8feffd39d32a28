"""Types and checks of command-line arguments."""

import argparse
import math
import textwrap
from pathlib import Path

from .errors import UsageError


class Help(argparse.HelpFormatter):
    """Text that keeps options whole: --host-step is not broken at its hyphens."""

    def _fill_text(self, text, width, indent):
        return textwrap.fill(
            " ".join(text.split()), width, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False
        )


class Parser(argparse.ArgumentParser):
    """So are its commands."""

    def __init__(self, **options):
        super().__init__(**{"formatter_class": Help} | options)


def positive(text: str) -> float:
    """A finite number above 0. Raises ArgumentTypeError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a positive number")
    return value


def whole(text: str) -> int:
    """A whole number above 0. Raises ArgumentTypeError."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number above 0")
    return int(text)


def is_fmu(name: str) -> bool:
    return name.lower().endswith(".fmu")


def existing(name: str) -> Path:
    """Raises UsageError where there is no such file."""
    path = Path(name)
    if not path.is_file():
        raise UsageError(f"{name}: no such file")
    return path


def check_ending(path: Path, *endings: str) -> None:
    """Raises UsageError where the file is called like one of another kind."""
    if path.suffix.lower() not in endings:
        raise UsageError(f"{path}: is written as {' or '.join(endings)}; give it that ending")


def check_folder_of(path: Path) -> None:
    """Raises UsageError where the file could not be written because its folder is missing."""
    if not path.parent.is_dir():
        raise UsageError(f"{path}: folder {path.parent} does not exist")
