"""The projection against a search in extended precision (tests/projection)."""

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
QUADS = int(os.environ.get("TIEFMU_QUADS", 20000))


@pytest.fixture(scope="module")
def program(tmp_path_factory) -> Path:
    """Built with the flags of the project."""
    file = tmp_path_factory.mktemp("projection") / "projection"
    eigen = Path(sysconfig.get_path("purelib")) / "cmeel.prefix" / "include" / "eigen3"
    sources = [
        ROOT / "tests" / "projection" / "main.cpp",
        ROOT / "src" / "segment.cpp",
        ROOT / "src" / "projection.cpp",
    ]
    compiler = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")
    flags = ["-std=c++20", "-O2", "-ffp-contract=off", f"-I{ROOT / 'src'}", "-isystem", eigen]
    subprocess.run([compiler, *flags, *sources, "-o", file], check=True)
    return file


def test_random_quads(program):
    """Sizes 1e-3 to 10, aspect ratios to 20, warped, convex and not, coordinates rounded to 2 to 16 digits of their
    size, up to 1e5 sizes from the origin; slaves inside, on edges and corners and up to 1.5 outside, gaps 0 to a size.
    """
    done = subprocess.run([program, str(QUADS), "1"], capture_output=True, text=True)
    print(done.stdout[-2000:])
    assert done.returncode == 0, done.stdout[-4000:]
    counts = re.fullmatch(
        r"(\d+) quads: 0 refused, 0 wrong; (\d+) missed by the search itself, .*"
        r"largest error (\S+) of what rounding allows\n",
        done.stdout,
    )
    assert int(counts[1]) == QUADS and 0 < float(counts[3]) < 1
    assert int(counts[2]) <= 1e-5 * QUADS
