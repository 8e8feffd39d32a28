"""The tree obeys its own rules: clang-format, ruff and mypy find nothing."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ["bench", "fmu", "modelDescription", "python", "src", "tests"]
CXX = sorted(str(path) for folder in FOLDERS for path in (ROOT / folder).rglob("*.?pp"))


@pytest.mark.parametrize(
    "command",
    [["clang-format", "--dry-run", "--Werror", *CXX], ["ruff", "check"], ["ruff", "format", "--check"], ["mypy"]],
    ids=["C++ format", "lint", "format", "types"],
)
def test_nothing_is_found(command):
    tool = Path(sys.executable).with_name(command[0])
    found = subprocess.run([tool, *command[1:]], cwd=ROOT, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout + found.stderr
