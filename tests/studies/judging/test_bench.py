"""Benches and stands of other simulations: nobody is blamed for a clock, and effects are named."""

from __future__ import annotations

import pytest

from studies.judging.bench import CLEAN, CLEAN_STAND, FRICTION, BenchCase, is_right, judge


@pytest.mark.timeout(900)
def test_a_clean_bench_is_not_blamed_for_the_phase_of_its_controller():
    """The controller begins 4.6 ms after the record."""
    row = judge(BenchCase(CLEAN, 1004))
    assert row["verdicts"] == {"bench": "consistent", "actuator": "consistent"}
    assert all(row["inside"].values())


@pytest.mark.slow
def test_dry_friction_is_named_first():
    """0.16 N, and a clock that jitters."""
    row = judge(BenchCase(FRICTION, 2002))
    assert row["verdicts"]["bench"] == "wrong"
    assert row["causes"] == ["coulomb_friction"]


@pytest.mark.slow
def test_no_impossible_damping_stands_for_dry_friction():
    """0.38 N, where the slide is so slow that 49 times its damping is as near to the record."""
    row = judge(BenchCase(FRICTION, 20261186105))
    assert is_right(row)
    assert "b_vc" not in row["named"]


@pytest.mark.slow
def test_a_sample_of_a_clean_stand_is_of_its_own_instant():
    """LabVIEW writes what it has just read, as a clock does that ticks just before each sample."""
    row = judge(BenchCase(CLEAN_STAND, 5))
    assert row["verdicts"]["stand"] == row["verdicts"]["actuator"] == "consistent"
    assert row["inside"]["sample_shift"]
    assert row["inside"]["placing_time"]


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["force_to_voltage", "swinging_weight"])
def test_an_effect_of_a_stand_is_named_in_its_member(effect):
    row = judge(BenchCase(effect, 6))
    assert is_right(row)
    assert all(row["inside"].values())


@pytest.mark.parametrize(
    ("said", "right"),
    [
        ({}, True),
        ({"verdict": "wrong"}, False),
        ({"verdict": "recalibrate", "named": ["R1"]}, True),
        ({"verdict": "recalibrate", "named": ["K"]}, False),
        ({"verdict": "recalibrate", "named": ["R1"], "inside": {"R1": False}}, False),
        ({"kind": FRICTION, "causes": ["coulomb_friction", "end_stops"]}, True),
        ({"kind": FRICTION, "causes": ["stribeck_friction"]}, True),
        ({"kind": FRICTION, "causes": ["asymmetric_friction"]}, False),
        ({"kind": FRICTION, "causes": []}, False),
        ({"kind": FRICTION, "causes": ["end_stops", "coulomb_friction"]}, False),
        ({"kind": CLEAN_STAND, "verdict": "wrong"}, False),
        ({"kind": "core_friction", "causes": ["core_friction"]}, True),
        ({"kind": "core_friction", "causes": ["swinging_weight"]}, False),
        ({"kind": "misalignment", "causes": ["sensor_gain(displacement_measured)"]}, True),
    ],
)
def test_what_is_right(said, right):
    row = {
        "kind": CLEAN,
        "verdict": "consistent",
        "named": [],
        "causes": [],
        "changed": ["R1"],
        "inside": {"R1": True},
    }
    assert is_right(row | said) is right
