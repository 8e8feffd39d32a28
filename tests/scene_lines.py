"""A scene with one entry changed, and the one line that the command line says about it."""

import copy
import os

from tiefmu.cli import main

IDS = "expected ids (whole numbers from 1)"
NOT_FOUND = "is not in the mesh (ids 1..101)"
NAN, INF = float("nan"), float("inf")


MISSING = object()


def changed(scene: dict, path: tuple, value) -> dict:
    """The scene with the entry at `path` replaced, added, or (MISSING) taken out."""
    scene = copy.deepcopy(scene)
    place = scene
    for key in path[:-1]:
        place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
    if value is MISSING:
        del place[path[-1]]
    elif isinstance(place, list) and path[-1] == len(place):
        place.append(value)
    else:
        place[path[-1]] = value
    return scene


def line_of(scene_file, capsys, scene) -> str:
    """What `tiefmu build` says about the scene, after checking that it says it properly."""
    name = scene_file(scene)
    status = main(["build", name])
    said = capsys.readouterr()
    assert status == 2
    assert said.out == ""
    assert said.err.startswith(f"error: {name}: ") and said.err.endswith("\n") and said.err.count("\n") == 1
    assert os.listdir() == [name], "left something behind"
    return said.err[len(f"error: {name}: ") : -1]
