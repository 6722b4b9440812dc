"""Work loops that are tracked: modes of the controllers, and currents planned on a model."""

import numpy as np
import pytest

from demonstrations.work_loops import (
    MODES,
    ellipse,
    endurance,
    forecast,
    inputs,
    planned_current,
    track,
)
from fmus import component, effects
from fmus.kit import UserError, stack
from fmus.kit.record import CompiledModel
from orchestration.experiment.execution import run
from orchestration.experiment.reading import read
from orchestration.experiment.work_loop import tracked_loops
from orchestration.system import library

LOOP = ellipse()
ACTUATOR = component("ppy_actuator")


@pytest.fixture(scope="module")
def tracked():
    """The nominal actuator in every mode, by mode."""
    system = library.system("work_loop")
    return {mode: track(system, LOOP, mode, cycles=3) for mode in MODES}


def errors(tracked):
    """Error of each cycle."""
    return np.array([cycle.error for cycle in tracked.cycles()])


@pytest.mark.slow
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
    loop = ellipse(charge_amplitude=-4e-5)  # within reach in all but the first second
    time, current = planned_current(model, loop, cycles=3, parameters=hidden)
    inputs = {"current": current, "force": loop.force_at(time)}
    reached = CompiledModel(model).run(time, inputs, hidden).signals["displacement"]
    error = loop.length_at(time) - reached
    assert np.abs(current).max() <= 1.3
    assert np.abs(error[40:]).max() < 1e-7


def test_planned_current_of_the_nominal_model_is_that_of_its_closed_form():
    """Charge x / alpha, and eq. 3.5 for a current that is held: i = (Q_next - a Q) / b."""
    loop = ellipse(mean_force=0.0, force_amplitude=0.0)
    time, current = planned_current(ACTUATOR, loop, cycles=3)
    decay = np.exp(-0.25 / (2.78 * 2.70))
    charge = loop.length_at(time) / 6.8e-5
    expected = (charge[1:] - decay * charge[:-1]) / (2.35 * 2.70 * (1.0 - decay))
    np.testing.assert_allclose(current[:-1], expected, rtol=0, atol=1e-6)


def test_a_planned_current_keeps_the_voltage_within_its_limit_between_samples_too():
    """A loop that is far beyond reach, with effects that the circuit has nothing to do with."""
    known = effects("ppy_actuator")
    model = stack(ACTUATOR, known["strain_lag"], known["strain_saturation"])
    hidden = {"lag_time": 0.8, known["strain_saturation"].neutral: 0.16}
    loop = ellipse(charge_amplitude=-4e-4)
    time, current = planned_current(model, loop, cycles=2, parameters=hidden, current_limit=9.0)
    fine = 0.01 * np.arange(2000)
    held = current[np.searchsorted(time, fine + 1e-9, side="right") - 1]
    run = CompiledModel(model).run(fine, {"current": held, "force": 0.0 * fine}, hidden)
    assert 0.98 < np.abs(run.signals["voltage"]).max() <= 1.0 + 1e-9


def test_cycles_that_limits_allow_are_those_of_the_creep_in_closed_form():
    """Q = (r - F/k1 - k - m) / alpha, with k and m of eq. 3.5 under a load of 0.5 N + cosine."""
    w, T, cycles = 0.2 * np.pi, 200.0, 40
    t = 0.01 * np.arange(cycles * 1000)
    flow = (0.5 * t + 0.4 * np.sin(w * t) / w) / 1.7e6
    swing = 0.4 * (np.cos(w * t) + w * T * np.sin(w * t) - np.exp(-t / T)) / (1.0 + (w * T) ** 2)
    kelvin = (0.5 * (1.0 - np.exp(-t / T)) + swing) / 1e4
    charge = (-7e-5 * np.sin(w * t) - kelvin - flow) / 6.8e-5
    rate = np.gradient(charge, t)
    voltage = 0.43 * rate + charge / 2.70
    needed = {"charge": charge, "voltage": voltage, "current": rate + voltage / 2.35}
    limits = {"charge": 1.7, "voltage": 0.7, "current": 1.0, "displacement": 7e-3}
    found = endurance(ACTUATOR, LOOP, cycles, limits=limits)
    for name, values in needed.items():
        peaks = np.abs(values).reshape(cycles, -1).max(axis=1)
        assert found[name] == np.argmax(peaks > limits[name]), name
    assert list(found.values()) == sorted(found.values()), "the one that binds is first"
    assert found["displacement"] == np.inf


def test_about_the_rest_length_the_creep_ends_at_the_limit_of_the_displacement():
    """All of the Kelvin element and 0.5 N / b1 are left beside the loop's 0.0794 + 0.0945 mm."""
    found = endurance(ACTUATOR, LOOP, recentred=True)
    reach = 7e-3 - 0.5 / 1e4 - (0.5 / 6300.0 + np.hypot(0.4 / 6300.0, 7e-5))
    assert found["displacement"] == pytest.approx(reach / (0.5 / 1.7e6) / 10.0, abs=1.0)
    assert {found[name] for name in ("charge", "voltage", "current")} == {np.inf}


def test_films_that_saturate_allow_fewer_cycles():
    known = effects("ppy_actuator")
    model = stack(ACTUATOR, known["strain_saturation"])
    hidden = {"strain_saturation_coefficient": 0.25}
    assert endurance(model, LOOP, 20, hidden)["charge"] < endurance(ACTUATOR, LOOP, 20)["charge"]


@pytest.mark.slow
def test_an_experiment_is_forecast_from_its_own_stimuli_and_parameters():
    settings = ["actuator.strain_saturation_coefficient=0", "actuator.b1=1.2e6"]
    experiment = read("work_loop", settings).model_copy(update={"variants": {}})
    found = forecast(experiment, "work_loop")
    of_films = endurance(ACTUATOR, LOOP, parameters={"b1": 1.2e6})
    assert found["held"] == of_films
    with pytest.raises(UserError, match="fig_5_9: cycles are those of a system with a work loop"):
        forecast(read("fig_5_9", []), "fig_5_9")


def test_errors_of_users_are_a_line():
    system = library.system("work_loop")
    with pytest.raises(UserError, match=r"no mode named 'learn' \(did you mean learning\?\)"):
        track(system, LOOP, "learn")
    for name, value in {"cycles": 0, "current_limit": -1.0, "voltage_limit": np.nan}.items():
        with pytest.raises(UserError, match=f"{name} = {value:g}: must be above 0"):
            planned_current(ACTUATOR, LOOP, **{name: value})
    with pytest.raises(
        UserError, match="pid: no actuator, as it has no parameter C, R1, R2, alpha"
    ):
        planned_current(component("pid"), LOOP)


@pytest.fixture(scope="module")
def made():
    """Three cycles of the experiment ``work_loop``."""
    return run(read("work_loop", ["duration=30s"]))


def test_the_experiment_drives_what_the_loop_and_its_modes_drive(made):
    wanted = inputs(LOOP, made.time.values, 0.25)
    for name, values in wanted.items():
        np.testing.assert_allclose(made[name].values, values, rtol=0, atol=1e-5 * np.ptp(values))
    experiment = read("work_loop")
    assert experiment.variants == {mode: MODES[mode] for mode in experiment.variants}
    of_systems = ["bare", "feedback", "feedforward", "both", "learning", "recentred"]
    assert list(experiment.variants) == of_systems


@pytest.mark.slow
def test_the_experiment_runs_each_variant_as_the_modes_do(made):
    hidden = {"actuator.lag_time": 1.0, "actuator.strain_saturation_coefficient": 0.16}
    system = library.system("work_loop").given(hidden)
    table = read("work_loop").work_loop
    for mode, loop in tracked_loops(made, table).items():
        np.testing.assert_allclose(errors(loop), errors(track(system, LOOP, mode, 3)), rtol=1e-3)
