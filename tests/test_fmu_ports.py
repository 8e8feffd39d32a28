"""FMUs with ports: description, derivatives, dependencies, saved states, terminals, command line."""

import re
from ctypes import byref, c_double, c_size_t, c_void_p, create_string_buffer

import fmpy
import numpy as np
import pytest
import tiefmu
from differences import check_derivatives
from fmpy.validation import validate_fmu
from fmu_calls import OK, Fmu, Instance
from fmu_scenes import random_values
from lxml import etree
from port_scenes import PORTS, ported
from test_fmu_dependencies import compare, declared, hash_of, observed
from test_fmu_derivatives import rates
from test_fmu_extras import Balanced, schema
from tiefmu.cli import main

CASES = [  # formulation, rotations, inertia, reaction, geometry; motion of the masters outside the ports
    (("default", True, "lumped", "loads", "finite"), "mixed"),
    (("default", True, "consistent", "full", "finite"), "driven"),
    (("default", True, "consistent", "split", "small"), "mixed"),
    (("default", False, "lumped", "full", "finite"), "mixed"),
    (("default", False, "consistent", "full", "small"), "driven"),
    (("optimized", False, "consistent", "split", "finite"), "mixed"),
    (("optimized", False, "lumped", "loads", "finite"), "driven"),
    (("optimized", True, "lumped", "full", "small"), "mixed"),
]
IDS = ["-".join(map(str, (*settings, motions))) for settings, motions in CASES]
PARTS = [
    {"name": "left", "nodes": [1, 2]},
    {"name": "right", "nodes": [3, 4, 5, 7, 9], "at": [0.1, 0.2, 0.3]},
    {"name": "load", "nodes": [101, 102, 103, 104]},
]
TOLERANCE = 3e-8  # of derivatives by differences: the sum of many slaves' power is their rounding
WHOLE = [{"name": "base", "nodes": list(range(1, 11))}, {"name": "load", "nodes": [101, 102, 103, 104, 105]}]


def case_scene(case, ports=None, seed=21) -> dict:
    settings, motions = case
    made = ported(np.random.default_rng(seed), settings, ports, "driven" if ports else motions)
    return made


@pytest.mark.parametrize("ports", [None, PARTS, WHOLE], ids=["some", "split", "whole"])
@pytest.mark.parametrize("case", CASES, ids=IDS)
def test_every_output_by_every_input(case, ports, tmp_path):
    rng = np.random.default_rng(22)
    fmu = Fmu(case_scene(case, ports), tmp_path)
    inputs, outputs = fmu.names("input"), fmu.names("output")
    assert any(name.startswith("port[") for name in inputs) and any(name.startswith("port[") for name in outputs)
    instance = Instance(fmu)
    assert instance.call("SetupExperiment", 0, c_double(0), c_double(0), 0, c_double(0)) == OK
    assert instance.call("EnterInitializationMode") == OK
    check_derivatives(instance, outputs, random_values(fmu, rng, inputs), rng, TOLERANCE)
    assert instance.call("ExitInitializationMode") == OK
    for k in range(3):
        assert instance.step(0.01 * k, 0.01) == OK, instance.log
        assert instance.set(random_values(fmu, rng, inputs)) == OK
    check_derivatives(instance, outputs, random_values(fmu, rng, inputs), rng, TOLERANCE)
    instance.free()


@pytest.mark.parametrize("ports", [None, PARTS, WHOLE], ids=["some", "split", "whole"])
@pytest.mark.parametrize("case", CASES, ids=IDS)
def test_dependencies(case, ports, tmp_path):
    rng = np.random.default_rng(abs(hash_of(case[0])))
    fmu = Fmu(case_scene(case, ports), tmp_path)
    lists, inputs = declared(fmu.description.outputs), fmu.names("input")
    if case[0][3] == "split":  # where the inertia that the tie adds and the one it takes off may cancel in a sum
        inputs = [name for name in inputs if not re.search(r"\.[az]\[", name)]
        lists = {name: {known: kind for known, kind in row.items() if known in inputs} for name, row in lists.items()}
    outputs = [name for name in fmu.names("output") if name in lists]
    instance = Instance(fmu).start(values=random_values(fmu, rng, inputs))
    for k in range(3):
        assert instance.step(0.01 * k, 0.01) == OK, instance.log
    compare(observed(instance, fmu, rng, inputs, outputs), inputs, outputs, lists)
    instance.free()


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """With reference results."""
    folder = tmp_path_factory.mktemp("fmu")
    made = case_scene((("default", True, "consistent", "full", "finite"), "mixed"))
    return Fmu(tiefmu.build(tiefmu.load(made), folder / "ports.fmu"), folder)


def started(fmu, seed=23) -> Instance:
    rng = np.random.default_rng(seed)
    instance = Instance(fmu).start(values=random_values(fmu, rng, fmu.names("input")))
    assert instance.step(0, 0.01) == OK
    return instance


def test_the_description_is_valid(fmu):
    """Also names: those of ports are no structured ones."""
    assert not validate_fmu(str(fmu.path))
    description = fmpy.read_model_description(
        str(fmu.path), validate=True, validate_variable_names=True, validate_model_structure=True
    )
    assert description.variableNamingConvention == "flat"
    members = {name for name in fmu.variables if re.match(r"(master\[[1-6]\]|slave\[[1245]\]|point\[1\])\.", name)}
    assert not members
    ports = {name for name in fmu.variables if name.startswith("port[")}
    driven = {f"port[{port}].{key}[{k}]" for port in ("base", "arm") for key in "vwazftr" for k in (1, 2, 3)}
    slaves = {f"port[{port}].{key}[{k}]" for port in ("load", "tip") for key in "vwftr" for k in (1, 2, 3)}
    assert ports == driven | slaves
    for name in ports:
        variable, key = fmu.variables[name], name.split(".")[1][0]
        drives = name.startswith(("port[base]", "port[arm]"))
        assert variable.causality == ("input" if key in ("vwaz" if drives else "ft") else "output")
        assert variable.description.endswith(f"(port {name[5:].split(']')[0]})")
        unit = {"v": "m/s", "w": "rad/s", "a": "m/s2", "z": "rad/s2", "f": "N", "t": "N.m", "r": "m"}[key]
        assert variable.unit == unit or variable.declaredType.unit == unit


def test_names_without_ports_stay_structured(weld, tmp_path):
    description = fmpy.read_model_description(str(tiefmu.build(tiefmu.load(weld), tmp_path / "a.fmu")))
    assert description.variableNamingConvention == "structured"


def test_serialised_states(fmu):
    outputs = fmu.names("output")
    rng = np.random.default_rng(24)
    instance, other = started(fmu), Instance(fmu).start()
    assert instance.set(random_values(fmu, rng, fmu.names("input"))) == OK
    state, size = instance.save(), c_size_t()
    assert instance.call("SerializedFMUstateSize", state, byref(size)) == OK
    data = create_string_buffer(size.value)
    assert instance.call("SerializeFMUstate", state, data, size) == OK
    expected = []
    for k in range(1, 5):
        assert instance.step(0.01 * k, 0.01) == OK
        expected.append(instance.get(outputs))
    restored = c_void_p()
    assert other.call("DeSerializeFMUstate", data, size, byref(restored)) == OK
    assert other.restore(restored) == OK and instance.restore(state) == OK
    for k in range(1, 5):
        for i in (instance, other):
            assert i.step(0.01 * k, 0.01) == OK
            np.testing.assert_array_equal(i.get(outputs), expected[k - 1])
    instance.free(), other.free()


def test_a_reset_starts_anew(fmu):
    outputs = fmu.names("output")
    instance, fresh = started(fmu), started(fmu)
    for k in range(1, 4):
        assert instance.step(0.01 * k, 0.01) == OK
    assert instance.call("Reset") == OK
    rng = np.random.default_rng(23)
    instance.start(values=random_values(fmu, rng, fmu.names("input")))
    assert instance.step(0, 0.01) == OK
    np.testing.assert_array_equal(instance.get(outputs), fresh.get(outputs))
    instance.free(), fresh.free()


def test_rates_of_outputs_know_the_ports_accelerations(tmp_path):
    """Velocities of slaves that ride on ports grow as their accelerations say, centripetal ones too."""
    made = case_scene((("default", True, "consistent", "full", "finite"), "driven"))
    fmu = Fmu(made, tmp_path)
    instance = started(fmu)
    assert instance.set({name: 0.0 for name in fmu.names("input") if name.startswith("port[") and ".v" in name}) == OK
    names = [f"slave[3].v[{k}]" for k in (1, 2, 3)]
    status, found = rates(instance, names)
    assert status == OK
    np.testing.assert_allclose(found, instance.get([name.replace(".v", ".a") for name in names]), rtol=1e-3, atol=1e-4)
    instance.free()


@pytest.mark.parametrize("name", [f"port[base].{key}[2]" for key in "vw"])
def test_a_port_that_leaves_the_world(name, tmp_path):
    fmu = Fmu(case_scene((("default", True, "lumped", "loads", "finite"), "driven")), tmp_path)
    instance = Instance(fmu).start()
    before = instance.save()
    assert instance.set({name: 1e300}) == OK
    assert instance.step(0.0, 0.1) != OK
    assert "port 'base' leaves the world" in instance.errors()[-1] and name in instance.errors()[-1]
    assert instance.restore(before) == OK
    assert instance.step(0.0, 0.1) == OK, instance.log
    instance.free()


def test_slaves_of_a_port_that_come_to_lie_on_a_line(tmp_path):
    made = {
        "mesh": {
            "nodes": [
                [1, 0, 0, 0],
                [2, 1, 0, 0],
                [3, 1, 1, 0],
                [4, 0, 1, 0],
                [101, 0.2, 0.5, 0],
                [102, 0.8, 0.5, 0],
                [103, 0.5, 0.8, 0],
            ],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all"}],
        "tie": [{"name": "tie", "slaves": [101, 102, 103]}],
        "interface": {"ports": [{"name": "load", "nodes": [101, 102, 103]}]},
    }
    instance = Instance(Fmu(made, tmp_path)).start()
    for i, y in ((3, -0.5), (4, -0.5), (1, 0.5), (2, 0.5)):  # all to y = 0.5
        assert instance.set({f"master[{i}].v[2]": y}) == OK
    assert instance.step(0.0, 1.0) == OK
    status, _ = instance.get_references([instance.fmu.reference["port[load].w[1]"]])
    assert status != OK and "the slaves of port 'load' have come to lie on a line" in instance.errors()[-1]
    instance.free()


def test_terminals_page_and_reference_results(fmu):
    root = etree.fromstring((fmu.folder / "terminalsAndIcons" / "terminalsAndIcons.xml").read_bytes())
    valid = schema()
    assert valid.validate(root), valid.error_log
    terminals = {t.get("name"): {m.get("memberName"): m.get("variableName") for m in t} for t in root.iter("Terminal")}
    for port in ("base", "arm", "load", "tip"):
        expected = {name.split(".", 1)[1]: name for name in fmu.variables if name.startswith(f"port[{port}].")}
        assert terminals[f"port[{port}]"] == expected and len(expected) > 12
    page = Balanced((fmu.folder / "documentation" / "index.html").read_text())
    for words in (
        "Ports: nodes that the interface shows as one rigid body",
        "base",
        "6 driven nodes",
        "3 slaves",
        "port[name]",
    ):
        assert words in page.text
    header = (fmu.folder / "extra" / "tiefmu" / "reference_in.csv").read_text().splitlines()[0].split(",")
    assert set(header[1:]) == set(fmu.names("input"))


def test_log_of_a_step_that_a_host_cannot_take(tmp_path):
    made = case_scene((("default", True, "lumped", "loads", "finite"), "driven"))
    made["node"][0]["stiffness"] = 1e4
    for table in made["node"][6:10]:
        table["mass"] = 0.0
    made["interface"]["ports"][0]["nodes"] = [1, 2, 3, 4, 5]
    instance = Instance(Fmu(made, tmp_path), logging=True).start()
    assert instance.step(0.0, 10.0) == OK
    assert any("of port 'base': an explicit host is unstable" in message[5] for message in instance.log)
    instance.free()


def test_command_line(scene_file, tmp_path, capsys):
    made = case_scene((("default", True, "lumped", "loads", "finite"), "driven"))
    made["interface"]["ports"][0]["name"] = "base plate-1"
    name = scene_file(made)
    (tmp_path / "in.csv").write_text("time,port[base plate-1].v[1],port[load].f[3]\n0,1,0\n0.5,1,2\n")
    assert main(["build", name]) == 0
    assert main(["info", name]) == 0
    assert main(["info", "weld.fmu"]) == 0
    told = capsys.readouterr().out
    assert told.count("port 'base plate-1': 6 driven nodes about [0.3, -0.2, 0.4] m, added mass") == 2
    assert told.count("port 'load': 3 slaves about [0.1, 0.7, 0.2] m\n") == 2
    assert main(["run", "weld.fmu", "--input", "in.csv", "--output", "out.csv", "--plot", "out.png"]) == 0
    result = np.genfromtxt("out.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    moved = result["port[base plate-1].r[1]"]
    np.testing.assert_allclose(moved[-1] - moved[0], 0.5, rtol=1e-9)
    assert np.ptp(result["port[base plate-1].f[3]"]) > 0
    assert (tmp_path / "out.png").stat().st_size > 1000
    assert main(["run", "weld.fmu", "--input", "bad.csv"]) == 2
    (tmp_path / "bad.csv").write_text("time,port[base].v[1]\n0,1\n1,1\n")
    capsys.readouterr()
    assert main(["run", "weld.fmu", "--input", "bad.csv"]) == 2
    assert "column 'port[base].v[1]': no such variable" in capsys.readouterr().err


def test_two_builds_are_the_same_and_a_name_changes_the_guid(tmp_path):
    made = case_scene((("optimized", False, "lumped", "loads", "finite"), "driven"))
    one, two = (tiefmu.build(tiefmu.load(made), tmp_path / f"{k}.fmu").read_bytes() for k in (1, 2))
    assert one == two
    moved = case_scene((("optimized", False, "lumped", "loads", "finite"), "driven"))
    moved["interface"]["ports"][0]["at"] = [0.3, -0.2, 0.5]
    assert PORTS[0]["at"] == [0.3, -0.2, 0.4]
    guids = {
        fmpy.read_model_description(str(tiefmu.build(tiefmu.load(scene), tmp_path / f"{k}.fmu"))).guid
        for k, scene in enumerate((made, moved))
    }
    assert len(guids) == 2
