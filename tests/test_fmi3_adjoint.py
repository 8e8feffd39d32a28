"""Adjoint derivatives: the transpose of the directional ones, which are tested against differences."""

import ast
import re
from ctypes import c_size_t, c_uint32
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from fmi3_calls import ERROR, OK, Fmu, Instance
from fmu_scenes import ALL_FREE, DRIVEN, MIXED, SETTINGS, extras, scene
from port_scenes import line_of_slaves, ported
from test_fmi3 import SCENES, name_of, random_inputs

# Beside those of fmu_scenes: places of driven masters that change the accelerations of free ones.
PLACES = [
    (*kind, "mixed", "consistent", reaction, "finite", "input")
    for kind, reaction in ((("optimized", False), "full"), (("optimized", True), "loads"), (("default", True), "split"))
]
PORTS = [
    ("default", True, "consistent", "split", "finite"),
    ("default", True, "lumped", "full", "small"),
    ("optimized", False, "consistent", "full", "finite"),
    ("optimized", True, "lumped", "loads", "finite"),
    ("default", False, "consistent", "split", "small"),
]


def panel(kind: str, rotations: bool, **model) -> dict:
    """Free nodes and a driven edge whose slaves hang together: more unknowns than are factored."""
    rng = np.random.default_rng(21)
    n = 7
    corner = [[i + n * j + 1, i, j, 0.1 * rng.normal()] for j in range(n) for i in range(n)]
    quads = [
        [e, i + n * j + 1, i + n * j + 2, i + n * j + n + 2, i + n * j + n + 1]
        for e, (i, j) in enumerate(((i, j) for j in range(n - 1) for i in range(n - 1)), 1)
    ]
    slaves = [[101 + k, *(rng.uniform(0.2, n - 1.2, size=2)), 0.3] for k in range(60)]
    turns = {"rotations": rotations, "inertia": 0.1 if rotations else 0.0}
    return {
        "mesh": {"nodes": [[int(k), *map(float, x)] for k, *x in corner + slaves], "segments": quads},
        "node": [
            {"nodes": [row[0] for row in corner], "motion": "free", "mass": 1.0, **turns},
            {"nodes": list(range(1, n + 1)), "motion": "driven", **turns},
            {"nodes": [row[0] for row in slaves], "mass": 0.5},
        ],
        "tie": [{"slaves": [row[0] for row in slaves], "formulation": kind, "search_distance": 2.0}],
        "model": {"inertia": "consistent"} | model,
        "interface": {"expose": extras()},
    }


def led(made: dict) -> dict:
    made["model"]["reaction_lead"] = 0.5
    return made


SMALL = {
    **{name_of(case): (lambda case=case: scene(np.random.default_rng(11), *case)) for case in SETTINGS + PLACES},
    **{
        f"ports-{name_of(case)}": (lambda case=case: ported(np.random.default_rng(3), case, motions="mixed"))
        for case in PORTS
    },
    "lead": lambda: led(scene(np.random.default_rng(11), *MIXED)),
    "lead-places": lambda: led(scene(np.random.default_rng(11), *PLACES[0])),
    "ports-line": lambda: line_of_slaves(True, at=[0.0, 0.4, 0.3]),
}
PANELS = {
    f"panel-{kind}-{geometry}": (
        lambda kind=kind, rotations=rotations, geometry=geometry: panel(
            kind, rotations, reaction="full", geometry=geometry
        )
    )
    for kind, rotations, geometry in (
        ("default", True, "finite"),
        ("default", False, "small"),
        ("optimized", False, "finite"),
    )
}
EXAMPLES = {path.stem: (lambda path=path: path) for path in SCENES if path.stem not in ("bracket", "mesh_transition")}
CASES = SMALL | PANELS | EXAMPLES


def moved(fmu: Fmu) -> Instance:
    """An instance away from its start."""
    rng = np.random.default_rng(13)
    instance, time = Instance(fmu).start(), 0.0
    step = 1e-2
    if "stable_time_step" in fmu.arrays:
        step = min(step, 10 * instance.get("stable_time_step")[0])
    for _ in range(3):
        assert instance.set(random_inputs(fmu, rng)) == OK
        assert instance.step(time, step)[0] == OK, instance.log
        time += step
    assert instance.set(random_inputs(fmu, rng)) == OK
    return instance


@pytest.fixture(scope="module")
def fmu_of(tmp_path_factory):
    folder, made = tmp_path_factory.mktemp("fmu"), {}

    def of(case: str) -> Fmu:
        if case not in made:
            made[case] = Fmu(CASES[case](), folder)
        return made[case]

    return of


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_transpose(fmu_of, case):
    """u.(J v) = (J^T u).v for all outputs by all inputs, and for some of them."""
    fmu = fmu_of(case)
    instance, rng = moved(fmu), np.random.default_rng(14)
    outputs, inputs = fmu.names("output"), fmu.names("input")
    choices = [(outputs, inputs)] + [
        tuple(rng.permutation(names)[: rng.integers(1, len(names) + 1)].tolist() for names in (outputs, inputs))
        for _ in range(4)
    ]
    for unknowns, knowns in choices:
        u, v = (rng.standard_normal(sum(map(fmu.size, names))) for names in (unknowns, knowns))
        change = instance.derivative("Directional", unknowns, knowns, v)
        gradient = instance.derivative("Adjoint", unknowns, knowns, u)
        size = np.linalg.norm(u) * np.linalg.norm(change) + np.linalg.norm(v) * np.linalg.norm(gradient)
        assert abs(u @ change - gradient @ v) <= 1e-13 * size
    instance.free()


@pytest.mark.parametrize("case", SMALL)
def test_every_element_is_that_of_the_directional_derivative(fmu_of, case):
    fmu = fmu_of(case)
    instance = moved(fmu)
    outputs, inputs = fmu.names("output"), fmu.names("input")
    sizes = [sum(map(fmu.size, names)) for names in (outputs, inputs)]
    columns = np.array([instance.derivative("Directional", outputs, inputs, row) for row in np.eye(sizes[1])]).T
    rows = np.array([instance.derivative("Adjoint", outputs, inputs, row) for row in np.eye(sizes[0])])
    assert np.count_nonzero(columns) > sizes[1]
    scale = np.abs(columns).max(axis=1, keepdims=True) + 1e-2 * np.abs(columns).max()  # the power's rows may cancel
    assert np.max(np.abs(rows - columns) / scale) < 1e-12
    instance.free()


@pytest.fixture(scope="module", params=[MIXED, ALL_FREE, DRIVEN], ids=["mixed", "free", "driven"])
def fmu(request, tmp_path_factory) -> Fmu:
    return Fmu(scene(np.random.default_rng(12), *request.param), tmp_path_factory.mktemp("fmu"))


def test_it_changes_nothing_that_follows(fmu):
    outputs, inputs = fmu.names("output"), fmu.names("input")
    one, other = moved(fmu), moved(fmu)
    time = one.get("time")[0]
    for _ in range(3):
        one.derivative("Adjoint", outputs, inputs, np.ones(sum(map(fmu.size, outputs))))
        for instance in (one, other):
            assert instance.step(time, 1e-3)[0] == OK
        time += 1e-3
        np.testing.assert_array_equal(one.get(*outputs), other.get(*outputs))
    one.free(), other.free()


def test_a_variable_may_be_named_twice_or_not_at_all(fmu):
    outputs, inputs = fmu.names("output"), fmu.names("input")
    instance, n = moved(fmu), fmu.size("slave.v")
    seed = np.random.default_rng(16).standard_normal(n)
    once = instance.derivative("Adjoint", ["slave.v"], inputs, seed)
    split = np.concatenate([0.25 * seed, 0.75 * seed])
    np.testing.assert_allclose(
        instance.derivative("Adjoint", ["slave.v"] * 2, inputs, split), once, rtol=1e-14, atol=1e-15
    )
    np.testing.assert_array_equal(
        instance.derivative("Adjoint", ["slave.v"], inputs * 2, seed), np.concatenate([once] * 2)
    )
    assert (instance.derivative("Adjoint", [], inputs, []) == 0).all()
    assert len(instance.derivative("Adjoint", outputs, [], np.ones(sum(map(fmu.size, outputs))))) == 0
    instance.free()


def test_in_initialization_mode(fmu):
    """Of the values at the start."""
    outputs, inputs = fmu.names("output"), fmu.names("input")
    seed = np.random.default_rng(17).standard_normal(sum(map(fmu.size, outputs)))
    early, late = Instance(fmu), Instance(fmu).start()
    assert early.initialise() == OK
    expected = late.derivative("Adjoint", outputs, inputs, seed)
    np.testing.assert_allclose(
        early.derivative("Adjoint", outputs, inputs, seed), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )
    early.free(), late.free()


def test_what_is_refused_changes_nothing(fmu):
    instance = moved(fmu)
    outputs = fmu.names("output")
    before = instance.get(*outputs)
    rows, columns = fmu.size("slave.v"), fmu.size("slave.f")
    last = max(v.valueReference for v in fmu.description.modelVariables)
    seed, result = np.ones(rows), np.full(columns, np.nan)

    def ask(unknown="slave.v", known="slave.f", seed=seed, seeds=rows, results=columns, result=result):
        references = [
            name if name is None or isinstance(name, c_uint32 * 1) else instance.references([name])[0]
            for name in (unknown, known)
        ]
        one = c_size_t(1)
        return instance.call(
            "GetAdjointDerivative",
            references[0],
            one,
            references[1],
            one,
            None if seed is None else seed.ctypes,
            c_size_t(seeds),
            None if result is None else result.ctypes,
            c_size_t(results),
        )

    beyond = (c_uint32 * 1)(last + 1)
    wrong = seed.copy()
    wrong[2] = np.nan
    for arguments, words in (
        ({"unknown": "slave.f", "seeds": columns}, "variable 'slave[1].f[1]' is not an output"),
        ({"known": "slave.v", "results": rows}, "variable 'slave[1].v[1]' is not an input"),
        ({"known": "slave.mass", "results": fmu.size("slave.mass")}, "is not an input"),
        ({"unknown": "slave.node"}, "not of type Float64"),
        ({"unknown": (c_uint32 * 1)(0), "seeds": 1}, "independent"),
        ({"unknown": beyond}, f"unknown value reference {last + 1}"),
        ({"known": beyond}, f"unknown value reference {last + 1}"),
        ({"seeds": rows - 1}, f"the variables hold {rows} values, not {rows - 1}"),
        ({"results": columns + 3}, f"the variables hold {columns} values, not {columns + 3}"),
        ({"seed": wrong}, "'slave[1].v[3]' cannot be set to NaN"),
        ({"unknown": None}, "null pointer"),
        ({"known": None}, "null pointer"),
        ({"seed": None}, "null pointer"),
        ({"result": None}, "null pointer"),
    ):
        assert ask(**arguments) == ERROR, arguments
        error = instance.errors()[-1]
        assert error.startswith("fmi3GetAdjointDerivative: ") and words in error
        assert np.isnan(result).all()
    assert len(instance.errors()) == 14
    np.testing.assert_array_equal(instance.get(*outputs), before)
    assert ask() == OK and np.isfinite(result).all()
    instance.free()


def test_not_in_the_middle_of_a_step(tmp_path):
    """As the standard says, which allows there only what was asked for."""
    fmu, answers = Fmu(scene(np.random.default_rng(12), *ALL_FREE), tmp_path), []

    def ask(instance, *_):
        nothing = None, c_size_t(0)
        answers.append(instance.call("GetAdjointDerivative", *nothing * 4))

    instance = Instance(fmu, update=ask).start()
    assert instance.step(0.0, 2.5 * instance.get("stable_time_step")[0])[0] == OK
    assert answers and set(answers) == {ERROR}
    instance.free()


def test_the_examples_of_the_page(tmp_path, monkeypatch, capsys):
    """FMPy runs both, and the gradient is that of a mean: the shares of all masters add up to one."""
    page = (Path(__file__).parents[1] / "docs" / "fmi3.md").read_text()
    use, adjoint = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    before, after = use.split("fmu.terminate()")
    monkeypatch.chdir(tmp_path)
    tiefmu.build(tiefmu.load(scene(np.random.default_rng(1), *DRIVEN)), "weld.fmu", fmi=3)
    exec(before + adjoint + "fmu.terminate()" + after, {})
    shares = ast.literal_eval(capsys.readouterr().out)
    assert len(shares) == 10
    np.testing.assert_allclose(sum(shares.values()), 1, rtol=1e-12)
