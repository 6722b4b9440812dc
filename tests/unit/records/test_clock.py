"""Claims: a clock that jitters is even, one that changes its rate is not, and what is even is
diagnosed as such.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit.sensors import sensor_drift, sensor_lag, transport_delay
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.identify.noise.autoregression import fit_autoregression
from orchestration.records.clock import JITTER, evenly_sampled
from tests.support.intersample_records import TRUE, record

SENSORS = [make(PpyActuator, "voltage") for make in (sensor_lag, sensor_drift, transport_delay)]


@pytest.mark.parametrize("rate", [1.0, 10.0, 50.0])
def test_five_milliseconds_of_jitter_are_even(rate):
    random, time = np.random.default_rng(1), np.arange(3000) / rate
    for shift in (random.uniform(-5e-3, 5e-3, time.size), 5e-3 * random.standard_normal(time.size)):
        assert evenly_sampled(np.sort(time + shift))


def test_other_clocks_are_not():
    random = np.random.default_rng(1)
    assert not evenly_sampled(np.geomspace(1.0, 3000.0, 500))
    assert not evenly_sampled(np.cumsum(random.exponential(size=3000)))
    assert not evenly_sampled(np.cumsum(np.repeat([0.1, 0.02], 1500)))
    assert evenly_sampled(np.cumsum(np.where(np.arange(3000) == 1000, 50.0, 0.1)))


@pytest.mark.parametrize("pole", [0.3, 0.45, 0.7, 0.9, 0.97])
def test_an_autoregression_bears_as_much_jitter_as_is_called_even(pole):
    """An exact Ornstein-Uhlenbeck process, sampled unevenly: what the innovations lose against an
    even clock.
    """
    random, n = np.random.default_rng(3), 100_000
    steps = np.clip(1.0 + JITTER * random.standard_normal(n), 0.05, None)
    kept = pole**steps
    white, noise = np.sqrt(1.0 - kept**2) * random.standard_normal(n), np.zeros(n)
    for k in range(1, n):
        noise[k] = kept[k] * noise[k - 1] + white[k]
    coefficients, variance = fit_autoregression(noise)
    innovation = lfilter(np.concatenate([[1.0], -coefficients]), [1.0], noise)
    assert variance == pytest.approx(np.mean(white**2), rel=0.09)
    assert abs(np.mean(innovation[1:] * innovation[:-1])) < 0.03 * variance


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["chirp", "multilevel"])
def test_a_clean_record_with_jitter_is_diagnosed_like_any(kind):
    deviations = []
    for seed in range(40, 45):
        data = record(
            kind,
            kind == "multilevel",
            seed,
            duration=60.0,
            rate=50.0,
            force="multilevel",
            jitter=5e-3,
        )
        assert np.ptp(np.diff(data.time)) > 0.015
        diagnosis = diagnose(
            PpyActuator,
            data,
            [*SENSORS, EFFECTS["double_layer"]],
            held=PpyActuator.layout.start_parameters,
        )
        assert diagnosis.causes == []
        assert diagnosis.verdict == "recalibrate"
        assert diagnosis.validation.first == 2000  # its end is held out, and not every third sample
        assert diagnosis.intersample["current"].linear is (kind == "chirp")
        for name in ("R1", "R2", "C", "alpha"):
            low, high = diagnosis.estimates[name].interval
            deviations.append(
                (diagnosis.estimates[name].value - TRUE[name]) / ((high - low) / 3.92)
            )
    assert np.mean(np.abs(deviations) < 1.96) >= 0.85
    assert np.abs(deviations).max() < 4.0
