"""How an input goes from sample to sample: in steps with rest between them, or smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data.intersample import (
    IntersampleCourse,
    classify_course,
    white_noise,
)
from tests.support.intersample_records import stimulus

SMOOTH, STEPS = ("chirp", "multisine", "triangle"), ("square", "prbs", "multilevel")


def at(kind: str, rate: float, seed: int = 1):
    return stimulus(kind, np.arange(round(120.0 * rate)) / rate, seed, rate)


@pytest.mark.parametrize(
    ("rate", "noise"),
    [(rate, noise) for rate in (1.0, 10.0, 50.0) for noise in (0.0, 0.001, 0.005)]
    + [(10.0, 0.02), (50.0, 0.02)],
)
@pytest.mark.parametrize("kind", [*SMOOTH, *STEPS])
def test_steps_are_told_from_a_smooth_course_whatever_the_noise(kind, noise, rate):
    values = at(kind, rate)
    measured = values + noise * np.ptp(values) * np.random.default_rng(2).standard_normal(
        len(values)
    )
    assert classify_course(measured) is (
        IntersampleCourse.SMOOTH if kind in SMOOTH else IntersampleCourse.STEPS
    )


@pytest.mark.parametrize("kind", [*SMOOTH, *STEPS])
@pytest.mark.parametrize("bits", [8, 12, 16])
def test_the_steps_of_a_recorder_are_none_of_the_input(kind, bits):
    values = at(kind, 50.0)
    grid = np.ptp(values) / 2**bits
    assert classify_course(np.round(values / grid) * grid) is (
        IntersampleCourse.SMOOTH if kind in SMOOTH else IntersampleCourse.STEPS
    )


def test_a_slow_sine_is_smooth_though_its_recorder_repeats_values():
    values = np.round(2000.0 * np.sin(2.0 * np.pi * np.arange(6000) / 6000.0))
    assert np.mean(np.diff(values) == 0.0) > 0.1
    assert classify_course(values) is IntersampleCourse.SMOOTH


def test_an_input_of_which_every_sample_is_another_does_not_tell():
    assert classify_course(at("every sample", 10.0)) is IntersampleCourse.UNCLEAR
    assert (
        classify_course(np.random.default_rng(1).choice([-1.0, 1.0], 3000))
        is not IntersampleCourse.SMOOTH
    )
    assert classify_course(np.ones(100)) is IntersampleCourse.STILL


@pytest.mark.parametrize("kind", [*SMOOTH, *STEPS])
def test_white_noise_is_seen_beside_a_smooth_course_and_beside_steps(kind):
    values = at(kind, 10.0)
    noise = 0.005 * np.random.default_rng(3).standard_normal(len(values))
    assert white_noise(values + noise) == pytest.approx(0.005, rel=0.35)
    assert white_noise(values) < 0.0015


def test_two_samples_tell_no_course():
    assert classify_course(np.array([0.0, 1.0])) is IntersampleCourse.UNCLEAR
