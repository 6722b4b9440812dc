"""Claims: the course of an FMU is that on paper: parts of equal length, inputs at their middle
where
the FMU cannot interpolate, else at their beginning with slopes.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.fmu.instance import Fmu
from orchestration.fmu.stepping import StepFailed, follow_course, plan_course
from tests.support.master.samples import build_member

TIME = np.array([1.0, 2.0, 4.0])
INPUTS = {"u": np.array([0.0, 1.0, 5.0])}  # slopes 1 and 2


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """FMUs that can interpolate inputs, and that cannot."""
    return {
        can: build_member(tmp_path_factory.mktemp("member"), canInterpolateInputs=can)
        for can in (True, False)
    }


def planned(path, linear, parts):
    return plan_course(Fmu(path), TIME, INPUTS, linear, parts)


def test_held_inputs_are_set_at_the_points_only(fmus):
    course = planned(fmus[True], [], 2)
    assert course.table[:, 0].tolist() == [0.0, 1.0, 5.0]
    assert [part.rows for part in course.parts] == [None, None]
    assert [part.begins[1:].tolist() for part in course.parts] == [[1.0, 2.0], [1.5, 3.0]]
    assert [part.ends[1:].tolist() for part in course.parts] == [[1.5, 3.0], [2.0, 4.0]]


def test_an_fmu_that_cannot_interpolate_gets_the_value_at_the_middle(fmus):
    course = planned(fmus[False], ["u"], 2)
    assert course.linear == []
    assert [part.slopes for part in course.parts] == [None, None]
    rows = [part.rows[1:, 0].tolist() for part in course.parts]
    assert rows == [[0.25, 2.0], [0.75, 4.0]]


def test_an_fmu_that_can_interpolate_gets_the_value_at_the_beginning_and_the_slope(fmus):
    course = planned(fmus[True], ["u"], 2)
    assert course.linear == ["u"]
    assert [part.slopes[1:, 0].tolist() for part in course.parts] == [[1.0, 2.0], [1.0, 2.0]]
    assert [part.rows[1:, 0].tolist() for part in course.parts] == [[0.0, 1.0], [0.5, 3.0]]


def test_a_failure_tells_how_many_points_are_complete(fmus):
    with Fmu(fmus[True], {"status": 3.0, "when": 2.0}) as fmu:
        fmu.start(1.0)
        course = plan_course(fmu, TIME, INPUTS, [], 1)
        result = np.full((3, 1), np.nan)
        told = []
        with pytest.raises(StepFailed, match=r"step from 2 s failed") as failed:
            follow_course(fmu, course, ["x"], result, told.append, 1)
    assert failed.value.point == 2
    assert told == [0, 1]
    assert np.isfinite(result[:, 0]).tolist() == [True, True, False]
