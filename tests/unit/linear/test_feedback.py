"""A sampled controller around a linear plant, against scipy's solution of the same loop."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import UserError
from fmus.kit.registry import DesignedController
from orchestration.linear import ControllerDesign, LinearModel, sampled_plant
from orchestration.linear.discretisation import Matrices
from orchestration.linear.operating_point import OperatingPoint

GAIN, LAG, PERIOD = 2.0, 0.7, 0.05


def lag(gain=GAIN, time=LAG, through=0.0, period=0.0, variations=()):
    """The plant gain / (time s + 1) + through, held over `period` if it is sampled."""
    A, B = np.array([[-1.0 / time]]), np.array([[gain / time]])
    if period:
        decay = np.exp(-period / time)
        A, B = np.array([[decay]]), np.array([[gain * (1.0 - decay)]])
    matrices = Matrices(A, B, np.ones((1, 1)), np.array([[through]]), period, ("x",))
    point = OperatingPoint(0.0, {}, {"u": 0.0}, {"x": 0.0}, {}, {"y": 0.0})
    units = {"u": "V", "y": "m"}
    return LinearModel("m", matrices, ("u",), ("y",), units, point, "paper", variations=variations)


def designed(plant, limits=(-np.inf, np.inf), gain=1.5, integral=0.6):
    low, high = np.clip(limits, -1e12, 1e12)
    arguments = {
        "name": "controller",
        "measured": "m",
        "command": "V",
        "sample_period": PERIOD,
        "proportional_gain": gain,
        "integral_time": integral,
        "tracking_time": integral,
        "command_min": float(low),
        "command_max": float(high),
    }
    made = DesignedController(
        "fmus.controllers.tuning:pid",
        arguments,
        {"measured": "y"},
        limits=("command_min", "command_max"),
    )
    return ControllerDesign(made, plant, limits)


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.05, 0.13])
@pytest.mark.parametrize("through", [0.0, 0.4])
def test_a_sampled_plant_answers_as_the_delayed_plant_does(delay, through):
    """Samples just before each update, of a staircase that begins at zero."""
    steps = np.random.default_rng(1).standard_normal(12)
    plant = sampled_plant(lag(through=through), PERIOD, delay).matrices
    x, found = np.zeros(len(plant.A)), []
    for step in steps:
        found.append(float(plant.C[0] @ x))
        x = plant.A @ x + plant.B[:, 0] * step
    changes = np.diff(steps, prepend=0.0)
    begins = PERIOD * np.arange(len(steps)) + delay
    for k, value in enumerate(found):
        since = PERIOD * k - begins
        begun = since > 1e-9
        answer = GAIN * (1.0 - np.exp(-since[begun] / LAG)) + through
        assert value == pytest.approx(float(changes[begun] @ answer), abs=1e-12)


def test_a_plant_that_is_sampled_faster_is_the_same_plant():
    slow = sampled_plant(lag(), PERIOD, 0.02).matrices
    fast = sampled_plant(lag(period=0.01), PERIOD, 0.02).matrices
    np.testing.assert_allclose(fast.A, slow.A, atol=1e-14)
    np.testing.assert_allclose(fast.B, slow.B, atol=1e-14)
    for period, delay, name in ((0.015, 0.0, "sample period"), (0.05, 0.025, "delay")):
        with pytest.raises(UserError, match=f"every 0.01 s: the {name} of the controller"):
            sampled_plant(lag(period=0.01), period, delay)


def test_a_delay_of_more_samples_than_can_be_computed_is_refused():
    assert len(sampled_plant(lag(), 0.01, 0.5).matrices.states) == 51
    with pytest.raises(
        UserError, match=r"a delay of 1e\+09 s: from 0 to 50 sample periods, 0.01 s"
    ):
        sampled_plant(lag(), 0.01, 1e9)


def simulated(reference, load, limits, delay, count, gain=1.5, integral=0.6):
    """The loop by scipy between samples, and the PI with back-calculation as its README has it."""
    x, command, unlimited, error_before = 0.0, 0.0, 0.0, 0.0
    measured, commands = [], []
    for _ in range(count):
        measured.append(x)
        error = reference - x
        applied = float(np.clip(unlimited, *limits))
        share = PERIOD / integral
        base = applied + (1.0 - share) * (unlimited - applied)
        unlimited = base + gain * ((1.0 + share) * error - error_before)
        error_before = error
        before, command = command, float(np.clip(unlimited, *limits))
        commands.append(command)
        for duration, driving in ((delay, before), (PERIOD - delay, command)):
            if duration:
                loaded = driving + (load if commands[1:] or driving is command else 0.0)
                rate = lambda t, y, u=loaded: (GAIN * u - y) / LAG  # noqa: E731
                end = solve_ivp(rate, (0.0, duration), [x], rtol=1e-11, atol=1e-13)
                x = float(end.y[0, -1])
    return np.array(measured), np.array(commands)


@pytest.mark.parametrize("delay", [0.0, 0.03])
@pytest.mark.parametrize(
    ("reference", "load", "limits"), [(1.0, 0.0, (-0.8, 0.8)), (0.0, 0.5, (-0.3, 2.0))]
)
def test_steps_within_limits_are_those_of_scipy(reference, load, limits, delay):
    design = designed(sampled_plant(lag(), PERIOD, delay), limits)
    found = design.step(reference, load)
    measured, command = simulated(reference, load, limits, delay, 120)
    np.testing.assert_allclose(found.measured[:120], measured, atol=1e-9)
    np.testing.assert_allclose(found.command[:120], command, atol=1e-9)
    assert found.command.min() >= limits[0]
    assert found.command.max() <= limits[1]
    assert (np.isin(found.command, limits)).any(), "a limit acts"


@pytest.mark.parametrize("limits", [(-np.inf, np.inf), (0.0, 1.0), (-1.0, 0.0)])
def test_loop_and_sensitivities_are_their_closed_forms(limits):
    """Also where the command rests at a limit, such as a heater that is off."""
    design = designed(sampled_plant(lag(), PERIOD, 0.0), limits)
    frequencies = np.geomspace(1e-3, 9.0, 50)
    z = np.exp(2j * np.pi * frequencies * PERIOD)
    decay = np.exp(-PERIOD / LAG)
    law = 1.5 * (1.0 + PERIOD / 0.6 / (1.0 - 1.0 / z))
    loop = law * GAIN * (1.0 - decay) / (z - decay)
    np.testing.assert_allclose(design.loop.response(frequencies), loop, rtol=1e-9)
    both = design.loop.sensitivities(frequencies)
    np.testing.assert_allclose(both, [1.0 / (1.0 + loop), loop / (1.0 + loop)], rtol=1e-9)
    assert design.peaks()[0] >= np.abs(both[0]).max() * (1.0 - 1e-3)


def test_the_band_tells_which_loops_are_unstable():
    plants = tuple(lag(gain) for gain in (1.0, 2.0, 30.0))
    design = designed(sampled_plant(lag(variations=plants), PERIOD, 0.1))
    poles = [np.abs(one.closed_poles()).max() for one in design.loop.variations]
    assert [pole < 1.0 for pole in poles] == [True, True, False]
    words = list(design.overview())[2]
    assert words.startswith("over 3 values of parameters: phase margin")
    assert words.endswith("1 of these loops are unstable")
    band = design.to_dict()["band"]
    assert [one["stable"] for one in band] == [True, True, False]
    assert band[1]["margins"]["phase"] == pytest.approx(design.margins().phase)


def test_the_picture_has_the_band_of_every_response_and_the_limits():
    plants = tuple(lag(gain) for gain in (1.5, 2.5))
    design = designed(sampled_plant(lag(variations=plants), PERIOD, 0.0), (-1.0, 1.0))
    axes = design.draw().axes
    assert len(axes) == 6
    assert all(axis.collections for axis in axes), "each has a band"
    limits = {tuple(line.get_ydata()) for line in axes[3].lines[1:]}
    assert {(1.0, 1.0), (-1.0, -1.0)} <= limits
    low, high = axes[1].collections[0].get_datalim(axes[1].transData).intervaly
    final = design.step(design.step_size).measured
    assert low <= final.min()
    assert final.max() <= high
