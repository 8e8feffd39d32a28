"""From scene to FMU: units, node tables, mesh files, the report, and the archive."""

import copy
import json
import re
import zipfile

import numpy as np
import pytest
import tiefmu
from tiefmu import binaries, package
from tiefmu.platforms import here


def found(scene: dict) -> dict:
    return tiefmu.report(tiefmu.load(scene))


def model_bytes(scene: dict) -> bytes:
    return tiefmu.load(scene).model.resource("")


# ------------------------------------------------------------------------------------------------------------- units


def everything(length, mass, time) -> dict:
    """A scene that uses every quantity with a unit, written in units of `length` m, `mass` kg and `time` s. All are
    decimal powers of ten, so that the text of each number changes and nothing else."""

    def in_units(value, powers):
        factor = length ** powers[0] * mass ** powers[1] * time ** powers[2]
        scaled = np.asarray(value, float) / factor if factor > 1 else np.asarray(value, float) * round(1 / factor)
        return np.vectorize(lambda x: float(f"{x:.12g}"))(scaled).tolist()

    L, M, T, stiffness, turning = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 1, -2), (2, 1, -2)
    nodes = [[1, 0, 0, 0], [2, 0.1, 0, 0], [3, 0.1, 0.1, 0], [4, 0, 0.1, 0], [5, 0.3, 0, 0], [101, 0.03, 0.06, 0.04]]
    return {
        "mesh": {"nodes": [[row[0], *in_units(row[1:], L)] for row in nodes], "segments": [[1, 1, 2, 3, 4]]},
        "node": [
            {
                "nodes": "all",
                "motion": "free",
                "rotations": True,
                "mass": in_units(1.5, M),
                "inertia": in_units(0.002, (2, 1, 0)),
                "stiffness": in_units(4000, stiffness),
                "rotational_stiffness": in_units(30, turning),
            }
        ],
        "tie": [{"name": "weld", "slaves": [101], "search_distance": in_units(0.25, L)}],
        "spring": [
            {
                "ground": [1, 2, 3],
                "kind": "bushing",
                "stiffness": in_units([1000, 2000, 3000], stiffness),
                "damping": in_units(5, (0, 1, -1)),
                "rotational_stiffness": in_units(7, turning),
                "rotational_damping": in_units([0.1, 0.2, 0.3], (2, 1, -1)),
            },
            {"nodes": [4, 5], "stiffness": in_units(6000, stiffness), "damping": in_units(8, (0, 1, -1))},
        ],
        "initial": [{"nodes": [1, 2], "v": in_units([1, 2, 3], (1, 0, -1)), "w": in_units([4, 5, 6], (0, 0, -1))}],
        "model": {"gravity": in_units([0, 0, -10], (1, 0, -2))},
        "integrator": {"time_step": in_units(0.0002, T)},
    }


@pytest.mark.parametrize(
    "units, factors",
    [
        ({"length": "mm", "mass": "t", "time": "s"}, (1e-3, 1e3, 1)),
        ({"length": "mm", "mass": "kg", "time": "ms"}, (1e-3, 1, 1e-3)),
        ({"length": "cm", "mass": "g", "time": "us"}, (1e-2, 1e-3, 1e-6)),
        ({"length": "km", "mass": "mg", "time": "s"}, (1e3, 1e-6, 1)),
        ({"length": "um"}, (1e-6, 1, 1)),
    ],
)
def test_units_give_the_same_model(units, factors):
    metric = found(everything(1, 1, 1))
    other = found(everything(*factors) | {"units": units})
    compare(other, metric)
    assert other["masters"][0]["mass"] == 1.5
    start, same = (tiefmu.load(scene).start for scene in (everything(*factors) | {"units": units}, everything(1, 1, 1)))
    for field in same.fields:
        np.testing.assert_allclose(start.get(field), same.get(field), rtol=1e-9, atol=1e-12, err_msg=field)


def test_millimetres_and_tonnes_give_the_same_bits(weld):
    """30 mm is the same double as 0.03 m: both are the nearest to the decimal number. With rotations nothing is to be
    said: messages name lengths in the scene's unit."""
    weld["node"][0]["rotations"] = True
    other = copy.deepcopy(weld) | {"units": {"length": "mm", "mass": "t", "time": "s"}}
    other["mesh"]["nodes"] = [[1, 0, 0, 0], [2, 100, 0, 0], [3, 100, 100, 0], [4, 0, 100, 0], [101, 30, 60, 40]]
    other["node"][0]["mass"], other["node"][1]["mass"] = 1e-3, 7e-4
    assert model_bytes(other) == model_bytes(weld)


@pytest.mark.parametrize(
    "units, metres, kilograms",
    [({"length": "in", "mass": "lb", "time": "min"}, 0.0254, 0.45359237), ({"length": "ft"}, 0.3048, 1.0)],
)
def test_other_units(weld, units, metres, kilograms):
    weld["units"] = units
    weld["node"][0]["rotations"] = True
    report = found(weld)
    assert report["slaves"][0]["d"] == pytest.approx(0.04 * metres, rel=1e-15, abs=0)
    assert sum(row["added_mass"] for row in report["masters"]) == pytest.approx(0.7 * kilograms, rel=1e-15, abs=0)


def compare(one, other, path="report"):
    if isinstance(other, dict):
        assert one.keys() == other.keys(), path
        for key in other:
            compare(one[key], other[key], f"{path}.{key}")
    elif isinstance(other, list):
        assert len(one) == len(other), path
        for k, (a, b) in enumerate(zip(one, other)):
            compare(a, b, f"{path}[{k}]")
    elif isinstance(other, float):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-14), path
    else:
        assert one == other, path


# ------------------------------------------------------------------------------------------------- node tables, initial


def test_later_node_tables_override_node_by_node_and_key_by_key(weld):
    weld["node"] = [
        {"nodes": "all", "mass": 1.0, "stiffness": 5.0},
        {"nodes": [1, 2], "mass": 2.0, "motion": "free"},
        {"nodes": [2, 3], "motion": "fixed", "rotations": True, "inertia": 0.5},
        {"nodes": [101], "mass": 0.7},
    ]
    masters = {row["id"]: row for row in found(weld)["masters"]}
    assert [masters[i]["mass"] for i in (1, 2, 3, 4)] == [2.0, 2.0, 1.0, 1.0]
    assert [masters[i]["motion"] for i in (1, 2, 3, 4)] == ["free", "fixed", "fixed", "driven"]
    assert [masters[i]["rotations"] for i in (1, 2, 3, 4)] == [False, True, True, False]


def test_slave_may_be_fixed_only_by_all(weld):
    weld["node"].insert(0, {"nodes": "all", "motion": "fixed"})
    assert found(weld)["slaves"][0]["id"] == 101
    weld["node"].append({"nodes": [101], "motion": "fixed"})
    with pytest.raises(tiefmu.SceneError, match="constrained twice"):
        tiefmu.load(weld)
    weld["node"].append({"nodes": [101], "motion": "free"})
    assert found(weld)["slaves"][0]["id"] == 101


def test_initial_velocities_pass_slaves_and_fixed_nodes_of_all(weld):
    weld["node"] += [{"nodes": [2], "motion": "fixed"}, {"nodes": [3], "rotations": True}]
    weld["initial"] = [{"nodes": "all", "v": [0, 0, 1.0], "w": [2.0, 0, 0]}, {"nodes": [4], "v": [0, 3.0, 0]}]
    simulation = tiefmu.load(weld).start
    names = [f"master[{i}].v[{k}]" for i in (1, 3, 4) for k in (1, 2, 3)] + ["master[3].w[1]"]
    assert simulation.get_values(names).tolist() == [0, 0, 1, 0, 0, 1, 0, 3, 0, 2]


def test_a_tie_without_a_name_is_called_by_its_number(weld):
    del weld["tie"][0]["name"]
    assert found(weld)["slaves"][0]["tie"] == "1"


def test_nodes_that_nothing_uses_are_left_out_and_named(weld):
    weld["mesh"]["nodes"] += [[7, 1, 0, 0], [6, 1, 1, 0]]
    assert found(weld)["left_out"] == [6, 7]


# --------------------------------------------------------------------------------------------------------------- report

REPORT_KEYS = {
    "title",
    "ties",
    "slaves",
    "masters",
    "points",
    "springs",
    "dropped",
    "left_out",
    "warnings",
    "notes",
    "stable_time_step",
    "nodal_time_step",
    "integrator_limit",
    "freedoms",
    "variables",
    "interface",
    "lumping",
}


def test_report_of_the_example(weld):
    report = found(weld)
    assert report.keys() == REPORT_KEYS
    assert report["ties"] == [
        {"name": "weld", "formulation": "default", "search": "box", "search_distance": 0.1, "segments": 1, "slaves": 1}
    ]
    slave = report["slaves"][0]
    assert (slave["id"], slave["number"], slave["tie"], slave["segment"]) == (101, 1, "weld", 1)
    assert slave["xi"] == pytest.approx(-0.4, abs=1e-14) and slave["eta"] == pytest.approx(0.2, abs=1e-14)
    assert slave["weights"] == pytest.approx([0.28, 0.12, 0.18, 0.42], abs=1e-14)
    assert slave["distance"] == slave["d"] == pytest.approx(0.04, rel=1e-14)
    assert slave["offset"] == pytest.approx([0, 0, 0.04], abs=1e-16)
    assert [row["node"] for row in slave["added"]] == slave["nodes"] == [1, 2, 3, 4]
    assert [row["mass"] for row in slave["added"]] == pytest.approx([0.7 * w for w in slave["weights"]])
    assert [row["added_mass"] for row in report["masters"]] == pytest.approx([0.7 * w for w in slave["weights"]])
    assert report["variables"]["master.v"] == 12 and report["variables"]["slave.f"] == 3
    assert report["freedoms"] == {"translations": 12, "rotations": 0, "left_out": []}
    assert "offset d = 0.04 m" in report["warnings"][0] and "optimized" in report["warnings"][0]
    assert json.loads(json.dumps(report)) == report


def test_added_inertia_adds_up_over_slaves(weld):
    """Rows per slave (computed for the report) against the solver's own sums per master, theory 4."""
    weld["mesh"]["nodes"] += [[102, 0.12, 0.04, 0.01], [103, 0.05, 0.02, -0.02]]
    weld["node"] = [
        {"nodes": "all", "rotations": True, "mass": 1.0, "inertia": 1e-3},
        {"nodes": [101, 102, 103], "mass": 0.7, "inertia": 2e-4},
    ]
    weld["tie"][0]["slaves"] = [101, 102]
    weld["tie"].append({"name": "glue", "slaves": [103], "formulation": "optimized"})
    report = found(weld)
    assert [row["clamped"] for row in report["slaves"]] == [False, True, False]
    for master in report["masters"]:
        own = [row for slave in report["slaves"] for row in slave["added"] if row["node"] == master["id"]]
        assert len(own) == 3
        assert sum(row["mass"] for row in own) == pytest.approx(master["added_mass"], rel=1e-13)
        assert sum(row["inertia"] for row in own) == pytest.approx(master["added_inertia"], rel=1e-13)


def test_dropped_slaves_are_named(weld):
    weld["mesh"]["nodes"].append([102, 5.0, 5.0, 0.0])
    weld["tie"][0] |= {"slaves": [101, 102], "unresolved": "drop"}
    report = found(weld)
    assert [(row["id"], row["tie"]) for row in report["dropped"]] == [(102, "weld")]
    assert report["dropped"][0]["reason"].startswith("no segment found")
    assert [row["id"] for row in report["slaves"]] == [101]
    assert any("slave 102" in line for line in report["warnings"])


def test_unused_rotations_are_named(weld):
    weld["node"] = [{"nodes": "all", "motion": "free", "mass": 1.0, "rotations": True}]
    weld["tie"][0]["formulation"] = "optimized"
    freedoms = found(weld)["freedoms"]
    assert freedoms == {
        "translations": 12,
        "rotations": 0,
        "left_out": [f"rotations of node {i}" for i in (1, 2, 3, 4)],
    }


def test_text_shows_twenty_slaves_and_counts_the_rest(weld):
    from tiefmu.report import text

    for k in range(30):
        weld["mesh"]["nodes"].append([200 + k, 0.001 * k, 0.05, 0.0])
    weld["tie"][0]["slaves"] += list(range(200, 230))
    shown = text("weld.toml", found(weld))
    assert "... and 11 more slaves (--json lists all)" in shown
    assert "     218 " in shown and "     219 " not in shown


def test_a_dict_may_hold_numpy_arrays(weld):
    other = copy.deepcopy(weld)
    other["tie"][0]["slaves"] = np.array([101])
    other["mesh"]["segments"] = np.array(weld["mesh"]["segments"])
    other["node"][0]["mass"] = np.float64(1.0)
    other["mesh"]["nodes"] = [(np.int64(row[0]), *np.array(row[1:], float)) for row in weld["mesh"]["nodes"]]
    assert found(other) == found(weld)


# -------------------------------------------------------------------------------------------------------------- archive


def test_two_builds_are_byte_identical(weld, tmp_path):
    one = tiefmu.build(tiefmu.load(weld), tmp_path / "one.fmu")
    two = tiefmu.build(tiefmu.load(copy.deepcopy(weld)), str(tmp_path / "two.fmu"))
    assert one == tmp_path / "one.fmu" and two == tmp_path / "two.fmu"
    assert one.read_bytes() == two.read_bytes()


def test_archive(weld, tmp_path, monkeypatch):
    monkeypatch.setattr(binaries, "BUILT", tmp_path / "nowhere")
    with zipfile.ZipFile(tiefmu.build(tiefmu.load(weld), tmp_path / "weld.fmu")) as archive:
        infos = archive.infolist()
        assert [info.filename for info in infos] == [
            f"binaries/{here().folder}/scene{here().suffix}",
            "documentation/index.html",
            *(f"documentation/licenses/{name}.txt" for name in ("cereal", "fmi", "license", "tiefmu")),
            "extra/tiefmu/reference_in.csv",
            "extra/tiefmu/reference_out.csv",
            "model.png",
            "modelDescription.xml",
            "resources/report.json",
            "resources/scene.bin",
            "terminalsAndIcons/terminalsAndIcons.xml",
        ]
        assert {info.date_time for info in infos} == {(1980, 1, 1, 0, 0, 0)}
        assert {info.compress_type for info in infos} == {zipfile.ZIP_DEFLATED}
        assert [oct(info.external_attr >> 16) for info in infos] == ["0o755"] + ["0o644"] * 12
        assert json.loads(archive.read("resources/report.json")) == found(weld)


def guid(scene: dict) -> str:
    xml = package.contents(tiefmu.load(scene))["modelDescription.xml"].decode()
    return re.search(r'guid="(\{[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}\})"', xml)[1]


def test_guid_changes_with_what_matters_only(weld):
    changes = [
        ("title", "other"),
        (("node", 1, "mass"), 0.8),
        (("mesh", "nodes", 4), [101, 0.03, 0.06, 0.05]),
        (("mesh", "nodes", 4), [102, 0.03, 0.06, 0.04]),
        (("tie", 0, "formulation"), "optimized"),
        (("node", 0, "motion"), "free"),
        ("model", {"geometry": "small"}),
        ("interface", {"expose": ["slave.r"]}),
        ("model", {"gravity": [0, 0, -9.81]}),
    ]
    guids = [guid(weld)]
    for path, value in changes:
        scene = copy.deepcopy(weld)
        place = scene
        for key in path[:-1] if isinstance(path, tuple) else ():
            place = place[key]
        place[path[-1] if isinstance(path, tuple) else path] = value
        if value == [102, 0.03, 0.06, 0.04]:
            scene["tie"][0]["slaves"] = scene["node"][1]["nodes"] = [102]
        guids.append(guid(scene))
    assert len(set(guids)) == len(guids)
    weld["mesh"]["nodes"].reverse()
    weld["units"] = {"length": "m"}
    assert guid(weld) == guids[0]


@pytest.mark.parametrize("exception", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("bug")])
def test_a_failed_build_leaves_the_old_file_and_nothing_else(weld, tmp_path, monkeypatch, exception):
    target = tmp_path / "weld.fmu"
    target.write_bytes(b"the old one")
    scene = tiefmu.load(weld)
    real = zipfile.ZipFile.writestr

    def fails_at_the_end(self, info, data, **options):
        if info.filename == "resources/scene.bin":
            raise exception
        return real(self, info, data, **options)

    monkeypatch.setattr(zipfile.ZipFile, "writestr", fails_at_the_end)
    with pytest.raises(tiefmu.UsageError if isinstance(exception, OSError) else type(exception)) as error:
        tiefmu.build(scene, target)
    if isinstance(exception, OSError):
        assert str(error.value) == f"{target}: No space left on device"
    assert target.read_bytes() == b"the old one"
    assert [path.name for path in tmp_path.iterdir()] == ["weld.fmu"]


def test_build_into_a_missing_folder(weld, tmp_path):
    target = tmp_path / "no" / "weld.fmu"
    with pytest.raises(tiefmu.UsageError) as error:
        tiefmu.build(tiefmu.load(weld), target)
    assert str(error.value) == f"{target}: folder {target.parent} does not exist"
