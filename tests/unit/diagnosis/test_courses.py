"""Claims: courses are those of free runs, of what is measured; which laws are one cause."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.courses import Courses, are_interchangeable, courses_of
from orchestration.diagnosis.fitting import Fit, Problem, StartPrior, nominal_point

TIME = 0.1 * np.arange(200)
CURRENT = 1.0 + np.sin(0.7 * TIME) + 0.5 * np.sin(2.3 * TIME)
START = 0.5


class Cell(Component):
    """A capacitor with a series resistance and a leak through the force on it."""

    name = "cell"
    farads = Parameter(2.0, "F", min=0.1)
    ohms = Parameter(1.0, "Ohm", min=0.0)
    current = Input("A", nominal=1.0)
    force = Input("N", nominal=1.0)
    charge = State("C", rate="charging", nominal=1.0, start=START)

    def capacitance(self):
        """Of the film."""
        return self.farads

    def inner(self):
        """Over the film."""
        return self.charge / self.capacitance()

    def drop(self):
        """Over the series resistance."""
        return self.ohms * self.current

    def charging(self):
        """Balance."""
        return self.current - 0.1 * self.force

    @Output("V", nominal=1.0)
    def voltage(self):
        """At the terminals."""
        return self.inner() + self.drop()

    @Output("C", nominal=1.0)
    def counted(self):
        """By the instrument."""
        return self.charge


@cache
def along() -> Courses:
    inputs = np.column_stack([CURRENT, np.cos(1.3 * TIME)])
    outputs = np.column_stack([np.zeros(200), np.full(200, np.nan)])
    record = Record(TIME, inputs, outputs, (False, False))
    starts = (StartPrior(np.array([START]), np.ones(1)),)
    problem = Problem(LawModel(Cell), (record,), np.array([0.5, 2.0]), starts)
    point = nominal_point(problem)
    fitted = Fit(problem, (), point, (), 0.0, np.zeros((3, 3)))
    result = courses_of(fitted, problem.records, point.starts)
    assert result is not None
    return result


def test_courses_are_free_runs_of_what_is_measured() -> None:
    """The charge is the sum of held currents; the output that was not measured is left out."""
    rate = along().inputs @ [1.0, -0.1]
    charge = START + np.concatenate([[0.0], np.cumsum(0.1 * rate)[:-1]])
    assert along().states[:, 0] == pytest.approx(charge, abs=1e-9)
    assert along().measured.tolist() == [True, False]
    (error,) = along().errors
    assert error == pytest.approx(-(charge / 2.0 + CURRENT)[:, None] / 0.5)
    assert along().length == pytest.approx(19.9)


@pytest.mark.parametrize(
    ("law", "other", "signal", "same"),
    [
        ("capacitance", "inner", "charge", True),  # q / C(q) is a voltage over q
        ("inner", "capacitance", "charge", True),
        ("inner", "drop", "current", True),  # they add up
        ("capacitance", "inner", "current", False),  # their ratio is over the charge
        ("capacitance", "drop", "charge", True),
        ("charging", "inner", "charge", False),  # one moves the charge, the other does not
        ("capacitance", "inner", "nowhere", False),
        ("nothing", "inner", "charge", False),
    ],
)
def test_laws_are_one_cause_if_a_function_of_the_signal_turns_one_into_the_other(
    law: str, other: str, signal: str, same: bool
) -> None:
    assert are_interchangeable(along(), law, other, signal) is same


def test_a_model_that_runs_away_has_no_courses() -> None:
    record = along().pieces[0]
    inputs = record.inputs.copy()
    inputs[50:] = 1e300
    assert courses_of(along().fitted, [replace(record, inputs=inputs)], [np.zeros(1)]) is None
