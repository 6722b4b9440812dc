"""Courses over time and curves over signals of the models of a diagnosis, for charts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.units import convert
from orchestration.diagnosis.comparison import Judged
from orchestration.diagnosis.courses import Courses, courses_of_fit
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.fitting import Fit
from orchestration.diagnosis.terms import NamedTerm, Term

_POINTS = 200  # of a curve
_OUTSIDE = 0.005  # share of the samples beyond either end of a curve


@dataclass(frozen=True)
class OutputCourse:
    """An output over a record, in the unit in which it is shown.

    Attributes
    ----------
    output, record : str
    unit : str
        That of the output's display; of a temperature that of the file.
    time, measured, before, after : ndarray, shape (n,)
        Simulated without terms, and by the final model; NaN where a run left its bounds. With
        another reading of the files `measured` is what they mean by it; the model without terms,
        which was fitted to the files as they were read, is shown if these outputs are the same.
    unseen_from : float
        Time from which on nothing was fitted.
    """

    output: str
    record: str
    unit: str
    time: Array
    measured: Array
    before: Array
    after: Array
    unseen_from: float


class Simulation(NamedTuple):
    """A simulated course of an output, as a chart shows it.

    Attributes
    ----------
    label : str
    values : ndarray, shape (n,)
    is_final : bool
        Whether of the final model, and not of the one without terms.
    error : float or None
        On samples by which nothing was chosen; see `Diagnosis.errors`.
    """

    label: str
    values: Array
    is_final: bool
    error: float | None


@dataclass(frozen=True)
class TermCurve:
    """A fitted term over its signal, SI.

    Attributes
    ----------
    term : Term
    signal, addition : ndarray, shape (m,)
        Value of the signal, or of the memory of it, and what is added to the law there.
    samples : ndarray, shape (n,)
        Values that the record reached.
    """

    term: Term
    signal: Array
    addition: Array
    samples: Array


def output_courses(diagnosis: Diagnosis) -> list[OutputCourse]:
    """Return every measured output over the first record of which a part is unseen."""
    subject = diagnosis.subject
    one = subject.left_out[0]
    record = one.record
    before = _simulated(diagnosis, diagnosis.found.base)
    after = _simulated(diagnosis, diagnosis.final)
    courses = []
    for j, output in enumerate(subject.problem.model.outputs):
        if np.isfinite(record.outputs[:, j]).any():
            unit = diagnosis.records[0].display_unit(output.name, output)
            runs = (record.outputs, before, after)
            measured, first, last = (convert(run[:, j], output.unit, unit) for run in runs)
            of = output.name, record.label, unit
            unseen_from = float(record.time[one.first])
            courses.append(OutputCourse(*of, record.time, measured, first, last, unseen_from))
    return courses


def simulations(diagnosis: Diagnosis, course: OutputCourse) -> list[Simulation]:
    """Return the simulated courses of an output that a chart shows."""
    before, after = "parameters fitted", "with the cause"
    if diagnosis.reading is not None:
        before, after = "model, file as read", "model, file corrected"
    result = []
    if np.isfinite(course.before).any():
        error = diagnosis.errors_before[course.output]
        result.append(Simulation(before, course.before, False, error))
    if diagnosis.is_named:
        error = diagnosis.errors_after[course.output]
        result.append(Simulation(after, course.after, True, error))
    return result


def _simulated(diagnosis: Diagnosis, judged: Judged) -> Array:
    """Return the outputs (n, ny) of a model over the record of `output_courses`."""
    shown = diagnosis.subject.left_out[0].record
    subject = diagnosis.found.subject_of(judged.reading)
    one = subject.left_out[0]
    is_same = np.array_equal(one.record.time, shown.time) and np.array_equal(
        one.record.outputs, shown.outputs, equal_nan=True
    )
    errors = subject.errors(judged.fit, replace(one, first=0)) if is_same else None
    if errors is None:
        return np.full(shown.outputs.shape, np.nan)
    return np.asarray(one.record.outputs - errors * subject.problem.spread)


def term_curves(fitted: Fit, terms: dict[str, Term]) -> dict[str, TermCurve]:
    """Return the curve of every term that has a signal, over what the fitted records reached."""
    along = own_courses(fitted)
    curves = {}
    for name, term in terms.items():
        if not term.signal or isinstance(term, NamedTerm):
            continue
        samples = along.seen_by(term)
        low, high = np.quantile(samples, [_OUTSIDE, 1.0 - _OUTSIDE])
        signal = np.linspace(low, high, _POINTS)
        curves[name] = TermCurve(term, signal, addition(fitted, term, signal), samples)
    return curves


def addition(fitted: Fit, term: Term, signal: Array) -> Array:
    """Return what a fitted term adds to its law, without its factor, at values (n,) of its signal.

    Parameters
    ----------
    fitted : Fit
    term : Term
        One of its terms.
    signal : ndarray, shape (n,)
        Or the memory of it.
    """
    values = fitted.values_of(term)
    width = float(np.exp(values[-1])) if term.shape.has_width else 1.0
    shapes = fitted.problem.model.shape_values(replace(term, width=width), signal)
    return np.asarray(term.size * shapes @ values[: term.coefficients])


def own_courses(fitted: Fit) -> Courses:
    """Return the courses of a fit over its records, which it ran over before."""
    along = courses_of_fit(fitted)
    assert along is not None, "a fit runs over its records"
    return along
