"""Claims: where a model keeps errors of its states, it is judged by predictions of an observer."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm, solve_discrete_are

from orchestration.diagnosis import (
    Found,
    LawModel,
    Record,
    Shape,
    Term,
    diagnose,
    engine,
    subject_of,
)
from orchestration.diagnosis.observer import Linear, growth_of, slowest_decay
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.responses import Drives, respond
from orchestration.diagnosis.runs import Setting
from orchestration.diagnosis.subject import _place
from orchestration.diagnosis.terms import Memory
from orchestration.fmu.model import declared_model_of
from tests.support.control import PLANTS, control_record
from tests.support.control_models import Cart, Upright
from tests.support.oscillator import oscillator_record
from tests.support.oscillator_model import Oscillator

MASS, STEP = 2.0, 0.05
GAIN = np.array([[0.3], [0.8]])


@pytest.fixture(scope="module")
def cart():
    return LawModel(Cart)


@pytest.fixture(scope="module")
def observed_record():
    """A record of a cart with gaps, and an observer of a gain that stays."""
    random = np.random.default_rng(1)
    time = STEP * np.arange(60)
    force = np.repeat(random.normal(0.0, 2.0, 12), 5)
    place = 0.3 * np.sin(2.0 * time) + random.normal(0.0, 0.01, 60)
    place[20:24] = np.nan
    gain = np.repeat(GAIN[np.newaxis], 60, axis=0)
    return Record(time, force[:, None], place[:, None], (False,), "cart", gain=gain)


def _setting(model: LawModel, terms: tuple[Term, ...] = (), values: tuple[float, ...] = ()):
    declared = np.array([float(p.start) for p in model.parameters])
    mass = [i for i, p in enumerate(model.parameters) if p.name == "mass"]
    return Setting(declared, np.array(mass), terms, np.array(values))


def _as_known(record: Record, mass: float, place: float, pull: float = 0.0) -> np.ndarray:
    """Predict places by the closed form of a cart whose acceleration has an offset."""
    state = np.array([place, 0.1])
    predicted = np.empty(len(record.time))
    for k, (force,) in enumerate(record.inputs):
        predicted[k] = state[0]
        error = record.outputs[k, 0] - state[0]
        if np.isfinite(error):
            state = state + GAIN[:, 0] * error
        rate = force / mass + pull
        speed = state[1] + rate * STEP
        state = np.array([state[0] + STEP * state[1] + 0.5 * rate * STEP**2, speed])
    return predicted


def test_an_observer_predicts_by_what_was_measured_before(cart, observed_record):
    run = cart.run(observed_record, _setting(cart), np.array([0.2, 0.1]))
    assert_allclose(run.outputs[:, 0], _as_known(observed_record, MASS, 0.2), rtol=1e-9)


def test_slopes_of_predictions_are_those_of_the_closed_form(cart, observed_record):
    run = cart.run(observed_record, _setting(cart), np.array([0.2, 0.1]), sensitive=True)
    by_mass, by_place = (
        (
            _as_known(observed_record, MASS + m, 0.2 + p)
            - _as_known(observed_record, MASS - m, 0.2 - p)
        )
        / 2e-6
        for m, p in ((1e-6, 0.0), (0.0, 1e-6))
    )
    assert_allclose(run.slopes[:, 0, 0], by_mass, atol=1e-7)
    assert_allclose(run.slopes[:, 0, 1], by_place, atol=1e-7)
    assert abs(run.slopes[-1, 0, 1]) < 1e-3  # the start is forgotten


def test_a_term_acts_on_the_corrected_states(cart, observed_record):
    drag = Term("acceleration", "velocity", Shape.LINEAR, size=1.0, scale=1.0)
    run = cart.run(observed_record, _setting(cart, (drag,), (-0.7,)), np.array([0.2, 0.1]))
    # place, velocity, and a force that stays within a step
    step = expm(STEP * np.array([[0.0, 1.0, 0.0], [0.0, -0.7, 1.0 / MASS], [0.0, 0.0, 0.0]]))
    state = np.array([0.2, 0.1])
    for k, (force,) in enumerate(observed_record.inputs):
        assert_allclose(run.outputs[k, 0], state[0], atol=1e-7)
        error = np.nan_to_num(observed_record.outputs[k, 0] - state[0])
        state = (step @ [*(state + GAIN[:, 0] * error), force])[:2]


def test_responses_of_predictions_are_those_of_the_closed_form(cart, observed_record):
    setting = _setting(cart)
    run = cart.run(observed_record, setting, np.array([0.2, 0.1]))
    part = cart.linearise(observed_record, setting, run)
    one, rows = np.ones((1, 60)), np.array([[cart.laws.index("acceleration")], [0], [0]])
    response = respond(observed_record, part, Drives(one, one, rows), 1)
    pulled = _as_known(observed_record, MASS, 0.2, pull=1.0)
    plain = _as_known(observed_record, MASS, 0.2)
    # gaps have no gain where a diagnosis chooses it
    until = 20
    assert_allclose(response.to_drives[:until, 0, 0], (pulled - plain)[:until], rtol=1e-6)


def _linear(transition: np.ndarray, push: np.ndarray, count: int) -> Linear:
    shown = np.zeros((count, 1, len(transition)))
    shown[:, :, 0] = 1.0
    return Linear(
        np.eye(len(transition)),
        np.repeat(transition[np.newaxis], count - 1, axis=0),
        shown,
        np.repeat(push[np.newaxis], count - 1, axis=0),
        np.ones((count, 1), dtype=bool),
    )


def test_the_gain_becomes_that_of_the_riccati_equation():
    transition = expm(STEP * np.array([[0.0, 1.0], [0.0, 0.0]]))
    push = np.array([[0.5 * STEP**2], [STEP]])
    gains = _linear(transition, push, 800).gains(np.array([0.1]), np.array([[0.5], [2.0]]))
    for share, own in zip((0.5, 2.0), gains, strict=True):
        covariance = solve_discrete_are(
            transition.T, np.array([[1.0], [0.0]]), share**2 * push @ push.T, np.array([[0.01]])
        )
        expected = covariance[:, :1] / (covariance[0, 0] + 0.01)
        assert_allclose(own[-1], expected, rtol=1e-6)


def test_without_disturbances_an_unstable_mode_is_mirrored():
    # its errors fall by 1 / a in each step (Anderson, Moore: Optimal Filtering, section 4.4)
    linear = _linear(np.array([[1.2]]), np.array([[1.0]]), 300)
    (gain,) = linear.gains(np.array([0.1]), np.array([[0.0]]))
    assert_allclose(1.2 * (1.0 - gain[-1, 0, 0]), 1.0 / 1.2, rtol=1e-9)
    assert_allclose(linear.memory(gain), 1.0 / np.log(1.2), rtol=1e-6)
    assert_allclose(linear.growths, [299 * np.log(1.2)])


@pytest.mark.parametrize(("rates", "expected"), [((0.0, -0.5), 2.0), ((0.0, 0.0), 0.0)])
def test_the_slowest_decay_is_that_of_no_integrator(rates, expected):
    """Over 100 s an integrator and a mode of a time constant of 2 s."""
    linear = _linear(np.diag(np.exp(0.1 * np.array(rates))), np.ones((2, 1)), 1001)
    place = SimpleNamespace(
        records=[SimpleNamespace(time=np.linspace(0.0, 100.0, 1001))],
        courses=list,
        linear=lambda courses: [linear],
    )
    assert slowest_decay(place) == pytest.approx(expected)


def test_without_disturbances_an_integrator_runs_freely_in_the_end():
    (gain,) = _linear(np.eye(1), np.ones((1, 1)), 2000).gains(np.ones(1), np.zeros((1, 1)))
    assert gain[-1, 0, 0] < 1e-3


def test_an_output_that_is_not_measured_corrects_nothing():
    linear = _linear(np.eye(1), np.ones((1, 1)), 30)
    linear.measured[10:12] = False
    (gain,) = linear.gains(np.ones(1), np.ones((1, 1)))
    assert not gain[10:12].any()
    assert gain[12:].all()


def test_gains_of_two_outputs_with_gaps_are_those_of_the_information_filter():
    """Its information adds up, and needs no inverse of a covariance of outputs."""
    rng = np.random.default_rng(0)
    transitions, shown = rng.normal(size=(39, 3, 3)), rng.normal(size=(40, 2, 3))
    pushes, measured = rng.normal(size=(39, 3, 2)), rng.random((40, 2)) > 0.3
    shares, noise = np.array([0.5, 2.0]), np.array([0.1, 0.7])
    (gains,) = Linear(np.eye(3), transitions, shown, pushes, measured).gains(noise, shares[None])
    covariance = np.eye(3)
    for k in range(40):
        precision = np.diag(np.where(measured[k], noise**-2, 0.0))
        seen = np.linalg.inv(np.linalg.inv(covariance) + shown[k].T @ precision @ shown[k])
        assert_allclose(gains[k], seen @ shown[k].T @ precision, rtol=1e-6, atol=1e-9)
        if k < 39:
            moved = transitions[k] @ seen @ transitions[k].T
            covariance = moved + (pushes[k] * shares**2) @ pushes[k].T


def _kernel_record(name: str, hidden: str = "", seed: int = 1) -> Record:
    record = control_record(name, hidden, seed, samples=400)
    signals = [column[:, None] for column in record.signals.values()]
    return Record(record.time, *signals, (False,), name)


def test_a_model_that_forgets_its_states_runs_freely():
    record = oscillator_record(1, samples=200)
    columns = [record.signals[name][:, None] for name in ("force", "position")]
    subject = subject_of(LawModel(Oscillator), [Record(record.time, *columns, (False,), "o")])
    assert subject.observer is None
    assert all(one.gain is None for one in subject.problem.records)
    assert growth_of(_place(subject.problem, subject.left_out, subject.base)) < -1.0


def test_a_model_that_runs_away_with_a_memory_is_linearised_where_it_starts():
    """The rates of the oscillator grow by 1e9 of a lag of its position."""
    record = oscillator_record(1, samples=200)
    columns = [record.signals[name][:, None] for name in ("force", "position")]
    subject = subject_of(LawModel(Oscillator), [Record(record.time, *columns, (False,), "o")])
    lag = Term("spring_force", "elongation", Shape.LINEAR, Memory.LAG, (0.1,))
    far = replace(subject.base.point, values=np.array([-1e9, np.log(0.1)]))
    fitted = replace(subject.base, terms=(lag,), point=far)
    place = _place(subject.problem, subject.left_out, fitted)
    assert place.runs([one.gain for one in place.records]) is None
    assert growth_of(place) > 0.0


def test_an_unstable_plant_is_predicted_within_its_noise():
    subject = subject_of(LawModel(Upright), [_kernel_record("upright")])
    # the unstable pole is at 2.8 1/s, which an observer mirrors at the slowest
    assert 0.0 < subject.observer.memory < 1.0 / 2.5
    noise = 2e-3 / subject.problem.spread[0]
    assert subject.base.misfit < 1.3 * noise
    assert subject.judge(subject.base).left_out < 1.3 * noise


@pytest.fixture
def without_search(monkeypatch):
    """Fit the model as it is, and nothing else."""
    monkeypatch.setattr(
        engine, "search", lambda subject, *_, **__: Found(subject, subject.judge(subject.base))
    )


@pytest.mark.usefixtures("without_search")
def test_a_drift_is_no_error_of_the_model_and_a_note_says_so():
    diagnosis = diagnose([control_record("cart", seed=31)], declared_model_of(Cart))
    assert diagnosis.verdict in ("consistent", "recalibrate")
    ((code, subject, text),) = diagnosis.notes
    assert (code, subject) == ("predictions", "cart")
    memory = f"{diagnosis.observer.memory:.2g} s"
    assert memory in text
    assert memory in wording.error_meaning(diagnosis)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTS)
def test_nothing_is_missing_in_a_clean_record(name):
    record = control_record(name, seed=32)
    diagnosis = diagnose([record], declared_model_of(PLANTS[name].cls))
    assert diagnosis.verdict in ("consistent", "recalibrate")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "hidden", "first"),
    [
        ("upright", "dry", r"friction\(velocity\)|gravity\(angle\)"),
        ("upright", "cubic", r"gravity\(angle\)"),
        ("upright", "offset", r"acceleration\(\)|reading_offset\(torque\)"),
        ("cart", "dry", r"acceleration\(velocity\)"),
        ("cart", "cubic", r"acceleration\(place\)"),
        ("cart", "offset", r"acceleration\(\)|reading_offset\(force\)"),
        ("tank", "cubic", r"(level|flow)_rate\(level\)"),
        ("tank", "offset", r"(level|flow)_rate\(\)|reading_offset\(command\)"),
    ],
)
def test_what_is_hidden_is_first(name, hidden, first):
    record = control_record(name, hidden, seed=32)
    diagnosis = diagnose([record], declared_model_of(PLANTS[name].cls))
    assert re.fullmatch(first, diagnosis.causes[0].name)
