"""Meshes as NumPy arrays (.npz)."""

import numpy as np
import pytest
from tiefmu import SceneError, load
from tiefmu.mesh import arrays
from tiefmu.report import report

GOOD = {
    "node_id": np.array([1, 2, 3, 4, 7, 101]),
    "position": np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0], [0.3, 0.6, 0.1]]),
    "segment_id": np.array([5, 8]),
    "segments": np.array([[1, 2, 3, 4], [2, 7, 3, 0]]),
    "nodes:pin": np.array([101]),
    "segments:sheet": np.array([5]),
}


def scene(tmp_path, monkeypatch, **changes) -> dict:
    monkeypatch.chdir(tmp_path)
    np.savez("m.npz", **{key: value for key, value in (GOOD | changes).items() if value is not None})
    return {
        "mesh": {"file": "m.npz"},
        "node": [{"nodes": "all", "mass": 1.0, "rotations": False, "motion": "driven"}],
        "tie": [{"name": "t", "segments": "sheet", "slaves": "pin", "search_distance": 1.0}],
    }


def test_sets_are_usable_by_name(tmp_path, monkeypatch):
    (row,) = report(load(scene(tmp_path, monkeypatch)))["slaves"]
    assert row["id"] == 101 and row["segment"] == 5


def test_what_is_written_is_read(tmp_path):
    for small in (True, False):
        sets = {"pin": GOOD["nodes:pin"]}, {"sheet": GOOD["segments:sheet"]}
        arrays.write(tmp_path / "m.npz", *(GOOD[key] for key in arrays.SHAPES), *sets, small)
        found = arrays.read(tmp_path / "m.npz")
        assert np.array_equal(found.node_id, GOOD["node_id"]) and np.array_equal(found.position, GOOD["position"])
        assert np.array_equal(found.blocks[0].nodes, GOOD["segments"])
        assert found.node_sets["pin"].tolist() == [101] and found.element_sets["sheet"].tolist() == [0]


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"node_id": None}, "has no array 'node_id'"),
        ({"position": np.zeros((6, 2))}, r"position: expected the shape \(n, 3\), found \(6, 2\)"),
        ({"segments": np.ones((2, 4))}, "segments: expected numbers, found an array of type float64"),
        ({"node_id": np.array([1, 2])}, "node_id has 2 entries, position has 6"),
        ({"node_id": np.array([1, 1, 3, 4, 7, 101])}, "node 1 is repeated"),
        ({"segments": np.array([[1, 2, 3, 9], [2, 7, 3, 0]])}, "segment 5: node 9 is not in the mesh"),
        ({"nodes:pin": np.array([102])}, "set 'pin': node 102 is not in the file"),
        ({"segments:sheet": np.array([6])}, "set 'sheet': segment 6 is not in the file"),
        ({"nodes:pin": np.array([[101]])}, "set 'pin': expected one row of ids"),
        ({"pin": np.array([101])}, "array 'pin' is not understood; sets are called nodes:NAME and segments:NAME"),
        ({"position": np.full((6, 3), np.nan)}, "node 1: a coordinate is not a finite number"),
        ({"node_id": np.array([1, 2, 3, 4, 7, None], object)}, "cannot be read as npz"),
    ],
)
def test_files_that_are_wrong(tmp_path, monkeypatch, changes, message):
    with pytest.raises(SceneError, match=rf"^scene: mesh: file: m.npz: {message}"):
        load(scene(tmp_path, monkeypatch, **changes))


@pytest.mark.parametrize("content", [b"", b"PK\3\4nonsense", b"\x93NUMPY", b"hello"])
def test_files_that_are_none(tmp_path, monkeypatch, content):
    tables = scene(tmp_path, monkeypatch)
    (tmp_path / "m.npz").write_bytes(content)
    with pytest.raises(SceneError, match=r"^scene: mesh: file: m.npz: cannot be read as npz"):
        load(tables)
