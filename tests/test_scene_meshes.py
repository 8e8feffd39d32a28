"""Meshes, ties and springs that cannot be: the one line that names the node, segment or slave."""

from pathlib import Path

import pytest
import tiefmu
from scene_lines import NOT_FOUND, line_of

QUAD = [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0], [101, 0.03, 0.06, 0.04]]
NO_AREA = "without area and passed over: segment 1"
CROSSES = "the nearest is segment 1, which crosses itself (its nodes are not in order round it)"
BEYOND = "but the slave lies beyond its edge by more than a quarter of its size (|xi| or |eta| above 1.5)"
NEEDLE = QUAD[:2] + [[3, 0.1, 1e-9, 0], [4, 0, 1e-9, 0], [101, 0.03, 0, 0.04]]

# name: (nodes, segments, keys of the tie, line)
MESHES = {
    "bow-tie": (
        QUAD,
        [[1, 1, 3, 2, 4]],
        {},
        f"tie 'weld': slave 101: no segment found within search_distance 0.122474 m; {CROSSES}",
    ),
    "bow-tie, nearest node": (
        QUAD,
        [[1, 1, 2, 4, 3]],
        {"search": "nearest-node"},
        "tie 'weld': slave 101: no segment found at its nearest master node within "
        f"search_distance 0.141421 m; {CROSSES}",
    ),
    "folded quad": (
        QUAD[:2] + [[3, 0.1, 0, 0], [4, 0, 0, 0]] + QUAD[4:],
        [[1, 1, 2, 3, 4]],
        {},
        f"tie 'weld': slave 101: no segment found within search_distance 0.0707107 m; {NO_AREA}",
    ),
    "collinear triangle": (
        QUAD[:2] + [[3, 0.2, 0, 0], [101, 0.03, 0, 0.04]],
        [[1, 1, 2, 3]],
        {},
        f"tie 'weld': slave 101: no segment found within search_distance 0.141421 m; {NO_AREA}",
    ),
    "all nodes in one place": (
        [[i, 1, 1, 1] for i in (1, 2, 3, 4, 101)],
        [[1, 1, 2, 3, 4]],
        {},
        f"tie 'weld': slave 101: no segment found within search_distance 0 m; {NO_AREA}",
    ),
    "needle that cannot hold a rotation": (
        NEEDLE,
        [[1, 1, 2, 3, 4]],
        {"formulation": "optimized"},
        "tie 'weld': segment 1: cannot hold slave 101: its nodes are collinear "
        "(cond(Ibar) = 5.76461e+15, at most 1e12), which leaves the rotation about "
        "them open",
    ),
    "needle out of reach": (
        NEEDLE,
        [[1, 1, 2, 3, 4]],
        {"search": "nearest-node", "search_distance": 0.049},
        "tie 'weld': slave 101: no segment found at its nearest master node within "
        "search_distance 0.049 m; the nearest is segment 1 at 0.04 m",
    ),
    "slaves beside the masters": (
        QUAD[:4] + [[101, 10, 10, 0]],
        [[1, 1, 2, 3, 4]],
        {},
        "tie 'weld': slave 101: no segment found within search_distance 0.1 m; the nearest is segment 1 at 14.0007 m, "
        f"{BEYOND}",
    ),
    "slaves far above the masters": (
        QUAD[:4] + [[101, 0.05, 0.05, 10]],
        [[1, 1, 2, 3, 4]],
        {},
        "tie 'weld': slave 101: no segment found within search_distance 0.1 m; the nearest is segment 1 at 10 m",
    ),
    "repeated node": (QUAD + [[3, 1, 1, 1]], [[1, 1, 2, 3, 4]], {}, "mesh: node 3 is repeated"),
    "missing node": (QUAD[:3] + QUAD[4:], [[1, 1, 2, 3, 4]], {}, f"mesh: segment 1: node 4 {NOT_FOUND}"),
    "node id of a segment is zero": (
        QUAD,
        [[1, 1, 2, 0, 4]],
        {},
        "mesh: segment 1: node 3: 0 is too small; it must be at least 1",
    ),
    "segment id is negative": (
        QUAD,
        [[-4, 1, 2, 3, 4]],
        {},
        "mesh: segments: row 1: id: -4 is too small; it must be at least 1",
    ),
    "segment id is too large": (
        QUAD,
        [[2**63, 1, 2, 3, 4]],
        {},
        "mesh: segments: row 1: id: 9223372036854775808 is too large; it must be at most 9.22337e+18",
    ),
    "node too far away": (
        [[1, 0, 0, 1e200]] + QUAD[1:],
        [[1, 1, 2, 3, 4]],
        {},
        "mesh: node 1: z: 1e+200 is too large; it must be at most 1e+30",
    ),
    "node too far away on the other side": (
        [[1, 0, -1e31, 0]] + QUAD[1:],
        [[1, 1, 2, 3, 4]],
        {},
        "mesh: node 1: y: -1e+31 is too small; it must be at least -1e+30",
    ),
}


@pytest.mark.parametrize("name", MESHES)
def test_mesh(name, weld, scene_file, capsys):
    nodes, segments, keys, line = MESHES[name]
    weld["mesh"] = {"nodes": nodes, "segments": segments}
    weld["tie"][0] |= keys
    assert line_of(scene_file, capsys, weld) == line


@pytest.mark.parametrize(
    "segments", [[[1, 4, 3, 2, 1]], [[1, 1, 2, 3, 4], [2, 4, 3, 2, 1]]], ids=["inverted", "inverted twin"]
)
def test_the_sense_of_a_segment_is_free(segments, weld):
    """No broken scene: a tie has no inside, so that an inverted segment moves its slaves as the other does."""
    weld["tie"][0]["formulation"] = "optimized"
    straight = tiefmu.report(tiefmu.load(weld))
    weld["mesh"]["segments"] = segments
    inverted = tiefmu.report(tiefmu.load(weld))
    assert inverted["warnings"] == straight["warnings"] == []
    assert sorted(map(repr, inverted["slaves"][0]["weights"])) == sorted(map(repr, straight["slaves"][0]["weights"]))


def test_segments_without_area_are_named_where_others_hold_the_slaves(weld):
    weld["mesh"]["nodes"].append([5, 0.05, 0, 0])
    weld["mesh"]["segments"].append([2, 1, 5, 2])
    assert (
        "tie 'weld': segment 2: has no area (its nodes coincide, are collinear or fold onto each other); passed over"
        in tiefmu.report(tiefmu.load(weld))["warnings"]
    )


def test_chain_of_ties(weld, scene_file, capsys):
    """The slave of one tie as the master of another, and the two as each other's masters."""
    weld["mesh"]["nodes"] += [[102, 0.03, 0.05, 0.05], [103, 0.05, 0.05, 0.05], [104, 0.03, 0.05, 0.06]]
    weld["mesh"]["segments"].append([2, 101, 102, 103])
    weld["tie"][0]["segments"] = [1]
    weld["tie"].append({"name": "glue", "segments": [2], "slaves": [104]})
    assert (
        line_of(scene_file, capsys, weld)
        == "tie 'weld': slave 101: is also a master, on segment 2 of tie 'glue'; take it out of one of them"
    )
    weld["tie"][1]["slaves"] = [4]
    weld["tie"][0]["slaves"] = [103]
    assert (
        line_of(scene_file, capsys, weld)
        == "tie 'glue': slave 4: is also a master, on segment 1 of tie 'weld'; take it out of one of them"
    )


def test_slaves_are_masters_too(weld, scene_file, capsys):
    weld["tie"][0]["slaves"] = [101, 1]
    assert (
        line_of(scene_file, capsys, weld)
        == "tie 'weld': slave 1: is also a master, on segment 1 of tie 'weld'; take it out of one of them"
    )


def test_all_slaves_of_a_set_are_masters(weld, scene_file, capsys):
    del weld["mesh"]["nodes"][-1], weld["node"][-1]
    weld["tie"][0]["slaves"] = "all"
    assert line_of(scene_file, capsys, weld) == "tie 'weld': slaves: every node of 'all' is a master of this tie"


def test_free_node_that_turns_without_inertia(weld, scene_file, capsys):
    weld["mesh"]["nodes"].append([5, 1, 1, 1])
    weld["node"].append({"nodes": [5], "motion": "free", "rotations": True, "mass": 1.0})
    weld["spring"] = [{"ground": [5], "kind": "bushing", "stiffness": 1.0}]
    assert (
        line_of(scene_file, capsys, weld) == "node 5: is free but has no inertia of its own and gets none from its "
        "slaves; give it inertia, or rotations = false"
    )


def test_spring_on_free_node_without_mass(weld, scene_file, capsys):
    weld["mesh"]["nodes"].append([5, 1, 1, 1])
    weld["node"].append({"nodes": [5], "motion": "free", "mass": 0.0})
    weld["spring"] = [{"nodes": [5, 101], "stiffness": 1.0}]
    assert (
        line_of(scene_file, capsys, weld)
        == "node 5: is free but has no mass of its own and gets none from its slaves; give it mass"
    )


def test_torsion_on_what_cannot_turn(weld, scene_file, capsys):
    weld["spring"] = [{"nodes": [101, 1], "kind": "bushing", "rotational_stiffness": 1.0}]
    assert (
        line_of(scene_file, capsys, weld) == "spring 1: slave 101 cannot take a moment: the nodes of segment 1 of "
        "tie 'weld' have no rotations; use formulation = \"optimized\""
    )


@pytest.mark.parametrize("number", [2**63, 2**64, 10**30])
def test_ids_of_a_gmsh_file_that_are_too_large(number, weld, scene_file, tmp_path):
    text = (Path(__file__).parent / "fuzz" / "corpus" / "scene" / "panel_2.msh").read_text()
    (tmp_path / "panel.msh").write_text(text.replace("\n72 3 2 ", f"\n{number} 3 2 "))
    weld["mesh"] = {"file": "panel.msh"}
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(scene_file(weld))
    assert str(error.value) == (
        f"weld.toml: mesh: file: panel.msh: {number} is no id; ids are less than 9223372036854775808"
    )


@pytest.mark.parametrize("file, line", [("..", "no such file"), ("a" * 300, "File name too long")])
def test_mesh_files_that_are_none(file, line, weld):
    weld["mesh"] = {"file": file}
    with pytest.raises(tiefmu.SceneError) as error:
        tiefmu.load(weld)
    assert str(error.value) == f"scene: mesh: file: {file}: {line}"


def test_every_slave_dropped(weld, scene_file, capsys):
    weld["mesh"]["nodes"][-1] = [101, 5.0, 5.0, 0.0]
    weld["tie"][0]["unresolved"] = "drop"
    line = line_of(scene_file, capsys, weld)
    assert line.startswith("tie 'weld': all its slaves are dropped (slave 101: no segment found ")
