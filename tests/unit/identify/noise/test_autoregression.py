"""Autoregressions against series of known coefficients."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.identify.noise.autoregression import (
    fit_autoregression,
    yule_walker,
)


@pytest.mark.parametrize(
    ("coefficients", "order"),
    [([0.9], 1), ([1.2, -0.5], 2), ([], 0), ([0.4, 0.2, -0.3], 3)],
    ids=str,
)
def test_noise_models_are_recognised(coefficients, order):
    noise = lfilter(
        [0.3], [1.0, *(-c for c in coefficients)], np.random.default_rng(4).standard_normal(20000)
    )
    found = fit_autoregression(noise)
    assert len(found.coefficients) == order
    assert found.coefficients == pytest.approx(coefficients, abs=0.03)
    assert found.deviation == pytest.approx(0.3, rel=0.015)


@pytest.mark.parametrize("bad", [np.inf, np.nan])
@pytest.mark.parametrize("lags", [2, 3, 21])
def test_a_residual_that_has_run_away_is_no_complaint_of_lapack(bad, lags, capfd):
    with pytest.raises(np.linalg.LinAlgError):
        yule_walker(np.full(lags, bad), 100)
    assert capfd.readouterr() == ("", "")


def test_a_residual_that_runs_away_has_no_autoregression():
    residual = np.geomspace(1.0, 1e200, 300)
    with np.errstate(over="ignore"), pytest.raises(np.linalg.LinAlgError, match="not finite"):
        fit_autoregression(residual)
