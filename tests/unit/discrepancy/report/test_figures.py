"""What the figures of a report show of noise of known colour, and how they are titled."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.discrepancy.report import figures


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9])
def test_the_band_of_a_spectrum_holds_99_percent_of_noise(colour):
    inside = []
    for seed in range(40):
        noise = lfilter([1.0], [1.0, -colour], np.random.default_rng(seed).standard_normal(4000))
        frequency, density = figures.amplitude_spectrum(noise, 0.1)
        low, high = figures.noise_band(noise, frequency, density, 0.1)
        inside.append(np.mean((low < density) & (density < high)))
    assert np.mean(inside) == pytest.approx(0.99, abs=0.006)
    exact = np.sqrt(2.0 * 0.1) / np.abs(1.0 - colour * np.exp(-2j * np.pi * frequency * 0.1))
    assert np.mean((low < exact) & (exact < high)) > 0.99
    hum = noise + 2.0 * np.sin(2.0 * np.pi * 0.83 * 0.1 * np.arange(4000))
    frequency, density = figures.amplitude_spectrum(hum, 0.1)
    beyond = frequency[density > 2.0 * figures.noise_band(hum, frequency, density, 0.1)[1]]
    assert beyond == pytest.approx(0.83, abs=0.05)


def test_autocorrelation_is_that_of_the_definition():
    x = lfilter([1.0], [1.0, -0.9], np.random.default_rng(1).standard_normal(100_000))
    assert figures.autocorrelation(x)[:5] == pytest.approx(0.9 ** np.arange(1, 6), abs=0.02)
    assert figures.autocorrelation(np.zeros(400)).tolist() == [0.0] * 40


def test_a_long_name_fits_above_its_panel():
    title = figures._panel_title("displacement_of_the_second_stage_relative_to_the_frame", "N*s/m")
    assert len(title) < 60
    assert title.endswith(" [N·s/m]")
