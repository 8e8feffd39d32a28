"""Every key of a scene, wrong in every way."""

import pytest
import tiefmu
from scene_lines import IDS, INF, NAN, NOT_FOUND, changed
from tiefmu.schema import ARRAYS, TABLES, SceneTables


def one_of(*names) -> list:
    names = ", ".join(f"'{name}'" for name in names)
    return [
        (value, f"{shown} is not one of {names}")
        for value, shown in (("", "''"), ("x", "'x'"), (1, "1"), (True, "true"), ([], "[]"), ({}, "a table"))
    ]


TEXT = [
    (5, "expected a text, found 5"),
    (True, "expected a text, found true"),
    (["a"], "expected a text, found ['a']"),
    ({}, "expected a text, found a table"),
    ("a\x00", "holds a character that cannot be printed, U+0000"),
    ("\u2028", "holds a character that cannot be printed, U+2028"),
]
NAME = TEXT + [("", "is empty"), ("a\nb", "holds a character that cannot be printed, U+000A")]
FLAG = [(1, "expected true or false, found 1"), ("yes", "expected true or false, found 'yes'")]
FINITE = [
    ("1", "expected a number, found '1'"),
    (True, "expected a number, found true"),
    ([1.0], "expected a number, found [1.0]"),
    ({}, "expected a number, found a table"),
    (NAN, "nan is not a finite number"),
    (INF, "inf is not a finite number"),
    (1e31, "1e+31 is too large; it must be at most 1e+30"),
    (10**400, f"1{'0' * 36}... is too large; it must be at most 1e+30"),
]
NUMBER = FINITE + [(-1e-3, "-0.001 is negative; it must be 0 or more")]
POSITIVE = FINITE + [(0, "0 is too small; it must be more than 0"), (-1, "-1 is too small; it must be more than 0")]
TOLERANCE = [
    (value, line.replace("+31 is too large; it must be at most 1e+30", "+31 is too large; it must be at most 0.01"))
    for value, line in FINITE
] + [(0, "0 is too small; it must be at least 1e-13"), (0.1, "0.1 is too large; it must be at most 0.01")]
SHARE = [
    (value, line.replace("+31 is too large; it must be at most 1e+30", "+31 is too large; it must be at most 1"))
    for value, line in FINITE
] + [(-0.1, "-0.1 is too small; it must be at least 0"), (1.5, "1.5 is too large; it must be at most 1")]
THREADS = [
    (0, "0 is too small; it must be at least 1"),
    (-3, "-3 is too small; it must be at least 1"),
    (257, "257 is too large; it must be at most 256"),
    (10**9, "1000000000 is too large; it must be at most 256"),
    (2.5, "expected a whole number, found 2.5"),
    (True, "expected a whole number, found true"),
    ("two", "expected a whole number, found 'two'"),
    ([2], "expected a whole number, found [2]"),
]
VECTOR = [
    (value, f"expected [x, y, z], found {shown}")
    for value, shown in (
        (1.0, "1.0"),
        ("x", "'x'"),
        ([], "[]"),
        ([1, 2], "[1, 2]"),
        ([1, 2, 3, 4], "[1, 2, 3, 4]"),
        ([1, 2, True], "[1, 2, true]"),
        ({}, "a table"),
    )
] + [([0, -INF, 0], "-inf is not a finite number"), ([0, 0, -1e40], "-1e+40 is too large; it must be at most 1e+30")]
NUMBER_OR_VECTOR = [
    (value, f"expected a number or [x, y, z], found {shown}")
    for value, shown in (("x", "'x'"), (True, "true"), ([], "[]"), ([1, 2], "[1, 2]"), ([1, 2, "3"], "[1, 2, '3']"))
] + [
    (-1, "-1 is negative; it must be 0 or more"),
    ([1, -2, 3], "-2 is negative; it must be 0 or more"),
    (NAN, "nan is not a finite number"),
    ([1e50, 0, 0], "1e+50 is too large; it must be at most 1e+30"),
]
NODES = [
    (value, f"expected a list of ids, a set name or 'all', found {shown}")
    for value, shown in ((5, "5"), (1.5, "1.5"), (True, "true"), ({}, "a table"))
] + [
    ([], "the list is empty; give at least one id"),
    ("", "the name of the set is empty"),
    ([1, 1], "id 1 is repeated"),
    ([999], f"node 999 {NOT_FOUND}"),
    ([2**63], f"{IDS}, found {2**63}"),
    ([-1], f"{IDS}, found -1"),
    ([0], f"{IDS}, found 0"),
    (["1"], f"{IDS}, found '1'"),
    ([[1]], f"{IDS}, found [1]"),
    ("a\nb", "the mesh has no set 'a\\nb'; it has no sets of nodes: give ids or 'all'"),
]
SEGMENTS = [
    (
        value,
        line.replace("node 999", "segment 999").replace("1..101", "1..1").replace("sets of nodes", "sets of segments"),
    )
    for value, line in NODES
]
TABLE = [
    (value, f"expected a table, found {shown}")
    for value, shown in ((5, "5"), ("x", "'x'"), (True, "true"), ([1], "[1]"))
]
LIST = [
    (value, f"expected a list, found {shown}")
    for value, shown in ((5, "5"), ("x", "'x'"), (True, "true"), ({}, "a table"))
]
PORT = "expected the name of a set, or a table {name, nodes, at}"
PORTS = LIST + [
    ([value], f"entry 1: {line}")
    for value, line in (
        (3, f"{PORT}, found 3"),
        (["a"], f"{PORT}, found ['a']"),
        (True, f"{PORT}, found true"),
        ({}, "name: is missing"),
        (
            "",
            "'' cannot name a port: letters, digits, spaces and _ - . : / can; "
            "give the set as nodes, with another name",
        ),
        ({"name": 5}, "name: expected a text, found 5"),
        ({"name": " a"}, "' a' cannot name a port: letters, digits, spaces and _ - . : / can"),
        ({"name": "a\n"}, "'a\\n' cannot name a port: letters, digits, spaces and _ - . : / can"),
        ({"name": "a", "nodes": 5}, "nodes: expected a list of ids, a set name or 'all', found 5"),
        ({"name": "a", "nodes": [1.5]}, f"nodes: {IDS}, found 1.5"),
        ({"name": "a", "at": [0, 0, NAN]}, "at: nan is not a finite number"),
    )
]
NAMES = LIST + [([3], "entry 1: expected a text, found 3"), ([["v"]], "entry 1: expected a text, found ['v']")]


def tables(name: str) -> list:
    return [
        (value, f"expected tables written [[{name}]], found {shown}")
        for value, shown in ((5, "5"), ("x", "'x'"), ({}, "a table"))
    ]


KEYS = {
    ("title",): TEXT,
    ("units",): TABLE,
    ("units", "length"): one_of("m", "cm", "mm", "um", "km", "in", "ft"),
    ("units", "mass"): one_of("kg", "g", "mg", "t", "lb"),
    ("units", "time"): one_of("s", "ms", "us", "min"),
    ("mesh",): TABLE,
    ("mesh", "file"): NAME,
    ("mesh", "properties"): NAME,
    ("mesh", "nodes"): LIST,
    ("mesh", "segments"): LIST,
    ("node",): tables("node"),
    ("node", 0, "nodes"): NODES,
    ("node", 0, "motion"): one_of("driven", "free", "fixed"),
    ("node", 0, "rotations"): FLAG,
    ("node", 0, "mass"): NUMBER,
    ("node", 0, "inertia"): NUMBER,
    ("node", 0, "stiffness"): NUMBER,
    ("node", 0, "rotational_stiffness"): NUMBER,
    ("tie",): tables("tie"),
    ("tie", 0, "name"): NAME,
    ("tie", 0, "segments"): SEGMENTS,
    ("tie", 0, "slaves"): NODES,
    ("tie", 0, "formulation"): one_of("default", "optimized"),
    ("tie", 0, "search"): one_of("box", "nearest-node"),
    ("tie", 0, "search_distance"): NUMBER,
    ("tie", 0, "unresolved"): one_of("error", "drop"),
    ("spring",): tables("spring"),
    ("spring", 0, "ground"): NODES,
    ("spring", 0, "kind"): one_of("axial", "bushing", "beam"),
    ("spring", 0, "stiffness"): NUMBER_OR_VECTOR,
    ("spring", 0, "damping"): NUMBER_OR_VECTOR,
    ("spring", 0, "rotational_stiffness"): NUMBER_OR_VECTOR,
    ("spring", 0, "rotational_damping"): NUMBER_OR_VECTOR,
    ("spring", 0, "orientation"): VECTOR,
    ("initial",): tables("initial"),
    ("initial", 0, "nodes"): NODES,
    ("initial", 0, "v"): VECTOR,
    ("initial", 0, "w"): VECTOR,
    ("model",): TABLE,
    ("model", "inertia"): one_of("lumped", "consistent"),
    ("model", "solver_tolerance"): TOLERANCE,
    ("model", "reaction"): one_of("loads", "full", "split"),
    ("model", "reaction_lead"): SHARE,
    ("model", "geometry"): one_of("finite", "small"),
    ("model", "position"): one_of("integrated", "input"),
    ("model", "gravity"): VECTOR,
    ("integrator",): TABLE,
    ("integrator", "method"): one_of("central-difference", "symplectic-euler", "noh-bathe", "rk4"),
    ("integrator", "time_step"): NUMBER,
    ("integrator", "safety"): POSITIVE,
    ("integrator", "threads"): THREADS,
    ("interface",): TABLE,
    ("interface", "names"): one_of("structured", "flat"),
    ("interface", "expose"): NAMES,
    ("interface", "hide"): NAMES,
    ("interface", "ports"): PORTS,
}


def test_all_keys_are_in_the_table():
    """Of `spring`, `nodes` has cases of its own above."""
    keys = {(table,) for table in SceneTables.model_fields}
    for name, model in TABLES.items():
        keys |= {(name, 0, key) if name in ARRAYS else (name, key) for key in model.model_fields}
    assert set(KEYS) == keys - {("spring", 0, "nodes")}


@pytest.mark.parametrize("path", KEYS, ids=lambda path: ".".join(map(str, path)))
def test_wrong_value(path, weld):
    """A dict: what is said does not depend on where the scene came from, as the cases above show."""
    weld |= {"spring": [{"ground": [1], "kind": "bushing"}], "initial": [{"nodes": [1], "v": [0, 0, 0]}]}
    head = {"node": "node table 1", "tie": "tie 'weld'", "spring": "spring 1", "initial": "initial 1"}
    for value, line in KEYS[path]:
        where = ": ".join([head.get(path[0], path[0]), *path[2:]] if len(path) == 3 else path)
        if path == ("tie", 0, "name"):
            where = "tie 1: name" if not isinstance(value, str) or not value else f"tie '{escaped(value)}': name"
        with pytest.raises(tiefmu.SceneError) as error:
            tiefmu.load(changed(weld, path, value))
        assert str(error.value) == f"scene: {where}: {line}"


def escaped(name: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in name)
