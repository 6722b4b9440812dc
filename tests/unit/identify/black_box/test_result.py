"""Claims: loss, AIC and BIC are those of Ljung's equations, and a summary says it all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.identify.black_box import arx, box_jenkins, input_output_data
from tests.support.black_box import BOX_JENKINS, box_jenkins_record


@pytest.fixture(scope="module")
def data():
    record = box_jenkins_record(11, 1500)
    return input_output_data(
        record.inputs, record.output, 0.1, ["force", "current"], "displacement"
    )


def test_criteria_are_those_of_the_equations(data):
    """Residuals of 1 and 3 have a mean square of 5; log V + 2 d / N, and log V + d log(N) / N."""
    result = replace(arx(data, 1, 1), residual=np.tile([1.0, 3.0], 50), count=4)
    assert result.loss == pytest.approx(5.0)
    assert result.aic == pytest.approx(np.log(5.0) + 0.08)
    assert result.bic == pytest.approx(np.log(5.0) + 0.04 * np.log(100.0))
    exact = replace(result, residual=np.zeros(100))
    assert np.isfinite([exact.aic, exact.bic]).all()


def test_a_parameter_is_found_by_its_name(data):
    result = arx(data, 1, 1)
    assert result.parameter("b2_1") is result.parameters[2]
    with pytest.raises(KeyError):
        result.parameter("c1")


def test_residuals_are_tested_up_to_lag_25_or_a_quarter_of_few(data):
    result = arx(data, 1, 1)
    assert len(result.residual_tests().autocorrelation) == 26
    few = replace(result, residual=result.residual[-40:])
    assert len(few.residual_tests().autocorrelation) == 11


def test_a_summary_says_it_all(data):
    result = box_jenkins(data, [2, 2], [2, 1], 1, 1, [1, 2])
    lines = result.summary().splitlines()
    assert lines[0] == "BJ from 1500 samples every 0.1 s"
    assert f"free-run fit {result.fit:.1f} %" in lines[1]
    assert sum("±" in line for line in lines) == len(BOX_JENKINS)
    assert lines[-1].startswith("offset: the model is about displacement = ")
