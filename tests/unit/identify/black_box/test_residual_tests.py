"""Claims: correlations are those of statsmodels, limits hold, and missing dynamics are seen."""

import numpy as np
import pytest
from scipy.signal import lfilter
from statsmodels.tsa.stattools import acf, ccf

from fmus.kit.errors import UserError
from orchestration.identify.black_box import box_jenkins, input_output_data, output_error
from orchestration.identify.black_box.residual_tests import residual_tests
from tests.support.black_box import box_jenkins_record


def coloured(random, samples, phi):
    return lfilter([1.0], [1.0, -phi], random.standard_normal(samples))


def test_correlations_agree_with_statsmodels():
    random = np.random.default_rng(3)
    e, u = coloured(random, 500, 0.5), coloured(random, 500, 0.8)
    result = residual_tests(e, u, 20)
    assert result.autocorrelation == pytest.approx(acf(e, nlags=20, fft=False), abs=1e-12)
    cross = result.inputs[0]
    assert cross.lags.tolist() == list(range(-20, 21))
    assert cross.values[20:] == pytest.approx(ccf(e, u, adjusted=False)[:21], abs=1e-12)
    assert cross.values[20::-1] == pytest.approx(ccf(u, e, adjusted=False)[:21], abs=1e-12)
    assert result.limit == pytest.approx(2.5758 / np.sqrt(500), rel=1e-4)


@pytest.mark.parametrize(("residual", "inputs"), [(0.0, 0.0), (0.0, 0.9), (0.6, 0.8)])
def test_independent_signals_are_called_so_as_often_as_is_said(residual, inputs):
    """Whatever their colours: at 5 %, 400 pairs give 20 false alarms, and not more than 36."""
    random = np.random.default_rng(11)
    rejected, outside = 0, []
    for _ in range(400):
        e, u = coloured(random, 800, residual), coloured(random, 800, inputs)
        cross = residual_tests(e, u, 15, 0.05).inputs[0]
        rejected += not cross.is_independent
        outside.append(np.mean(np.abs(cross.values) > cross.limit))
    assert 6 <= rejected <= 36
    assert np.mean(outside) == pytest.approx(0.05, abs=0.02)


def test_a_path_that_is_missing_is_seen_where_it_is():
    record = box_jenkins_record(2, 1500)
    data = input_output_data(record.inputs, record.output, 1.0)
    tests = box_jenkins(
        data, [2, 2], [2, 1], 1, 1, [1, 6]
    ).residual_tests()  # the second input acts later than it does
    assert not tests.passed
    assert tests.inputs[0].is_independent
    late = tests.inputs[1]
    assert not late.is_independent
    peaks = late.lags[np.abs(late.values) > 3.0 * late.limit]
    assert set(peaks) <= set(range(1, 6))
    assert peaks.size


def test_an_order_too_few_is_seen():
    record = box_jenkins_record(2, 1500)
    data = input_output_data(record.inputs, record.output, 1.0)
    tests = box_jenkins(data, [1, 2], [1, 1], 2, 2, [1, 2]).residual_tests()
    assert not tests.inputs[0].is_independent


def test_feedback_is_seen_before_lag_zero_and_is_no_fault_of_the_model():
    random = np.random.default_rng(4)
    e = 0.3 * random.standard_normal(2000)
    w, u, y = random.standard_normal(2000), np.zeros(2000), np.zeros(2000)
    for t in range(2000):
        y[t] = (0.5 * y[t - 1] - 0.5 * e[t - 1] + 0.8 * u[t - 1] if t else 0.0) + e[t]
        u[t] = w[t] - 0.8 * y[t]
    cross = output_error(input_output_data(u, y, 1.0), 1, 1).residual_tests().inputs[0]
    assert np.abs(cross.values[cross.lags < 1]).max() > 3.0 * cross.limit


@pytest.mark.parametrize(
    ("residual", "inputs", "lags", "said"),
    [
        (np.ones(50), np.ones(50), 5, "residual not constant"),
        (np.arange(50.0), np.ones(40), 5, "residual of shape"),
        (
            np.arange(50.0),
            np.ones(50),
            13,
            "lags = 13: must be from 1 to a quarter of the 50 samples",
        ),
        (np.arange(50.0), np.full(50, np.nan), 5, "must be finite numbers"),
    ],
)
def test_mistakes_are_told(residual, inputs, lags, said):
    with pytest.raises(UserError, match=said):
        residual_tests(residual, inputs, lags)
    with pytest.raises(UserError, match=r"^significance = 2: must be between 0 and 1$"):
        residual_tests(np.arange(50.0), np.ones(50), 5, 2.0)
