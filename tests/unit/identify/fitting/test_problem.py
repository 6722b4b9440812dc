"""Claims: a problem has residuals and derivatives by searched coordinates, within their ranges.

Oracles: arithmetic of exponentials, and SciPy's densities.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from fmus.kit import Component, Input, Output, Parameter, State, UserError, cos, stack
from fmus.kit.sensors import transport_delay
from orchestration.identify.fitting.problem import Problem, Scale
from orchestration.identify.noise import Noise


class Turning(Component):
    """The height of a point on a wheel, which is the sine of speed times time."""

    name = "turning"
    speed = Parameter(1.0, "1/s")
    angle = State("1", rate="turning")
    height = State("1", rate="rising", output=True)

    def turning(self):
        return self.speed

    def rising(self):
        return self.speed * cos(self.angle)


def test_a_simulation_that_takes_far_more_steps_than_others_is_abandoned():
    """A problem that has seen no cheaper one allows it."""

    def turning():
        return Problem(Turning, TIME, {}, {"height": np.sin(TIME)}, ["speed"], {})

    fast = np.array([7e2])
    searched = turning()
    assert searched.evaluate(np.array([1.0]))[0]["height"] == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(UserError, match=r"more than [0-9.]+ internal steps per sample"):
        searched.evaluate(fast)
    alone = turning().evaluate(fast)[0]["height"]
    assert alone == pytest.approx(np.sin(TIME) - np.sin(7e2 * TIME), abs=1e-2)


TIME = 0.1 * np.arange(100)
U = np.where(TIME < 5.0, 1.0, -1.0)


class Amplifier(Component):
    """An input times a gain, and an offset of either sign."""

    name = "amplifier"

    gain = Parameter(2.0, "1", min=0.0, max=10.0)
    offset = Parameter(0.0, "1", min=-3.0, max=3.0, nominal=0.5)
    unused = Parameter(1.0, "1", min=0.0)
    u = Input("1")

    @Output("1")
    def y(self):
        """Return what is amplified."""
        return self.gain * self.u + self.offset


def amplified(names=("gain", "offset"), measured=None, cls=Amplifier, **fixed):
    y = 3.0 * U + 0.25 if measured is None else measured
    return Problem(cls, TIME, {"u": U}, {"y": y}, names, fixed)


def test_a_positive_parameter_is_searched_in_its_logarithm_and_another_in_units_of_its_size():
    logarithm, size = Scale(True, 2.0), Scale(False, 0.5)
    assert logarithm.position(2.0) == pytest.approx(np.log(2.0))
    assert logarithm.value(np.log(2.0)) == logarithm.slope(np.log(2.0)) == pytest.approx(2.0)
    assert logarithm.position(0.0) == -np.inf
    assert (size.position(-0.25), size.value(-0.5), size.slope(7.0)) == (-0.5, -0.25, 0.5)
    assert amplified().scales == [Scale(True, 2.0), Scale(False, 0.5)]


def test_residuals_are_measured_minus_simulated_where_there_was_a_measurement():
    y = np.where(np.arange(100) < 10, np.nan, 3.0 * U + 0.25)
    problem = amplified(measured=y)
    residual, jacobian = problem.evaluate(np.array([np.log(2.5), 0.2]))
    assert residual["y"] == pytest.approx(0.5 * U[10:] + 0.15)
    assert jacobian["y"] == pytest.approx(
        np.column_stack([-2.5 * U[10:], np.full(90, -0.5)])  # d(gain) = gain dq, d(offset) = dq / 2
    )
    assert problem.samples == 90
    problem.evaluate(np.array([np.log(2.5), 0.2]))
    assert problem.evaluations == 1


def test_values_and_intervals_stay_in_their_ranges():
    problem = amplified()
    low, high = problem.bounds()
    assert low.tolist() == [-np.inf, -6.0]
    assert high == pytest.approx([np.log(10.0), 6.0])
    assert problem.values(np.array([50.0, -9.0])) == {"gain": 10.0, "offset": -3.0}
    assert problem.inside(np.array([np.log(10.0), -6.0])) == pytest.approx(
        [np.log(10.0) - 0.1, -5.9]
    )
    ends = problem.intervals(np.array([np.log(2.0), 0.0]), np.array([0.1, np.inf]))
    assert ends["gain"] == pytest.approx((2.0 * np.exp(-0.196), 2.0 * np.exp(0.196)), rel=1e-3)
    assert ends["offset"] == (-np.inf, np.inf)


def test_a_search_goes_on_from_a_positive_value_that_ran_off_to_zero():
    problem = amplified()
    start = problem.position({"gain": 0.0, "offset": -800.0})
    assert np.isfinite(start).all()
    assert problem.values(start) == {"gain": pytest.approx(0.0, abs=1e-300), "offset": -3.0}
    # a coordinate of a linear scale may be as far below zero as it likes
    assert start[1] == pytest.approx(-1600.0)


def test_a_delay_is_searched_within_a_sample_and_then_across_it():
    late = stack(Amplifier, transport_delay(Amplifier, "y"))
    problem = amplified(["gain", "y_delay"], cls=late, y_delay=0.25)
    position = problem.scales[1].position
    q = problem.position(problem.start)
    low, high = problem.smooth_bounds(q)
    assert [low[1], high[1]] == pytest.approx([position(0.2001), position(0.2999)])
    assert problem.across_sample(q) is None
    at_the_edge = np.array([q[0], position(0.2999)])
    assert problem.across_sample(at_the_edge) == pytest.approx([q[0], position(0.31)])
    problem.held = [0]
    low, high = problem.smooth_bounds(q)
    assert low[0] == high[0] == q[0]


def test_what_is_no_number_cannot_be_searched():
    class Switched(Amplifier):
        count = Parameter(1, "1", type="integer")

    with pytest.raises(UserError, match="count is integer; only real parameters can be fitted"):
        amplified(["count"], cls=Switched)


def test_the_end_of_an_unbounded_range_has_a_value_and_a_slope():
    """A search may come to it, where a product of the two must be a number."""
    scale = Scale(True, 1.0)
    end = scale.position(np.inf)
    assert np.isfinite([scale.value(end), scale.slope(end), 1e3 * scale.slope(end)]).all()
    assert scale.position(7.0) == pytest.approx(np.log(7.0))


def test_the_deviance_is_the_likelihood_of_the_residuals_relative_to_unit_density():
    """The oracle is SciPy's density of a Gaussian distribution."""
    e = np.random.default_rng(1).normal(0.0, 0.3, 100)
    expected = -2.0 * norm.logpdf(e, scale=0.2).sum() - len(e) * np.log(2.0 * np.pi)
    assert amplified().deviance({"y": Noise(0.2)}, {"y": e}) == pytest.approx(expected)
