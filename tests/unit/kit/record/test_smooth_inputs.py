"""Claims: a smooth input that bends between samples is simulated as it bends; lines stay lines."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import lsim, sawtooth

from fmus.kit import stack
from fmus.kit.record.smooth_inputs import is_curved, with_knots
from fmus.kit.sensors import transport_delay
from fmus.ppy_actuator.model import PpyActuator
from orchestration.identify.fitting.delay import DelayedModel
from orchestration.identify.fitting.simulation_input import SimulationInput
from tests.support.intersample_records import TRUE, circuit

REST = {"charge_start": 0.0, "kelvin_elongation_start": 0.0, "maxwell_elongation_start": 0.0}


def sine(time):
    return np.sin(2.0 * np.pi * 0.8 * time)


def triangle(time):
    return sawtooth(2.0 * np.pi * time / 8.0 + 0.3, 0.5)


def simulated(shape, rate, cls=PpyActuator, linear=("current",), **more):
    """Return the voltage under a current known at samples, and SciPy's under the true one."""
    time = np.arange(round(60.0 * rate) + 1) / rate
    model = DelayedModel(cls, ["R1"], linear)
    inputs = {"current": shape(time), "force": np.zeros(time.size)}
    values = {p.name: p.start for p in cls.layout.parameters} | REST | TRUE | more
    ran = model.run(SimulationInput(time, inputs, values))
    fine = np.linspace(0.0, time[-1], 50 * (time.size - 1) + 1)
    _, truth, _ = lsim(circuit(), np.column_stack([shape(fine), np.zeros(fine.size)]), fine)
    return time, ran, fine, truth[:, 0]


@pytest.mark.parametrize(("rate", "within"), [(20.0, 2e-5), (10.0, 3e-4), (5.0, 5e-3)])
def test_a_sine_is_simulated_as_a_sine(rate, within):
    """Straight lines miss a twelfth of the curvature: 0.5 % at 20 Hz and 8 % at 5 Hz."""
    _, ran, _, truth = simulated(sine, rate)
    assert np.abs(ran.signals["voltage"] - truth[::50]).max() < within * np.ptp(truth)
    assert len(ran.sensitivities["voltage"]) == len(ran.signals["voltage"])


def test_what_is_integrated_is_the_area_of_the_spline():
    time = (np.arange(200) + np.random.default_rng(1).uniform(-0.3, 0.3, 200)) / 10.0
    clock, fed, at = with_knots(time, {"u": sine(time), "held": time}, ["u"])
    assert np.array_equal(clock[at], time)
    assert np.array_equal(fed["held"][1::2], time[:-1])
    pieces = np.diff(clock) * (fed["u"][1:] + fed["u"][:-1]) / 2.0
    spline = CubicSpline(time, sine(time))
    areas = [float(spline.integrate(a, b)) for a, b in pairwise(time)]
    assert pieces[::2] + pieces[1::2] == pytest.approx(areas, rel=1e-9, abs=1e-12)


def test_kinks_stay_kinks():
    """Ramps turn at samples and between them; only there a straight line is wrong."""
    time = np.arange(1000) / 10.0
    assert not is_curved(time, triangle(time))
    assert with_knots(time, {"u": triangle(time)}, True)[0] is time


@pytest.mark.parametrize("noise", [1e-4, 1e-2])
def test_noise_is_no_curve(noise):
    random = np.random.default_rng(2)
    time = np.arange(1000) / 10.0
    assert not is_curved(time, triangle(time) + noise * random.standard_normal(1000))
    assert not is_curved(time, noise * random.standard_normal(1000))
    assert is_curved(time, sine(time) + noise * random.standard_normal(1000))


def test_what_moved_for_a_while_counts():
    time = np.arange(1000) / 10.0
    assert is_curved(time, np.where(time < 20.0, sine(time), 0.0))
    assert not is_curved(time, np.zeros(1000))
    assert not is_curved(time[:4], np.arange(4.0))


def test_a_delayed_output_is_of_the_same_course():
    """The voltage of 0.13 s ago, between two samples of a current that bends there."""
    late = transport_delay(PpyActuator, "voltage")
    time, ran, fine, truth = simulated(sine, 10.0, stack(PpyActuator, late), **{late.neutral: 0.13})
    then = np.interp(time - 0.13, fine, truth)
    assert np.abs(ran.signals["voltage"] - then)[2:].max() < 5e-3 * np.ptp(truth)


def test_nothing_changes_what_is_held():
    time = np.arange(600) / 10.0
    inputs = {"current": sine(time), "force": np.zeros(600)}
    start = {p.name: p.start for p in PpyActuator.layout.parameters} | REST | TRUE
    held = (
        DelayedModel(PpyActuator, []).run(SimulationInput(time, inputs, start)).signals["voltage"]
    )

    def rates(_, charge, current):
        return (TRUE["R2"] * current - charge / TRUE["C"]) / (TRUE["R1"] + TRUE["R2"])

    charge = [0.0]
    for k in range(20):
        ran = solve_ivp(
            rates, (0.0, 0.1), [charge[-1]], args=(inputs["current"][k],), rtol=1e-10, atol=1e-13
        )
        charge.append(ran.y[0, -1])
    both, c = TRUE["R1"] + TRUE["R2"], np.array(charge[:20])
    expected = TRUE["R2"] / both * (TRUE["R1"] * inputs["current"][:20] + c / TRUE["C"])
    assert held[:20] == pytest.approx(expected, rel=1e-6, abs=1e-9)
