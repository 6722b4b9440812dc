"""Claims: the map has each law over each signal once, and what is hidden gains most there."""

from __future__ import annotations

import pytest

from orchestration.diagnosis.law_map import map_laws
from orchestration.diagnosis.terms import SensorTerm
from tests.support.oscillator import diagnosis_without_terms, oscillator_record


@pytest.fixture(scope="module")
def rubbing():
    return map_laws(diagnosis_without_terms(oscillator_record(1, dry=1.5))).entries


def test_the_hidden_friction_gains_most(rubbing):
    """Dry friction over the velocity; alike laws are told as that which depends on it."""
    assert rubbing[0].term.cause == ("friction", "velocity")
    assert rubbing[0].gain > 10.0
    gains = [entry.gain for entry in rubbing]
    assert gains == sorted(gains, reverse=True)


def test_each_law_stands_over_each_signal_once(rubbing):
    causes = [entry.term.cause for entry in rubbing]
    assert len(set(causes)) == len(causes)
    assert {signal for _, signal in causes} >= {"force", "velocity", "elongation", "time"}
    assert not any(isinstance(entry.term, SensorTerm) or not entry.term.signal for entry in rubbing)


def test_nothing_gains_where_nothing_is_hidden():
    entries = map_laws(diagnosis_without_terms(oscillator_record(2))).entries
    assert entries
    assert max(entry.gain for entry in entries) < 5.0
