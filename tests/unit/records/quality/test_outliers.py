"""Claims: bad readings are found in what a model leaves, and nothing else is.

Oracle: the places at which they were put.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.records.quality import outliers_of

PLACES = [40, 41, 700, 1503]
STILL = np.zeros((2000, 1))


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(2000)


@pytest.mark.parametrize("slow", [0.0, 30.0])
@pytest.mark.parametrize("seed", range(5))
def test_spikes_are_found_in_noise_and_in_slow_errors(seed: int, slow: float) -> None:
    errors = noise(seed) + slow * np.sin(np.arange(2000) / 150.0)
    assert not outliers_of(errors, STILL).any()
    errors[PLACES] += [20.0, 25.0, -18.0, 30.0]
    errors[900] = np.nan
    assert np.flatnonzero(outliers_of(errors, STILL)).tolist() == PLACES


def test_an_error_beside_a_jump_of_an_input_is_none() -> None:
    """The model may be a sample late there."""
    errors = noise(1)
    errors[[700, 1503]] += 40.0
    inputs = np.where(np.arange(2000) < 700, 0.0, 5.0)[:, np.newaxis]
    assert np.flatnonzero(outliers_of(errors, inputs)).tolist() == [1503]


def test_many_are_a_noise_of_another_kind() -> None:
    errors = noise(2)
    errors[::15] += 40.0
    assert not outliers_of(errors, STILL).any()


def test_a_short_record_tells_nothing() -> None:
    assert not outliers_of(np.array([0.0, 50.0, 0.0, 0.1]), STILL[:4]).any()
