"""Settings of the solver are the keys of three tables of the schema, its enumerations have the words that it takes."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from random_scenes import one_segment
from tiefmu import _core, schema
from tiefmu.scene import Assembly
from tiefmu.study import speed_accuracy_charts, stability_cases, variants

TABLES = (schema.Model, schema.Integrator, schema.Interface)
CHOICES = [
    (schema.Node, "motion", _core.Motion),
    (schema.Tie, "formulation", _core.Formulation),
    (schema.Tie, "search", _core.SearchMethod),
    (schema.Spring, "kind", _core.SpringKind),
    (schema.Model, "inertia", _core.Inertia),
    (schema.Model, "reaction", _core.Reaction),
    (schema.Model, "geometry", _core.Geometry),
    (schema.Model, "position", _core.Position),
    (schema.Integrator, "method", _core.Method),
    (schema.Interface, "names", _core.Names),
]


def literals(annotation) -> list[str]:
    """Words of a Literal, or of a Literal or None."""
    found = [word for part in get_args(annotation) for word in (get_args(part) or [part])]
    return [word for word in found if isinstance(word, str)]


@pytest.mark.parametrize("table, key, kind", CHOICES, ids=lambda each: each if isinstance(each, str) else "")
def test_a_choice_has_the_words_of_its_enumeration(table, key, kind):
    words = literals(table.model_fields[key].annotation)
    assert [word.replace("-", "_") for word in words] == [value.name for value in kind]


def test_studies_know_every_method():
    methods = set(literals(schema.Integrator.model_fields["method"].annotation))
    assert set(variants.METHODS) == methods == set(stability_cases.METHODS)
    assert methods <= set(speed_accuracy_charts.COLOURS) and methods <= set(speed_accuracy_charts.MARKERS)


def test_the_solver_has_every_key_and_no_other():
    keys = [key for table in TABLES for key in table.model_fields if key != "ports"]
    assert len(set(keys)) == len(keys)
    assert set(keys) == {name for name in dir(_core.Settings) if not name.startswith("_")}


def test_every_key_arrives():
    scene = one_segment(np.random.default_rng(1))
    scene["units"] = {"length": "mm", "time": "ms"}
    scene["model"] = {
        "inertia": "consistent",
        "solver_tolerance": 1e-9,
        "reaction": "split",
        "reaction_lead": 0.5,
        "geometry": "small",
        "position": "input",
        "gravity": [1.0, 2.0, -3.0],
    }
    scene["integrator"] = {"method": "noh-bathe", "time_step": 0.25, "safety": 0.75, "threads": 3}
    scene["interface"] = {"names": "flat", "expose": ["energy"], "hide": ["slave.v"]}
    settings = Assembly(schema.parse(scene), Path(".")).settings()
    assert settings.inertia == _core.Inertia.consistent
    assert settings.reaction == _core.Reaction.split
    assert settings.reaction_lead == 0.5
    assert settings.geometry == _core.Geometry.small
    assert settings.position == _core.Position.input
    assert settings.method == _core.Method.noh_bathe
    assert settings.names == _core.Names.flat
    np.testing.assert_allclose(settings.gravity, [1e3, 2e3, -3e3], rtol=1e-15)
    assert settings.solver_tolerance == 1e-9
    assert (settings.time_step, settings.safety, settings.threads) == (0.25e-3, 0.75, 3)
    assert (settings.expose, settings.hide) == (["energy"], ["slave.v"])
    new = _core.Settings()
    for table in TABLES:  # what is left out of the scene above shows
        for key in table.model_fields:
            assert key == "ports" or not np.array_equal(getattr(settings, key), getattr(new, key)), key
