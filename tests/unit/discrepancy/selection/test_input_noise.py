"""Claims: noise on an input is told from its course, and denoising takes it off, but no steps."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.selection.input_noise import denoised_course, input_noise_std
from tests.support.intersample_records import stimulus
from tests.support.pace import slow_but

KINDS = ("chirp", "multisine", "triangle", "square", "prbs", "multilevel")


@pytest.mark.parametrize("rate", [10.0, 50.0])
@pytest.mark.parametrize("kind", KINDS)
def test_noise_is_seen_on_every_course(kind, rate):
    values = stimulus(kind, np.arange(round(120.0 * rate)) / rate, 1, rate)
    for share in (0.001, 0.005, 0.02):
        noise = share * np.ptp(values)
        measured = values + noise * np.random.default_rng(2).standard_normal(len(values))
        if share > 0.001 or kind not in (
            "chirp",
            "multisine",
        ):  # of which third differences are larger
            assert input_noise_std(measured) == pytest.approx(noise, rel=0.25)


@pytest.mark.parametrize("rate", [1.0, 10.0, 50.0])
@pytest.mark.parametrize("kind", [*KINDS, "every sample"])
def test_what_has_no_noise_has_none(kind, rate):
    values = stimulus(kind, np.arange(round(240.0 * rate)) / rate, 1, rate)
    assert input_noise_std(values) == 0.0


TIME = np.arange(3000) * 0.02
NOISE = 0.01


def binary(clock, seed=3):
    return np.repeat(np.sign(np.random.default_rng(seed).normal(size=-(-3000 // clock))), clock)[
        :3000
    ]


COURSES = {
    "square": np.sign(np.sin(1.3 * TIME + 0.1)),
    "binary, slow": binary(40),
    "binary, fast": binary(3),
    "staircase": np.floor(TIME / 6.0) * 0.3,
    "steps and rest": np.where(TIME % 20.0 < 5.0, 1.0, 0.0),
    "sine": np.sin(0.9 * TIME),
    "chirp": np.sin(0.05 * TIME**2),
    "triangle": 2.0 * np.abs((TIME / 7.0) % 1.0 - 0.5),
    "multisine": sum(np.sin(k * 0.4 * TIME + k * k) for k in range(1, 6)) / 3.0,
}


@pytest.mark.parametrize(
    "name",
    slow_but(
        COURSES, "chirp", "square", "binary, slow", "binary, fast", "staircase", "steps and rest"
    ),
)
def test_most_of_the_noise_goes_and_the_course_stays(name):
    course = COURSES[name]
    noisy = course + NOISE * np.random.default_rng(1).normal(size=len(TIME))
    found = denoised_course(TIME, noisy, input_noise_std(noisy))
    left = np.sqrt(np.mean((found - course) ** 2)) / NOISE
    assert left < (0.5 if name in ("chirp", "multisine", "triangle", "sine") else 0.2)


@pytest.mark.parametrize("name", ["binary, fast", "square"])
def test_levels_are_levels(name):
    noisy = COURSES[name] + NOISE * np.random.default_rng(2).normal(size=len(TIME))
    assert len(np.unique(denoised_course(TIME, noisy, input_noise_std(noisy)))) == 2


@pytest.mark.parametrize("share", [0.002, 0.005, 0.02])
def test_a_chirp_is_not_smoothed_away(share):
    """What is smoothed is nearer to the truth than what was measured, be it slow or fast."""
    time = np.arange(20_000) / 10.0
    course = stimulus("chirp", time, 1, 10.0)
    noise = share * np.ptp(course)
    noisy = course + noise * np.random.default_rng(4).standard_normal(len(course))
    found = denoised_course(time, noisy, noise)
    assert np.sqrt(np.mean((found - course) ** 2)) < 0.9 * noise


def test_a_straight_line_by_an_uneven_clock_stays_straight():
    """Its second divided differences are zero, whatever the steps of the clock are."""
    random = np.random.default_rng(6)
    time = np.cumsum(random.uniform(0.05, 0.15, 2000))
    noise = 0.01
    line = 0.05 * time
    found = denoised_course(time, line + noise * random.standard_normal(2000), noise)
    assert np.sqrt(np.mean((found - line) ** 2)) < 0.1 * noise
