"""Iterative learning against python-control, its convergence in closed form, and its limits."""

import itertools

import control
import numpy as np
import pytest
from scipy.linalg import expm

from fmus.controllers.learning_controller import LearningController
from fmus.kit import stack
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.displacement_loop import drive, worst
from tests.support.sampled import run

SAMPLES = LearningController.samples
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
PERIOD = 0.25
DECAY = np.exp(-PERIOD / ((R1 + R2) * C))
# the sampled actuator: displacement (1 - a) K / (z - a) of the current
STATIC = ALPHA * R2 * C


def polynomial(powers):
    """Coefficients from those by powers of 1/z, in z."""
    order = max(powers)
    return [powers.get(k, 0.0) for k in range(order + 1)]


@pytest.mark.parametrize("lead", [0, 1, 5, 8])
@pytest.mark.parametrize("smoothing", [0.0, 0.2])
@pytest.mark.parametrize("recentring", [0.0, 0.7])
def test_it_is_its_discrete_transfer_function(lead, smoothing, recentring):
    """u = z^-N Q(z) (u + z^m l) - r M(z) (u + l), where l = G (1 + T_l (1 - 1/z)/h) e,
    Q(z) = q z + 1 - 2 q + q/z, and M(z) is the mean of 1/z to z^-N.
    """
    gain, time, count = 700.0, 2.0, 6 * SAMPLES
    errors = 1e-6 * np.random.default_rng(lead).standard_normal(count)
    model = LearningController(
        learning_gain=gain,
        learning_time=time,
        lead=lead,
        smoothing=smoothing,
        recentring=recentring,
        current_limit=1e3,
    )
    found = run(model, {"reference": errors}, count)["command"]
    taps = {-1: smoothing, 0: 1.0 - 2.0 * smoothing, 1: smoothing}
    rate = time / PERIOD
    learns, repeats = {}, {0: 1.0}
    for shift, share in taps.items():
        repeats[SAMPLES + shift] = -share
        for delay, factor in ((0, gain * (1.0 + rate)), (1, -gain * rate)):
            power = SAMPLES - lead + shift + delay
            learns[power] = learns.get(power, 0.0) + share * factor
    for age in range(1, SAMPLES + 1):
        mean = recentring / SAMPLES
        repeats[age] = repeats.get(age, 0.0) + mean
        for power, factor in ((age, gain * (1.0 + rate)), (age + 1, -gain * rate)):
            learns[power] = learns.get(power, 0.0) - mean * factor
    order = max(max(learns), max(repeats))
    numerator = np.pad(polynomial(learns), (0, order - max(learns)))
    denominator = np.pad(polynomial(repeats), (0, order - max(repeats)))
    discrete = control.tf(numerator, denominator, PERIOD)
    expected = control.forced_response(discrete, PERIOD * np.arange(count), errors).outputs
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def wave(cycles, size=3e-5):
    """Displacement that begins at rest."""
    time = np.arange(cycles * SAMPLES) / SAMPLES
    return size * (1.0 - np.cos(2.0 * np.pi * time)) / 2.0


def rms_by_cycle(found, references):
    """Error of each cycle."""
    errors = (references - found["displacement"]).reshape(-1, SAMPLES)
    return np.sqrt(np.mean(errors**2, axis=1))


@pytest.mark.parametrize("share", [0.3, 0.5, 1.0])
def test_with_the_inverse_of_the_actuator_errors_shrink_by_what_is_left_of_them(share):
    """e(k) = (1 - share) e(k - N), sample by sample."""
    model = LearningController(
        learning_gain=share / STATIC,
        learning_time=PERIOD * DECAY / (1.0 - DECAY),
        lead=1,
        smoothing=0.0,
    )
    references = wave(6)
    found = drive(model, PpyActuator(), references)
    errors = (references - found["displacement"]).reshape(-1, SAMPLES)
    # the first lesson is there after a period less the lead
    for before, after in itertools.pairwise(errors[1:]):
        assert after == pytest.approx((1.0 - share) * before, abs=1e-7 * 3e-5)


@pytest.mark.parametrize(
    "hidden",
    [
        ("strain_lag", 0.5),
        ("strain_saturation", 0.16),
        pytest.param(("diffusion", 0.6), marks=pytest.mark.slow),
    ],
)
def test_it_learns_what_the_model_does_not_know(hidden):
    name, value = hidden
    effect = EFFECTS[name]
    plant = stack(PpyActuator, effect)(**{effect.neutral: value})
    references = wave(16)
    cycles = rms_by_cycle(drive(LearningController(), plant, references), references)
    assert cycles[-1] < 0.1 * cycles[0]
    assert np.all(np.diff(cycles[1:]) < 0.02 * cycles[0]), "it does not grow on the way"


def test_without_learning_it_repeats_itself():
    model = LearningController(smoothing=0.0)
    run(model, {"reference": wave(3)}, 3 * SAMPLES)
    given = {"learning": False, "reference": 1e-5}
    # what was not repeated yet of the lessons before comes within a period
    run(model, given, SAMPLES)
    again = run(model, given, 2 * SAMPLES)["command"].reshape(2, SAMPLES)
    np.testing.assert_array_equal(*again)
    assert np.ptp(again) > 0.0


def test_an_error_that_stays_does_not_wind_up():
    """A minute and more beyond reach, then the limit's command is unlearnt in as many periods as a
    lesson of it takes, not in the periods that it was there.
    """
    model = LearningController(learning_time=0.0, smoothing=0.0, learning_gain=1e4)
    found = run(model, {"reference": 1e-3}, 20 * SAMPLES)["command"]
    assert found.max() == 1.3
    # an error of -65 um asks for -0.65 A: two periods back to zero
    after = run(model, {"reference": -6.5e-5}, 4 * SAMPLES)["command"].reshape(4, SAMPLES)
    assert after[3].max() < 0.0
    assert worst({"command": after}, "command") <= 1.3


def test_the_feedback_beside_is_added_within_the_limit():
    model = LearningController()
    model.feedback_command = 0.4
    assert model.command() == 0.4
    model.feedback_command = 4.0
    assert model.command() == 1.3


@pytest.mark.parametrize("stages", [1, 2])
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.5, 1.0, 2.0])
def test_the_defaults_converge_for_films_that_lag(stages, lag):
    """|Q (1 - L P)| < 1, P by partial fractions of the circuit's pole and that of each stage."""
    model = LearningController()
    z = np.exp(1j * np.linspace(1e-4, np.pi, 300))
    rate = 1.0 / ((R1 + R2) * C)
    A = np.diag([-rate] + [-stages / max(lag, 1e-3)] * stages)
    for k in range(stages):
        A[k + 1, k] = -A[k + 1, k + 1]
    joined = np.zeros((stages + 2, stages + 2))
    joined[:-1, :-1], joined[0, -1] = A, ALPHA * R2 / (R1 + R2)
    flow = expm(joined * PERIOD)
    state, drive = flow[:-1, :-1], flow[:-1, -1]
    one = np.eye(stages + 1)
    plant = np.array([np.linalg.solve(point * one - state, drive)[-1] for point in z])
    change = model.learning_time * (1.0 - 1.0 / z) / PERIOD
    lesson = model.learning_gain * (1.0 + change) * z**model.lead
    smooth = 1.0 - 2.0 * model.smoothing + model.smoothing * (z + 1.0 / z)
    assert np.abs(smooth * (1.0 - lesson * plant)).max() < 0.985
