"""Claims: a late output is that of the solution of the equations, read so much earlier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from orchestration.diagnosis.delays import earlier
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.runs import Course, Record, Setting
from orchestration.diagnosis.terms import DelayTerm, Shape, Term
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record
from tests.support.oscillator_model import Oscillator

TIME = 0.02 * np.arange(400)
FORCE = 4.0 * np.sin(1.3 * TIME) + 2.0 * np.sin(3.1 * TIME)
SECONDS = 0.13
LATE = DelayTerm("position", "position", Shape.LINEAR, size=0.1)
RUBS = Term("friction", "velocity", Shape.LINEAR, size=5.0, scale=0.5)
START = np.zeros(2)


@pytest.fixture(scope="module")
def model() -> LawModel:
    return LawModel(Oscillator)


def record() -> Record:
    outputs = np.zeros((len(TIME), 1))
    return Record(TIME, FORCE[:, np.newaxis], outputs, (True,), "record")


def setting(model: LawModel, seconds: float, friction: float = 0.0) -> Setting:
    parameters = np.array([float(p.start) for p in model.parameters])
    values = np.array([friction, seconds / LATE.size])
    return Setting(parameters, np.arange(3), (RUBS, LATE), values, 4)


def run(model: LawModel, chosen: Setting) -> Course:
    course = model.run(record(), chosen, START, sensitive=True)
    assert course is not None
    return course


def solution(seconds: float) -> np.ndarray:
    """Return the position by SciPy on a grid of a thousandth of a second, so much earlier."""
    fine = np.arange(0.0, TIME[-1] + 1e-9, 1e-3)
    return np.interp(TIME - seconds, fine, exact_on(fine))


def exact_on(fine: np.ndarray) -> np.ndarray:
    """Return the position at times from 0 on, by SciPy."""
    system = StateSpace([[0.0, 1.0], [-20.0, -0.8]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    return np.asarray(lsim(system, np.interp(fine, TIME, FORCE), fine)[1])


@pytest.mark.parametrize("seconds", [0.02, SECONDS, 1.0])
def test_a_late_output_is_the_solution_so_much_earlier(model: LawModel, seconds: float) -> None:
    """Linear between samples: within an eighth of a step squared times the acceleration."""
    late = run(model, setting(model, seconds)).outputs[:, 0]
    assert late == pytest.approx(solution(seconds), abs=0.02**2 / 8.0 * 12.0)
    assert np.abs(late - solution(0.0)).max() > 10.0 * 0.02**2 / 8.0 * 12.0


def test_a_delay_into_the_future_is_none(model: LawModel) -> None:
    course = run(model, setting(model, -0.5))
    assert course.outputs[:, 0] == pytest.approx(solution(0.0), abs=1e-5)
    assert not course.slopes[:, 0, 4].any()


def test_slopes_are_those_of_the_run(model: LawModel) -> None:
    """Central differences by parameters, by both values, and by the start states."""
    chosen = setting(model, SECONDS, 0.1)
    slopes = run(model, chosen).slopes[:, 0]
    for column in range(5):
        outputs = []
        for step in (1e-5, -1e-5):
            values = np.concatenate([chosen.parameters[:3], chosen.values])
            values[column] += step
            parameters = np.concatenate([values[:3], chosen.parameters[3:]])
            moved = replace(chosen, parameters=parameters, values=values[3:])
            outputs.append(run(model, moved).outputs[:, 0])
        expected = (outputs[0] - outputs[1]) / 2e-5
        assert slopes[:, column] == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    assert slopes.shape == (len(TIME), 3 + 2 + 2)


def test_linearised_it_is_the_slope_of_the_output_with_its_sign_changed(model: LawModel) -> None:
    chosen = setting(model, SECONDS)
    course = run(model, chosen)
    part = model.linearise(record(), chosen, course)
    expected = -LATE.size * np.gradient(solution(SECONDS), TIME)
    assert part.outputs[5:-5, 0, 4] == pytest.approx(expected[5:-5], abs=2e-3)
    assert not part.rates[:, :, 4].any()
    plain = model.linearise(record(), replace(chosen, terms=(RUBS,), values=np.zeros(1)), course)
    others = [k for k in range(part.outputs.shape[2]) if k != 4]
    assert part.outputs[:, :, others] == pytest.approx(plain.outputs)
    assert part.rates[:, :, others] == pytest.approx(plain.rates)


def test_before_the_first_sample_is_as_there() -> None:
    time = np.array([0.0, 1.0, 3.0])
    values, slopes = earlier(np.array([5.0, 7.0, 1.0]), time, 0.5)
    assert values.tolist() == [5.0, 6.0, 2.5]
    assert slopes.tolist() == [0.0, 2.0, -3.0]


def test_a_sensor_that_is_late_by_parts_of_a_sample_is_the_cause() -> None:
    """Five samples and a half; a whole number of them is no reading that fits."""
    exact = oscillator_record(3, noise=0.0)
    late = np.interp(exact.time - 0.11, exact.time, exact.signals["position"])
    late += np.random.default_rng(4).normal(0.0, 1e-3, len(late))
    measured = replace(exact, signals=exact.signals | {"position": late})
    diagnosis = diagnosis_with(measured, (LATE,), (DRY,), (CUBE,))
    assert [cause.name for cause in diagnosis.causes] == ["transport_delay(position)"]
    low, high = diagnosis.parameters["position_delay"].interval
    assert low < 0.11 < high
    assert high - low < 0.01


@pytest.mark.parametrize("share", [0.03, -0.03])
def test_outputs_by_another_clock_are_the_solution_at_other_times(
    model: LawModel, share: float
) -> None:
    """A clock that is fast says a second after less of it; none is known past the end."""
    read = Reading(ReadingKind.PACE, ("position",), shift=share).apply(model, record())
    course = model.run(read, setting(model, 0.0), START, sensitive=False)
    assert course is not None
    fine = np.arange(0.0, TIME[-1] + 1e-9, 1e-3)
    there = TIME / (1.0 + share)
    exact = np.interp(there, fine, exact_on(fine))
    known = there <= TIME[-1]
    assert course.outputs[known, 0] == pytest.approx(exact[known], abs=0.02**2 / 8.0 * 12.0)
    assert (np.isfinite(read.outputs[:, 0]) == known).all()


def test_an_output_without_its_sign_has_slopes_of_the_other_sign(model: LawModel) -> None:
    level = 0.05
    read = replace(record(), folds=np.array([level]))
    plain, folded = (
        model.run(one, setting(model, 0.0), START, sensitive=True) for one in (record(), read)
    )
    assert plain is not None
    assert folded is not None
    position = plain.outputs[:, 0]
    assert folded.outputs[:, 0] == pytest.approx(np.abs(position - level))
    signs = np.where(position < level, -1.0, 1.0)
    assert 0.2 < np.mean(signs < 0.0) < 0.8
    assert folded.slopes[:, 0] == pytest.approx(signs[:, np.newaxis] * plain.slopes[:, 0])
    parts = [
        model.linearise(one, setting(model, 0.0), course)
        for one, course in ((record(), plain), (read, folded))
    ]
    assert parts[1].outputs[:, 0] == pytest.approx(signs[:, np.newaxis] * parts[0].outputs[:, 0])
    assert parts[1].rates == pytest.approx(parts[0].rates)
