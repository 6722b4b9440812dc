"""Work loops: figures of cycles in closed form, modes, and currents planned on a model."""

import json

import numpy as np
import pytest

from fmus import component, effects
from fmus.kit import UserError, stack
from fmus.kit.record import CompiledModel
from orchestration.experiment.work_loop import (
    MODES,
    TrackedLoop,
    WorkLoop,
    figures,
    picture,
    planned_current,
    track,
)
from orchestration.system import library

LOOP = WorkLoop.ellipse()
ACTUATOR = component("ppy_actuator")


@pytest.fixture(scope="module")
def tracked():
    """The nominal actuator in every mode, by mode."""
    system = library.system("work_loop")
    return {mode: track(system, LOOP, mode, cycles=3) for mode in MODES}


def errors(tracked):
    """Error of each cycle."""
    return np.array([cycle.error for cycle in tracked.cycles()])


def test_figures_of_an_ellipse_are_those_of_its_formula():
    """Area pi F x, energy of a resistor, and the error of a loop that is too small."""
    time = np.linspace(0.0, 20.0, 4001)
    angle = 0.2 * np.pi * time
    length = (0.5 + 0.4 * np.cos(angle)) / 6300.0 - 5e-5 * np.sin(angle)
    current = 0.3 * np.sin(angle)
    cycles = TrackedLoop(LOOP, time, length, current, 2.0 * current).cycles()
    assert len(cycles) == 2
    for cycle in cycles:
        assert cycle.work == pytest.approx(-np.pi * 0.4 * 5e-5, rel=1e-4)
        assert cycle.error == pytest.approx(2e-5 * np.sqrt(0.5), rel=1e-3)
        assert cycle.electrical_energy == pytest.approx(2.0 * 0.09 / 2.0 * 10.0, rel=1e-5)
        assert (cycle.largest_current, cycle.largest_voltage) == pytest.approx((0.3, 0.6), rel=1e-5)


def test_any_loop_goes_on_round_after_its_last_phase():
    loop = WorkLoop(np.array([0.0, 1.0, 0.0, -1.0]), np.array([0.0, 2.0, 4.0, 2.0]), period=4.0)
    time = np.array([0.0, 0.5, 3.5, 4.0, 5.0])
    np.testing.assert_allclose(loop.force_at(time), [0.0, 0.5, -0.5, 0.0, 1.0])
    np.testing.assert_allclose(loop.length_at(time), [0.0, 1.0, 1.0, 0.0, 2.0])
    ahead = loop.inputs(time, 0.5)
    np.testing.assert_allclose(ahead["next_reference"], loop.length_at(time + 0.5))


def test_without_current_only_the_creep_takes_up_energy(tracked):
    """Dashpots take up the integral of F^2 / b, less than 5 uJ of a load below 0.9 N."""
    for cycle in tracked["bare"].cycles():
        assert cycle.electrical_energy == cycle.largest_current == 0.0
        assert 0.0 < cycle.work < 5e-6


def test_the_modes_of_the_nominal_actuator_in_their_order(tracked):
    """Its feedforward is its inverse, so that hardly anything is left for the others."""
    last = {mode: errors(loop)[-1] for mode, loop in tracked.items()}
    assert last["feedback"] < 0.35 * last["bare"]
    for mode in ("feedforward", "both", "learning", "all"):
        assert last[mode] < 0.005 * last["bare"]
        assert tracked[mode].cycles()[-1].work == pytest.approx(-np.pi * 0.4 * 7e-5, rel=0.005)


def test_no_mode_passes_the_limits(tracked):
    for loop in tracked.values():
        for cycle in loop.cycles():
            assert cycle.largest_current <= 1.3
            assert cycle.largest_voltage <= 1.0


def test_planned_current_is_the_inverse_of_a_model_with_effects():
    known = effects("ppy_actuator")
    model = stack(ACTUATOR, known["strain_lag"], known["strain_saturation"])
    hidden = {"lag_time": 0.8, known["strain_saturation"].neutral: 0.16}
    loop = WorkLoop.ellipse(charge_amplitude=-4e-5)  # within reach in all but the first second
    time, current = planned_current(model, loop, cycles=3, parameters=hidden)
    inputs = {"current": current, "force": loop.force_at(time)}
    run = CompiledModel(model).run(time, inputs, hidden)
    error = loop.length_at(time) - run.signals["displacement"]
    assert np.abs(current).max() <= 1.3
    assert np.abs(error[40:]).max() < 1e-7


def test_planned_current_of_the_nominal_model_is_that_of_its_closed_form():
    """Charge x / alpha, and eq. 3.5 for a current that is held: i = (Q_next - a Q) / b."""
    loop = WorkLoop.ellipse(mean_force=0.0, force_amplitude=0.0)
    time, current = planned_current(ACTUATOR, loop, cycles=3)
    decay = np.exp(-0.25 / (2.78 * 2.70))
    charge = loop.length_at(time) / 6.8e-5
    expected = (charge[1:] - decay * charge[:-1]) / (2.35 * 2.70 * (1.0 - decay))
    np.testing.assert_allclose(current[:-1], expected, rtol=0, atol=1e-6)


def test_figures_are_json_and_the_picture_has_units(tracked):
    told = json.loads(json.dumps(figures(tracked)))
    assert list(told) == list(MODES)
    assert told["bare"][0]["error"] == tracked["bare"].cycles()[0].error
    labels = {axis.get_ylabel().replace("\n", " ") for axis in picture(tracked).axes}
    assert labels == {"force [N]", "error, rms [um]", "work taken up [uJ]", "electrical energy [J]"}


def test_errors_of_users_are_a_line():
    system = library.system("work_loop")
    with pytest.raises(UserError, match=r"no mode named 'learn' \(did you mean learning\?\)"):
        track(system, LOOP, "learn")
    with pytest.raises(UserError, match=r"force has the shape \(2,\), length \(3,\): a value"):
        WorkLoop(np.zeros(2), np.zeros(3))
    with pytest.raises(UserError, match=r"period = 0 s: must be above 0"):
        WorkLoop(np.zeros(2), np.zeros(2), 0.0)
