"""Claims: one model in two parametrisations is one cause, and models that differ are two."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.arrays import Array
from orchestration.diagnosis import equivalence
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.equivalence import equivalent_pairs
from orchestration.diagnosis.fitting import Fit, Point, Problem, StartPrior
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.terms import Memory, SensorTerm, Shape, Term

TIME = 0.5 * np.arange(400)
CURRENT = np.where(np.sin(0.1 * TIME) > 0.3, 1.0, 0.0)


class Cell(Component):
    """A resistance and one RC pair."""

    name = "cell"
    i = Input("A", doc="current")
    ambient = Input("K", start=293.0, doc="temperature, which changes nothing here")
    R0 = Parameter(0.1, "ohm", min=1e-3, max=10.0)
    R1 = Parameter(0.2, "ohm", min=1e-3, max=10.0)
    C1 = Parameter(20.0, "F", min=1.0, max=1e3)
    u = State("V", rate="pair_rate")

    def pair_rate(self):
        """One pair."""
        return (self.i - self.u / self.R1) / self.C1

    def drop(self):
        """Voltage lost."""
        return self.R0 * self.i + self.u

    @Output("V")
    def voltage(self):
        """As measured."""
        return self.drop()


MODEL = LawModel(Cell)
OF_CURRENT = Term("drop", "i", Shape.LINEAR, Memory.LAG, (30.0,))
OF_PAIR = Term("drop", "u", Shape.LINEAR, Memory.LAG, (30.0,))
OF_SENSOR = SensorTerm("voltage", "voltage", Shape.LINEAR, Memory.FADING, (30.0,))


def cause(term: Term, coefficient: float, error: float = 0.1) -> Cause:
    """Return a cause that leaves so much of a base with an error of one."""
    inputs = np.column_stack([CURRENT, 293.0 + CURRENT])
    record = Record(TIME, inputs, np.zeros((len(TIME), 1)), (False, False))
    prior = StartPrior(np.zeros(1), np.array([1e-3]))
    problem = Problem(MODEL, (record,), np.full(1, 0.1), (prior,))
    values = np.append(coefficient, np.log(30.0))
    errors = np.full((len(TIME), 1), error)
    point = Point(problem.mean, values, (np.zeros(1),))
    fitted = Fit(problem, (term,), point, (errors,), 0.0, np.eye(6))
    judged = SimpleNamespace(fit=fitted, choosing=errors)
    return Cause(*term.cause, 0.4, judged, (term,), None, 0.0, frozenset({term.cause}))


def pairs(causes: Sequence[Cause]) -> set[frozenset[tuple[str, str]]]:
    base: Array = np.ones((len(TIME), 1))
    return set(equivalent_pairs(causes, base))


def test_two_lags_in_parallel_are_two_in_series() -> None:
    """``1/(s + a) + 1/(s + b)`` has the poles of ``(1 + c/(s + b)) / (s + a)``."""
    both = [cause(OF_CURRENT, 0.05), cause(OF_PAIR, 0.3)]
    assert pairs(both) == {frozenset((("drop", "i"), ("drop", "u")))}


def test_what_differs_at_other_levels_is_another_cause() -> None:
    """Of levels zero and one the square is the level; of a trial with others it is not."""
    squared = Term("pair_rate", "i", Shape.SQUARE, Memory.LAG, (30.0,))
    assert pairs([cause(OF_CURRENT, 0.05), cause(squared, 0.05)]) == set()


def test_a_fault_of_a_sensor_is_another_cause_than_a_law(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equivalence, "_reproduces", lambda one, other: True)
    assert pairs([cause(OF_CURRENT, 0.05), cause(OF_SENSOR, 0.05)]) == set()
    assert len(pairs([cause(OF_CURRENT, 0.05), cause(OF_PAIR, 0.05)])) == 1


def test_predictions_that_are_far_apart_are_not_compared() -> None:
    both = [cause(OF_CURRENT, 0.05), cause(OF_PAIR, 0.3, error=0.6)]
    assert pairs(both) == set()
