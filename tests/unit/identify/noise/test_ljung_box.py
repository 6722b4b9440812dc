"""Ljung and Box's test against statsmodels, and its rates of false alarms and of detection."""

import numpy as np
import pytest
from scipy.signal import lfilter
from statsmodels.stats.diagnostic import acorr_ljungbox
from statsmodels.tsa.stattools import acf

from orchestration.identify.noise.ljung_box import whiteness


def autoregressive(random, samples, phi):
    """Return an AR(1) series with its start-up cut off."""
    return lfilter([1.0], [1.0, -phi], random.standard_normal(samples + 200))[200:]


@pytest.mark.parametrize("phi", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("lags", [1, 10, 40])
def test_ljung_box_agrees_with_statsmodels(phi, lags):
    residual = 3.0 + autoregressive(np.random.default_rng(17), 400, phi)
    result = whiteness(residual, lags=lags)
    oracle = acorr_ljungbox(residual, lags=[lags])
    assert result.statistic == pytest.approx(oracle["lb_stat"].iloc[0], rel=1e-10)
    assert result.p_value == pytest.approx(oracle["lb_pvalue"].iloc[0], rel=1e-8)
    assert result.lag_one == pytest.approx(acf(residual, nlags=1)[1], rel=1e-10)
    assert (result.samples, result.lags) == (400, lags)


def test_default_lags():
    random = np.random.default_rng(0)
    assert whiteness(random.standard_normal(1000)).lags == 25
    assert whiteness(random.standard_normal(200)).lags == 10
    assert whiteness(random.standard_normal(20)).lags == 1


@pytest.mark.parametrize("gaps", [0.0, 0.3])
def test_false_alarms_on_white_noise_are_about_one_percent(gaps):
    random = np.random.default_rng(1)
    results = []
    for _ in range(2000):
        residual = random.standard_normal(1000)
        residual[random.random(1000) < gaps] = np.nan
        results.append(whiteness(residual))
    alarms = np.mean([not result.is_white for result in results])
    # Four standard deviations of a 1 % rate over 2000 records are 0.9 %; chi-square is itself an
    # approximation.
    assert 0.002 < alarms < 0.021
    assert np.mean([result.fraction_outside for result in results]) == pytest.approx(
        0.01, abs=0.0025
    )
    # p-values are uniform, not only right in the tail.
    assert np.mean([result.p_value < 0.5 for result in results]) == pytest.approx(0.5, abs=0.05)


def test_short_records_keep_the_false_alarm_rate():
    random = np.random.default_rng(6)
    alarms = np.mean([not whiteness(random.standard_normal(100)).is_white for _ in range(4000)])
    assert alarms == pytest.approx(
        0.01, abs=0.0063
    )  # four standard deviations of a 1 % rate over 4000 records


@pytest.mark.parametrize(("phi", "least_power"), [(0.9, 1.0), (-0.5, 1.0), (0.25, 0.95)])
def test_coloured_noise_is_found(phi, least_power):
    random = np.random.default_rng(8)
    results = [whiteness(autoregressive(random, 1000, phi)) for _ in range(200)]
    assert np.mean([not result.is_white for result in results]) >= least_power
    assert np.mean([result.lag_one for result in results]) == pytest.approx(phi, abs=0.02)


def test_gaps_do_not_bias_the_autocorrelation():
    random = np.random.default_rng(4)
    residual = autoregressive(random, 20_000, 0.9)
    residual[5000:9000] = np.nan
    result = whiteness(residual)
    assert result.samples == 16_000
    assert result.lag_one == pytest.approx(0.9, abs=0.02)
    assert not result.is_white


def test_every_other_sample_missing_leaves_the_even_lags():
    residual = np.full(1000, np.nan)
    residual[::2] = autoregressive(np.random.default_rng(5), 500, 0.9)
    present = residual[::2]
    result = whiteness(residual, lags=20)
    oracle = acorr_ljungbox(present, lags=[10])
    assert result.statistic == pytest.approx(oracle["lb_stat"].iloc[0], rel=1e-10)
    assert result.p_value == pytest.approx(oracle["lb_pvalue"].iloc[0], rel=1e-8)


def test_a_constant_residual_is_not_called_white():
    result = whiteness(np.zeros(100))
    assert not result.is_white
    assert np.isnan(result.p_value)
    assert result.summary() == "constant"


@pytest.mark.parametrize(
    ("residual", "options", "text"),
    [
        (np.arange(19.0), {}, "lags = 0 for 19 samples"),
        ([0.0, np.inf] * 50, {}, "infinite"),
        (np.arange(50.0), {"lags": 50}, "lags"),
        (np.arange(50.0), {"lags": 0}, "at least 1"),
    ],
)
def test_refusals_name_what_is_wrong(residual, options, text):
    with pytest.raises(ValueError, match=text):
        whiteness(residual, **options)
