"""modelDescription.xml: what it lists, and that importers can read it."""

import copy
import re
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
import tiefmu
from fmpy.validation import validate_fmu
from fmu_calls import OK, Fmu, Instance, build_without_references
from fmu_scenes import SETTINGS
from fmu_scenes import scene as many_sided
from lxml import etree

SCENES = sorted((Path(__file__).parents[1] / "scenes").glob("*.toml"))


def quad(motion="driven", rotations=True, formulation="default", slaves=1, offset=0.04, **tables) -> dict:
    """Nodes 11..14 with slaves 101.. over them."""
    places = [(i + 0.5) / slaves for i in range(slaves)]
    return {
        "mesh": {
            "nodes": [
                [11, 0, 0, 0],
                [12, 0.1, 0, 0],
                [13, 0.1, 0.1, 0],
                [14, 0, 0.1, 0],
                *([101 + j, 0.1 * s, 0.06, offset] for j, s in enumerate(places)),
            ],
            "segments": [[1, 11, 12, 13, 14]],
        },
        "node": [
            {
                "nodes": "all",
                "motion": motion,
                "rotations": rotations,
                "mass": 0.5,
                "inertia": 0.001 if rotations else 0.0,
            }
        ],
        "tie": [
            {"name": "tie", "segments": "all", "slaves": [101 + j for j in range(slaves)], "formulation": formulation}
        ],
        **tables,
    }


def table_of(scene, tmp_path) -> dict[str, str]:
    """Name without component and number -> causality."""
    names = {}
    for v in Fmu(scene, tmp_path).description.modelVariables:
        names[re.sub(r"\[\d+\]$", "", v.name)] = v.causality
    return names


# ----------------------------------------------------------------------------------------------- what the table lists

OF_DRIVEN = {
    "master[{}].v": "input",
    "master[{}].w": "input",
    "master[{}].f": "output",
    "master[{}].t": "output",
    "master[{}].added_mass": "calculatedParameter",
    "master[{}].added_inertia": "calculatedParameter",
}
OF_FREE = OF_DRIVEN | {
    "master[{}].v": "output",
    "master[{}].w": "output",
    "master[{}].f_ext": "input",
    "master[{}].t_ext": "input",
}
OF_SLAVE = {"slave[1].f": "input", "slave[1].t": "input", "slave[1].v": "output", "slave[1].w": "output"}
OF_FREE_SCENE = {
    "stable_time_step": "output",
    "nodal_time_step": "output",
    "integrator.time_step": "parameter",
    "integrator.safety": "parameter",
}


def each(table, numbers=(1, 2, 3, 4)):
    return {name.format(i): causality for i in numbers for name, causality in table.items()}


def without(table, *names):
    return {name: causality for name, causality in table.items() if name.split(".")[-1] not in names}


def test_driven_masters_with_rotations(tmp_path):
    assert table_of(quad(), tmp_path) == each(OF_DRIVEN) | OF_SLAVE


def test_free_masters_with_rotations(tmp_path):
    assert table_of(quad(motion="free"), tmp_path) == each(OF_FREE) | OF_SLAVE | OF_FREE_SCENE


def test_translations_only(tmp_path):
    assert table_of(quad(rotations=False), tmp_path) == (
        each(without(OF_DRIVEN, "w", "t", "added_inertia")) | without(OF_SLAVE, "t", "w")
    )


def test_optimized_needs_no_rotations(tmp_path):
    assert table_of(quad(rotations=False, formulation="optimized"), tmp_path) == (
        each(without(OF_DRIVEN, "w", "t", "added_inertia")) | OF_SLAVE
    )


def test_optimized_gives_no_moment_to_rotating_masters(tmp_path):
    assert table_of(quad(formulation="optimized"), tmp_path) == each(without(OF_DRIVEN, "t")) | OF_SLAVE


@pytest.mark.parametrize("inertia, reaction", [("lumped", "full"), ("consistent", "full"), ("consistent", "split")])
def test_accelerations_are_inputs_of_driven_masters(tmp_path, inertia, reaction):
    scene = quad(model={"inertia": inertia, "reaction": reaction})
    accelerations = {"master[{}].a": "input", "master[{}].z": "input"}
    assert table_of(scene, tmp_path) == each(OF_DRIVEN | accelerations) | OF_SLAVE


def test_positions_are_inputs_of_driven_masters(tmp_path):
    scene = quad(model={"position": "input"}, interface={"expose": ["master.r", "slave.r"]})
    assert table_of(scene, tmp_path) == (
        each(OF_DRIVEN | {"master[{}].r": "input"}) | OF_SLAVE | {"slave[1].r": "output"}
    )


def test_fixed_masters_have_reactions_only(tmp_path):
    scene = quad()
    scene["node"].append({"nodes": [12, 14], "motion": "fixed"})
    reactions = {"master[{}].f": "output", "master[{}].t": "output"}
    assert table_of(scene, tmp_path) == each(OF_DRIVEN, (1, 3)) | each(reactions, (2, 4)) | OF_SLAVE


def test_points(tmp_path):
    scene = quad(
        spring=[
            {"nodes": [101, 5], "stiffness": 1e3},
            {"nodes": [101, 201], "stiffness": 1e3},
            {"nodes": [101, 202], "stiffness": 1e3},
        ],
        interface={"expose": ["point.r"]},
    )
    scene["mesh"]["nodes"] += [[5, 0, 0, 1], [201, 0, 1, 1], [202, 1, 1, 1]]
    scene["node"] += [
        {"nodes": [5], "motion": "free", "rotations": True, "mass": 1.0, "inertia": 0.1},
        {"nodes": [202], "motion": "fixed"},
        {"nodes": [201], "rotations": False},
    ]
    points = {
        "point[1].v": "output",
        "point[1].w": "output",
        "point[1].r": "output",
        "point[1].f_ext": "input",
        "point[1].t_ext": "input",
        "point[2].v": "input",
        "point[2].r": "output",
    }
    assert table_of(scene, tmp_path) == each(OF_DRIVEN) | OF_SLAVE | points | OF_FREE_SCENE


def test_moments_only_where_a_tie_gives_them(tmp_path):
    """Two quads in a row: a default tie on the first, an optimized one on the second; all nodes have rotations."""
    scene = quad()
    scene["mesh"]["nodes"] += [[15, 0.2, 0, 0], [16, 0.2, 0.1, 0], [102, 0.15, 0.05, 0.02]]
    scene["mesh"]["segments"].append([2, 12, 15, 16, 13])
    scene["tie"][0]["segments"] = [1]
    scene["tie"].append({"name": "other", "segments": [2], "slaves": [102], "formulation": "optimized"})
    names = table_of(scene, tmp_path)
    assert {i for i in range(1, 7) if f"master[{i}].t" in names} == {1, 2, 3, 4}
    assert all(f"master[{i}].w" in names for i in range(1, 7))


def test_everything_exposed(tmp_path):
    names = [
        "slave.r",
        "slave.a",
        "master.r",
        "energy",
        "power_residual",
        "drift",
        "master.stiffness",
        "slave.mass",
        "slave.inertia",
    ]
    scene = quad(motion="free", interface={"expose": names})
    extra = {f"energy.{kind}": "output" for kind in ("kinetic", "strain", "dissipated", "external", "residual")}
    extra |= {
        "power_residual": "output",
        "drift": "output",
        "slave[1].r": "output",
        "slave[1].a": "output",
        "slave[1].mass": "parameter",
        "slave[1].inertia": "parameter",
    }
    extra |= each(
        {
            "master[{}].r": "output",
            "master[{}].stiffness": "calculatedParameter",
            "master[{}].rotational_stiffness": "calculatedParameter",
        }
    )
    assert table_of(scene, tmp_path) == each(OF_FREE) | OF_SLAVE | OF_FREE_SCENE | extra


def test_hidden_variables(tmp_path):
    scene = quad(motion="free", interface={"hide": ["master.f_ext", "master.t", "nodal_time_step", "slave.t"]})
    shown = each(without(OF_FREE, "f_ext", "t")) | without(OF_SLAVE, "t") | without(OF_FREE_SCENE, "nodal_time_step")
    assert table_of(scene, tmp_path) == shown


def test_unknown_names_in_interface():
    for key, name in (("expose", "slave.q"), ("expose", "master.v"), ("hide", "master.q")):
        with pytest.raises(tiefmu.SceneError) as refusal:
            tiefmu.load(quad(interface={key: [name]}))
        assert str(refusal.value).startswith(f"scene: interface: {key}: unknown name '{name}'; known: ")
        assert "\n" not in str(refusal.value)


def test_numbers_ascend_with_node_ids_and_descriptions_name_them(tmp_path):
    fmu = Fmu(quad(slaves=3), tmp_path)
    assert fmu.variables["master[2].v[1]"].description.endswith("(node 12)")
    assert fmu.variables["slave[3].f[2]"].description.endswith("(node 103)")
    nodes = [re.match(r"(master|slave|point)\[(\d+)\]", v.name).groups() for v in fmu.description.modelVariables]
    order = [({"master": 0, "slave": 1, "point": 2}[prefix], int(number)) for prefix, number in nodes]
    assert order == sorted(order)


# ---------------------------------------------------------------------------------------------- importers can read it


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_example_scenes_are_valid(tmp_path, path):
    assert validate_fmu(str(tiefmu.build(tiefmu.load(path), tmp_path / "scene.fmu"))) == []


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: "-".join(map(str, s)))
def test_all_kinds_of_scenes_are_valid(tmp_path, settings):
    scene = many_sided(np.random.default_rng(3), *settings)
    assert validate_fmu(str(build_without_references(scene, tmp_path / "scene.fmu"))) == []


def test_every_variable_is_a_real_with_a_defined_unit(tmp_path):
    fmu = Fmu(many_sided(np.random.default_rng(4), *SETTINGS[4]), tmp_path)
    bases = {unit.name: unit.baseUnit for unit in fmu.description.unitDefinitions}
    assert all(base is not None for base in bases.values())
    newton = bases["N"]
    assert (newton.kg, newton.m, newton.s) == (1, 1, -2)
    for v in fmu.description.modelVariables:
        assert v.type == "Real" and v.causality != "independent"
        assert v.unit in bases and v.declaredType.unit == v.unit and v.declaredType.quantity
        assert v.name not in {t.name for t in fmu.description.typeDefinitions}


def test_value_references_are_gapless(tmp_path):
    fmu = Fmu(quad(motion="free"), tmp_path)
    assert sorted(fmu.reference.values()) == list(range(len(fmu.reference)))


def test_names_are_flat_where_there_are_many(tmp_path):
    assert Fmu(quad(slaves=2), tmp_path).description.variableNamingConvention == "structured"
    many = Fmu(quad(slaves=900), tmp_path)
    assert len(many.reference) > 10000 and many.description.variableNamingConvention == "flat"


def test_starts_read_back_to_the_same_double(tmp_path):
    rng = np.random.default_rng(5)
    scene = quad(motion="free", model={"position": "input"}, interface={"expose": ["slave.mass", "slave.inertia"]})
    scene["mesh"]["nodes"] = [
        [row[0], *(np.array(row[1:]) + 0.01 * rng.normal(size=3)).tolist()] for row in scene["mesh"]["nodes"]
    ]
    scene["node"] += [{"nodes": [11, 12], "motion": "driven"}, {"nodes": [101], "mass": 1 / 3, "inertia": 0.1 / 7}]
    scene["initial"] = [{"nodes": [11], "v": rng.normal(size=3).tolist(), "w": [1e-300, -1 / 3, 12345678.9]}]
    scene["integrator"] = {"safety": 0.7}
    fmu = Fmu(scene, tmp_path)
    started = [v for v in fmu.description.modelVariables if v.start is not None]
    assert (
        {v.causality for v in started}
        == {"input", "parameter"}
        == {v.causality for v in fmu.description.modelVariables if v.initial == "exact"}
    )
    instance = Instance(fmu)
    assert instance.call("EnterInitializationMode") == OK
    values = instance.get([v.name for v in started])
    assert values.tolist() == [float(v.start) for v in started]
    start = dict(zip((v.name for v in started), values))
    assert [start[f"master[1].r[{k}]"] for k in (1, 2, 3)] == scene["mesh"]["nodes"][0][1:]
    assert [start[f"master[1].w[{k}]"] for k in (1, 2, 3)] == [1e-300, -1 / 3, 12345678.9]
    assert start["slave[1].mass"] == 1 / 3 and start["integrator.safety"] == 0.7
    instance.free()


def test_outputs_and_initial_unknowns_are_complete_and_ordered(tmp_path):
    fmu = Fmu(quad(motion="free", interface={"expose": ["energy", "master.stiffness"]}), tmp_path)
    place = {v.name: k for k, v in enumerate(fmu.description.modelVariables)}
    for unknowns, causalities in (
        (fmu.description.outputs, {"output"}),
        (fmu.description.initialUnknowns, {"output", "calculatedParameter"}),
    ):
        listed = [place[u.variable.name] for u in unknowns]
        assert (
            listed
            == sorted(listed)
            == [place[v.name] for v in fmu.description.modelVariables if v.causality in causalities]
        )
        for u in unknowns:
            if u.dependencies is not None:
                known = [place[v.name] for v in u.dependencies]
                assert known == sorted(set(known))


def test_a_row_of_thousands_of_dependencies_is_left_out(tmp_path):
    fmu = Fmu(quad(slaves=900, rotations=False, formulation="optimized"), tmp_path)
    rows = {u.variable.name: u.dependencies for u in fmu.description.outputs}
    assert rows["master[1].f[1]"] is None  # six inputs of 900 slaves
    assert len(rows["slave[7].v[2]"]) == 12


def test_a_long_row_of_nearly_all_inputs_is_left_out(tmp_path):
    """Every slave's load reaches every master of the only segment."""

    def rows(slaves):
        outputs = Fmu(quad(slaves=slaves, rotations=False, formulation="optimized"), tmp_path).description.outputs
        return [row.dependencies for row in outputs if row.variable.name.startswith("master")]

    assert [len(row) for row in rows(160)] == 12 * [960]  # of 972
    assert rows(170) == 12 * [None]


def test_kinds_are_left_out_where_all_are_dependent(tmp_path):
    def kinds(**model):
        scene = quad(rotations=False, formulation="optimized", model=model)
        return [row.dependenciesKind for row in Fmu(scene, tmp_path).description.outputs if row.dependencies]

    assert kinds() and not any(kinds())
    assert all(kinds(geometry="small"))


def test_default_experiment(tmp_path):
    def experiment(scene):
        fmu = Fmu(scene, tmp_path)
        e = fmu.description.defaultExperiment
        instance = Instance(fmu).start()
        limit = instance.get(["stable_time_step"])[0] if "stable_time_step" in fmu.reference else None
        instance.free()
        return float(e.startTime), float(e.stopTime), float(e.stepSize), limit

    assert experiment(quad()) == (0, 1, 0.001, None)
    assert experiment(quad(motion="free")) == (0, 1, 0.001, 1e30)
    sprung = quad(motion="free", spring=[{"ground": [11, 12, 13, 14], "kind": "bushing", "stiffness": 7e4}])
    start, stop, step, limit = experiment(sprung)
    assert 0.9 * limit / 2.5 < step <= 0.9 * limit
    assert start == 0 and stop == pytest.approx(1000 * step, rel=1e-12)
    sprung["integrator"] = {"time_step": 2.3e-5}
    assert experiment(sprung)[:3] == (0, 0.02, 2e-5)
    # What an explicit host may take, theory (6.3): sqrt(2 m/K) of the driven masters, with what the tie adds.
    stiff = quad(rotations=False)
    stiff["node"] = [{"nodes": "all", "mass": 0.5, "stiffness": 1e6}, {"nodes": [101], "mass": 0.0, "stiffness": 0.0}]
    assert np.sqrt(2 * 0.5 / 1e6) == pytest.approx(1e-3)
    assert experiment(stiff)[2] in (1e-3, 5e-4)  # the very limit, to rounding
    stiff["node"][0]["stiffness"] = 9e6
    assert experiment(stiff) == (0, 0.2, 2e-4, None)


PORTS = {"ports": [{"name": "flange", "nodes": [11, 12, 13, 14]}, {"name": "left weld", "nodes": [101]}]}


@pytest.mark.parametrize(
    "scene", [quad("free"), quad(slaves=2), quad(interface=PORTS)], ids=["free", "driven", "ports"]
)
def test_flat_names(scene, tmp_path):
    """For tools that make buses of dots and brackets: the same variables under names of letters, digits and _."""
    scene["node"][0]["mass"] = 1.0
    shown = scene.get("interface", {})
    shown["expose"] = ["slave.r", "energy", "power_residual", "drift", *(["port.r"] if shown else [])]
    structured = Fmu(scene | {"interface": shown}, tmp_path)
    flat = Fmu(scene | {"interface": shown | {"names": "flat"}}, tmp_path)
    assert flat.description.variableNamingConvention == "flat"
    names = [v.name for v in flat.description.modelVariables]
    assert len(set(names)) == len(names) == len(structured.variables)
    assert all(re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) for name in names)
    for one, other in zip(structured.description.modelVariables, flat.description.modelVariables):
        assert one.valueReference == other.valueReference and one.description == other.description
        assert other.name == re.sub(r"[.\[ ]", "_", one.name).replace("]", "")
    instances = [Instance(fmu).start() for fmu in (structured, flat)]
    for instance in instances:
        n = len(instance.fmu.names("input"))
        assert instance.set(dict(zip(instance.fmu.names("input"), 0.1 * np.arange(n)))) == OK
        assert instance.step(0, 1e-3) == OK
    one, other = (instance.get(instance.fmu.names("output")) for instance in instances)
    np.testing.assert_array_equal(one, other)
    assert instances[1].set({names[0]: np.nan}) != OK and f"'{names[0]}'" in instances[1].errors()[-1]
    terminals = etree.parse(str(flat.folder / "terminalsAndIcons" / "terminalsAndIcons.xml"))
    assert {m.get("variableName") for m in terminals.iter("TerminalMemberVariable")} <= set(names)
    for instance in instances:
        instance.free()


def test_only_what_is_built_is_promised(tmp_path):
    description = Fmu(quad(), tmp_path).description
    assert description.generationTool == f"tiefmu {tiefmu.__version__}"
    promises = description.coSimulation
    assert promises.canHandleVariableCommunicationStepSize and promises.canGetAndSetFMUstate
    assert not promises.canBeInstantiatedOnlyOncePerProcess and not promises.needsExecutionTool
    assert promises.canSerializeFMUstate and promises.providesDirectionalDerivative  # test_fmu_serialisation,
    assert promises.canInterpolateInputs and promises.maxOutputDerivativeOrder == 1  # test_fmu_derivatives
    assert not promises.canRunAsynchronuously


def test_titles_and_names_are_escaped(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    title = "Tür & <tie> \"a\" 'b' %s\tend"
    quoted = title.replace('"', '\\"').replace("\t", "\\t")
    Path("2 <weld> & 'tür'.toml").write_text(f'title = "{quoted}"\n{TOML}', encoding="utf-8")
    scene = tiefmu.load("2 <weld> & 'tür'.toml")
    path = tiefmu.build(scene, tmp_path / "out.fmu")
    assert validate_fmu(str(path)) == []
    description = fmpy.read_model_description(str(path))
    assert description.description == title.replace("\t", " ")
    assert description.modelName == "2 <weld> & 'tür'"
    identifier = description.coSimulation.modelIdentifier
    assert re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", identifier)
    with zipfile.ZipFile(path) as archive:
        assert any(name.startswith("binaries/") and Path(name).stem == identifier for name in archive.namelist())
    assert np.isfinite(fmpy.simulate_fmu(str(path), stop_time=0.01)["slave[1].v[1]"]).all()


TOML = """
[mesh]
nodes = [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.3, 0.6, 0.0]]
segments = [[1, 1, 2, 3, 4]]
[[tie]]
name = "tie"
slaves = [101]
"""


# ------------------------------------------------------------------------------------------------------------- GUID


def guid(scene) -> str:
    xml = tiefmu.package.contents(tiefmu.load(scene))["modelDescription.xml"]
    return etree.fromstring(xml).get("guid")


def test_guid_changes_with_everything_that_matters():
    base = quad(motion="free", spring=[{"ground": [11], "kind": "bushing", "stiffness": 1e3}])

    def changed(change):
        scene = copy.deepcopy(base)
        change(scene)
        return guid(scene)

    guids = [guid(base)] + [
        changed(change)
        for change in (
            lambda s: s.update(title="Other"),
            lambda s: s["mesh"]["nodes"][0].__setitem__(1, 1e-17),
            lambda s: s["node"][0].update(mass=0.5000000000000001),
            lambda s: s["node"][0].update(stiffness=1.0),
            lambda s: s["tie"][0].update(formulation="optimized"),
            lambda s: s["spring"][0].update(damping=1.0),
            lambda s: s.update(model={"gravity": [0, 0, -9.81]}),
            lambda s: s.update(model={"inertia": "consistent"}),
            lambda s: s.update(model={"geometry": "small"}),
            lambda s: s.update(integrator={"method": "rk4"}),
            lambda s: s.update(integrator={"safety": 0.8}),
            lambda s: s.update(interface={"expose": ["drift"]}),
            lambda s: s.update(initial=[{"nodes": [12], "v": [0, 0, 1e-9]}]),
        )
    ]
    assert len(set(guids)) == len(guids)
    assert guid(base) == guids[0]
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", guids[0])


def test_two_builds_are_the_same_bytes(tmp_path):
    scene = many_sided(np.random.default_rng(6), *SETTINGS[15])
    first, second = (tiefmu.build(tiefmu.load(scene), tmp_path / name).read_bytes() for name in ("a.fmu", "b.fmu"))
    assert first == second
