import numpy as np
import pytest

from orchestration.identify.metrics import fit_percent, normalised_rms, rms


def test_rms_closed_forms():
    assert rms([3.0, -4.0]) == pytest.approx(np.sqrt(12.5))
    assert rms(2 * np.sin(2 * np.pi * np.arange(100) / 100)) == pytest.approx(np.sqrt(2))
    assert rms([np.nan, 5.0]) == 5.0
    assert np.isnan(rms([np.nan, np.nan]))


def test_fit_closed_forms():
    measured = np.array([1.0, 2.0, 3.0, 4.0])
    assert fit_percent(measured, measured) == 100.0
    assert fit_percent(measured, np.full(4, 2.5)) == 0.0
    # An error of d on every sample: sqrt(4 d^2) / sqrt(5).
    assert fit_percent(measured, measured + 0.1) == pytest.approx(100 * (1 - 0.2 / np.sqrt(5)))
    assert normalised_rms(measured, measured + 0.1) == pytest.approx(0.2 / np.sqrt(5))
    assert fit_percent(measured, -measured) < 0


def test_fit_of_a_sine_with_a_smaller_sine():
    phase = 2 * np.pi * np.arange(1000) / 100
    assert fit_percent(7 + np.sin(phase), 7 + 0.8 * np.sin(phase)) == pytest.approx(80.0)


def test_gaps_in_the_measurement_are_left_out_but_not_failures_of_the_simulation():
    measured, simulated = np.array([1.0, np.nan, 3.0, 4.0]), np.array([1.1, 50.0, 2.9, 4.2])
    kept = [0, 2, 3]
    assert fit_percent(measured, simulated) == fit_percent(measured[kept], simulated[kept])
    assert np.isnan(fit_percent([1.0, 2.0, 3.0], [1.0, np.nan, 3.0]))
    assert fit_percent([1.0, 2.0, 3.0], [1.0, np.inf, 3.0]) == -np.inf


def test_fit_needs_something_to_explain():
    assert np.isnan(fit_percent([2.0, 2.0], [2.0, 2.0]))
    assert np.isnan(fit_percent([np.nan], [1.0]))
    with pytest.raises(ValueError, match="one length"):
        fit_percent([1.0, 2.0], [1.0])
