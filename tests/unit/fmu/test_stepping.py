"""Claims: an FMU that cannot vary its step makes steps of its own size only, with inputs held and
outputs taken between.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.fmu.instance import Fmu
from orchestration.fmu.stepping import (
    StepFailed,
    communication_points,
    follow_course,
    plan_course,
)
from tests.support.master.samples import build_member

TIME = np.array([1.0, 2.0, 4.0])
INPUTS = {"u": np.array([0.0, 1.0, 5.0])}


@pytest.fixture(scope="module")
def member(tmp_path_factory):
    return build_member(tmp_path_factory.mktemp("member"))


def described(varies=False, declared=None, internal=None):
    return SimpleNamespace(
        coSimulation=SimpleNamespace(
            canHandleVariableCommunicationStepSize=varies, fixedInternalStepSize=internal
        ),
        defaultExperiment=SimpleNamespace(stepSize=declared),
    )


def test_one_that_varies_its_step_steps_from_time_to_time():
    assert communication_points(described(varies=True, declared="0.5"), TIME) is TIME


@pytest.mark.parametrize(
    ("declared", "internal", "step"), [("0.5", None, 0.5), ("0.5", "0.25", 0.25), (None, None, 1.5)]
)
def test_one_that_does_not_has_even_steps_that_cover_the_run(declared, internal, step):
    points = communication_points(described(declared=declared, internal=internal), TIME)
    assert np.diff(points).tolist() == [step] * (points.size - 1)
    assert points[0] == 1.0
    assert 0.0 <= points[-1] - 4.0 < step


def test_even_times_at_its_own_step_are_its_points():
    time = 0.1 * np.arange(31)
    assert communication_points(described(declared="0.1"), time) is time


def test_inputs_are_held_and_outputs_taken_between(member):
    fmu = Fmu(member)
    fmu.description.coSimulation.canHandleVariableCommunicationStepSize = False
    fmu.description.defaultExperiment = SimpleNamespace(stepSize="0.8")
    course = plan_course(fmu, TIME, INPUTS)
    assert course.time.tolist() == pytest.approx([1.0, 1.8, 2.6, 3.4, 4.2])
    assert course.table[:, 0].tolist() == [0.0, 0.0, 1.0, 1.0, 5.0]
    result = np.column_stack([course.time**2, np.arange(5.0)])
    taken = course.at_wanted(result, [True, False])
    chord = 1.8**2 + 0.2 / 0.8 * (2.6**2 - 1.8**2)
    assert taken[:, 0].tolist() == pytest.approx([1.0, chord, 3.4**2 + 0.75 * (4.2**2 - 3.4**2)])
    assert taken[:, 1].tolist() == [0.0, 1.0, 3.0]


def test_a_failure_tells_how_many_points_are_complete(member):
    with Fmu(member, {"status": 3.0, "when": 2.0}) as fmu:
        fmu.start(1.0)
        course = plan_course(fmu, TIME, INPUTS)
        result = np.full((3, 1), np.nan)
        told = []
        with pytest.raises(StepFailed, match=r"step from 2 s failed") as failed:
            follow_course(fmu, course, ["x"], result, told.append, 1)
    assert failed.value.point == 2
    assert told == [0, 1]
    assert np.isfinite(result[:, 0]).tolist() == [True, True, False]
