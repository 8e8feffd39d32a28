"""Threads and the builds of the kernels change how fast a step is, and no bit of its result."""

import os
from pathlib import Path

import fmpy
import numpy as np
import pytest
import tiefmu
from fmu_scenes import SETTINGS, scene
from tiefmu._core import kernels


def panel(formulation: str, rotations: bool, motion: str, side: int = 64, shuffled: bool = False, **tables) -> dict:
    """A wavy panel of side x side quads (four parts for threads at 64), two slaves off each."""
    rng, start = np.random.default_rng(5), np.random.default_rng(6)
    i, j = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    x = np.stack([i, j, 0.2 * np.sin(i + 2 * j)], axis=-1).reshape(-1, 3).astype(float)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.stack([corner, corner + 1, corner + side + 2, corner + side + 1], axis=-1)
    centre = x[quads].mean(axis=1)
    slaves = np.concatenate([centre + [0.2, 0.1, 0.3], centre + [-0.3, 0.2, -0.2]])
    places = np.concatenate([x, slaves])
    ids = np.arange(1, len(places) + 1)
    if shuffled:
        rng.shuffle(ids)
        rng.shuffle(quads)
    slave_ids = ids[len(x) :]
    return {
        "mesh": {
            "nodes": [[int(k), *map(float, p)] for k, p in zip(ids, places)],
            "segments": [[e + 1, *map(int, ids[q])] for e, q in enumerate(quads)],
        },
        "node": [
            {
                "nodes": [int(k) for k in ids[: len(x)]],
                "motion": motion,
                "rotations": rotations,
                "mass": 1.0,
                "inertia": 0.1,
            },
            {
                "nodes": [int(k) for k in slave_ids],
                "mass": 0.3,
                "inertia": 0.02 if rotations or formulation == "optimized" else 0.0,
            },
        ],
        "tie": [
            {
                "name": "panel",
                "segments": "all",
                "slaves": [int(k) for k in slave_ids],
                "formulation": formulation,
                "search_distance": 1.5,
            }
        ],
        "initial": [{"nodes": [int(k)], "v": [float(a) for a in start.normal(size=3)]} for k in ids[: min(20, len(x))]]
        if motion == "free"
        else [],
        **tables,
    }


def trajectory(tables: dict) -> np.ndarray:
    """Everything the simulation holds after some steps under loads that differ from slave to slave."""
    simulation = tiefmu.Simulation(tiefmu.load(tables).model)
    rng = np.random.default_rng(7)
    simulation.set("slave_force", rng.normal(size=simulation.get("slave_force").shape))
    if tables["node"][0]["motion"] == "driven":
        simulation.set("velocity", rng.normal(size=simulation.get("velocity").shape))
    simulation.initialise(0.0)
    values = []
    for _ in range(5):
        simulation.step(0.01)
        simulation.update_outputs()
        values += [
            simulation.get(name).ravel()
            for name in ("slave_velocity", "reaction_force", "velocity", "position")
            if name in simulation.fields
        ]
    assert np.abs(values[0]).max() > 0
    return np.concatenate(values)


CASES = [
    ("default", False, "free"),
    ("default", True, "free"),
    ("optimized", False, "free"),
    ("optimized", False, "driven"),
    ("default", True, "driven"),
]


@pytest.mark.parametrize("formulation, rotations, motion", CASES)
def test_threads_do_not_change_a_bit(formulation, rotations, motion):
    first = trajectory(panel(formulation, rotations, motion))
    for threads in (2, 3, 7):
        assert np.array_equal(first, trajectory(panel(formulation, rotations, motion, integrator={"threads": threads})))


@pytest.mark.parametrize(
    "tables",
    [
        {"model": {"inertia": "consistent"}},
        {"integrator": {"method": "rk4"}},
        {"integrator": {"method": "noh-bathe"}},
        {"model": {"geometry": "small"}},
    ],
)
def test_threads_do_not_change_a_bit_of_other_methods(tables):
    first = trajectory(panel("optimized", False, "free", **tables))
    threaded = tables | {"integrator": tables.get("integrator", {}) | {"threads": 2}}
    assert np.array_equal(first, trajectory(panel("optimized", False, "free", **threaded)))


@pytest.mark.parametrize("formulation, rotations, motion", CASES)
def test_the_builds_of_the_kernels_agree_to_the_bit(formulation, rotations, motion):
    tables = panel(formulation, rotations, motion, side=9)
    fastest = trajectory(tables)
    assert kernels.use_baseline(True)
    try:
        assert np.array_equal(fastest, trajectory(tables))
    finally:
        kernels.use_baseline(False)


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: "-".join(map(str, s)))
def test_the_builds_of_the_kernels_agree_on_scenes_of_all_kinds(settings):
    tables = scene(np.random.default_rng(3), *settings)
    fastest = trajectory(tables)
    kernels.use_baseline(True)
    try:
        assert np.array_equal(fastest, trajectory(tables))
    finally:
        kernels.use_baseline(False)


@pytest.mark.parametrize("formulation, rotations", [("default", True), ("optimized", False), ("optimized", True)])
def test_connected_surfaces_with_consistent_inertia(formulation, rotations):
    """Sums of the iteration, too, are the same whoever makes them."""
    model = {"inertia": "consistent"}
    first = trajectory(panel(formulation, rotations, "free", model=model))
    threaded = panel(formulation, rotations, "free", model=model, integrator={"threads": 3})
    assert np.array_equal(first, trajectory(threaded))
    kernels.use_baseline(True)
    try:
        assert np.array_equal(first, trajectory(threaded))
    finally:
        kernels.use_baseline(False)


def test_order_of_the_input_does_not_matter():
    """Scattered ids and segments give the same motion, to rounding: sums come in another order."""

    def by_place(shuffled):
        tables = panel("optimized", False, "free", side=12, shuffled=shuffled, interface={"expose": ["slave.r"]})
        simulation = tiefmu.Simulation(tiefmu.load(tables).model)
        simulation.initialise(0.0)
        simulation.update_outputs()
        order = np.lexsort(np.round(simulation.get("slave_position"), 9).T)
        for _ in range(5):
            simulation.step(0.01)
        simulation.update_outputs()
        return simulation.get("slave_velocity")[order]

    np.testing.assert_allclose(by_place(True), by_place(False), rtol=1e-11, atol=1e-12)


def threads_now() -> int:
    return len(list(Path(f"/proc/{os.getpid()}/task").iterdir()))


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """An unpacked FMU that threads can share, and its description."""
    folder = tmp_path_factory.mktemp("large")
    scene_ = panel("default", False, "free", side=46, integrator={"threads": 4}, interface={"hide": ["master.f_ext"]})
    tiefmu.build(tiefmu.load(scene_), folder / "panel.fmu")
    return fmpy.extract(str(folder / "panel.fmu"), str(folder / "panel")), fmpy.read_model_description(
        folder / "panel.fmu", validate=False
    )


def started(large, threads: int):
    folder, description = large
    fmu = fmpy.fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        instanceName="panel",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    fmu.setupExperiment()
    reference = next(v.valueReference for v in description.modelVariables if v.name == "integrator.threads")
    fmu.setReal([reference], [float(threads)])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.01)
    return fmu


def test_threads_end_with_their_instance(large):
    before = threads_now()
    instances = [started(large, 4), started(large, 4)]
    assert threads_now() == before + 6
    instances[0].reset()
    assert threads_now() == before + 3
    for fmu in instances:
        fmu.freeInstance()
    assert threads_now() == before


def test_threads_are_a_parameter_of_the_fmu(large):
    variable = next(v for v in large[1].modelVariables if v.name == "integrator.threads")
    assert (variable.causality, variable.variability, float(variable.start)) == ("parameter", "fixed", 4.0)
    outputs = [v.valueReference for v in large[1].modelVariables if v.causality == "output"]
    values = []
    for threads in (1, 2):
        fmu = started(large, threads)
        values.append(fmu.getReal(outputs))
        fmu.freeInstance()
    assert values[0] == values[1] and len(values[0]) > 20000


@pytest.mark.parametrize("threads", [0, -1, 1.5, 257, float(2**40)])
def test_numbers_of_threads_that_make_no_sense(tmp_path, threads):
    tiefmu.build(
        tiefmu.load(panel("default", False, "free", side=4, integrator={"threads": 2})), tmp_path / "panel.fmu"
    )
    said = []
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmpy.simulate_fmu(
            str(tmp_path / "panel.fmu"),
            stop_time=0.01,
            start_values={"integrator.threads": threads},
            logger=lambda *a: said.append(a[-1].decode() if isinstance(a[-1], bytes) else str(a[-1])),
        )
    assert any(
        f"integrator.threads is {threads:.6g}; it must be a whole number from 1 to 256" in line for line in said
    ), said
