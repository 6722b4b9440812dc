"""Periodic parts of a residual."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.lines import ALPHA, spectral_lines
from tests.support.diagnosis import coloured
from tests.support.residuals import COLOURS, STEP, TIME, noise


def hum(amplitude, frequency):
    return amplitude * np.sin(2.0 * np.pi * frequency * TIME)


@COLOURS
def test_a_hum_is_found_and_noise_has_none(colour):
    time = 0.1 * np.arange(4000)
    for seed in range(40):
        assert spectral_lines(coloured(colour, seed), 0.1) == []
    (line, *_) = spectral_lines(coloured(colour, 1) + 1.5 * np.sin(2.0 * np.pi * 0.83 * time), 0.1)
    assert line.frequency == pytest.approx(0.83, abs=0.003)
    assert line.amplitude == pytest.approx(1.5, rel=0.2)


@COLOURS
def test_two_lines_are_told_by_frequency_and_amplitude_the_strongest_first(colour):
    lines = spectral_lines(noise(colour, 2) + hum(1.5, 0.83) + hum(3.0, 1.91), STEP)
    assert [line.frequency for line in lines] == pytest.approx([1.91, 0.83], abs=1.0 / TIME[-1])
    assert [line.amplitude for line in lines] == pytest.approx([3.0, 1.5], rel=0.2)
    assert all(line.p_value < ALPHA for line in lines)


@pytest.mark.parametrize(("share", "expected"), [(0.03, []), (0.5, [0.5])])
def test_what_is_little_beside_a_line_of_the_output_is_no_disturbance(share, expected):
    """Under a periodic input a model that is 3 % off leaves a line; half of the output's own line
    is another matter.
    """
    time = 0.1 * np.arange(4000)
    output = np.sin(2.0 * np.pi * 0.5 * time)
    residual = share * output + 0.01 * np.random.default_rng(0).standard_normal(time.size)
    assert len(spectral_lines(residual, 0.1)) == 1
    assert [line.frequency for line in spectral_lines(residual, 0.1, output)] == pytest.approx(
        expected, abs=0.003
    )


@pytest.mark.parametrize("residual", [np.zeros(3000), np.ones(3000), np.sin(np.arange(200.0))])
def test_nothing_is_said_of_a_constant_or_of_too_few_samples(residual):
    assert spectral_lines(residual, STEP) == []
