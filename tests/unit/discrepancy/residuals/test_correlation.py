"""With which signal, and when, a residual correlates: in noise of known colour."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.correlation import cross_correlations
from orchestration.discrepancy.residuals.innovations import score_innovations
from orchestration.discrepancy.residuals.regressors import Regressor
from orchestration.identify.noise.autoregression import ORDER
from orchestration.identify.noise.model import estimate_noise
from tests.support.residuals import COLOURS, EVERY, STEP, bench, noise


def correlations(residual, signals, present=EVERY, order=ORDER):
    kind = estimate_noise(residual, present, order)
    return cross_correlations("y", score_innovations(residual, present, kind), kind, signals, STEP)[
        0
    ]


@COLOURS
def test_false_alarms_are_as_rare_as_they_say(colour):
    outside, alarms = [], 0
    for seed in range(60):
        residual = noise(colour, seed)
        known = correlations(residual, bench(seed))
        outside.append(np.mean([np.mean(np.abs(c.correlation) > c.band) for c in known]))
        alarms += any(c.significant for c in known)
    assert np.mean(outside) == pytest.approx(0.01, abs=0.004)
    assert alarms <= 2  # of 60, at 1 %


@COLOURS
def test_a_correlation_is_found_at_its_lag(colour):
    signals = {s.name: s for s in bench(3)}
    hidden = np.roll(signals["square of charge"].values, 4)
    residual = noise(colour, 5) + 0.3 * hidden / hidden.std() / (1.0 - colour)
    best = correlations(residual, list(signals.values()))[0]
    assert best.signal in ("square of charge", "rate of charge", "speed of voltage")
    assert best.significant
    alone = correlations(residual, [signals["square of charge"]])[0]
    assert alone.lag == pytest.approx(0.4, abs=0.11)
    assert "later" in alone.describe("y")


@COLOURS
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_sign_is_that_of_the_dependence_in_number_and_word(colour, sign):
    (charge,) = (s for s in bench(3) if s.name == "charge")
    residual = noise(colour, 5) + sign * 3.0 * charge.values / charge.values.std() / (1.0 - colour)
    (only,) = correlations(residual, [charge])
    assert only.significant
    assert np.sign(only.strength) == sign
    assert only.describe("y").startswith(f"y correlates with charge: {'+' if sign > 0 else '-'}0.")


def test_a_correlation_over_a_gap_uses_the_pairs_there_are():
    residual, present = noise(0.0, 1), EVERY.copy()
    present[1000:1400] = False
    signal = Regressor(
        "u", np.concatenate([residual[2:], [0.0, 0.0]]), "A"
    )  # two samples before the residual
    (only,) = correlations(residual[present], [signal], present)
    assert only.lag == pytest.approx(2 * STEP)
    assert only.strength == pytest.approx(1.0, abs=0.1)


def test_without_an_even_clock_the_samples_are_correlated_as_they_are():
    residual, present = noise(0.0, 1), EVERY.copy()
    present[1000:1400] = False
    kept, other = residual[present], noise(0.0, 2) + residual
    (only,) = correlations(kept, [Regressor("u", other, "A")], present, order=0)
    assert only.lag == 0.0
    assert only.strength == pytest.approx(np.corrcoef(kept, other[present])[0, 1], abs=0.015)


def test_what_comes_after_the_residual_is_no_structure():
    residual = noise(0.0, 1)
    signal = Regressor("u", np.concatenate([[0.0, 0.0], residual[:-2]]), "A")
    (only,) = correlations(residual, [signal])
    assert only.correlation[only.lags == -2 * STEP] == pytest.approx(1.0, abs=0.01)
    assert not only.significant
