"""Claims: curves are what was hidden, courses what was measured and simulated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim

from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.report.curves import (
    addition,
    output_courses,
    simulations,
    term_curves,
)
from orchestration.diagnosis.terms import Memory, Shape, Term
from tests.support.fitted_terms import fitted
from tests.support.oscillator import (
    DRY,
    diagnosis_read_as,
    diagnosis_with,
    misread,
    oscillator_record,
)
from tests.support.oscillator_model import Oscillator


def test_the_curve_of_a_term_is_the_friction_that_was_hidden(dry):
    (curve,) = term_curves(dry.final.fit, dry.terms).values()
    hidden = 1.5 * np.tanh(curve.signal / 0.1)
    assert np.abs(curve.addition - hidden).max() < 0.05
    assert curve.signal[0] >= curve.samples.min()
    assert curve.signal[-1] <= curve.samples.max()


def test_a_curve_goes_over_the_memory_of_its_signal():
    lag = Term("friction", "velocity", Shape.LINEAR, Memory.LAG, (0.5,), size=1.0, scale=1.0)
    diagnosis = diagnosis_with(oscillator_record(1, dry=1.5), (lag,))
    fit = diagnosis.found.fits[0].fit
    (curve,) = term_curves(fit, {"lag": lag}).values()
    constant = float(np.exp(fit.values_of(lag)[1]))
    record = fit.problem.records[0]
    course = fit.problem.run(record, fit.point, fit.terms, fit.point.starts[0], False)
    velocity, memory = course.states[:, 1], curve.samples
    # the lag's own equation, by differences
    rate = np.gradient(memory, record.time)
    expected = (velocity - memory) / constant
    assert np.abs(rate - expected)[1:-1].max() < 0.05 * np.abs(expected).max()
    assert addition(fit, lag, np.array([2.0])) == pytest.approx(2.0 * fit.values_of(lag)[:1])


@pytest.mark.parametrize("memory", [Memory.FADING, Memory.TWO_LAGS, Memory.RATE_LIMIT])
def test_a_curve_goes_over_what_a_memory_is_behind(memory):
    # both lags are the same, and no rate is as fast as the limit
    constants = (0.3, {Memory.TWO_LAGS: 1.0}.get(memory, 1e4))[: memory.constants]
    term = Term("friction", "velocity", Shape.LINEAR, memory, constants, size=1.0, scale=1.0)
    fit = fitted(Oscillator, [term], [[0.2, *np.log(constants)]])
    (curve,) = term_curves(fit, {"term": term}).values()
    record = fit.problem.records[0]
    course = fit.problem.run(record, fit.point, fit.terms, fit.point.starts[0], False)
    velocity = course.states[:, 1]
    _, expected, _ = lsim(([0.3, 0.0], [0.3, 1.0]), velocity - velocity[0], record.time)
    assert np.abs(curve.samples - expected).max() < 0.01 * np.abs(expected).max()


def test_courses_are_the_record_and_its_models(dry):
    (course,) = output_courses(dry)
    measured = dry.records[0].signals["position"]
    assert course.measured == pytest.approx(measured)
    assert course.unseen_from == pytest.approx(course.time[int(len(measured) * 2 / 3)])
    assert np.std(course.measured - course.after) == pytest.approx(1e-3, rel=0.2)
    assert np.std(course.measured - course.before) > 0.03


def test_courses_are_in_the_unit_in_which_their_output_is_shown(dry, monkeypatch):
    (output,) = dry.subject.problem.model.outputs
    monkeypatch.setattr(output, "display", "mm")
    (course,) = output_courses(dry)
    assert course.unit == "mm"
    assert course.measured == pytest.approx(1e3 * dry.records[0].signals["position"])
    assert np.std(course.measured - course.after) == pytest.approx(1.0, rel=0.2)


def test_courses_are_in_the_scale_of_the_record(dry, monkeypatch):
    """Whatever the model displays."""
    (output,) = dry.subject.problem.model.outputs
    monkeypatch.setattr(output, "display", "mm")
    monkeypatch.setitem(dry.records[0].scales, "position", "cm")
    (course,) = output_courses(dry)
    assert course.unit == "cm"
    assert course.measured == pytest.approx(1e2 * dry.records[0].signals["position"])


def test_a_misread_input_is_shown_with_the_model_of_the_file_as_it_was_read(flipped):
    (course,) = output_courses(flipped)
    assert course.measured == pytest.approx(flipped.records[0].signals["position"])
    labels = [label for label, *_ in simulations(flipped, course)]
    assert labels == ["model, file as read", "model, file corrected"]
    assert np.std(course.measured - course.after) == pytest.approx(1e-3, rel=0.2)
    assert np.std(course.measured - course.before) > 0.03


def test_a_misread_output_is_shown_corrected_and_without_the_model_of_the_file():
    right = oscillator_record(1)
    reading = Reading(ReadingKind.UNIT, ("position",), factor=1e-3, unit="in mm")
    diagnosis = diagnosis_read_as(misread(right, position=1e3), reading)
    (course,) = output_courses(diagnosis)
    assert course.measured == pytest.approx(right.signals["position"])
    assert [label for label, *_ in simulations(diagnosis, course)] == ["model, file corrected"]


def test_a_model_without_terms_that_is_the_answer_is_called_fitted():
    right = diagnosis_with(oscillator_record(1), (DRY,))
    (course,) = output_courses(right)
    assert [label for label, *_ in simulations(right, course)] == ["parameters fitted"]
