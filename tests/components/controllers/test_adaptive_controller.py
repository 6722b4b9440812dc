"""Adaptive control: the nominal loop against python-control, the limit of stability on both of its
sides, and actuators other than the nominal one.
"""

import control
import numpy as np
import pytest

from fmus.controllers.adaptive_controller import AdaptiveController
from fmus.ppy_actuator.model import PpyActuator
from tests.support.displacement_loop import drive, worst
from tests.support.sampled import run

PERIOD = 0.02
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
DECAY = np.exp(-PERIOD / ((R1 + R2) * C))
PER_CURRENT = ALPHA * R2 * C * (1.0 - DECAY)
MODEL = np.exp(-PERIOD / 1.0)
STEP = 5e-5


def test_the_defaults_are_the_sampled_actuator():
    model = AdaptiveController()
    assert model.decay == pytest.approx(DECAY, rel=1e-12)
    assert model.displacement_per_current == pytest.approx(PER_CURRENT, rel=1e-10)


def test_the_nominal_actuator_follows_the_model():
    references = 2e-5 * np.random.default_rng(1).standard_normal(500).cumsum() / 10.0
    found = drive(AdaptiveController(), PpyActuator(), references)
    model = control.tf([1.0 - MODEL], [1.0, -MODEL], PERIOD)
    expected = control.forced_response(model, PERIOD * np.arange(500), references).outputs
    assert worst(found, "current") < 1.3
    np.testing.assert_allclose(
        found["displacement"], expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )


def test_without_adaptation_it_is_a_static_law_of_two_inputs():
    reference, displacement = 1e-5 * np.random.default_rng(2).standard_normal((2, 300))
    model = AdaptiveController(adaptation_gain=0.0, gain_start=0.7, current_limit=1e3)
    found = run(model, {"reference": reference, "displacement": displacement}, 300)["command"]
    law = control.ss([], [], [], [[1.0 - MODEL, MODEL - DECAY]], PERIOD)
    time = PERIOD * np.arange(300)
    answered = control.forced_response(law, time, [reference, displacement]).outputs[0]
    expected = 0.7 / PER_CURRENT * answered
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def sensitivity_at_rest(step):
    """Return the sensitivity in the steady state of a constant reference."""
    return (1.0 - DECAY) / (1.0 - MODEL) * step


@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.3])
@pytest.mark.parametrize(("product", "stable"), [(0.9, True), (1.1, False)])
def test_the_limit_of_stability_is_where_the_readme_says(ratio, product, stable):
    """About the equilibrium the loop is (z - 1)(z - p) + g k (1 - p) s^2 / (d^2 + s^2)."""
    sensitivity = sensitivity_at_rest(STEP)
    share = sensitivity**2 / (1e-6**2 + sensitivity**2)
    gain = product / (ratio * share)
    moving = gain * ratio * (1.0 - MODEL) * share
    poles = np.roots([1.0, -(1.0 + MODEL), MODEL + moving])
    assert (np.abs(poles).max() < 1.0) == stable
    # the same of the controller itself, a little off its equilibrium
    controller = AdaptiveController(
        adaptation_gain=gain,
        gain_start=(1.0 + 1e-4) / ratio,
        sensitivity_start=sensitivity,
        model_displacement_start=STEP,
        current_limit=1e3,
    )
    plant = PpyActuator(alpha=ALPHA * ratio, charge_start=STEP / (ALPHA * ratio))
    found = drive(controller, plant, np.full(6000, STEP))
    errors = np.abs(found["displacement"] - STEP)
    begun, ended = errors[:200].max(), errors[-200:].max()
    assert begun > 0.0
    assert (ended < 0.01 * begun) if stable else (ended > 10.0 * begun)


@pytest.mark.parametrize("ratio", [0.7, 1.3])
def test_sines_are_tracked_by_an_actuator_other_than_the_nominal_one(ratio):
    """As Bowers tracks them: a tenth of a hertz, the coupling 30 % off."""
    time = PERIOD * np.arange(10_000)
    references = 3e-5 * np.sin(0.2 * np.pi * time)
    model = control.tf([1.0 - MODEL], [1.0, -MODEL], PERIOD)
    expected = control.forced_response(model, time, references).outputs

    def error(adaptation):
        plant = PpyActuator(alpha=ALPHA * ratio)
        controller = AdaptiveController(adaptation_gain=adaptation)
        found = drive(controller, plant, references)["displacement"]
        return np.std((found - expected)[-2000:]), controller.gain

    (fixed, _), (adapted, gain) = error(0.0), error(0.02)
    assert adapted < 0.05 * fixed
    assert gain == pytest.approx(1.0 / ratio, rel=0.03)


def test_the_gain_stays_at_the_limit_of_the_current_and_within_its_own():
    found = run(AdaptiveController(), {"reference": 1e-2}, 200)
    assert set(found["command"]) == {1.3}
    model = AdaptiveController(adaptation_gain=5.0, current_limit=1e3)
    run(model, {"reference": 1e-4, "displacement": 1e-3}, 500)
    assert 0.2 <= model.gain <= 5.0
