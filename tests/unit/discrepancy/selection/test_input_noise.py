"""Claims: noise on an input is told from its course, and smoothing takes it off, but no steps."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.selection.input_noise import input_noise_std, smoothed_input
from tests.support.intersample_records import stimulus

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


def test_weighted_means_of_three_leave_three_eighths_of_the_power_and_every_step():
    """1/16 + 1/4 + 1/16 of the power of white noise is left; a step is as steep as it was."""
    steps = np.repeat([0.0, 10.0], 5000)
    noise = 0.1 * np.random.default_rng(1).standard_normal(10_000)
    found = smoothed_input(steps + noise, 0.1)
    assert np.var(found - steps) / np.var(noise) == pytest.approx(3.0 / 8.0, rel=0.05)
    assert found[5000] - found[4999] == pytest.approx(10.0, abs=0.5)
