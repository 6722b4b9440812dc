"""Claims: a stiff component and its sensitivities are followed accurately, in few steps.

Oracle: SciPy's LSODA at rtol 1e-11 on the equations written anew here, with their variational
equations.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, sin, stack
from fmus.kit.build import record_model_sources
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.record.library import RecordLibrary
from fmus.kit.sensors import sensor_lag
from fmus.kit.symbolic import trace
from tests.support.pace import slow_but
from tests.support.stiff_drive import STEP, Drive, Nonlinear, ladder_of

NOMINAL = {"current": 1.0, "position": 0.1, "velocity": 1.0}
SIZE = {
    "R": 3.0,
    "L": 1e-3,
    "K": 4.0,
    "m": 0.3,
    "b": 1.5,
    "k": 20.0,
    "hardening": 300.0,
    "stop": 100.0,
}
HARD, STOPPED = {"hardening": 900.0, "stop": 0.0}, {"hardening": 300.0, "stop": 250.0}
SHORT = {"L": 1e-4}  # 1500 time constants in a sample: exponential steps are worth while


def voltage_at(samples):
    """Return a staircase (V), one value for a sample."""
    return np.repeat([0.5, 2.0, -1.0, 1.5, 0.3], math.ceil(samples / 5))[:samples]


@cache
def oracle(given, time, linear, method="LSODA", rtol=1e-11):
    """States (n, 3) and their derivatives (n, 3, 8) by a stiff solver, from sample to sample."""
    at = SIZE | {"hardening": 0.0, "stop": 0.0, "edge": 0.1} | dict(given)
    voltage, names = voltage_at(len(time)), list(SIZE)

    def flow(t, both, u, slope, since):
        v = u + slope * (t - since)
        i, x, w = both[:3]
        R, L, K, m, b, k, h, s = (at[n] for n in names)
        over = max(x - at["edge"], 0.0)
        beyond = float(over > 0.0)
        force = K * i - b * w - k * x - h * x**3 - s * over
        f = np.array([(v - R * i - K * w) / L, w, force / m])
        J = np.array(
            [[-R / L, 0, -K / L], [0, 0, 1], [K / m, -(k + 3 * h * x**2 + s * beyond) / m, -b / m]]
        )
        by = np.zeros((3, 8))
        by[0, :3] = -i / L, -f[0] / L, -w / L
        by[2, 2:] = i / m, -f[2] / m, -w / m, -x / m, -(x**3) / m, -over / m
        return np.concatenate([f, (J @ both[3:].reshape(3, 8) + by).ravel()])

    found = [np.zeros(27)]
    for n in range(len(time) - 1):
        h = time[n + 1] - time[n]
        slope = (voltage[n + 1] - voltage[n]) / h if linear else 0.0
        solved = solve_ivp(
            flow,
            (time[n], time[n + 1]),
            found[-1],
            method,
            rtol=rtol,
            atol=1e-3 * rtol,
            args=(voltage[n], slope, time[n]),
        )
        found.append(solved.y[:, -1])
    all_of_them = np.array(found)
    return all_of_them[:, :3], all_of_them[:, 3:].reshape(-1, 3, 8)


def followed(cls, values, time, linear=False, tolerance=3e-8):
    """Hold a component against the oracle, relative to the size of every signal."""
    states, slopes = oracle(tuple(values.items()), tuple(time.tolist()), linear)
    names = list(SIZE)[: 6 if cls is Drive else 8]
    ran = CompiledModel(cls, names).run(time, {"voltage": voltage_at(len(time))}, values, linear)
    for k, name in enumerate(("current", "position", "velocity")):
        error = np.abs(ran.signals[name] - states[:, k]).max() / np.abs(states[:, k]).max()
        assert error < tolerance, (name, error)
        for i, parameter in enumerate(names):
            exact, declared = slopes[:, k, i], NOMINAL[name] / SIZE[parameter]
            error = np.abs(ran.sensitivities[name][:, i] - exact).max() / (
                np.abs(exact).max() + declared
            )
            assert error < tolerance, (name, parameter, error)


@pytest.mark.parametrize("linear", slow_but([False, True], True))
@pytest.mark.parametrize(
    ("cls", "values", "samples"),
    [
        (Drive, {}, 40),
        (Nonlinear, HARD, 40),
        (Nonlinear, STOPPED, 40),
        (Nonlinear, HARD | SHORT, 10),
    ],
    ids=["linear", "hardening", "stop", "stiffer"],
)
def test_a_stiff_component_and_its_sensitivities_follow_a_stiff_solver(
    cls, values, samples, linear
):
    followed(cls, values, STEP * np.arange(samples), linear)


@pytest.mark.slow
@pytest.mark.parametrize(
    "given", [HARD, STOPPED, HARD | SHORT], ids=["hardening", "stop", "stiffer"]
)
def test_another_stiff_solver_has_the_same_solution(given):
    asked = tuple(given.items()), tuple((STEP * np.arange(10)).tolist()), False
    for found, radau in zip(oracle(*asked), oracle(*asked, "Radau", 1e-10), strict=True):
        assert (np.abs(found - radau).max(0) <= 1e-9 * np.abs(radau).max(0) + 1e-12).all()


@pytest.mark.parametrize("linear", slow_but([False, True], False))
def test_uneven_samples_are_followed_too(linear):
    time = np.cumsum(np.random.default_rng(4).choice([0.03, 0.05, 0.0713, 0.2], 10))
    followed(Nonlinear, HARD | SHORT, time, linear)


def test_what_is_linear_takes_one_step_a_sample_however_stiff():
    time = STEP * np.arange(400)
    model, voltage = CompiledModel(Drive), {"voltage": voltage_at(400)}
    for L in (1e-3, 1e-6, 1e-9):
        model.run(time, voltage, {"L": L}, effort=2.0)
    # beside what is linear the stop and the hardening are slow
    CompiledModel(Nonlinear).run(time, voltage, STOPPED | {"L": 1e-6}, effort=4.0)


@pytest.mark.parametrize("decimals", [12, 9], ids=["even", "rounded"])
@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
def test_a_long_record_of_what_is_linear_is_exact_though_it_is_not_stiff(decimals, linear):
    """First order, 600 samples a second: one exponential for each interval of the clock."""
    a, count = 2.0, 2400
    time = np.round(np.arange(count) / 600.0, decimals)
    u = np.cumsum(np.random.default_rng(6).normal(size=count))
    ran = CompiledModel(Sensed, ["a"]).run(time, {"u": u}, {"a": a}, linear, effort=1.01)
    x, by_a = np.zeros(count), np.zeros(count)
    for k, h in enumerate(np.diff(time)):
        decay, slope = math.exp(-a * h), (u[k + 1] - u[k]) / h if linear else 0.0
        # x' = a (u - x) with u = u_k + slope s: x settles to u - slope / a
        rest = x[k] - u[k] + slope / a
        x[k + 1] = u[k] + slope * h - slope / a + rest * decay
        by_a[k + 1] = slope / a**2 * (1.0 - decay) + by_a[k] * decay - h * rest * decay
    np.testing.assert_allclose(ran.signals["x"], x, atol=3e-11 * np.ptp(x))
    np.testing.assert_allclose(ran.sensitivities["x"][:, 0], by_a, atol=3e-10 * np.ptp(by_a))


class Followed(Component):
    """A fast lag behind a level that is set at sample instants."""

    name = "followed"

    a = Parameter(400.0, "1/s", min=1e-6)
    gain = Parameter(0.6, "1")
    reference = Input("1", start=1.0)
    x = State("1", rate="x_rate", start=0.2, output=True)
    level = Discrete("1", update="next_level", period=0.3)

    def x_rate(self):
        return self.a * (self.level - self.x)

    def next_level(self):
        return self.level + self.gain * (self.reference - self.x)


def test_sample_instants_between_samples_are_exact():
    """The level follows the settled state: a geometric series, and its derivative by the gain."""
    time = 0.2 * np.arange(31)
    ran = CompiledModel(Followed, ["gain"]).run(time, {})
    # an instant that falls on a sample is not seen there yet; 40 time constants after the latest
    # nothing is left
    updates = np.ceil(time / 0.3 - 1e-9)[1:]
    first = 0.6 * (1.0 - 0.2)  # level after the first update, when the state was still 0.2
    exact = 1.0 - (1.0 - first) * 0.4 ** (updates - 1.0)
    by_gain = 0.8 * 0.4 ** (updates - 1.0) + (1.0 - first) * (updates - 1.0) * 0.4 ** (
        updates - 2.0
    )
    np.testing.assert_allclose(ran.signals["x"][1:], exact, rtol=1e-9)
    np.testing.assert_allclose(ran.sensitivities["x"][1:, 0], by_gain, rtol=1e-7, atol=1e-9)


class Shaken(Nonlinear):
    """The same on a floor that shakes many times within a sample."""

    name = "shaken"

    def velocity_rate(self):
        return super().velocity_rate() + 1e3 * sin(3e3 * self.time)


def test_steps_that_are_not_worth_while_are_left_to_runge_and_kutta():
    """A remainder that oscillates within a sample needs more steps than Runge and Kutta's cost."""
    time = 2.0 * STEP * np.arange(10)
    ladder = ladder_of(time, Shaken)
    library = RecordLibrary.from_sources(Shaken.layout, record_model_sources(trace(Shaken)))
    parameters = np.array([float(p.start) for p in Shaken.layout.parameters])

    def steps(worth):
        _, _, count = library.simulate(
            time,
            np.ones((10, 1)),
            np.zeros(1),
            parameters,
            tolerance=1e-8,
            effort=1e6,
            ladder=replace(ladder, worth=worth),
        )
        return count

    by_runge_kutta = steps(0.0) - 1.0  # one exponential step is tried
    tried = math.floor(ladder.worth * time[-1]) + 1
    assert abs(steps(ladder.worth) - by_runge_kutta) <= tried
    assert abs(steps(math.inf) - by_runge_kutta) > tried


class Hastened(Component):
    """A decay that is hastened at sample instants, from the first on, before the first step."""

    name = "hastened"

    period = Parameter(1.0, "s", min=1e-6)
    x = State("1", rate="x_rate", start=1.0, output=True)
    speed = Discrete("1/s", start=50.0, update="next_speed", period="period")

    def x_rate(self):
        return -self.speed * self.x

    def next_speed(self):
        return 0.5 * self.speed


@pytest.mark.parametrize(
    ("period", "steps"), [(0.4, 60.0), (1e9, 2.0)], ids=["again and again", "once"]
)
def test_a_rate_that_is_set_at_sample_instants_is_followed(period, steps):
    """Exponentials, one after the other; set only at the start, it takes one step a sample."""
    time = 0.1 * np.arange(21)
    found = CompiledModel(Hastened).run(time, {}, {"period": period}, effort=steps).signals["x"]
    instants = np.arange(0.0, 2.0, period)
    spent = np.clip(time[:, None] - instants, 0.0, period)  # s, at every speed
    exact = np.exp(-(spent * 50.0 * 0.5 ** np.arange(1, len(instants) + 1)).sum(1))
    np.testing.assert_allclose(found, exact, atol=3e-8)


class Sensed(Component):
    """A first-order response and a feedthrough."""

    name = "sensed"

    a = Parameter(2.0, "1/s", min=1e-6)
    u = Input("V")
    x = State("V", rate="x_rate")

    def x_rate(self):
        return self.a * (self.u - self.x)

    @Output("V")
    def y(self):
        """Return the measured state."""
        return 0.5 * self.u + self.x


def test_a_sensor_that_lags_far_less_than_a_sample_takes_one_step():
    """Its equilibrium is known at the first sample; then it is linear: a matrix exponential."""
    lag, m, step = 0.004, 0.01, 0.1
    time, u = step * np.arange(200), np.random.default_rng(5).normal(size=200)
    cls = stack(Sensed, sensor_lag(Sensed, "y"))
    found = CompiledModel(cls, ["a", "y_lag_time"]).run(
        time, {"u": u}, {"y_lag_time": lag}, effort=2.0
    )

    def measured(a, lag):
        tau, states, values = lag + m * math.exp(-lag / m), np.array([0.0, 0.5 * u[0]]), []
        A = np.array([[-a, 0.0, a], [1.0 / tau, -1.0 / tau, 0.5 / tau], [0.0, 0.0, 0.0]])
        over = expm(step * A)
        for held in u:
            y = 0.5 * held + states[0]
            values.append(y - lag * (y - states[1]) / tau)
            states = (over @ [*states, held])[:2]
        return np.array(values)

    np.testing.assert_allclose(found.signals["y"], measured(2.0, lag), atol=1e-11)
    for k, (by_a, by_lag) in enumerate(((1e-5, 0.0), (0.0, 1e-7))):
        ends = [measured(2.0 + sign * by_a, lag + sign * by_lag) for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * (by_a + by_lag))
        np.testing.assert_allclose(
            found.sensitivities["y"][:, k], slope, atol=1e-6 * np.abs(slope).max()
        )


@pytest.mark.parametrize("n", [1, 2, 5, 8, 9, 12])
def test_components_of_any_number_of_states_are_stiff(n):
    """Of up to eight, sums of products are compiled for that number. Lags one after the other."""
    members = {"a": Parameter(300.0, "1/s", min=1e-6), "u": Input("1", start=1.0)}
    for k in range(n):
        members[f"x{k}"] = State("1", rate=f"rate{k}", start=0.1 * k)
        before = f"x{k - 1}" if k else "u"
        members[f"rate{k}"] = lambda self, k=k, before=before: (
            (k + 1) * self.a * (getattr(self, before) - getattr(self, f"x{k}"))
        )
    lags = type("Lags", (Component,), {"name": "lags", "__doc__": "Lags.", **members})
    matrix = np.diag(-300.0 * np.arange(1.0, n + 1)) + np.diag(300.0 * np.arange(2.0, n + 1), -1)
    start = 0.1 * np.arange(n) - 1.0  # from the equilibrium
    time = 0.01 * np.arange(40)
    both = np.zeros((2 * n, 2 * n))  # the states, and their derivatives by a
    both[:n, :n] = both[n:, n:] = matrix
    both[n:, :n] = matrix / 300.0
    exact = np.array([expm(both * t) @ np.concatenate([start, 0.0 * start]) for t in time])
    ran = CompiledModel(lags, ["a"]).run(time, {})
    for k in range(n):
        assert ran.signals[f"x{k}"] == pytest.approx(1.0 + exact[:, k], abs=1e-8)
        found = ran.sensitivities[f"x{k}"][:, 0]
        assert found == pytest.approx(exact[:, n + k], abs=1e-9)
