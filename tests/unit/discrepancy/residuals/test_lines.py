"""Periodic parts of a residual."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.lines import ALPHA, TRACKING_SHARE, spectral_lines
from tests.support.residuals import COLOURS, STEP, TIME, noise


def hum(amplitude, frequency):
    return amplitude * np.sin(2.0 * np.pi * frequency * TIME)


@COLOURS
def test_two_lines_are_told_by_frequency_and_amplitude_the_strongest_first(colour):
    lines = spectral_lines(noise(colour, 2) + hum(1.5, 0.83) + hum(3.0, 1.91), STEP)
    assert [line.frequency for line in lines] == pytest.approx([1.91, 0.83], abs=1.0 / TIME[-1])
    assert [line.amplitude for line in lines] == pytest.approx([3.0, 1.5], rel=0.2)
    assert all(line.p_value < ALPHA for line in lines)


def test_what_is_little_beside_the_line_of_the_output_is_no_disturbance():
    residual = noise(0.0, 2) + hum(1.0, 0.83)
    for amplitude, lines in ((0.5 / TRACKING_SHARE, 1), (3.0 / TRACKING_SHARE, 0)):
        output = residual + hum(amplitude, 0.83)
        assert len(spectral_lines(residual, STEP, output)) == lines


@pytest.mark.parametrize("residual", [np.zeros(3000), np.ones(3000), np.sin(np.arange(200.0))])
def test_nothing_is_said_of_a_constant_or_of_too_few_samples(residual):
    assert spectral_lines(residual, STEP) == []
