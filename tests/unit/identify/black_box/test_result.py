"""Claims: loss, AIC and BIC are those of Ljung's equations, a summary says it all, and a degenerate
model is known by its standard errors, its offset and its poles.
"""

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


def test_a_sound_model_has_no_doubts(data):
    result = box_jenkins(data, [2, 2], [2, 1], 1, 1, [1, 2])
    assert result.doubts == ()
    assert not result.is_integrating


def test_parameters_that_the_data_do_not_determine_are_named(data):
    result = arx(data, 1, 1)
    first, second, third = result.parameters
    open_ended = (first, replace(second, standard_error=np.inf), third)
    assert replace(result, parameters=open_ended).doubts == ("the record does not determine b1_1",)


@pytest.mark.parametrize(
    ("offset", "is_beyond"), [(-10.5, True), (-9.5, False), (19.5, False), (20.5, True)]
)
def test_an_offset_beyond_the_record_is_told(data, offset, is_beyond):
    """A rise that is cut off half-way ends one span below where it settles: such is allowed."""
    result = arx(data, 1, 1)
    rising = replace(data, output=np.linspace(0.0, 10.0, 1500))
    model = replace(result.model, output_offset=offset)
    beyond = (f"its offset, {offset}, is beyond the record, 0 to 10",)
    assert replace(result, data=rising, model=model).doubts == (beyond if is_beyond else ())


@pytest.mark.parametrize(
    ("pole", "is_integrating"), [(1.0, True), (0.9995, True), (0.9985, False), (-1.0, False)]
)
def test_a_model_integrates_if_the_record_ends_before_its_pole_decays(data, pole, is_integrating):
    """Of 1000 samples, 1 / (1 - p) of which it takes to decay by 1/e."""
    result = replace(arx(data, 1, 1), residual=np.ones(1000))
    model = replace(result.model, a=np.array([1.0, -pole]))
    assert replace(result, model=model).is_integrating is is_integrating


def test_a_model_that_integrates_has_no_offset_to_be_beyond_a_record(data):
    result = arx(data, 1, 1)
    model = replace(result.model, a=np.array([1.0, -1.0]), output_offset=1e6)
    assert replace(result, model=model).doubts == ()
