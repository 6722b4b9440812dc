"""Claims: cases come to the closed form of what they run, from the start each, and one that
is refused fails alone.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestration.fmu.simulation import FmuSource
from orchestration.sweeps.task import CaseRunner, Task, failed_case

TIME = 0.1 * np.arange(11)
CASES = np.array([[0.5, 1.0], [2.0, -3.0], [-1.0, 1.0], [0.5, 1.0]])


@pytest.fixture(scope="module")
def task(lag):
    """A lag from nothing, over a parameter and an input that is held."""
    return Task(FmuSource(Path(lag)), ("tau", "u"), {}, TIME, {}, ("x",), ("last", "trace"))


@pytest.fixture(scope="module")
def outcomes(task):
    with CaseRunner(task) as runner:
        return runner.run(CASES)


@pytest.mark.parametrize("case", [0, 1, 3])
def test_a_case_is_its_parameter_and_its_input(outcomes, case):
    tau, u = CASES[case]
    exact = u * (1.0 - np.exp(-TIME / tau))
    assert outcomes.traces[case, :, 0] == pytest.approx(exact, abs=1e-12)
    assert outcomes.numbers[case] == pytest.approx(exact[-1:, None])


def test_a_case_that_is_refused_fails_alone(outcomes):
    assert list(outcomes.failures) == [2]
    assert "tau" in outcomes.failures[2]
    assert np.isnan(outcomes.numbers[2]).all()
    assert np.isnan(outcomes.traces[2]).all()


def test_outcomes_are_chosen_by_their_places(outcomes):
    chosen = outcomes.select([2, 0, 2])
    assert np.array_equal(chosen.numbers, outcomes.numbers[[2, 0, 2]], equal_nan=True)
    assert chosen.failures == {0: outcomes.failures[2], 2: outcomes.failures[2]}


def test_traces_are_kept_only_where_they_are_asked_for(task):
    numbers_only = replace(task, keep=("last", "largest"))
    with CaseRunner(numbers_only) as runner:
        found = runner.run(CASES[:1])
    assert found.traces.shape == (1, 0, 1)
    assert found.numbers.shape == (1, 2, 1)


def test_a_case_that_nobody_ran_has_its_reason_and_no_numbers(task):
    lost = failed_case(task, "its worker died")
    assert lost.failures == {0: "its worker died"}
    assert lost.traces.shape == (1, 11, 1)
    assert np.isnan(lost.numbers).all()
