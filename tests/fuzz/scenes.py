"""Loads broken variants of the scenes and mesh files in corpus/scene.

    python tests/fuzz/scenes.py --seconds 20
    python tests/fuzz/scenes.py --first 4711 --count 1 --keep FOLDER      one variant again, its files kept

Whatever stands in a file, `load` gives a scene - whose report, description and resource can be written - or a
SceneError of one line. The first variant that does otherwise ends the program with its number and status 1; a crash
of the interpreter leaves the number in the traceback's last line (`faulthandler`).
"""

import argparse
import faulthandler
import json
import random
import sys
import tempfile
import time
import traceback
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import tiefmu
from tiefmu import package

CORPUS = Path(__file__).resolve().parent / "corpus" / "scene"
SCENES = sorted(CORPUS.glob("*.toml"))
ODD = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-308",
    "1e200",
    "1e30",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775808",
    "1e400",
    "true",
    "[]",
    "{}",
    "''",
    '"all"',
    "[[]]",
    "[1]",
    "1.5",
    '"\\u0000"',
    '"a\\nb"',
    '"%s%n"',
    "\ufffe",
    "é",
    "\x00",
    "\n",
    ",",
    "=",
    "[",
    "]",
    '"',
    "#",
    "*",
    "$",
    "1979-05-27",
    "0x1F",
]


def variant(text: str, rng: random.Random) -> str:
    """The text with one to four changes: odd tokens, lost, doubled and swapped tokens and lines, noise."""
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        how = rng.randrange(6)
        if how < 3:  # tokens: words, numbers, signs
            parts = tokens(text)
            at = rng.randrange(len(parts))
            parts[at] = [rng.choice(ODD), "", parts[at] * 2, rng.choice(parts), rng.choice(ODD)][rng.randrange(5)]
            text = "".join(parts)
        elif how < 5:
            lines = text.split("\n")
            at = rng.randrange(len(lines))
            lines[at : at + 1] = [[], [lines[at]] * 2, [rng.choice(lines)], lines[at:]][rng.randrange(4)]
            text = "\n".join(lines)
        elif text:
            at = rng.randrange(len(text))
            text = (
                text[:at] + chr(rng.choice([0, 9, 10, 34, 44, 46, 91, 93, 127, 233, 0x2028, 0xFFFE])) + text[at + 1 :]
            )
        text = text or "\n"
    return text


def tokens(text: str) -> list[str]:
    parts = [""]
    for a, b in zip(" " + text, text):
        if word(a) and word(b):
            parts[-1] += b
        else:
            parts.append(b)
    return parts[1:] or [""]


def word(c: str) -> bool:
    return c.isalnum() or c in "_.-+"


def write(number: int, folder: Path) -> Path:
    """The scene and mesh files of a variant; one of them is broken."""
    rng = random.Random(number)
    scene = rng.choice(SCENES)
    files = [scene] + [f for f in CORPUS.iterdir() if f.name in scene.read_text()]
    broken = rng.choice(files)
    for f in files:
        text = f.read_text()
        data = (variant(text, rng) if f == broken else text).encode("utf-8", "surrogatepass")
        if f == broken and rng.randrange(20) == 0:
            at = rng.randrange(len(data))
            data = data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
        (folder / f.name).write_bytes(data)
    return folder / scene.name


def check(path: Path):
    """Raises unless the scene is loaded, or refused properly."""
    try:
        scene = tiefmu.load(path)
        xml = package.contents(scene)["modelDescription.xml"]
        json.dumps(tiefmu.report(scene), allow_nan=False)
    except tiefmu.SceneError as error:
        line = str(error)
        assert line.startswith(f"{path}: ") and line.isprintable(), repr(line)
        return
    for element in ElementTree.fromstring(xml).iter("Real"):
        if "start" in element.attrib:
            assert abs(float(element.attrib["start"])) <= sys.float_info.max, element.attrib
    assert len(scene.model.resource("{guid}")) > 0


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--count", type=float, default=float("inf"))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args(arguments)
    faulthandler.enable()
    warnings.simplefilter("error")
    number, end = options.first, time.monotonic() + options.seconds
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        while number < options.first + options.count and time.monotonic() < end:
            path = write(number, folder)
            faulthandler.dump_traceback_later(60, exit=True)
            try:
                check(path)
            except Exception:
                traceback.print_exc()
                print(f"variant {number}", file=sys.stderr)
                return 1
            number += 1
    faulthandler.cancel_dump_traceback_later()
    print(f"{number - options.first} variants")
    return 0


if __name__ == "__main__":
    sys.exit(main())
