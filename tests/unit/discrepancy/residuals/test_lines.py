"""Spectral lines of a residual: found in noise of known colour, and none where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.lines import spectral_lines
from tests.support.diagnosis import coloured


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_hum_is_found_and_noise_has_none(colour):
    time = 0.1 * np.arange(4000)
    for seed in range(40):
        assert spectral_lines(coloured(colour, seed), 0.1) == []
    (line, *_) = spectral_lines(coloured(colour, 1) + 1.5 * np.sin(2.0 * np.pi * 0.83 * time), 0.1)
    assert line.frequency == pytest.approx(0.83, abs=0.003)
    assert line.amplitude == pytest.approx(1.5, rel=0.2)


@pytest.mark.parametrize(("share", "expected"), [(0.03, []), (0.5, [0.5])])
def test_what_is_little_beside_a_line_of_the_output_is_no_disturbance(share, expected):
    """Under a periodic input a model that is 3 % off leaves a line; half of the output's own line is another matter."""
    time = 0.1 * np.arange(4000)
    output = np.sin(2.0 * np.pi * 0.5 * time)
    residual = share * output + 0.01 * np.random.default_rng(0).standard_normal(time.size)
    assert len(spectral_lines(residual, 0.1)) == 1
    assert [line.frequency for line in spectral_lines(residual, 0.1, output)] == pytest.approx(expected, abs=0.003)
