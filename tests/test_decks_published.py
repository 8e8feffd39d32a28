"""A deck against figures that OpenRadioss printed for one of its own test models (two plates, a pin between them, both
ends tied by Spotflag 1): nodal masses, total mass, nodal time steps. The deck here is written anew with its numbers."""

from pathlib import Path

import numpy as np
import pytest
from tiefmu import decks
from tiefmu.decks.element_properties import nodal
from tiefmu.report import report

DECK = Path(__file__).parent / "decks" / "two_plates.rad"
CORNER, CENTRE, PIN = 8.19e-3, 1.131e-2, 5.0e-4  # kg, as printed
UNTIED_STEP, TIED_STEP = 2.2671416000071e-04, 2.2882597200459e-04  # s, as printed: corners, nodes with a slave


def test_nodal_masses():
    deck = decks.read(DECK).deck
    masses = dict(zip(deck.node_id.tolist(), nodal(deck).mass))
    for node in (1, 2, 8, 9, 11, 12, 18, 19):
        assert masses[node] == pytest.approx(CORNER, rel=1e-13)
    for node in (3, 4, 6, 7, 13, 14, 16, 17):
        assert masses[node] == pytest.approx(CENTRE, rel=1e-13)
    for node in (5, 15):
        assert masses[node] == pytest.approx(PIN, rel=1e-13)
    assert sum(masses.values()) == pytest.approx(0.157, rel=1e-13)


def test_nodal_step_of_nodes_without_slaves():
    deck = decks.read(DECK).deck
    values = nodal(deck)
    corner = int(np.flatnonzero(deck.node_id == 1)[0])
    step = min(
        np.sqrt(2 * values.mass[corner] / values.stiffness[corner]),
        np.sqrt(2 * values.inertia[corner] / values.rotational_stiffness[corner]),
    )
    assert step == pytest.approx(UNTIED_STEP, rel=1e-13)


def test_nodal_step_of_the_tied_scene():
    scene = decks.load(DECK, free=("lower", "upper"))
    assert report(scene)["nodal_time_step"] == pytest.approx(TIED_STEP, rel=1e-13)
