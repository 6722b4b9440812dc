"""Claims: the free run is fitted as least squares of SciPy fits it.

Neither noise models nor outliers take it away.

Oracles: two relaxations on paper, least squares of SciPy on them, and the variance bound of
Student's t distribution.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import Component, Input, Output, Parameter, State, sin, where
from orchestration.identify.fitting import prediction_error
from orchestration.identify.fitting.least_squares import minimise
from orchestration.identify.fitting.prediction_error import (
    EVALUATE,
    fit_prediction_error,
)
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.noise.model import white_noise
from orchestration.identify.uncertainty.covariance import heteroscedastic, parameter_covariance

STEP = 0.1
NAMES = ["fast", "slow", "share", "gain"]


class Pair(Component):
    """Two relaxations side by side."""

    name = "pair"

    gain = Parameter(1.0, "1", min=0)
    share = Parameter(0.5, "1", min=0)
    fast = Parameter(1.0, "s", min=1e-3)
    slow = Parameter(10.0, "s", min=1e-3)
    u = Input("1")
    a = State("1", rate="a_rate")
    b = State("1", rate="b_rate")

    def a_rate(self):
        return (self.u - self.a) / self.fast

    def b_rate(self):
        return (self.u - self.b) / self.slow

    @Output("1")
    def y(self):
        """Return the sum of both."""
        return self.gain * (self.a + self.share * self.b)


def relaxed(u, time_constant):
    """Response to an input that is held, on paper."""
    decay = np.exp(-STEP / time_constant)
    return lfilter([0.0, 1.0 - decay], [1.0, -decay], u)


def on_paper(values, u):
    fast, slow, share, gain = values
    return gain * (relaxed(u, fast) + share * relaxed(u, slow))


def problem_of(y, u, start=None, names=NAMES, order=4):
    return Problem(
        Pair, STEP * np.arange(len(u)), {"u": u}, {"y": y}, names, start or {}, order=order
    )


def square(n, dwell=80):
    return np.where(np.arange(n) // dwell % 2 == 0, 1.0, -1.0)


STUCK = [  # from these alone a search ends elsewhere
    {"fast": 26.8, "slow": 17.9, "share": 1.16, "gain": 0.36},
    {"fast": 207.0, "slow": 5.1, "share": 0.08, "gain": 0.49},
    {"fast": 7.7, "slow": 10.3, "share": 7.7, "gain": 0.02},
]


def test_a_look_without_colour_is_brief(monkeypatch):
    """Allow a fit without colour few points, for the coloured one goes on from its end.

    In a valley it would be long.
    """
    u, allowed = square(1500), []

    def spied(*arguments, trials, **options):
        allowed.append(trials)
        return minimise(*arguments, trials=trials, **options)

    monkeypatch.setattr(prediction_error, "minimise", spied)
    y = on_paper([0.7, 6.0, 1.4, 2.0], u) + lfilter(
        [0.02], [1.0, -1.5, 0.7], np.random.default_rng(2).standard_normal(u.size)
    )
    problem = problem_of(y, u)
    fitted = fit_prediction_error(problem, problem.position(problem.start))
    assert len(fitted.noise["y"].coefficients) > 1
    assert allowed[0] >= 200  # the first of all goes to its end
    assert 12 in allowed


def _scale(y):
    """Size of white noise from third differences, whose variance is 20 times as large."""
    third = np.abs(np.diff(y, 3))
    return np.median(third) / 0.6744897501960817 / np.sqrt(20.0)


@pytest.mark.slow
def test_in_heavy_tails_it_comes_close_to_the_bound():
    """Reach the variance bound (Lange, Little, Taylor), (nu + 3) / (nu + 1) of the scale.

    The oracle beside it is least squares in closed form: the model is linear in its gain.
    """
    u, freedom, errors = square(600), 3.0, []
    clean = on_paper([0.7, 6.0, 1.4, 2.0], u)
    for seed in range(200):
        y = clean + 0.05 * np.random.default_rng(seed).standard_t(freedom, u.size)
        problem = problem_of(
            y, u, {"fast": 0.7, "slow": 6.0, "share": 1.4, "gain": 2.0}, ["gain"], order=0
        )
        begin = problem.position(problem.start)
        least = 2.0 * (clean @ y) / (clean @ clean)
        fitted = fit_prediction_error(problem, begin).values["gain"]
        errors.append([fitted - 2.0, least - 2.0])
    robust, plain = np.mean(np.square(errors), axis=0)
    bound = (0.05**2 * (freedom + 3.0) / (freedom + 1.0)) / float((clean / 2.0) @ (clean / 2.0))
    assert robust < 1.4 * bound  # of 200 samples 1 in 1000 is beyond
    assert robust < 0.75 * plain


def test_outliers_hardly_move_it_and_count_little():
    u = square(800)
    random = np.random.default_rng(5)
    clean = on_paper([0.7, 6.0, 1.4, 2.0], u)
    y = clean + 0.02 * random.standard_normal(u.size)
    where = random.choice(np.arange(100, 800), 8, replace=False)
    y[where] += 1.0
    problem = problem_of(y, u)
    found = fit_prediction_error(problem, problem.position(problem.start))
    assert found.noise["y"].freedom < 10.0
    assert found.weights["y"][where].max() < 0.05
    assert [found.values[n] for n in NAMES] == pytest.approx([0.7, 6.0, 1.4, 2.0], rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["level", "colour"])
def test_intervals_hold_where_noise_is_not_what_the_fit_takes_it_for(kind):
    u, inside = square(1200, 150), []
    clean = on_paper([0.7, 6.0, 1.4, 2.0], u)
    truth = {"fast": 0.7, "slow": 6.0, "share": 1.4, "gain": 2.0}
    for seed in range(30):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
        noise = (
            noise * np.where(np.arange(u.size) % 150 < 30, 4.0, 1.0)
            if kind == "level"
            else lfilter([1.0], [1.0, -0.9], noise)
        )
        problem = problem_of(clean + noise, u, truth)
        begin = problem.position(problem.start)
        found = fit_prediction_error(problem, begin, white_noise({"y": noise}))
        intervals = problem.intervals(found.q, found.covariance.standard_errors)
        inside += [low <= truth[n] <= high for n, (low, high) in intervals.items()]
    assert np.mean(inside) > 0.9


def test_a_covariance_is_widened_as_white_has_it_and_never_made_narrower():
    random = np.random.default_rng(1)
    x = random.standard_normal((4000, 1))
    level = np.where(np.abs(x[:, 0]) > 1.0, 3.0, 0.5)
    bread = parameter_covariance(x.T @ x)
    wider = heteroscedastic(bread, x, level * random.standard_normal(4000))
    expected = float((x[:, 0] ** 2 * level**2).sum() / (x[:, 0] @ x[:, 0]) ** 2)
    assert wider.matrix[0, 0] == pytest.approx(expected, rel=0.15)
    assert heteroscedastic(bread, x, np.full(4000, 0.1)).matrix[0, 0] == bread.matrix[0, 0]


class Limited(Component):
    """A lag behind a limit."""

    name = "limited"

    limit = Parameter(10.0, "1", min=0)
    lag = Parameter(0.3, "s", min=1e-3)
    u = Input("1")
    x = State("1", rate="x_rate")

    def x_rate(self):
        return (where(self.u > self.limit, self.limit, self.u) - self.x) / self.lag

    @Output("1")
    def y(self):
        """Return the state."""
        return self.x


def test_no_pass_is_made_twice(monkeypatch):
    """Skip passes whose result is known.

    In coloured noise a fit begins again without colour; where that ends as before, so do the passes
    after it.
    """
    begun = []

    def noted(problem, q, noise, *rest):
        colour = [*noise["y"].coefficients, np.log(noise["y"].deviation)]
        begun.append(np.concatenate([q, np.resize(np.append(colour, np.zeros(5)), 5)]))
        return minimised(problem, q, noise, *rest)

    minimised = prediction_error._minimise
    monkeypatch.setattr(prediction_error, "_minimise", noted)
    u = square(2000)
    noise = lfilter([0.05], [1.0, -1.2, 0.5], np.random.default_rng(8).standard_normal(len(u)))
    problem = problem_of(on_paper((1.2, 8.0, 0.6, 1.1), u) + noise, u)
    found = fit_prediction_error(problem, problem.position(problem.start))
    assert len(found.noise["y"].coefficients) == 2
    coloured = [place for place in begun if place[len(NAMES)] > 0.5]
    apart = [np.abs(a - b).max() for i, a in enumerate(coloured) for b in coloured[:i]]
    assert len(begun) > len(coloured) + 1, "it began again"
    assert min(apart, default=1.0) > 1e-2


def test_an_evaluation_stays_where_it_is_however_near_a_bound():
    u = np.repeat(np.random.default_rng(1).standard_normal(40), 10)
    measured = {"y": relaxed(u, 1.0) + 0.001 * relaxed(u, 10.0)}
    start = {"share": 0.0}  # so that it is not searched in its logarithm
    problem = Problem(Pair, STEP * np.arange(400), {"u": u}, measured, ["share"], start)
    q = problem.position({"share": 0.001})
    assert fit_prediction_error(problem, q, method=EVALUATE).values["share"] == pytest.approx(0.001)


class Tone(Component):
    """A tone of which the frequency is searched linearly, from none on."""

    name = "tone"
    rate = Parameter(0.0, "rad/s", min=0.0, max=1e6, nominal=100.0)

    @Output("1")
    def y(self):
        return sin(self.rate * self.time)


def test_a_start_near_a_bound_is_kept_where_it_is_nearer_to_the_record():
    """A tenth of a unit off the bound the tone is five times as high, and no search leads back."""
    time = np.linspace(0.0, 20.0, 400)
    noise = 0.01 * np.random.default_rng(5).standard_normal(time.size)
    problem = Problem(Tone, time, {}, {"y": np.sin(2.0 * time) + noise}, ["rate"], {})
    fitted = fit_prediction_error(problem, problem.position({"rate": 2.01}))
    assert fitted.values["rate"] == pytest.approx(2.0, abs=0.002)
