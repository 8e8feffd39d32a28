"""What the fuzzers start from, and some thousand broken scenes. More of everything: `make fuzz`."""

import subprocess
import sys
from pathlib import Path

import pytest
import tiefmu
from fuzz.make_corpus import SMALL

FUZZ = Path(__file__).resolve().parent / "fuzz"
HEADER = len("tiefmu scene\n") + 4  # and the version


@pytest.mark.parametrize("path", sorted((FUZZ / "corpus" / "scene").glob("*.toml")), ids=lambda path: path.stem)
def test_corpus_of_scenes_is_whole(path):
    assert len(tiefmu.report(tiefmu.load(path))["slaves"]) > 0


def test_corpus_of_resources_is_of_this_format():
    """Of another length or version it fuzzes nothing but the header: raise formatVersion, run fuzz/make_corpus.py."""
    now = tiefmu.load(SMALL).model.resource("{fuzz}")
    kept = (FUZZ / "corpus" / "resource" / "small.bin").read_bytes()
    assert (len(kept), kept[:HEADER]) == (len(now), now[:HEADER])


def test_broken_scenes_are_refused_in_one_line():
    done = subprocess.run([sys.executable, str(FUZZ / "scenes.py"), "--count", "2000"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "2000 variants\n"
