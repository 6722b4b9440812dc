"""Which effects a record can speak of, and what a candidate made of them brings."""

from __future__ import annotations

from fmus.kit.sensors import sensor_lag
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from fmus.voice_coil_dma.effects import EFFECTS as OF_BENCH
from orchestration.discrepancy.candidates.candidate import (
    Candidate,
    catalogue,
    label,
    own_parameters,
    without_random,
)


def test_the_catalogue_speaks_of_what_was_measured():
    names = [label(effect) for effect in catalogue(PpyActuator, EFFECTS, ["voltage"])]
    assert set(EFFECTS) <= set(names)
    assert "transport_delay(voltage)" in names
    assert not [name for name in names if "displacement)" in name]


def test_effects_of_random_numbers_are_not_looked_for():
    """Of the bench, noise and jitter are; hum and the protection are as they are in a record."""
    found = {effect.id for effect in without_random(OF_BENCH.values())}
    assert set(OF_BENCH) - found == {"bridge_noise", "clock_jitter"}
    assert without_random(EFFECTS.values()) == [*EFFECTS.values()]


def test_a_candidate_has_its_switch_first():
    assert own_parameters(EFFECTS["second_kelvin"])[0] == "second_creep_compliance"
    lag = sensor_lag(PpyActuator, "voltage")
    assert own_parameters(lag) == ["voltage_lag_time"]
    both = Candidate((), PpyActuator).with_effect(EFFECTS["strain_saturation"]).with_effect(lag)
    assert both.name == "strain_saturation + sensor_lag(voltage)"
    assert both.parameters == ["strain_saturation_coefficient", "voltage_lag_time"]
