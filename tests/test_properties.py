"""[mesh] properties: a table of node properties beside the scene means what the same [[node]] tables mean."""

import numpy as np
import pytest
import tiefmu
from conftest import toml

CSV = """# from a deck
id, mass, inertia ,stiffness,rotational_stiffness,motion,rotations
3,0.25,2e-3,1e6,5.5,free,true

1,,,,,,TRUE
4, 1.5 ,,,,DRIVEN,0
2,,,0,,,1
101,0.7,,,,,
"""
TABLES = [
    {"nodes": [3], "mass": 0.25, "inertia": 2e-3, "stiffness": 1e6, "rotational_stiffness": 5.5, "motion": "free"},
    {"nodes": [1, 2, 3], "rotations": True},
    {"nodes": [4], "mass": 1.5, "motion": "driven", "rotations": False},
    {"nodes": [2], "stiffness": 0.0},
    {"nodes": [101], "mass": 0.7},
]
NPZ = {
    "id": np.array([3, 1, 4, 2, 101]),
    "mass": np.array([0.25, np.nan, 1.5, np.nan, 0.7]),
    "inertia": np.array([2e-3, np.nan, np.nan, np.nan, np.nan]),
    "stiffness": np.array([1e6, np.nan, np.nan, 0, np.nan]),
    "rotational_stiffness": np.array([5.5, np.nan, np.nan, np.nan, np.nan]),
    "motion": np.array(["free", "", "driven", "", ""]),
    "rotations": np.array(["true", "true", "false", "true", ""]),
}
UNITS = {"length": "mm", "mass": "t", "time": "ms"}


def scene_of(weld: dict, tables: list, **mesh) -> dict:
    weld = weld | {"units": UNITS, "node": tables, "mesh": weld["mesh"] | mesh}
    weld["tie"][0]["formulation"] = "optimized"
    return weld


def resource(scene) -> bytes:
    return tiefmu.load(scene).model.resource("")


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nodes.csv").write_text(CSV)
    np.savez(tmp_path / "nodes.npz", **NPZ)


@pytest.mark.parametrize("name", ["nodes.csv", "nodes.npz"])
def test_a_table_means_the_same_as_node_tables(weld, files, name):
    assert resource(scene_of(weld, [], properties=name)) == resource(scene_of(weld, TABLES))


def test_node_tables_override_it_key_by_key(weld, files):
    later = [{"nodes": [3], "mass": 0.5}, {"nodes": [4], "rotations": True}]
    scene = scene_of(weld, later, properties="nodes.csv")
    assert resource(scene) == resource(scene_of(weld, TABLES + later))
    assert resource(scene) != resource(scene_of(weld, TABLES))


def test_values_are_in_the_units_of_the_scene(weld, files):
    scene = scene_of(weld, [], properties="nodes.csv")
    scene["tie"][0]["formulation"] = "default"
    nodes = {row["id"]: row for row in tiefmu.report(tiefmu.load(scene))["masters"]}
    assert nodes[3]["mass"] == 250.0  # 0.25 t
    assert nodes[3]["motion"] == "free"


def test_numbers_of_rotations_in_npz_may_be_bools(weld, files, tmp_path):
    np.savez(tmp_path / "bools.npz", id=[1, 2, 3, 4], rotations=[True, True, True, False])
    tables = [{"nodes": [1, 2, 3], "rotations": True}, {"nodes": [101], "mass": 0.7}]
    assert resource(scene_of(weld, tables[1:], properties="bools.npz")) == resource(scene_of(weld, tables))


def test_it_is_relative_to_the_scene(weld, files, tmp_path):
    (tmp_path / "deck").mkdir()
    (tmp_path / "nodes.csv").rename(tmp_path / "deck" / "nodes.csv")
    path = tmp_path / "deck" / "weld.toml"
    path.write_text(toml(scene_of(weld, [], properties="nodes.csv")))
    assert resource(path) == resource(scene_of(weld, TABLES))


def test_a_slave_that_it_fixes(weld, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nodes.csv").write_text("id,motion\n101,fixed\n")
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(scene_of(weld, [], properties="nodes.csv"))
    assert str(error.value) == (
        "scene: tie 'weld': slave 101: constrained twice, by the tie and by motion = 'fixed' in nodes.csv; take it out "
        "of one"
    )


@pytest.mark.parametrize(
    "text, line",
    [
        ("", "is empty; its first line names the columns: id, mass, ..."),
        ("mass\n1\n", "has no column 'id'"),
        ("id,mas\n1,1\n", "unknown column 'mas'; did you mean 'mass'?"),
        ("id,mass,mass\n1,1,1\n", "column 'mass' is repeated"),
        ("id,mass\n1,1\n2\n", "line 3: has 1 fields, the first line names 2"),
        ("id,mass\n1,1\n\n# two\n2,x\n", "line 5: mass: expected a number, found 'x'"),
        ("id,mass\n1,-2\n", "line 2: mass: -2 is negative; it must be 0 or more"),
        ("id,mass\n1,\n2,nan\n", "line 3: mass: nan is not a finite number"),
        ("id,mass\n1,1e31\n", "line 2: mass: 1e+31 is too large; it must be at most 1e+30"),
        ("id,motion\n1,stuck\n", "line 2: motion: expected driven, free or fixed, found 'stuck'"),
        ("id,rotations\n1,2\n", "line 2: rotations: expected true or false, found '2'"),
        ("id,mass\n1,1\n9,1\n", "line 3: id: node 9 is not in the mesh (ids 1..101)"),
        ("id,mass\n1,1\n2,1\n1,1\n", "line 4: id: node 1 is repeated"),
        ("id,mass\n1.5,1\n", "line 2: id: expected an id (a whole number from 1), found '1.5'"),
        ("id,mass\n0,1\n", "line 2: id: expected an id (a whole number from 1), found '0'"),
        ("id,mass\n9223372036854775808,1\n", "line 2: id: expected an id (a whole number from 1), found '922337203685"),
        ("id,mass\n,1\n", "line 2: id: expected an id (a whole number from 1), found ''"),
        ("id,mass\n1,\xff\n", "not a text file (byte 10 is not UTF-8)"),
    ],
)
def test_wrong_csv(weld, tmp_path, monkeypatch, text, line):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nodes.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(scene_of(weld, [], properties="nodes.csv"))
    assert str(error.value).startswith(f"scene: mesh: properties: nodes.csv: {line}")


@pytest.mark.parametrize(
    "arrays, line",
    [
        ({"id": [1.0, 2.0]}, "row 1: id: expected an id (a whole number from 1), found 1.0"),
        ({"id": [1, 0]}, "row 2: id: expected an id (a whole number from 1), found 0"),
        ({"id": [1, 2], "mass": [1.0]}, "its columns are no arrays of one length"),
        ({"id": [[1, 2]], "mass": [[1.0, 2.0]]}, "its columns are no arrays of one length"),
        ({"id": [1, 2], "mass": ["a", "b"]}, "mass: expected numbers, found an array of type <U1"),
        ({"id": [1, 2], "mass": [1.0, -1.0]}, "row 2: mass: -1 is negative; it must be 0 or more"),
        ({"id": [1, 2], "motion": [1, 2]}, "row 1: motion: expected driven, free or fixed, found '1'"),
    ],
)
def test_wrong_npz(weld, tmp_path, monkeypatch, arrays, line):
    monkeypatch.chdir(tmp_path)
    np.savez(tmp_path / "nodes.npz", **{key: np.array(value) for key, value in arrays.items()})
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(scene_of(weld, [], properties="nodes.npz"))
    assert str(error.value) == f"scene: mesh: properties: nodes.npz: {line}"


def test_files_that_are_none(weld, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04 nonsense")
    for name, line in (("no.csv", "No such file or directory"), ("broken.npz", "cannot be read as npz (")):
        with pytest.raises(tiefmu.SceneError) as error:
            tiefmu.load(scene_of(weld, [], properties=name))
        assert str(error.value).startswith(f"scene: mesh: properties: {name}: {line}")
