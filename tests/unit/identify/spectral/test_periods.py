"""Claims: a period is found where a signal has one, noise on it or not, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.identify.spectral.periods import named_period, period_of
from tests.support import frequency as made

RANDOM = np.random.default_rng(1)
TIME = made.STEP * np.arange(600)


@pytest.mark.parametrize(
    ("values", "period"),
    [
        (made.square(600), 100),
        (made.noisy(RANDOM, made.square(600), 0.05), 100),
        (made.prbs(RANDOM), 126),
        (made.multisine(RANDOM, 150, 4), 150),
        (np.sin(2 * np.pi * TIME / 10.0 / 1.0), 100),
        (np.sin(2 * np.pi * TIME / (10.0 / 3.0)), 100),  # 33.3 samples: three periods are whole
        (made.square(600) + 0.05 * np.sin(2 * np.pi * TIME / 20.0), 200),
        (made.square(190), 0),  # not two periods
        (RANDOM.normal(size=600), 0),
        (np.cumsum(RANDOM.normal(size=600)), 0),
        (TIME, 0),
        (np.ones(600), 0),
        (np.repeat(RANDOM.choice([-1.0, 0.0, 1.0], 20), 30), 0),
    ],
)
def test_the_period_of_a_signal(values, period):
    assert period_of(values) == period


def test_a_named_period_holds_for_what_repeats():
    inputs = {"current": made.square(600), "force": RANDOM.normal(size=600)}
    assert named_period(10.0, made.STEP, inputs) == {"current": 100, "force": 0}
    assert named_period(20.0 / 3.0, made.STEP, {"current": made.square(600)}) == {"current": 200}


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (np.nan, "has periods from 0.2 s to half of it"),
        (40.0, "has periods from 0.2 s to half of it"),
        (7.7777, "no multiple of it within half the record is a whole number of samples of 0.1 s"),
        (15.0, "current do not repeat after 15 s"),
    ],
)
def test_a_period_that_cannot_be_is_refused(seconds, said):
    with pytest.raises(UserError, match=said):
        named_period(seconds, made.STEP, {"current": made.square(600)})
