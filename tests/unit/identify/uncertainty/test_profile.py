"""Claims: a profile is the ellipse of a linear model, and else the likelihood itself.

Oracles: the deviance of y = a (1 - exp(-t / tau)) by scipy, with a in closed form; binomial bounds.
"""

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.signal import lfilter
from scipy.stats import binom, chi2, norm

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from orchestration.fmu.model import find_model
from orchestration.identify.comparison import fit_model
from orchestration.identify.fitting import FitData
from orchestration.identify.grey_box import fit_grey_box
from orchestration.identify.uncertainty.profile import Coordinate, profile_likelihood
from tests.support.command import PNG
from tests.support.hosts import build_one_state_fmu

LEVEL = chi2.ppf(0.95, 1)
TIME = np.linspace(0.0, 1.0, 51)


class Rise(Component):
    """``y = a (1 - exp(-t / tau))`` for u = 1."""

    name = "rise"

    a = Parameter(1.0, "V", min=0)
    tau = Parameter(1.0, "s", min=1e-6)
    nothing = Parameter(1.0, "1", min=0)
    u = Input("1")
    x = State("1", rate="x_rate")

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("V")
    def y(self):
        """Return the state times a."""
        return self.a * self.x


class Capped(Rise):
    """``tau`` is known to be 3 s at most."""

    name = "capped"

    tau = Parameter(1.0, "s", min=1e-6, max=3.0)


class Line(Component):
    """``y = slope u + offset``, linear in both."""

    name = "line"

    slope = Parameter(1.0, "V", min=-50, max=50)
    offset = Parameter(0.5, "V", min=-50, max=50)
    u = Input("1")

    @Output("V")
    def y(self):
        """On a line."""
        return self.slope * self.u + self.offset


def rise(tau, seed, noise=0.02):
    measured = (
        1.0 - np.exp(-TIME / tau) + noise * np.random.default_rng(seed).normal(size=TIME.size)
    )
    return {"u": np.ones(TIME.size)}, {"y": measured}


def fitted(seed, tau=4.0, cls=Rise, names=("a", "tau")):
    return fit_grey_box(cls, TIME, *rise(tau, seed), names)


def by_hand(found, measured, ceiling=1e9):
    """Return the interval of tau by the deviance of the best a for every tau, and the ellipse's.

    In the logarithm the standard error of the ellipse is its interval's; what white noise would
    have of it is by the normal matrix of the closed form.
    """

    def squares(log_tau):
        shape = -np.expm1(-TIME / np.exp(log_tau))
        return float(measured @ measured - (measured @ shape) ** 2 / (shape @ shape))

    best = minimize_scalar(
        squares, (np.log(0.5), np.log(5.0)), method="brent", options={"xtol": 1e-12}
    ).x
    variance = squares(best) / TIME.size
    tau, shape = np.exp(best), -np.expm1(-TIME / np.exp(best))
    a = (measured @ shape) / (shape @ shape)
    slopes = np.column_stack([a * shape, -a * np.exp(-TIME / tau) * TIME / tau])
    white = variance * np.linalg.inv(slopes.T @ slopes)[1, 1]
    low, high = found.intervals["tau"]
    allowed = (np.log(high / low) / (2.0 * norm.ppf(0.975))) ** 2 / white

    def above(log_tau):
        return (squares(log_tau) - squares(best)) / variance - LEVEL * allowed

    upper = np.exp(brentq(above, best, np.log(ceiling))) if above(np.log(ceiling)) > 0.0 else np.inf
    return np.exp(brentq(above, best - 5.0, best)), upper, allowed


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_of_a_linear_model_it_is_the_ellipse(colour):
    noise = lfilter([0.1], [1.0, -colour], np.random.default_rng(1).normal(size=400))
    u = np.random.default_rng(2).normal(size=400) + 2.0
    found = fit_grey_box(
        Line, 0.1 * np.arange(400), {"u": u}, {"y": 3.0 * u - 1.0 + noise}, ["slope", "offset"]
    )
    for name, (low, high) in found.intervals.items():
        traced = found.profile(name)
        width = high - low
        assert traced.interval == pytest.approx((low, high), abs=1e-4 * width)
        assert traced.ellipse == pytest.approx((low, high), rel=1e-12)
        assert traced.open == (False, False)
        assert traced.deviance == pytest.approx(traced.parabola(traced.values), abs=1e-4)
        assert traced.fits <= 14
        assert traced.warnings == ()


@pytest.mark.parametrize("seed", range(4))
def test_where_the_time_constant_is_long_it_is_the_likelihood_itself(seed):
    found, measured = fitted(seed, 1.5), rise(1.5, seed)[1]["y"]
    low, high, _ = by_hand(found, measured)
    traced = found.profile("tau")
    assert traced.interval == pytest.approx((low, high), rel=1e-3)
    assert traced.open == (False, False)
    # the slope at t = 0 is a / tau, so that long ones differ little
    assert high / traced.estimate > 1.05 * traced.estimate / low


def test_colour_counts_as_it_does_in_the_ellipse():
    """A wave that is left makes the interval wider, and by as much."""
    inputs, measured = rise(1.5, 5)
    measured["y"] += lfilter([0.01], [1.0, -0.8], np.random.default_rng(7).normal(size=TIME.size))
    found = fit_grey_box(Rise, TIME, inputs, measured, ["a", "tau"])
    low, high, allowed = by_hand(found, measured["y"])
    assert allowed > 1.5
    assert found.profile("tau").interval == pytest.approx((low, high), rel=1e-3)


def test_an_end_that_the_record_does_not_tell_is_open():
    found = fitted(1)
    traced = found.profile("tau")
    low, high, _ = by_hand(found, rise(4.0, 1)[1]["y"])
    assert high == np.inf
    assert traced.interval == (pytest.approx(low, rel=1e-3), np.inf)
    assert traced.open == (False, True)
    assert np.isfinite(traced.ellipse).all()
    assert traced.written.endswith("… open")
    assert "does not bound tau above" in traced.warnings[0]
    assert traced.warnings[0] in found.all_warnings
    assert f"warning: {traced.warnings[0]}" in str(found)
    told = json.loads(json.dumps(found.to_dict()))["profiles"]["tau"]
    assert told["ci95"] == [traced.interval[0], None]
    assert told["open"] == [False, True]
    assert (np.diff(told["values"]) > 0.0).all()
    assert told["level"] == pytest.approx(3.8415, abs=1e-4)


def test_it_ends_where_the_range_does():
    traced = fitted(1, cls=Capped).profile("tau")
    assert traced.interval[1] == 3.0
    assert traced.open[1]
    assert traced.values[-1] == pytest.approx(3.0, rel=1e-12)


def test_a_parameter_that_does_nothing_is_open_on_both_sides():
    traced = fitted(1, 1.5, names=("a", "tau", "nothing")).profile("nothing")
    assert traced.open == (True, True)
    assert traced.interval == (0.0, np.inf)
    assert traced.deviance == pytest.approx(np.zeros(traced.values.size), abs=1e-6)


def test_what_was_fitted_stays_and_is_not_profiled_twice():
    found = fitted(2, 1.5)
    before, told = found.values, []
    one = found.profile("tau", told.append)
    assert found.profile("tau") is one
    assert found.values == before
    assert len(told) == one.fits
    # nothing stays held
    assert found.profile("a").interval == pytest.approx(
        fitted(2, 1.5).profile("a").interval, rel=1e-12
    )
    with pytest.raises(UserError, match="no profile of nothing"):
        found.profile("nothing")


def test_a_search_that_is_interrupted_leaves_the_fit_as_it_was():
    found, fits = fitted(2, 1.5), 0

    def interrupt(text):
        nonlocal fits
        fits += 1
        if fits == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        found.profile("tau", interrupt)
    assert found.profiles == {}
    assert found.profile("tau").interval == fitted(2, 1.5).profile("tau").interval


@pytest.mark.parametrize(
    "copied", [lambda f: pickle.loads(pickle.dumps(f)), copy.deepcopy], ids=["pickle", "copy"]
)
def test_a_fit_is_copied_without_its_model(copied):
    found = fitted(2, 1.5)
    made = found.profile("tau")
    again = copied(found)
    assert str(again) == str(found)
    assert again.values == found.values
    assert again.intervals == found.intervals
    assert again.profile("tau").interval == made.interval
    assert again.draws(5)["a"].tolist() == found.draws(5)["a"].tolist()
    with pytest.raises(
        UserError, match="no profile of a: this is a copy of a fit, without its model; fit again"
    ):
        again.profile("a")
    assert found.profile("a").interval[0] < found.values["a"]  # the fit itself is as it was


def followed(deviance, low=-10.0, high=10.0, asked=None):
    """Profile of the only coordinate, of a deviance over its level that is given on paper."""

    def refit(start):
        if asked is not None:
            asked.append(float(start[0]))
        return start, deviance(start[0])

    along = Coordinate(0, float, low, high, False, np.ones(1), 0.5)
    return profile_likelihood("a", Parameter(0.0, "V"), refit, np.zeros(1), along)


def test_a_better_optimum_on_the_way_is_told():
    found = followed(lambda x: ((x - 1.0) ** 2 - 1.0) / 2.0)
    assert found.interval == pytest.approx((1.0 - 3.0**0.5, 1.0 + 3.0**0.5), abs=1e-3)
    assert "likelier than the estimate" in found.warnings[0]


def test_where_the_model_fails_a_profile_ends():
    def deviance(x):
        if x > 0.7:
            raise UserError("too stiff")
        return x**2 / 4.0

    found = followed(deviance)
    assert found.open == (False, True)
    assert found.interval == (pytest.approx(-2.0, abs=1e-3), np.inf)
    assert 0.69 < found.values[-1] <= 0.7
    assert "cannot be simulated farther on" in found.warnings[0]


@pytest.mark.parametrize("worth", [None, np.nan, np.inf], ids=["raised", "nan", "inf"])
def test_an_end_that_is_bracketed_is_no_open_one(worth):
    """Fit nothing between 1.70 and 1.99.

    On both sides the root is a straight line that is one at 1.8.
    """

    def deviance(x):
        if 1.70 < x < 1.99:
            if worth is None:
                raise UserError("too stiff")
            return worth
        return (x / 1.8) ** 2

    asked = []
    found = followed(deviance, asked=asked)
    assert max(asked) > 1.99
    assert found.open == (False, False)
    assert found.interval == pytest.approx((-1.8, 1.8), rel=1e-3)
    assert np.isfinite(found.deviance).all()
    assert len(found.warnings) == 1
    assert "the end above of a is interpolated between" in found.warnings[0]
    assert found.fits == len(asked)


def test_a_deviance_that_is_no_number_ends_a_profile_as_a_failure_does():
    asked = []
    found = followed(lambda x: x**2 / 4.0 if x <= 0.7 else np.nan, asked=asked)
    assert found.open == (False, True)
    assert 0.69 < found.values[-1] <= 0.7
    assert np.isfinite(found.deviance).all()
    assert "cannot be simulated farther on" in found.warnings[0]
    assert found.fits == len(asked) < 40


def test_no_more_fits_are_made_than_make_sense():
    """Let every other fit find a deviance just below the level.

    Steps become shorter and shorter.
    """
    asked = []
    found = followed(lambda x: 0.9 * (len(asked) % 2), -np.inf, np.inf, asked)
    assert found.open == (True, True)
    assert found.fits == len(asked) == 80
    assert [text.endswith("after 40 fits") for text in found.warnings] == [True, True]


def test_fits_of_a_crossing_count_among_those_that_are_made_at_most():
    """A wall that the 38th of 40 fits comes to: two are left to tell where it stands."""
    first, asked = [], []
    followed(lambda x: 0.9 * (len(first) % 2), -np.inf, np.inf, first)
    near, far = first[76:78]
    wall = near + 0.3 * (far - near)
    found = followed(lambda x: 2.0 if x > wall else 0.9 * (len(asked) % 2), -np.inf, np.inf, asked)
    assert asked[:78] == first[:78]
    assert found.fits == len(asked) == 80
    assert near <= found.interval[1] <= far
    assert "above of a is interpolated between" in found.warnings[-1]


def test_any_fmu_has_profiles(tmp_path):
    """Profile one parameter alone: the crossing of a sum of squares on paper.

    The FMU is opened again for it.
    """
    time = 0.1 * np.arange(101)
    measured = 1.0 - np.exp(-time / 0.73) + 0.05 * np.random.default_rng(1).normal(size=101)
    model = find_model(str(build_one_state_fmu(tmp_path)))
    found = fit_model(model, [FitData(time, {"u": np.ones(101)}, {"x": measured})], ["tau"], {})
    assert pickle.loads(pickle.dumps(found)).values == found.values
    traced = found.profile("tau")

    def squares(log_tau):
        return float(((measured + np.expm1(-time / np.exp(log_tau))) ** 2).sum())

    best = minimize_scalar(squares, (np.log(0.5), np.log(1.0)), method="brent").x
    variance, tau = squares(best) / 101, np.exp(best)
    slope = np.exp(-time / tau) * time / tau
    low, high = found.intervals["tau"]
    allowed = (np.log(high / low) / (2.0 * norm.ppf(0.975))) ** 2 / (variance / (slope @ slope))

    def above(log_tau):
        return (squares(log_tau) - squares(best)) / variance - LEVEL * allowed

    expected = [np.exp(brentq(above, best, best + sign)) for sign in (-1.0, 1.0)]
    assert traced.interval == pytest.approx(expected, rel=1e-3)


def test_profiles_are_drawn(tmp_path):
    found = fitted(1)
    with pytest.raises(UserError, match="no profile was made"):
        found.plot_profiles()
    found.profile("tau")
    found.profile("a")
    figure = found.plot_profiles(tmp_path / "p.png")
    assert (tmp_path / "p.png").read_bytes().startswith(PNG)
    above, below = figure.axes
    assert above.get_xlabel() == "tau [s]"
    assert below.get_xlabel() == "a [V]"
    assert above.get_xscale() == "log"
    named = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"profile", "parabola of the ellipse", "95 % interval of the profile"} <= named
    assert Path(tmp_path / "p.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize(("true", "least"), [(1.0, 0.0), (3.0, 0.0), (10.0, 0.05)])
def test_profiles_hold_the_truth_as_often_as_they_say(true, least):
    """400 records of 1 s, of a time constant of 1, 3 and 10 s.

    Of the longest many records have their optimum at the end of the range, where a time constant is
    infinite: there half of a chi-square is zero (Self and Liang, J. Amer. Statist. Assoc. 82,
    1987), and an interval holds more often.
    """
    draws, held = 400, {"profile": 0, "ellipse": 0, "open": 0}
    for seed in range(draws):
        traced = fitted(1000 + seed, true).profile("tau")
        held["profile"] += traced.interval[0] <= true <= traced.interval[1]
        held["ellipse"] += traced.ellipse[0] <= true <= traced.ellipse[1]
        held["open"] += traced.open[1]
    print(true, {name: f"{100.0 * count / draws:.1f} %" for name, count in held.items()})
    low, high = binom.interval(0.998, draws, 0.95)
    assert held["profile"] >= low
    assert held["profile"] <= high or held["open"] > 0.9 * draws
    assert held["ellipse"] <= held["profile"] - least * draws
