"""Claims: slope, area and gap of loops are those of closed forms, and intervals hold.

They hold the truth as often as they say.
"""

import re

import numpy as np
import pytest
from scipy.stats import linregress

from demonstrations.graphical.loops import area, read_loops
from fmus.kit.errors import UserError

TIME = 0.01 * np.arange(3001)  # s
OMEGA = 2 * np.pi / 2.5  # rad/s, 12 cycles


@pytest.mark.parametrize("lag", [-0.4, 0.0, 0.4, 1.2])
def test_a_lagging_sine_makes_an_ellipse(lag):
    """Compare y = b sin(wt - lag) over x = a sin(wt) with the closed form.

    Slope b/a cos(lag), area pi a b sin(lag); a polygon has corners.
    """
    found = read_loops(TIME, 3.0 * np.sin(OMEGA * TIME), 0.5 * np.sin(OMEGA * TIME - lag), 2.5)
    assert found.cycles == 12
    assert found.slope.value == pytest.approx(0.5 / 3.0 * np.cos(lag), abs=1e-9)
    assert found.slope_through_zero.value == pytest.approx(0.5 / 3.0 * np.cos(lag), abs=1e-9)
    assert found.area.value == pytest.approx(np.pi * 3.0 * 0.5 * np.sin(lag), rel=2e-4, abs=1e-9)
    assert found.gap.value == pytest.approx(0.0, abs=1e-12)
    assert [
        q.unit
        for q in (found.slope, found.intercept, found.slope_through_zero, found.area, found.gap)
    ] == ["m/C", "m", "m/C", "C*m", "m"]


def test_the_sign_of_an_area_is_the_sense_in_which_it_is_traversed():
    square = np.array([[0, 0], [2, 0], [2, 1], [0, 1]], dtype=float)
    assert area(*square.T) == pytest.approx(2.0)
    assert area(*square[::-1].T) == pytest.approx(-2.0)
    assert area(*(square + 1e6).T) == pytest.approx(2.0, rel=1e-9)


def test_lines_are_those_of_scipy_and_of_the_normal_equation():
    random = np.random.default_rng(3)
    x = np.sin(OMEGA * TIME) + 0.7 + 0.1 * random.standard_normal(TIME.size)
    y = 0.3 + 2.0 * x + 0.05 * random.standard_normal(TIME.size)
    whole = slice(0, 3000)  # twelve cycles; the last sample begins the thirteenth
    found, line = read_loops(TIME, x, y, 2.5), linregress(x[whole], y[whole])
    assert (found.slope.value, found.intercept.value) == pytest.approx(
        (line.slope, line.intercept), rel=1e-9
    )
    assert found.slope_through_zero.value == pytest.approx(
        (x[whole] @ y[whole]) / (x[whole] @ x[whole]), rel=1e-9
    )


def test_cycles_need_not_be_whole_numbers_of_samples():
    """Compare 0.15 Hz at 10 Hz with the ellipse.

    Samples are far apart, but the polygon of many cycles has its area.
    """
    time = 0.1 * np.arange(601)
    omega = 0.3 * np.pi
    found = read_loops(time, np.cos(omega * time), np.sin(omega * time), 1 / 0.15)
    assert found.cycles == 9
    assert found.area.value == pytest.approx(np.pi, rel=2e-3)


def test_a_drift_is_told_by_the_gap():
    found = read_loops(TIME, np.sin(OMEGA * TIME), np.sin(OMEGA * TIME) + 0.02 * TIME, 2.5)
    assert found.gap.value == pytest.approx(0.02 * 2.5, rel=1e-9)
    assert found.gap.interval == pytest.approx((0.05, 0.05), rel=1e-9)


def test_a_drift_that_is_fitted_along_leaves_the_loops_as_they_were():
    """A charge that settles while a film flows pulls a line that knows of no time."""
    x = np.sin(OMEGA * TIME) + np.exp(-TIME / 7.5)
    y = 0.5 * x + 0.1 * np.cos(OMEGA * TIME)
    still, drifting = (
        read_loops(TIME, x, y, 2.5),
        read_loops(TIME, x, y + 0.02 * TIME, 2.5, drift=True),
    )
    blind = read_loops(TIME, x, y + 0.02 * TIME, 2.5)
    columns = np.column_stack([x, np.ones(3001), TIME])[:3000]
    expected = np.linalg.lstsq(columns, (y + 0.02 * TIME)[:3000])[0]
    assert (drifting.slope.value, drifting.intercept.value) == pytest.approx(expected[:2], rel=1e-9)
    assert drifting.area.value == pytest.approx(still.area.value, rel=0.02)
    assert drifting.gap.value == pytest.approx(still.gap.value, abs=2e-3)
    assert blind.gap.value == pytest.approx(still.gap.value + 0.05, rel=1e-9)
    through = np.linalg.lstsq(columns[:, ::2], (y + 0.02 * TIME)[:3000])[0][0]
    assert drifting.slope_through_zero.value == pytest.approx(through, rel=1e-9)
    assert abs(drifting.slope.value - 0.5) < 0.01 < 0.05 < abs(blind.slope.value - 0.5)


def test_what_comes_before_the_start_and_what_is_short_of_a_cycle_is_left_out():
    x = np.where(TIME < 5.0, 40.0, np.sin(OMEGA * TIME))
    found = read_loops(TIME[:2900], x[:2900], 2.0 * x[:2900], 2.5, start=5.0)
    assert found.cycles == 9
    assert found.slope.value == pytest.approx(2.0, rel=1e-9)


def test_intervals_hold_the_truth_19_times_in_20():
    """Every cycle has a slope and an area of its own, as if its noise remembered all of it."""
    random = np.random.default_rng(8)
    time = 0.05 * np.arange(501)
    kept = np.zeros(3)
    for _ in range(300):
        own = np.repeat(random.standard_normal((2, 10)), 50, axis=1)
        own = np.column_stack([own, own[:, -1]])
        x, ahead = np.sin(OMEGA * time), np.cos(OMEGA * time)
        y = 0.1 + (1.0 + 0.1 * own[0]) * x + (0.2 + 0.05 * own[1]) * ahead
        found = read_loops(time, x, y, 2.5)
        for k, (q, true) in enumerate(
            ((found.slope, 1.0), (found.slope_through_zero, 1.0), (found.area, -0.2 * np.pi))
        ):
            kept[k] += q.interval[0] <= true <= q.interval[1]
    assert np.all((kept / 300 > 0.91) & (kept / 300 < 0.99)), kept / 300


def test_one_cycle_has_no_interval():
    found = read_loops(TIME[:251], np.sin(OMEGA * TIME[:251]), np.sin(OMEGA * TIME[:251]), 2.5)
    assert found.cycles == 1
    assert found.area.interval == (-np.inf, np.inf)
    assert found.slope.interval == (-np.inf, np.inf)


SINE = np.sin(OMEGA * TIME)


@pytest.mark.parametrize(
    ("time", "x", "y", "options", "message"),
    [
        (
            TIME,
            SINE[1:],
            SINE,
            {},
            "x has the shape (3000,): time and signals must be vectors of one length",
        ),
        (
            TIME,
            SINE,
            np.where(np.arange(3001) == 7, np.nan, SINE),
            {},
            "y: sample 7 is nan, and must be a finite number",
        ),
        (TIME[::-1], SINE, SINE, {}, "time: must increase, and does not after sample 0"),
        (TIME, SINE, SINE, {"period": 0.0}, "period = 0 s: must be above 0"),
        (TIME, SINE, SINE, {"period": np.nan}, "period = nan s: must be above 0"),
        (TIME, SINE, SINE, {"start": -1.0}, "start = -1 s: must be 0 or more"),
        (TIME, SINE, SINE, {"period": 31.0}, "record of 30 s after the start: a cycle takes 31 s"),
        (TIME, SINE, SINE, {"start": 29.0}, "record of 1 s after the start: a cycle takes 2.5 s"),
        (TIME, SINE, SINE, {"period": 0.03}, "cycle 1 has 3 samples: at least 4 enclose an area"),
        (TIME, np.ones_like(TIME), SINE, {}, "x does not change: there is no slope over it"),
    ],
)
def test_what_makes_no_loop_is_refused(time, x, y, options, message):
    with pytest.raises(UserError, match=f"^{re.escape(message)}$"):
        read_loops(time, x, y, **({"period": 2.5} | options))
