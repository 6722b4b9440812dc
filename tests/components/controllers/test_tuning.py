"""The tuning of a PID against closed forms: the margins asked for, and the law of the thesis."""

import control
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from fmus.controllers.tuning import pid, tuned_pi, tuned_pid
from fmus.kit import UserError
from fmus.kit.registry import DesignRequest, DesignSignal
from tests.support.sampled import run

PERIOD = 0.02


def drawn_plant(seed):
    """Gain, two lags and a whole number of late samples; (A, B, C) of both lags in a row."""
    random = np.random.default_rng(seed)
    gain = random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-6.0, 3.0)
    first, second = 10.0 ** random.uniform([-0.5, -1.5], [1.0, -0.5])
    late = int(random.integers(0, 4))
    return gain, first, second, late


def closed_form(gain, first, second, late, z):
    """Response of a held command, by partial fractions: (1 - 1/z) Z{P(s)/s} z^-late."""
    a, b = np.exp(-PERIOD / first), np.exp(-PERIOD / second)
    share = first / (first - second)
    one = share * (1.0 - a) / (z - a)
    other = (1.0 - share) * (1.0 - b) / (z - b)
    return gain * (one + other) * z**-late


def sampled(gain, first, second, late):
    """The same plant as matrices, by the matrix exponential of a chain of two lags."""
    A = np.array([[-1.0 / first, 0.0], [1.0 / second, -1.0 / second]])
    joined = np.zeros((3, 3))
    joined[:2, :2], joined[0, 2] = A, gain / first
    flow = expm(joined * PERIOD)
    plant = control.ss(flow[:2, :2], flow[:2, 2:], [[0.0, 1.0]], 0, PERIOD)
    for _ in range(late):
        plant = control.ss(0, 1, 1, 0, PERIOD) * plant
    return plant


def law(parameters, z):
    """The PID by backward differences, s = (1 - 1/z) / h, as its README has it."""
    s = (1.0 - 1.0 / z) / PERIOD
    derivative = parameters["derivative_time"] * s / (parameters["filter_time"] * s + 1.0)
    integral = 1.0 / (parameters["integral_time"] * s)
    return parameters["proportional_gain"] * (1.0 + integral + derivative)


def phase_margin(parameters, plant):
    """Least phase margin in degrees and its crossover in Hz, on a fine grid and by roots."""

    def loop(frequency):
        z = np.exp(2j * np.pi * frequency * PERIOD)
        return law(parameters, z) * closed_form(*plant, z)

    def size(frequency):
        return np.log(abs(loop(frequency)))

    grid = np.geomspace(1e-5, 0.5 / PERIOD, 20_000)
    signs = np.sign(size(grid))
    places = [brentq(size, grid[k], grid[k + 1]) for k in np.flatnonzero(np.diff(signs))]
    return min((np.degrees(np.angle(-loop(place))), place) for place in places)


def request(plant, margin=60.0, crossover=None, limits=(-np.inf, np.inf), at_rest=(0.0, 0.0)):
    measured, command = DesignSignal("y", "m", at_rest[0]), DesignSignal("u", "A", at_rest[1])
    return DesignRequest(plant, measured, command, limits, margin, crossover, lambda *_: None)


@pytest.mark.parametrize("rule", [tuned_pid, tuned_pi])
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 50), marks=pytest.mark.slow)])
def test_drawn_plants_have_the_margin_that_was_asked_for(rule, seeds):
    for seed in seeds:
        plant = drawn_plant(seed)
        margin = np.random.default_rng(1000 + seed).uniform(40.0, 70.0)
        designed = rule(request(sampled(*plant), margin))
        found, _ = phase_margin(designed.arguments, plant)
        assert found == pytest.approx(margin, abs=1.0), seed


def test_a_crossover_that_is_asked_for_is_that_of_the_loop():
    plant = (2e-5, 3.0, 0.2, 1)
    designed = tuned_pid(request(sampled(*plant), 55.0, 0.6))
    assert phase_margin(designed.arguments, plant) == pytest.approx((55.0, 0.6), abs=1e-6)
    assert designed.arguments["derivative_time"] == designed.arguments["integral_time"] / 4.0


@pytest.mark.slow
def test_without_a_crossover_no_slower_loop_has_a_larger_integral_gain():
    plant = (1.0, 2.0, 0.3, 2)
    best = tuned_pi(request(sampled(*plant))).arguments
    strength = best["proportional_gain"] / best["integral_time"]
    for crossover in np.geomspace(0.01, 0.5, 20):
        try:
            other = tuned_pi(request(sampled(*plant), 60.0, crossover)).arguments
        except UserError:
            continue
        assert other["proportional_gain"] / other["integral_time"] <= 1.01 * strength


def battery():
    """Voltage of a cell under a load current: a resistance, and slow relaxation in a sum of lags.

    The phase of such a plant hardly turns, so that a PI has a margin of 60 degrees only where its
    integral hardly acts.
    """
    flow = control.tf([-0.02], [60.0, 1.0]) + control.tf([-1e-4], [1.0, 0.0])
    sampled_flow = control.sample_system(control.ss(flow), 1.0, "zoh")
    return sampled_flow + control.ss([], [], [], -0.03, 1.0) * control.ss(0, 1, 1, 0, 1.0)


@pytest.mark.slow
def test_without_a_margin_none_that_is_tried_has_a_larger_integral_gain():
    def strength(margin):
        made = tuned_pi(request(battery(), margin)).arguments
        return abs(made["proportional_gain"]) / made["integral_time"]

    chosen = strength(None)
    assert all(chosen > 0.9 * strength(margin) for margin in (60.0, 75.0, 95.0))
    assert chosen > 2.0 * strength(60.0)


@pytest.mark.parametrize("gain", [1.0, -1.0])
@pytest.mark.parametrize("integrators", [0, 1, 2])
def test_a_turn_that_is_refused_is_that_of_a_plant_of_either_sign(gain, integrators):
    """Fifteen samples late, 162 degrees at 0.03 Hz, and 95.4 for each integral of a held value."""
    late = control.ss(np.eye(15, k=-1), np.eye(15)[:, :1], np.eye(15)[-1:], 0, 1.0)
    plant = gain * late
    for _ in range(integrators):
        plant = plant * control.ss(1, 1, 1, 0, 1.0)
    turn = 60.0 - 180.0 + 162.0 + 95.4 * integrators
    with pytest.raises(UserError, match=f"by {(turn + 180.0) % 360.0 - 180.0:.3g} degrees"):
        tuned_pi(request(plant, 60.0, 0.03))


def test_the_loop_of_the_thesis_gives_the_law_of_the_thesis():
    """117.4 degrees at 4.21 Hz with the coil by Tustin's rule, 3.9 N/A: V = V + 0.66 E - 0.06 E."""
    rate, resistance, inductance = 30.0, 8.7, 0.0028
    coil = control.tf([3.9], [inductance, resistance])
    tustin = control.sample_system(control.ss(coil), 1.0 / rate, "bilinear")
    z = np.exp(2j * np.pi * 4.21 / rate)
    loop = (0.66 - 0.06 / z) / (1.0 - 1.0 / z) * tustin(z)
    margin, gain = np.degrees(np.angle(-loop)), abs(loop)
    scaled = control.ss(tustin.A, tustin.B, tustin.C / gain, tustin.D / gain, 1.0 / rate)
    found = tuned_pi(request(scaled, margin, 4.21)).arguments
    first = found["proportional_gain"] * (1.0 + 1.0 / rate / found["integral_time"])
    assert (first, found["proportional_gain"]) == pytest.approx((0.66, 0.06), rel=1e-6)


def test_it_has_the_units_of_its_signals():
    made = pid("level", "m", "degC", proportional_gain=2.0)
    units = {v.name: v.unit for v in made.layout.variables}
    assert (units["reference"], units["measured"], units["command"]) == ("m", "m", "degC")
    assert units["proportional_gain"] == "K/m"
    assert pid("same", "N", "N").layout.parameters[1].unit == "1"
    assert pid("lever", "N*m", "A").layout.parameters[1].unit == "A/(N*m)"


@pytest.mark.parametrize("crossover", [0.2, None])
def test_the_class_is_that_of_its_source_and_starts_where_the_loop_rests(crossover):
    plant = sampled(1.0, 2.0, 0.3, 0)
    designed = tuned_pid(request(plant, 60.0, crossover, (0.5, 2.0), (0.3, 0.7)))
    scope = {}
    exec(designed.source, scope)
    made = scope["Controller"]
    rest = run(made(), {"reference": 0.3, "measured": 0.3}, 5)
    np.testing.assert_array_equal(rest["command"], 0.7)
    beyond = run(made(), {"reference": [0.3, 50.0, 50.0, -50.0, -50.0], "measured": 0.3}, 5)
    assert (beyond["command"].max(), beyond["command"].min()) == (2.0, 0.5)


@pytest.mark.parametrize(
    ("margin", "crossover", "words"),
    [
        (60.0, 25.0, "below half the sampling rate, 25 Hz"),
        (60.0, -1.0, "above 0"),
        (60.0, 1.0, "would have to turn the phase by"),
        (175.0, None, "no crossover up to 5 Hz gives"),
    ],
)
def test_what_no_controller_does_is_refused(margin, crossover, words):
    with pytest.raises(UserError, match=words):
        tuned_pid(request(sampled(1.0, 1.0, 0.3, 5), margin, crossover))
