"""Studies and advice vary a scene by copying it: a key that they know nothing of stays."""

import pytest
from conftest import toml
from pydantic import create_model
from tiefmu import _core, schema
from tiefmu.study.variants import Source, Variant, in_si

LATER = 42.0  # of a key of a later version

SCENE = {
    "title": "every table",
    "units": {"length": "mm", "mass": "g", "time": "ms"},
    "mesh": {
        "nodes": [
            *([1, 0, 0, 0], [2, 100, 0, 0], [3, 100, 100, 0], [4, 0, 100, 0], [101, 30, 60, 40], [201, 30, 60, 80])
        ],
        "segments": [[1, 1, 2, 3, 4]],
    },
    "node": [
        {"nodes": "all", "motion": "free", "rotations": True, "mass": 1000.0, "inertia": 2e6},
        {"nodes": [1], "motion": "driven", "stiffness": 3.0, "rotational_stiffness": 4.0},
    ],
    "tie": [
        {
            "name": "weld",
            "segments": [1],
            "slaves": [101],
            "formulation": "default",
            "search": "nearest-node",
            "search_distance": 200.0,
            "unresolved": "drop",
        }
    ],
    "spring": [
        {
            "nodes": [101, 201],
            "kind": "bushing",
            "stiffness": [1.0, 2.0, 3.0],
            "damping": 0.1,
            "rotational_stiffness": 5e4,
            "rotational_damping": 6.0,
        },
        {"ground": [2, 3, 201], "kind": "axial", "stiffness": 2.0} | {"kind": "bushing"},
        {"nodes": [2, 201], "kind": "beam", "stiffness": 2.0, "orientation": [0.0, 0.0, 1.0]},
    ],
    "initial": [{"nodes": [2, 3], "v": [0.1, 0.2, 0.3], "w": [0.0, 0.01, 0.0]}],
    "model": {
        "inertia": "lumped",
        "solver_tolerance": 1e-5,
        "reaction": "full",
        "reaction_lead": 0.5,
        "geometry": "finite",
        "position": "integrated",
        "gravity": [0.0, 0.0, -9.81e-3],
    },
    "integrator": {"method": "noh-bathe", "time_step": 1e-3, "safety": 0.5, "threads": 2},
    "interface": {"expose": ["energy"], "hide": ["drift"], "names": "flat"},
}
DROPPED = {"w"}  # by a variant without rotations
CHANGED = {  # what a variant is about, and what the studies set themselves
    "mesh": {"nodes", "segments", "file", "properties"},
    "node": {"nodes"},
    "tie": {"segments", "slaves"},
    "spring": {"nodes", "ground"},
    "initial": {"nodes"},
    "model": {"inertia", "solver_tolerance", "geometry", "reaction", "reaction_lead", "position"},
    "integrator": {"method", "time_step", "safety"},
    "interface": {"expose", "hide"},
}


def grown(table: type[schema.Table]) -> type[schema.Table]:
    """The table with a key that nobody knows."""
    return create_model(table.__name__, __base__=table, later=(float | None, None))


@pytest.fixture
def source(tmp_path, monkeypatch):
    tables = {name: grown(table) for name, table in schema.TABLES.items()}
    whole = create_model(
        "SceneTables",
        __base__=schema.SceneTables,
        **{
            n: (list[t] if n in schema.ARRAYS else t, [] if n in schema.ARRAYS else t.model_construct())
            for n, t in tables.items()
        },
    )
    monkeypatch.setattr(schema, "SceneTables", whole)
    monkeypatch.setattr(schema, "TABLES", tables)
    known = property(lambda settings: None, lambda settings, value: None)
    monkeypatch.setattr(_core.Settings, "later", known, raising=False)  # the solver of that version has it, too
    raw = {
        name: [one | {"later": LATER} for one in item] if isinstance(item, list) else item | {"later": LATER}
        for name, item in SCENE.items()
        if name != "title"
    }
    (tmp_path / "scene.toml").write_text(toml({"title": SCENE["title"]} | raw))
    return Source(tmp_path / "scene.toml")


def test_the_scene_has_every_key():
    """A new key of the schema has to come here, too. A mesh file and ports are another way to say the same."""
    for name, table in schema.TABLES.items():
        item = SCENE[name]
        said = set().union(*item) if isinstance(item, list) else set(item)
        assert said == set(table.model_fields) - {"file", "properties", "ports"}, name


@pytest.mark.parametrize("heavy", [False, True], ids=["tie", "heavy"])
@pytest.mark.parametrize(
    "variant",
    [Variant(), Variant("lumped", "small"), Variant(formulation="optimized"), Variant(freedoms="translations")],
    ids=["consistent", "lumped", "optimized", "translations"],
)
def test_a_variant_keeps_every_other_key(source, variant, heavy):
    before = in_si(source.tables) if heavy else source.tables
    after = source.tables_of(variant, "rk4", "full", heavy=heavy)
    assert after.title == "every table"
    for name in schema.TABLES:
        ours, theirs = getattr(before, name), getattr(after, name)
        changed = CHANGED.get(name, set()) | ({"formulation"} if variant.formulation != "scene" else set())
        if name in ("node", "spring", "initial"):  # tables may be added, or one a node or spring be made of them
            kept = [table for table in theirs if getattr(table, "later", None) == LATER]
            assert len(kept) >= len(ours), name
            assert heavy or [k.model_dump(exclude=DROPPED) for k in kept] == [
                k.model_dump(exclude=DROPPED) for k in ours
            ]
            continue
        for one, other in zip(ours, theirs, strict=True) if isinstance(ours, list) else [(ours, theirs)]:
            for key in {"later", *type(one).model_fields} - changed:
                assert getattr(one, key) == getattr(other, key), f"{name}: {key}"
    if variant.freedoms == "all":  # the scene's bushing needs the rotations
        source.compile(after)


def test_the_same_scene_node_by_node(source):
    """Inline mesh in SI, a table a node, sets as ids: the same model to the bit."""
    again = source.compile(source.arrays(source.tables, heavy=False))
    assert again.model.resource("") == source.scene.model.resource("")
