"""Claims: the amount of another simulation is that of least squares beside the model's own gain."""

from __future__ import annotations

import numpy as np
import pytest
import statsmodels.api as sm

from orchestration.discrepancy.candidates.encompassing_test import encompassing
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting import PRIOR_STD
from tests.support.regression_model import Amplifier, offset_record


@pytest.fixture(scope="module")
def fitted():
    data = offset_record(30.0, 1)
    return data, Search(data, Amplifier, ["gain"]).nominal()


def test_an_amount_is_that_of_least_squares(fitted):
    """All of the other is an offset of 1/10 V more than the fitted model."""
    data, base = fitted
    u, y = data.inputs["signal"], data.measured["shown"]
    simulated = base.fit.values["gain"] * u
    (amount,) = encompassing(base, [{"shown": simulated + 0.1}])
    oracle = sm.OLS(y, np.column_stack([u, np.full(u.size, 0.1)])).fit()
    assert amount.value == pytest.approx(oracle.params[1], rel=0.02)
    assert amount.standard_error == pytest.approx(oracle.bse[1], rel=0.1)
    error = (amount.value - 1.0) / amount.standard_error
    assert amount.excess == pytest.approx(error**2)
    none = (amount.value / amount.standard_error) ** 2
    assert amount.margin == pytest.approx(none - amount.excess)


def test_what_the_gain_does_too_is_known_as_well_as_the_gain_was_before(fitted):
    """A tenth more of the logarithm of a gain that is assumed within PRIOR_STD of it."""
    data, base = fitted
    simulated = base.fit.values["gain"] * data.inputs["signal"]
    (same,) = encompassing(base, [{"shown": 1.1 * simulated}])
    assert same.standard_error == pytest.approx(PRIOR_STD / 0.1, rel=1e-3)
    assert same.value == pytest.approx(0.0, abs=1e-6)
    assert same.shift == pytest.approx([-0.1], rel=1e-3)


def test_disturbances_add_to_the_variance(fitted):
    """Half of the other, as a disturbance, is a standard deviation of a half."""
    data, base = fitted
    u = data.inputs["signal"]
    simulated = base.fit.values["gain"] * u
    other = [{"shown": simulated + 0.1}]
    (plain,), (disturbed,) = (
        encompassing(base, other),
        encompassing(base, other, [{"shown": np.full(u.size, 0.05)}]),
    )
    assert disturbed.value == plain.value
    assert disturbed.standard_error == pytest.approx(np.hypot(plain.standard_error, 0.5), rel=1e-3)
    assert plain.inflation == 1.0
    assert disturbed.inflation == pytest.approx(1.0 + (0.5 / plain.standard_error) ** 2, rel=1e-3)
