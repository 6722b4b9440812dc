"""Claims: the fit finds what made the record, with intervals that hold.

What cannot be determined is reported.

Oracles: the emulated rig (own equations), least squares of scipy on solutions on paper, binomial
bounds.
"""

from dataclasses import asdict
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import binom

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from fmus import component
from fmus.kit import Component, Input, Output, Parameter, State, UserError, stack
from fmus.kit.record.compiled import CompiledModel
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.experiment.waveforms import multilevel, square_wave
from orchestration.identify.grey_box import fit_grey_box
from orchestration.identify.metrics import fit_percent
from orchestration.identify.noise.ljung_box import whiteness
from orchestration.records import read_record

TRUTH = RigParameters().scattered(3)
TRUE = asdict(TRUTH)
NAMES = list(TRUE)
ELECTRICAL = ["R1", "R2", "C"]
quiet = partial(EmulatedRig, voltage_noise=0.0, displacement_noise=0.0)


def stimulus(stop, step, dwell=(15.0, 60.0)):
    time = np.arange(0.0, stop, step)
    current = multilevel(time, [-0.9, -0.45, 0.0, 0.45, 0.9], (2.0, 8.0), 1)
    return time, {"current": current, "force": multilevel(time, [0.5, 1.0, 1.75, 2.75], dwell, 2)}


class Product(Component):
    """First order; only the product of two of its parameters matters."""

    name = "product"

    a = Parameter(2.0, "1", min=0)
    b = Parameter(3.0, "1", min=0)
    rate = Parameter(0.5, "1/s", min=0)
    offset = Parameter(0.0, "1", min=-5, max=5)
    u = Input("1")
    x = State("1", rate="x_rate")

    def x_rate(self):
        return self.rate * (self.a * self.b * self.u - self.x)

    @Output("1")
    def y(self):
        """Return the state and an offset."""
        return self.x + self.offset


def product_response(gain, rate, offset=0.0, step=0.1, samples=300):
    """Return exact samples of Product under u = 1, then -1; u is held."""
    u = np.where(np.arange(samples) < samples // 2, 1.0, -1.0)
    decay = np.exp(-rate * step)
    x = lfilter([0.0, gain * (1 - decay)], [1.0, -decay], u)
    return step * np.arange(samples), {"u": u}, x + offset


def test_all_eight_parameters_of_the_emulated_rig_are_found():
    time, inputs = stimulus(600.0, 0.2)
    result = fit_grey_box(PpyActuator, time, inputs, quiet(TRUTH).run(time, **inputs), NAMES)
    assert result.warnings == []
    for name, estimate in result.estimates.items():
        assert estimate.value == pytest.approx(TRUE[name], rel=1e-6)
        assert estimate.nominal == asdict(RigParameters())[name]  # where it started from


def test_start_values_are_parameters_too():
    time, inputs = stimulus(60.0, 0.1)
    measured = {"voltage": quiet(TRUTH, initial_charge=-0.6).run(time, **inputs)["voltage"]}
    result = fit_grey_box(PpyActuator, time, inputs, measured, [*ELECTRICAL, "charge_start"])
    assert result.values == pytest.approx(
        {n: TRUE[n] for n in ELECTRICAL} | {"charge_start": -0.6}, rel=1e-6
    )


# effect -> argument of with_effects, true value; the effect itself says which of its parameters
# switches it
HIDDEN = {
    "double_layer": ("resistance", 0.3),
    "resistance_growth": ("growth", 5e-3),
    "quadratic_strain": ("beta", -4e-6),
    "strain_saturation": ("saturation", 0.05),
    "strain_lag": ("lag", 1.5),
}


def with_effects(time, current, *, resistance=0.0, growth=0.0, beta=0.0, saturation=0.0, lag=0.0):
    """Integrate voltage and charge's elongation by scipy, with the equations written out.

    States: charge, throughput, pending, interface.
    """
    p, tau, shortest = RigParameters(), 0.2, 0.05
    following = lag + shortest * np.exp(-lag / shortest)

    def charging(x, i):
        films = x[0] / p.C + resistance * x[3]
        return (p.R2 * i - films) / (p.R1 * (1 + growth * x[1]) + p.R2)

    def slope(_, x, i):
        rate = charging(x, i)
        return [rate, abs(rate), rate - x[2] / following, (rate - x[3]) / tau]

    states = np.zeros((4, time.size))
    for a, b in pairwise([0, *(np.flatnonzero(np.diff(current)) + 1), time.size - 1]):
        span = (time[a], time[b])
        solution = solve_ivp(
            slope, span, states[:, a], "DOP853", time[a : b + 1], args=(current[a],), rtol=1e-9
        )
        states[:, a : b + 1] = solution.y
    charge, leaked = states[0], p.R2 * (current - charging(states, current))
    elongation = p.alpha * (charge - lag / following * states[2]) + beta * charge**2
    if saturation:
        elongation = p.alpha * np.tanh(np.sqrt(saturation) * charge) / np.sqrt(saturation)
    return leaked, elongation


@pytest.mark.parametrize("effect", HIDDEN)
def test_an_effect_is_fitted_from_its_neutral_value(effect):
    """Neutral is the end of the range of most; other parameters start off, too."""
    (argument, value), name = HIDDEN[effect], EFFECTS[effect].neutral
    time, inputs = stimulus(120.0, 0.1)
    voltage, elongation = with_effects(time, inputs["current"], **{argument: value})
    rig = quiet()
    rig.run(time, **inputs)
    measured = {
        "voltage": voltage,
        "displacement": elongation + rig.truth["mechanical_displacement"],
    }
    # without any noise a search would go on among the rounding errors of two integrators
    noise = np.random.default_rng(0)
    measured = {o: y + 1e-6 * np.ptp(y) * noise.normal(size=y.size) for o, y in measured.items()}
    again = partial(fit_grey_box, stack(PpyActuator, EFFECTS[effect]), time, inputs, measured)
    result = again([name, "R1", "alpha"], {"R1": 0.6})
    assert result.warnings == []
    assert result.estimates[name].nominal == 0.0
    assert result.values == pytest.approx({name: value, "R1": 0.43, "alpha": 6.8e-5}, rel=1e-4)
    alone = again([name])
    assert alone.values == pytest.approx({name: value}, rel=1e-4)
    assert alone.evaluations < 25


@pytest.mark.parametrize("effect", HIDDEN)
def test_an_effect_that_is_not_there_is_not_made_up(effect):
    """Fit an effect to a rig without it, in noise.

    Its interval holds the neutral value, at the end of the range of most.
    """
    time, inputs = stimulus(120.0, 0.1)
    name, measured = EFFECTS[effect].neutral, EmulatedRig(seed=1).run(time, **inputs)
    estimates = fit_grey_box(
        stack(PpyActuator, EFFECTS[effect]), time, inputs, measured, [name, "R1", "C", "alpha"]
    ).estimates
    low, high = estimates[name].interval
    assert low <= 0.0 <= high
    assert high - low < 0.1 * abs(HIDDEN[effect][1])


def test_gaps_in_an_output_are_left_out():
    time, inputs = stimulus(600.0, 0.2)
    measured = quiet(TRUTH).run(time, **inputs)
    measured["voltage"][100:400] = np.nan
    measured["displacement"][::7] = np.nan
    assert fit_grey_box(PpyActuator, time, inputs, measured, NAMES).values == pytest.approx(
        TRUE, rel=1e-6
    )


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_intervals_hold_the_truth_as_often_as_they_say(colour):
    """Count over 30 records each, white noise and AR(1) with phi = 0.9.

    If the latter were taken for white, half the intervals would miss.
    """
    time, inputs = stimulus(1200.0, 1.0)
    held = tried = 0
    for seed in range(30):
        measured = EmulatedRig(TRUTH, seed=seed, noise_colour=colour).run(time, **inputs)
        for name, estimate in fit_grey_box(
            PpyActuator, time, inputs, measured, NAMES, TRUE
        ).estimates.items():
            low, high = estimate.interval
            held, tried = held + (low <= TRUE[name] <= high), tried + 1
    assert tried == 240
    # the eight of one record are not independent: the bound is that of 60 independent ones, 0.88 of
    # them
    assert binom.ppf(0.01, 60, 0.95) / 60 >= 0.88
    assert 0.88 <= held / tried <= 1.0


def test_intervals_are_as_wide_as_the_estimates_scatter():
    """Compare the standard error with the scatter over 40 records with AR(1) noise.

    Intervals are not merely wide: both agree to a third.
    """
    time, inputs = stimulus(300.0, 0.5)
    values, told = [], []
    for seed in range(40):
        measured = {
            "voltage": EmulatedRig(TRUTH, seed=seed, noise_colour=0.9).run(time, **inputs)[
                "voltage"
            ]
        }
        estimates = fit_grey_box(PpyActuator, time, inputs, measured, ELECTRICAL, TRUE).estimates
        values.append([np.log(estimates[n].value) for n in ELECTRICAL])
        told.append([np.diff(np.log(estimates[n].interval))[0] / 2 / 1.959964 for n in ELECTRICAL])
    ratio = np.median(told, axis=0) / np.std(values, axis=0, ddof=1)
    assert np.all((ratio > 0.67) & (ratio < 1.5)), ratio


def test_a_force_that_never_acts_says_nothing_about_stiffness():
    time, inputs = stimulus(60.0, 0.1)
    inputs["force"] = np.zeros(time.size)
    result = fit_grey_box(
        PpyActuator,
        time,
        inputs,
        EmulatedRig(TRUTH).run(time, **inputs),
        ["R1", "alpha", "k1", "b2"],
        TRUE,
    )
    assert result.warnings == ["this record does not determine k1, b2"]
    assert result.estimates["k1"].interval == (0.0, np.inf)
    assert result.values["k1"] == pytest.approx(TRUE["k1"])  # left where it started
    low, high = result.estimates["R1"].interval  # and the others are none the worse for it
    assert 0.95 * TRUE["R1"] < low < TRUE["R1"] < high < 1.05 * TRUE["R1"]


def test_a_single_undetermined_parameter_is_told():
    time, inputs = stimulus(60.0, 0.1)
    inputs["current"] = np.zeros(time.size)
    measured = {"displacement": EmulatedRig(TRUTH).run(time, **inputs)["displacement"]}
    result = fit_grey_box(PpyActuator, time, inputs, measured, ["alpha", "k1"], TRUE)
    assert result.warnings == ["this record does not determine alpha"]
    assert result.estimates["alpha"].interval == (-np.inf, np.inf)


def test_collinear_parameters_are_told():
    time, inputs, y = product_response(gain=9.0, rate=0.8)
    y = y + 0.01 * np.random.default_rng(0).standard_normal(y.size)
    result = fit_grey_box(Product, time, inputs, {"y": y}, ["a", "b", "rate"])
    assert result.warnings == ["this record does not determine a, b separately"]
    assert result.values["a"] * result.values["b"] == pytest.approx(9.0, rel=1e-2)
    assert result.estimates["a"].interval == result.estimates["b"].interval == (0.0, np.inf)
    low, high = result.estimates["rate"].interval
    assert low < 0.8 < high < 1.05 * low


def test_undetermined_and_collinear_parameters_are_told_apart():
    time, inputs = stimulus(60.0, 0.1)
    inputs["current"] = np.full(time.size, 0.5)
    inputs["force"] = np.full(time.size, 2.0)
    measured = {"displacement": EmulatedRig(TRUTH).run(time, **inputs)["displacement"]}
    # under a constant load its own spring and the start of the flow are one and the same offset
    result = fit_grey_box(
        PpyActuator, time, inputs, measured, ["k1", "maxwell_elongation_start", "k2"], TRUE
    )
    assert (
        "this record does not determine k1, maxwell_elongation_start separately" in result.warnings
    )
    inputs["force"] = np.zeros(time.size)
    result = fit_grey_box(PpyActuator, time, inputs, measured, ["k1", "alpha"], TRUE)
    assert "this record does not determine k1" in result.warnings


def test_a_parameter_that_the_record_hardly_determines_is_told():
    """60 s of creep under 4 mN: the flow, and the creep spring, drown in 3 um of noise."""
    time, inputs = stimulus(60.0, 0.1)
    inputs["force"] = 4e-3 * inputs["force"]
    measured = {"displacement": EmulatedRig(TRUTH).run(time, **inputs)["displacement"]}
    result = fit_grey_box(PpyActuator, time, inputs, measured, ["alpha", "b1"], TRUE)
    assert any("hardly determines b1" in w or "ended at the limit" in w for w in result.warnings)


def test_a_parameter_within_a_factor_of_two_is_determined():
    time, inputs, y = product_response(gain=9.0, rate=0.8)
    y = y + 60.0 * np.random.default_rng(0).standard_normal(y.size)
    result = fit_grey_box(Product, time, inputs, {"y": y}, ["a"])
    low, high = result.estimates["a"].interval
    assert 2.0 < high / low < 4.0
    assert result.warnings == []


def test_a_parameter_at_the_limit_of_its_range_is_told():
    time, inputs, y = product_response(gain=6.0, rate=0.5, offset=7.0)
    result = fit_grey_box(Product, time, inputs, {"y": y}, ["offset"])
    assert result.values["offset"] == pytest.approx(5.0)
    assert "offset ended at the limit of its range" in result.warnings


def test_a_parameter_of_either_sign_may_change_its_sign():
    time, inputs = stimulus(60.0, 0.1)
    other = RigParameters()
    measured = quiet(other).run(time, **inputs)
    measured["displacement"] -= 2 * 6.8e-5 * quiet_charge(other, time, inputs)
    result = fit_grey_box(PpyActuator, time, inputs, measured, ["alpha"])
    assert result.values["alpha"] == pytest.approx(-6.8e-5, rel=1e-6)
    low, high = result.estimates["alpha"].interval
    assert low <= result.values["alpha"] <= high < 0.0


def quiet_charge(parameters, time, inputs):
    rig = quiet(parameters)
    rig.run(time, **inputs)
    return rig.truth["charge"]


def test_intervals_of_positive_parameters_are_positive_and_those_of_others_symmetric():
    time, inputs = stimulus(20.0, 0.1)
    rig = EmulatedRig(
        TRUTH, voltage_noise=0.4, displacement_noise=3e-4
    )  # so much noise that a plain one would pass 0
    estimates = fit_grey_box(
        PpyActuator, time, inputs, rig.run(time, **inputs), ["C", "R2", "alpha"], TRUE
    ).estimates
    for name in ("C", "R2"):
        low, high = estimates[name].interval
        assert 0.0 < low < estimates[name].value < high
        assert estimates[name].value == pytest.approx(np.sqrt(low * high))
    low, high = estimates["alpha"].interval
    assert estimates["alpha"].value == pytest.approx((low + high) / 2)


def test_a_far_starting_point_leads_to_the_same_optimum():
    time, inputs = stimulus(60.0, 0.1)
    measured = {"voltage": EmulatedRig(TRUTH).run(time, **inputs)["voltage"]}
    near = fit_grey_box(PpyActuator, time, inputs, measured, ELECTRICAL, TRUE)
    far = fit_grey_box(
        PpyActuator, time, inputs, measured, ELECTRICAL, {"R1": 20.0, "R2": 0.3, "C": 40.0}
    )
    assert far.values == pytest.approx(near.values, rel=1e-5)


def test_mistakes_are_told():
    time, inputs = stimulus(20.0, 0.5)
    measured = quiet(TRUTH).run(time, **inputs)
    again = partial(fit_grey_box, PpyActuator, time, inputs)
    with pytest.raises(UserError, match="named twice in R1, C, R1"):
        again(measured, ["R1", "C", "R1"])
    with pytest.raises(UserError, match="no parameter named 'R9'"):
        again(measured, ["R9"])
    with pytest.raises(
        UserError, match=r"fit of R1 cannot start at -1 ohm; allowed is 0 … 1e\+06 ohm"
    ):
        again(measured, ["R1"], {"R1": -1.0})
    with pytest.raises(
        UserError, match="potentiostat is boolean; only real parameters can be fitted"
    ):
        fit_grey_box(
            component("galvanostat"), time, {}, {"current": inputs["current"]}, ["potentiostat"]
        )
    few = {"voltage": np.where(np.arange(time.size) < 2, measured["voltage"], np.nan)}
    with pytest.raises(UserError, match="3 parameters cannot be fitted to 2 measured values"):
        again(few, ELECTRICAL)


def test_a_lag_that_no_sample_shows_where_the_search_starts_is_not_determined():
    """Start the search of a lag where no sample shows it.

    A lag of 4 s seen every 10 s: one of 50 us has left no trace by the next sample; from 2 s it is
    found.
    """
    time = np.arange(0.0, 200.0, 10.0)
    command = np.where(time < 100.0, 1.0, -1.0)
    galvanostat = component("galvanostat")
    measured = {
        "current": CompiledModel(galvanostat)
        .run(time, {"current_command": command}, {"response_time": 4.0})
        .signals["current"]
    }
    again = partial(
        fit_grey_box, galvanostat, time, {"current_command": command}, measured, ["response_time"]
    )
    assert again({"response_time": 5e-5}).intervals["response_time"][1] == np.inf
    assert again({"response_time": 2.0}).values["response_time"] == pytest.approx(4.0, rel=1e-6)


# --- records that nobody here made
# ------------------------------------------------------------------------------------


def test_creep_of_a_melt_agrees_with_least_squares_on_the_solution_on_paper(public_data):
    """Compare with scipy's fit of J(t) F = F (1/k1 + t/b1 + (1 - exp(-k2 t/b2))/k2).

    The fit is 99.75 % in the project's metric, 100 (1 - |y - yhat| / |y - mean(y)|), by least
    squares on the simulation error. With relative weights, 1 / max(|y|, 1e-3), because creep spans
    decades, the same four parameters reach 95 % in the same metric (83 % with a floor of 1e-6):
    they trade the long times, which hold nearly all of the variance, for the short ones.
    """
    signals = {"force": "N", "displacement": "m"}
    mapping = {"stress": "force[N]", "strain": "displacement[m]"}
    record = read_record(
        public_data("creep_polyethylene_cm3.csv"), signals, mapping=mapping, inputs=["force"]
    )
    time, y = record.time, record.signals["displacement"]
    names = ["k1", "b1", "k2", "b2"]
    result = fit_grey_box(
        PpyActuator, time, {"force": record.signals["force"]}, {"displacement": y}, names
    )

    def paper(q):
        k1, b1, k2, b2 = np.exp(q)
        since = time - time[0]
        return 10.0 * (1 / k1 + since / b1 + (1 - np.exp(-k2 / b2 * since)) / k2)

    def misfit(q, floor=np.inf):
        return (paper(q) - y) / (1.0 if floor == np.inf else np.maximum(np.abs(y), floor))

    start = np.log([2e4, 5e4, 2e3, 1e5])
    own = least_squares(misfit, start, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    for name, value in zip(names, np.exp(own.x), strict=True):
        assert result.values[name] == pytest.approx(value, rel=1e-3), name
    assert fit_percent(y, paper(own.x)) == pytest.approx(99.75, abs=0.01)
    assert not whiteness(y - paper(own.x)).is_white  # one creep time is too few for this melt
    relative = least_squares(misfit, start, max_nfev=2000, args=(1e-3,))
    assert fit_percent(y, paper(relative.x)) == pytest.approx(95.05, abs=0.1)
    explanation = (Path(__file__).parents[3] / "docs" / "explanation.md").read_text(
        encoding="utf-8"
    )
    for values in (own.x, relative.x):
        assert f"{fit_percent(y, paper(values)):.2f} %" in explanation


def cell(public_data, age):
    record = read_record(
        public_data(f"supercapacitor_{age}_ageing_5mV_per_s.csv"),
        {"current": "A", "voltage": "V"},
        inputs=["current"],
    )
    return record.time, record.signals["current"], record.signals["voltage"]


def cell_voltage(q, time, current, start):
    """Simulate R2 parallel to R1 and C in series, driven by a held current.

    The step is nearly constant, and taken as exact.
    """
    R1, R2, C = np.exp(q)
    charge, steps = np.empty(time.size), np.diff(time)
    charge[0] = start
    decay, gain = np.exp(-steps / ((R1 + R2) * C)), R2 * C * current[:-1]
    for k in range(steps.size):
        charge[k + 1] = gain[k] + (charge[k] - gain[k]) * decay[k]
    return R1 * (R2 * current - charge / C) / (R1 + R2) + charge / C


@pytest.mark.slow
def test_an_aged_cell_has_more_resistance_and_less_capacitance(public_data):
    """Fit both records on voltage while the measured current drives.

    Own exact discretisation and scipy agree.
    """
    names = ["R1", "R2", "C", "charge_start"]
    found = {}
    for age in ("before", "after"):
        time, current, y = cell(public_data, age)
        result = fit_grey_box(PpyActuator, time, {"current": current}, {"voltage": y}, names)
        assert ["varies slowly" in w for w in result.warnings] == [True]  # one RC branch is too few
        values = found[age] = result.values
        optimum = np.array([*np.log([values[n] for n in names[:3]]), values["charge_start"]])
        residual = partial(
            lambda q, t, i, y: (cell_voltage(q[:3], t, i, q[3]) - y)[::4], t=time, i=current, y=y
        )
        # from a point off the optimum, on every fourth sample: what separates the two is less than
        # the intervals
        own = least_squares(
            residual,
            optimum + np.array([0.1, 0.3, 0.05, 0.02]),
            x_scale=[1, 1, 1, 0.1],
            max_nfev=30,
        )
        assert own.x[:3] == pytest.approx(optimum[:3], abs=0.02)
        assert own.x[3] == pytest.approx(optimum[3], abs=2e-3)
        best = fit_percent(y, cell_voltage(optimum[:3], time, current, optimum[3]))
        assert best > 80.0
        assert not whiteness(y - cell_voltage(optimum[:3], time, current, optimum[3])).is_white
    assert 2.0 < found["after"]["R1"] / found["before"]["R1"] < 4.0
    assert 0.4 < found["after"]["C"] / found["before"]["C"] < 0.7


@pytest.mark.parametrize(("colour", "told"), [(0.0, False), (0.999, True)])
def test_a_slow_residual_is_told(colour, told):
    time = np.arange(0.0, 300.0, 0.1)
    current = square_wave(time, 0.9, 0.2)
    rig = EmulatedRig(RigParameters(), seed=4, noise_colour=colour)
    measured = {"voltage": rig.run(time, current, np.zeros_like(time))["voltage"]}
    result = fit_grey_box(PpyActuator, time, {"current": current}, measured, ["R1", "R2", "C"])
    assert any("varies slowly" in w for w in result.warnings) is told


class Sum(Component):
    """Two inputs, each with a factor; linear, so that least squares is on paper."""

    name = "sum"

    a = Parameter(1.0, "1")
    b = Parameter(1.0, "1")
    u = Input("1")
    v = Input("1")

    @Output("1")
    def y(self):
        """Their sum."""
        return self.a * self.u + self.b * self.v


@pytest.mark.parametrize("alike", [0.0, 0.7, 0.99])
def test_correlations_are_those_of_least_squares(alike):
    rng = np.random.default_rng(5)
    u, other = rng.normal(size=(2, 400))
    v = alike * u + np.sqrt(1.0 - alike**2) * other
    y = 2.0 * u - v + 0.1 * rng.normal(size=400)
    found = fit_grey_box(Sum, np.arange(400.0), {"u": u, "v": v}, {"y": y}, ["a", "b"])
    columns = np.column_stack([u, v])
    exact = np.linalg.inv(columns.T @ columns)
    (value,) = found.correlations.values()
    assert value == pytest.approx(exact[0, 1] / np.sqrt(exact[0, 0] * exact[1, 1]), abs=0.06)
    assert (("a", "b") in found.coupled) is (alike > 0.9)
    assert found.to_dict()["correlations"][0]["between"] == ["a", "b"]


class Gain(Component):
    """Two gains whose ranges end at numbers that the exponential of their logarithm misses."""

    name = "gain"

    low = Parameter(1.0, "1", min=1e-5, max=10.0)
    high = Parameter(1.0, "1", min=1e-5, max=10.0)
    u = Input("1")

    @Output("1")
    def y(self):
        """Of one."""
        return self.low * self.u

    @Output("1")
    def z(self):
        """Of the other."""
        return self.high * self.u


def test_what_ends_at_the_end_of_its_range_is_not_beyond_it():
    """An FMU refuses a value that is beyond by the rounding of a logarithm."""
    assert np.exp(np.log(1e-5)) < 1e-5
    assert np.exp(np.log(10.0)) > 10.0
    time = 0.1 * np.arange(200)
    u, rng = np.sin(time), np.random.default_rng(1)
    measured = {
        "y": 1e-9 * u + 1e-7 * rng.standard_normal(200),
        "z": 1e3 * u + 0.1 * rng.standard_normal(200),
    }
    found = fit_grey_box(Gain, time, {"u": u}, measured, ["low", "high"])
    assert found.values == {"low": 1e-5, "high": 10.0}
