"""Claims: the interval of repeated measurements is Student's, as SciPy has it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import sem, t

from demonstrations.graphical.quantity import mean, quantity, resampled

VALUES = [2.1, 1.9, 2.4, 2.0]


def test_a_mean_has_the_interval_of_scipy():
    found = mean(VALUES, "ohm")
    assert found.value == pytest.approx(2.1)
    assert found.interval == pytest.approx(t.interval(0.95, 3, np.mean(VALUES), sem(VALUES)))
    assert str(found) == "2.1 ohm (95 % interval 1.756 to 2.444)"


def test_what_was_measured_once_has_no_interval():
    for once in (mean([2.1], "V"), quantity(2.1, 0.3, 1, "V")):
        assert once.interval == (-np.inf, np.inf)


def test_of_many_repetitions_it_is_nearly_that_of_a_normal_distribution():
    assert quantity(0.0, 1.0, 10_000, "1").interval == pytest.approx((-1.96, 1.96), abs=1e-3)


def test_an_interval_by_resampling_has_the_size_that_theory_gives():
    """Of a mean of n values of white noise: 1.96 deviations over the root of n."""
    random = np.random.default_rng(1)
    measured = 3.0 + 0.5 * random.standard_normal(4000)
    (estimate,) = resampled(
        lambda y: [y.mean()], lambda level: np.full(4000, *level), measured, ["V"]
    )
    assert estimate.value == measured.mean()
    low, high = estimate.interval
    assert (high - low) / 2 == pytest.approx(1.96 * 0.5 / np.sqrt(4000.0), rel=0.2)
    assert (high + low) / 2 == pytest.approx(measured.mean(), abs=0.01)


def test_the_colour_of_noise_widens_an_interval_by_resampling():
    """Noise of which each value comes eight times has a mean that is sqrt(8) times as uncertain."""
    random = np.random.default_rng(1)
    slow = np.repeat(random.standard_normal(250), 8)
    (estimate,) = resampled(lambda y: [y.mean()], lambda level: np.full(2000, *level), slow, ["V"])
    low, high = estimate.interval
    white = 1.96 / np.sqrt(2000.0)
    assert 1.8 * white < (high - low) / 2 < 3.0 * white


@pytest.mark.parametrize("bias", [0.5, -0.5])
def test_an_interval_by_resampling_reaches_to_the_value_without_the_bias_of_its_reading(bias):
    """A method that always reads so much too much is known by reading its own curve."""
    measured = 3.0 + 0.1 * np.random.default_rng(1).standard_normal(4000)
    (estimate,) = resampled(
        lambda y: [y.mean() + bias], lambda level: np.full(4000, *level), measured, ["V"]
    )
    half = 1.96 * 0.1 / np.sqrt(4000.0)
    ends = sorted([measured.mean(), measured.mean() + bias])
    assert estimate.interval == pytest.approx([ends[0] - half, ends[1] + half], abs=0.3 * half)
