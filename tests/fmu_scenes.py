"""A scene of many kinds of nodes, and FMUs of it as fixtures."""

import numpy as np
import pytest
import tiefmu
from fmu_calls import Fmu

SETTINGS = [
    # formulation, rotations, motion of the masters, inertia, reaction, geometry, position; reaction_lead
    ("default", True, "driven", "lumped", "loads", "finite", "integrated"),
    ("default", True, "driven", "lumped", "full", "finite", "integrated"),
    ("default", True, "driven", "consistent", "full", "finite", "integrated"),
    ("default", True, "mixed", "consistent", "split", "finite", "integrated"),
    ("default", True, "mixed", "lumped", "full", "small", "input"),
    ("default", True, "free", "consistent", "loads", "finite", "integrated"),
    ("default", True, "mixed", "consistent", "full", "small", "integrated"),
    ("default", False, "driven", "consistent", "split", "finite", "integrated"),
    ("default", False, "mixed", "consistent", "full", "finite", "input"),
    ("default", False, "mixed", "lumped", "loads", "finite", "input"),
    ("optimized", False, "driven", "lumped", "loads", "finite", "integrated"),
    ("optimized", False, "driven", "lumped", "loads", "finite", "input"),
    ("optimized", True, "driven", "consistent", "full", "finite", "input"),
    ("optimized", False, "driven", "consistent", "split", "small", "input"),
    ("optimized", False, "mixed", "lumped", "full", "small", "integrated"),
    ("optimized", False, "mixed", "consistent", "split", "finite", "integrated"),
    ("optimized", True, "free", "lumped", "loads", "finite", "integrated"),
    ("optimized", True, "driven", "consistent", "split", "finite", "input", 0.75),
]


def extras() -> list[str]:
    """Every name that `expose` takes where there are no ports, as its refusal lists them."""
    mesh = {"nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 0, 1, 0], [4, 0.3, 0.3, 0]], "segments": [[1, 1, 2, 3]]}
    with pytest.raises(tiefmu.SceneError) as refused:
        tiefmu.load({"mesh": mesh, "tie": [{"slaves": [4]}], "interface": {"expose": ["nothing"]}})
    return str(refused.value).split("; known: ")[1].split(", ")


def scene(rng, formulation, rotations, motion, inertia, reaction, geometry, position, reaction_lead=0.0) -> dict:
    """Two pairs of a quad and a triangle, apart from each other, with slaves off their surfaces, two of which hold
    dampers to a driven and to a free point."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    sheet = np.array([[0, 0, 0], [1, 0, 0.1], [1.1, 0.9, 0], [0, 1, 0.15], [2, 0.4, 0.1]])
    corners = np.vstack([sheet, sheet + [0, 0, 3]]) + 0.05 * rng.normal(size=(10, 3))
    slaves = np.array([[0.3, 0.4, 0.3], [0.7, 0.6, -0.2], [1.4, 0.5, 0.25], [0.4, 0.7, 3.4], [1.5, 0.45, 2.7]])
    points = np.array([[0.5, 0.5, 1.2], [0.6, 0.4, 2.2]])
    nodes = [
        [first + k, *(turn @ x)]
        for first, group in ((1, corners), (101, slaves), (201, points))
        for k, x in enumerate(group)
    ]
    turns = rotations or formulation == "optimized"
    masters = list(range(1, 11))
    chosen = {"mixed": ["driven", "driven", "free", "fixed", "free", "driven", "free", "driven", "driven", "free"]}
    motions = chosen.get(motion, [motion] * 10)
    table = [
        {
            "nodes": [i],
            "motion": m,
            "rotations": rotations,
            "mass": rng.uniform(1, 2),
            "inertia": rng.uniform(0.2, 0.4) if rotations else 0.0,
        }
        for i, m in zip(masters, motions)
    ]
    table.append({"nodes": [201], "motion": "driven", "rotations": turns})
    table.append({"nodes": [202], "motion": "free", "rotations": turns, "mass": 1.5, "inertia": 0.3 if turns else 0.0})
    table += [{"nodes": [101 + j], "mass": rng.uniform(1, 2), "inertia": 0.3 if turns else 0.0} for j in range(5)]
    turning = {"rotational_stiffness": 2.0, "rotational_damping": [0.1, 0.2, 0.3]} if turns else {}
    beam = {"nodes": [105, 202], "kind": "beam", "stiffness": [4.0, 2.0, 3.0], "damping": [0.3, 0.2, 0.1]} | turning
    return {
        "mesh": {"nodes": nodes, "segments": [[1, 1, 2, 3, 4], [2, 2, 5, 3], [3, 6, 7, 8, 9], [4, 7, 10, 8]]},
        "node": table,
        "tie": [
            {
                "name": "tie",
                "segments": "all",
                "slaves": [101, 102, 103, 104, 105],
                "formulation": formulation,
                "search_distance": 2.0,
            }
        ],
        "spring": [
            {
                "nodes": [101, 201],
                "kind": "bushing",
                "stiffness": [3.0, 4.0, 5.0],
                "damping": [0.5, 0.7, 0.9],
                **turning,
            },
            {"nodes": [104, 202], "kind": "axial", "stiffness": 2.0, "damping": 0.3},
            {"nodes": [201, 5], "kind": "axial", "stiffness": 2.0, "damping": 0.3},
            *([beam | {"orientation": [0.2, 1.0, 0.1]}] if turns else []),
        ],
        "initial": [
            {"nodes": [i for i, m in zip(masters, motions) if m == "free"] + [202], "v": rng.normal(size=3).tolist()}
        ],
        "model": {
            "inertia": inertia,
            "reaction": reaction,
            "reaction_lead": reaction_lead,
            "geometry": geometry,
            "position": position,
            "gravity": [0.3, 0.0, -9.81],
        },
        "interface": {"expose": extras()},
    }


def random_values(fmu, rng, knowns) -> dict[str, float]:
    """Inputs of size one about their start; parameters stay positive."""
    values = {}
    for name in knowns:
        start = float(fmu.variables[name].start)
        if name.startswith("integrator."):
            values[name] = rng.uniform(0.5, 1)
        elif name.endswith((".mass", ".inertia")):
            values[name] = start * rng.uniform(0.8, 1.2)
        else:
            values[name] = start + rng.normal() * (0.05 if ".r[" in name else 1.0)
    return values


MIXED = ("default", True, "mixed", "consistent", "split", "finite", "integrated")
DRIVEN = ("default", False, "driven", "lumped", "full", "small", "input")
LED = SETTINGS[-1]
ALL_FREE = ("optimized", True, "free", "lumped", "loads", "finite", "integrated")


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """Driven, free and fixed masters, springs, dampers, everything exposed."""
    return Fmu(scene(np.random.default_rng(1), *MIXED), tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="module", params=[MIXED, ALL_FREE, DRIVEN, LED], ids=["mixed", "free", "driven", "led"])
def any_fmu(request, tmp_path_factory):
    return Fmu(scene(np.random.default_rng(2), *request.param), tmp_path_factory.mktemp("fmu"))


@pytest.fixture
def loose(tmp_path):
    """One free quad without springs: nothing limits the step, and a large force runs away."""
    scene = {
        "mesh": {
            "nodes": [[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0], [101, 0.3, 0.6, 0.0]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "motion": "free", "mass": 1.0}],
        "tie": [{"name": "tie", "slaves": [101]}],
        "interface": {"expose": ["slave.mass"]},
    }
    return Fmu(scene, tmp_path)
