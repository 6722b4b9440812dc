"""Claims: outliers hardly move a fit, and intervals hold in noise of varying level.

Oracles: two relaxations on paper, least squares in closed form, and the variance bound of
Student's t distribution.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import Component, Input, Output, Parameter, State, sin
from orchestration.identify.fitting.output_error import fit_output_error
from orchestration.identify.fitting.problem import Problem
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


def problem_of(y, u, start=None, names=NAMES):
    return Problem(Pair, STEP * np.arange(len(u)), {"u": u}, {"y": y}, names, start or {})


def square(n, dwell=80):
    return np.where(np.arange(n) // dwell % 2 == 0, 1.0, -1.0)


@pytest.mark.slow
def test_in_heavy_tails_it_comes_close_to_the_bound():
    """Reach the variance bound (Lange, Little, Taylor), (nu + 3) / (nu + 1) of the scale.

    The oracle beside it is least squares in closed form: the model is linear in its gain.
    """
    u, freedom, errors = square(600), 3.0, []
    clean = on_paper([0.7, 6.0, 1.4, 2.0], u)
    for seed in range(200):
        y = clean + 0.05 * np.random.default_rng(seed).standard_t(freedom, u.size)
        start = {"fast": 0.7, "slow": 6.0, "share": 1.4, "gain": 2.0}
        problem = problem_of(y, u, start, ["gain"])
        begin = problem.position(problem.start)
        least = 2.0 * (clean @ y) / (clean @ clean)
        fitted = fit_output_error(problem, begin).values["gain"]
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
    found = fit_output_error(problem, problem.position(problem.start))
    assert found.noise["y"].freedom < 10.0
    assert found.weights["y"][where].max() < 0.05
    assert [found.values[n] for n in NAMES] == pytest.approx([0.7, 6.0, 1.4, 2.0], rel=0.03)


@pytest.mark.slow
def test_intervals_hold_where_the_level_of_the_noise_varies():
    u, inside = square(1200, 150), []
    clean = on_paper([0.7, 6.0, 1.4, 2.0], u)
    truth = {"fast": 0.7, "slow": 6.0, "share": 1.4, "gain": 2.0}
    for seed in range(30):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
        noise *= np.where(np.arange(u.size) % 150 < 30, 4.0, 1.0)
        problem = problem_of(clean + noise, u, truth)
        begin = problem.position(problem.start)
        found = fit_output_error(problem, begin)
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
    fitted = fit_output_error(problem, problem.position({"rate": 2.01}))
    assert fitted.values["rate"] == pytest.approx(2.0, abs=0.002)
