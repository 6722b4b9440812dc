"""Claims: a compiled library runs a record, and many cases of it, each as if it were alone."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit.build.sources import record_sources
from fmus.kit.record.library import RecordLibrary
from fmus.kit.symbolic import trace


class Lag(Component):
    """A first-order lag of a held input: x = u + (x0 - u) exp(-t / tau)."""

    name = "lag"
    tau = Parameter(0.7, "s", min=1e-9)
    u = Input("1")
    x = State("1", rate="x_rate", start=0.2)

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("1")
    def twice(self):
        return 2.0 * self.x


TIME = 0.25 * np.arange(21)
NAMES = [p.name for p in Lag.layout.parameters]
LIMITS = {"tolerance": 1e-9, "effort": 1000.0}


@pytest.fixture(scope="module")
def library():
    return RecordLibrary.from_sources(Lag.layout, record_sources(trace(Lag), 1))


def rows(*cases):
    starts = {p.name: float(p.start) for p in Lag.layout.parameters}
    return np.array([[(starts | case)[name] for name in NAMES] for case in cases])


def held(tau=0.7, x_start=0.2, u=1.5):
    return u + (x_start - u) * np.exp(-TIME / tau)


def test_a_record_follows_the_closed_form(library):
    outputs, states = library.simulate(
        TIME, np.full((21, 1), 1.5), np.zeros(1), rows({"x_start": 0.4})[0], **LIMITS, ladder=None
    )
    assert states[:, 0] == pytest.approx(held(x_start=0.4), abs=1e-8)
    np.testing.assert_array_equal(outputs[:, 0], 2.0 * states[:, 0])


CASES = [{}, {"tau": 0.3}, {"x_start": -1.0}]


@pytest.mark.parametrize("levels", [[1.5], [1.5, -0.5, 3.0]], ids=["one input", "one each"])
def test_cases_are_runs_by_themselves(library, levels):
    """Columns are chosen: output 0, then state 0, which is number 1."""
    tables = np.array(levels)[:, np.newaxis, np.newaxis] * np.ones((1, 21, 1))
    courses, done = library.cases(TIME, tables, rows(*CASES), *LIMITS.values(), [1, 0])
    assert done.all()
    assert courses.shape == (3, 21, 2)
    for k, case in enumerate(CASES):
        exact = held(**case, u=levels[k % len(levels)])
        assert courses[k, :, 0] == pytest.approx(exact, abs=1e-8)
        np.testing.assert_array_equal(courses[k, :, 1], 2.0 * courses[k, :, 0])


def test_a_case_that_cannot_be_run_leaves_the_others(library):
    cases = rows({}, {"x_start": np.nan}, {"tau": 0.3})
    courses, done = library.cases(TIME, np.full((1, 21, 1), 1.5), cases, *LIMITS.values(), [1])
    assert done.tolist() == [True, False, True]
    assert courses[2, :, 0] == pytest.approx(held(tau=0.3), abs=1e-8)


def test_what_fails_is_told(library):
    with pytest.raises(UserError, match="'u' is not a finite number at t = 0 s"):
        library.simulate(
            TIME, np.full((21, 1), np.nan), np.zeros(1), rows({})[0], **LIMITS, ladder=None
        )
