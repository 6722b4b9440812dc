"""Claims: forgetting is eq. 4.11; the instrument takes away the bias of noise; the covariance stays
bounded.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from fmus.degradation_estimator import model as estimator
from fmus.degradation_estimator.model import DegradationEstimator
from tests.support.estimator import LEAST_SQUARES, R1, R2, C, impedance, measured, square
from tests.support.pace import slow_but

README = Path(estimator.__file__).with_name("README.md").read_text(encoding="utf-8")


def test_forgetting_factor_is_eq_4_11_and_the_printed_numbers_are_not_what_they_are_called():
    for percent, age, period in ((10.0, 600.0, 0.1), (1.0, 10.0, 0.1), (50.0, 5.0, 1 / 15)):
        model = DegradationEstimator(
            remaining_weight=percent / 100, forgetting_time=age, sample_period=period
        )
        assert model.forgetting_factor() == pytest.approx(
            10 ** ((math.log10(percent) - 2) * period / age), rel=1e-13
        )
    for name, factor, left in (
        ("thesis_10_hz", 0.91, 8e-5),
        ("thesis_15_hz", 0.985, 0.32),
    ):  # errata 11
        values = DegradationEstimator.presets[name].values
        assert DegradationEstimator(**values).forgetting_factor() == pytest.approx(
            factor, rel=1e-12
        )
        assert values["remaining_weight"] == pytest.approx(left, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("millivolts", slow_but([5, 20], 20))
def test_noise_biases_least_squares_and_not_the_instrumental_variable(estimate, millivolts):
    """Errata 9, 0.9 A at 0.2 Hz, true R2 2.35 ohm; the figures are those of the README's table."""
    current = square(600.0)
    values, shown = {}, [f"{millivolts} mV rms"]
    for name, options in (("plain", LEAST_SQUARES), ("instrument", {})):
        runs = [
            estimate(current, measured(current, 1e-3 * millivolts, seed), **options)
            for seed in range(40)
        ]
        values[name] = np.array(
            [[run[signal][-1] for signal in ("R1", "R2", "C", "impedance")] for run in runs]
        )
        shown.append(f"{values[name][:, 1].mean():.2f} ± {values[name][:, 1].std(ddof=1):.2f} Ω")
    assert f"| {' | '.join(shown)} |" in README
    assert values["plain"][:, 1].mean() < 0.95 * R2
    mean, spread = values["instrument"].mean(axis=0), values["instrument"].std(axis=0)
    assert mean[:3] == pytest.approx([R1, R2, C], rel=0.016)  # three standard errors of the mean
    assert spread[1] < 0.04 * R2
    assert values["instrument"][:, 3] == pytest.approx(impedance(R1, R2, C), rel=0.01)


def test_one_long_record_gives_r2_within_3_percent(estimate):
    current = square(7200.0)
    voltage = measured(current, 20e-3, seed=11)
    found = estimate(current, voltage, forgetting_time=7200.0)
    assert found["R2"][-1] == pytest.approx(R2, rel=0.03)
    assert estimate(current, voltage, forgetting_time=7200.0, **LEAST_SQUARES)["R2"][-1] < 0.6 * R2


def test_covariance_stays_bounded_and_symmetric_for_least_squares(estimate):
    current = square(3600.0, amplitude=0.06)  # hardly any excitation for so fast a forgetting
    current[::50] += 0.2
    options = {"forgetting_time": 5.0, "maximum_trace": 100.0, "initial_covariance": 10.0}
    for instrumental in (0.0, 1.0):
        found = estimate(
            current, measured(current, 5e-3), instrumental_variable=instrumental, **options
        )
        total = found["p[1,1]"] + found["p[2,2]"] + found["p[3,3]"]
        assert np.all(total[20:] <= 100.0 * (1 + 1e-12))
        assert np.all(total[20:] > 0.0)
        assert all(np.all(np.isfinite(values)) for values in found.values())
        if not instrumental:
            assert found["p[1,3]"] == pytest.approx(found["p[3,1]"], rel=1e-6, abs=1e-6)
