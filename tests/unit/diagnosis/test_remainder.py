"""Claims: what is left is told in noise widths, and a slow error from noise."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.diagnosis.remainder import Remainder, noise_of
from tests.support.oscillator import diagnosis_with, oscillator_record


def test_what_is_left_is_the_noise_that_was_added():
    diagnosis = diagnosis_with(oscillator_record(1, noise=3e-3))
    (left,) = diagnosis.remainders
    measured = diagnosis.records[0].signals["position"]
    unseen = measured[len(measured) * 2 // 3 :]
    assert left.share == pytest.approx(3e-3 / np.std(unseen), rel=0.25)
    assert left.noise_widths == pytest.approx(1.0, abs=0.2)
    assert not left.is_slow


def test_noise_is_told_from_a_slow_error():
    time = np.linspace(0.0, 20.0, 4000)
    noise = np.random.default_rng(3).normal(0.0, 0.2, time.size)
    assert noise_of(noise + np.sin(time)) == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize(
    ("correlation", "widths", "more"),
    [(0.9, 3.0, True), (0.9, None, True), (0.9, 1.2, False), (0.1, 3.0, False)],
)
def test_more_than_noise_is_slow_and_large(correlation, widths, more):
    assert (
        Remainder("position", 0.1, widths, {"correlation": correlation}).is_more_than_noise is more
    )
