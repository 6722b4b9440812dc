"""Claims: the course of an addition is the likeliest random walk, as a dense least-squares problem
has it too.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.laws.linear.response import LinearResponse, Sides, SimulatedCourse
from orchestration.discrepancy.laws.linear.smoothing import Smoother, TrackingTarget

N, STEP, LAG = 120, 0.125, 0.7


class Lag(Component):
    """A first-order lag whose input a law gives."""

    name = "lag"

    lag = Parameter(LAG, "s", min=1e-6)
    drive = Input("1")
    state = State("1", rate="rate")

    def fed(self):
        return self.drive

    hidden = State("1", rate="hidden_rate")

    def unseen(self):
        return -self.hidden

    def rate(self):
        return (self.fed() - self.state) / self.lag

    def hidden_rate(self):
        return self.unseen()

    @Output("1")
    def shown(self):
        """The state, and a little of what is fed."""
        return self.state + 0.1 * self.fed()


@pytest.fixture(scope="module")
def response():
    time = STEP * np.arange(N)
    still = np.zeros(N)
    course = SimulatedCourse.of(time, {"drive": still}, {"state": still, "hidden": still}, True)
    return LinearResponse(PerturbedLaws(Lag), course, {}, ["shown"])


def shown(w):
    """The lag of a course that is straight between samples, in closed form, and a tenth of it
    beside.
    """
    z = STEP / LAG
    decay = np.exp(-z)
    late = 1.0 - (1.0 - decay) / z
    drive = (1.0 - decay - late) * w[:-1] + late * w[1:]
    return np.append(0.0, lfilter([1.0], [1.0, -decay], drive)) + 0.1 * w


def wanted(response, y, slopes=None):
    none = np.zeros((len(y), 0))
    return TrackingTarget(response, {"shown": y}, {"shown": none if slopes is None else slopes})


NOTHING = np.zeros(0)


@pytest.mark.parametrize("stirred", [0.1, 1.0, 100.0])
@pytest.mark.parametrize("gap", [(), range(30, 50)], ids=["whole", "gap"])
def test_it_is_what_a_dense_least_squares_problem_gives(response, stirred, gap):
    rng = np.random.default_rng(3)
    y = shown(np.sin(np.arange(N) / 9.0)) + 0.05 * rng.normal(size=N)
    y[list(gap)] = np.nan
    slopes = 10.0 * np.column_stack([np.exp(-np.arange(N) / 20.0), np.ones(N)])
    precision = np.array([0.5, 2.0])
    [found], step, left = Smoother(
        [wanted(response, y, slopes)], "fed", {"shown": 0.05}, precision
    )(stirred)
    seen = np.isfinite(y)
    columns = np.column_stack([shown(e) for e in np.eye(N)])
    whole = np.linalg.norm(y[seen]) / 0.05
    reach = stirred * whole / (np.linalg.norm(columns @ np.ones(N)) / 0.05)
    walk = np.diff(np.eye(N), axis=0) * np.sqrt((N - 1) * STEP / (reach**2 * STEP))
    rows = np.vstack(
        [
            np.hstack([columns[seen], -slopes[seen]]) / 0.05,
            np.hstack([walk, np.zeros((N - 1, 2))]),
            np.hstack([np.zeros((2, N)), np.diag(np.sqrt(precision))]),
        ]
    )
    dense = np.linalg.lstsq(rows, np.append(y[seen] / 0.05, np.zeros(N + 1)), rcond=None)[0]
    assert np.abs(dense[N:]).max() < 1.0, "farther a coordinate does not move"
    assert found == pytest.approx(dense[:N], rel=1e-5, abs=1e-5 * np.abs(dense).max())
    assert step == pytest.approx(dense[N:], rel=1e-5, abs=1e-6)
    error = np.sum(((y + slopes @ step - shown(found))[seen] / 0.05) ** 2)
    assert left == pytest.approx(max(error, seen.sum()), rel=1e-6)


def test_the_course_makes_up_for_what_a_coordinate_may_not_do(response):
    """Of a step of 5, wanted by an output that shows little of it, there is 1; what is left is as
    small as it was.
    """
    slope = 0.1 * np.cos(np.arange(N) / 30.0)[:, None]
    y = -5.0 * slope[:, 0]
    found, step, left = Smoother(
        [wanted(response, y, slope)], "fed", {"shown": 0.05}, np.array([1e-9])
    )(100.0)
    assert step == pytest.approx([1.0])
    assert left < 1.2 * N
    assert shown(found[0]) == pytest.approx(y + slope[:, 0], abs=0.1)


def test_runs_have_courses_of_their_own_and_one_step(response):
    rng = np.random.default_rng(6)
    slope = np.cos(np.arange(N) / 4.0)[:, None]
    waves = [np.sin(np.arange(N) / 30.0), np.cos(np.arange(N) / 40.0)]
    runs = [
        wanted(response, shown(w) - 0.7 * slope[:, 0] + 0.001 * rng.normal(size=N), slope)
        for w in waves
    ]
    courses, step, left = Smoother(runs, "fed", {"shown": 0.001}, np.array([0.01]))(1.0)
    assert step == pytest.approx([0.7], abs=0.01)
    for course, w in zip(courses, waves, strict=True):
        assert course[5:-5] == pytest.approx(w[5:-5], abs=0.1)
    assert left < 3.0 * N


def test_a_course_that_no_output_shows_is_none_whatever_is_missing(response):
    y = shown(np.sin(np.arange(N) / 30.0))
    [course], _, left = Smoother([wanted(response, y)], "unseen", {"shown": 0.1}, NOTHING)(1.0)
    assert course == pytest.approx(np.zeros(N), abs=1e-12)
    assert left == pytest.approx(np.sum((y / 0.1) ** 2))


def test_a_course_is_let_go_no_farther_than_it_has_to_be(response):
    """Noise asks for none, a wave for as much as follows it, and no course for what is mere
    noise.
    """
    rng = np.random.default_rng(4)
    noise = 0.05 * rng.normal(size=N)
    wave = shown(np.sin(np.arange(N) / 3.0)) + noise
    level = {"shown": 0.05}
    of_noise, of_wave = (
        Smoother([wanted(response, y)], "fed", level, NOTHING) for y in (noise, wave)
    )
    stirred = of_wave.smoothest()
    assert of_noise.smoothest() < stirred
    [course], _, left = of_wave(stirred)
    assert left < 1.5 * N
    assert course[5:-5] == pytest.approx(np.sin(np.arange(N) / 3.0)[5:-5], abs=0.5)
    assert of_wave(stirred / 10.0)[2] > 1.1**2 * left


def test_the_same_as_the_response_has_it(response):
    """What the smoother takes a course to do is what the response says that it does."""
    w = np.cos(np.arange(N) / 5.0)
    one = response("fed", Sides(w[:, None], np.append(w[1:], w[-1:])[:, None]))["shown"][:, 0]
    assert one == pytest.approx(shown(w), abs=1e-9)
