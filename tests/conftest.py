"""Fixtures for scenes as dicts, as files, and for the command line."""

import subprocess
import sys

import pytest
from tiefmu import binaries
from tiefmu.cli import main

pytest_plugins = ["fmu_scenes"]  # its fixtures


@pytest.fixture(autouse=True, scope="session")
def only_the_local_compilers_library(request, tmp_path_factory):
    """Tests do not depend on what `make binaries` has left in the checkout, but for those of just that."""
    if not any(item.get_closest_marker("elsewhere") for item in request.session.items):
        binaries.BUILT = tmp_path_factory.mktemp("binaries") / "nowhere"


@pytest.fixture
def weld() -> dict:
    """The scene of the interface page: one quad, one slave off its plane, driven masters."""
    return {
        "title": "Spot weld on a quarter panel",
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0], [101, 0.03, 0.06, 0.04]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "motion": "driven", "rotations": False, "mass": 1.0}, {"nodes": [101], "mass": 0.7}],
        "tie": [
            {
                "name": "weld",
                "segments": "all",
                "slaves": [101],
                "formulation": "default",
                "search": "box",
                "search_distance": 0.0,
                "unresolved": "error",
            }
        ],
    }


def toml(value, top=True) -> str:
    """A scene dict as TOML text."""
    if isinstance(value, dict) and top:
        return "".join(f"{key} = {toml(item, False)}\n" for key, item in value.items())
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(item, False)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(item, False) for item in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"' if isinstance(value, str) else repr(value)


@pytest.fixture
def scene_file(tmp_path, monkeypatch):
    """Writes a scene dict (or text) to a file in an empty current folder; returns its name."""
    monkeypatch.chdir(tmp_path)

    def write(scene, name="weld.toml") -> str:
        (tmp_path / name).write_text(scene if isinstance(scene, str) else toml(scene))
        return name

    return write


@pytest.fixture
def process(tmp_path):
    """Runs the command line in a process of its own, in the test's folder."""

    def run(*arguments) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-m", "tiefmu.cli", *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True
        )

    return run


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """The same in this process, which a second of imports has already been spent on."""

    def run(*arguments) -> subprocess.CompletedProcess:
        monkeypatch.chdir(tmp_path)
        capsys.readouterr()
        try:
            status = main([*map(str, arguments)])
        except SystemExit as end:  # of argparse
            status = end.code
        return subprocess.CompletedProcess(arguments, status, *capsys.readouterr())

    return run
