"""Claims: the subspace method finds the system, and its noise model predicts.

Delays and feedthrough are kept.
"""

import time

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from orchestration.identify.black_box import box_jenkins, input_output_data, state_space
from tests.support.black_box import box_jenkins_record, fit

A = np.array([[0.9, 0.2, 0.0], [-0.2, 0.85, 0.1], [0.0, 0.0, 0.6]])


B = np.array([[0.5, 0.0], [0.1, 0.4], [1.0, -0.3]])


C = np.array([1.0, 0.0, 0.5])


D = np.array([0.0, 0.2])


Q, R = 0.02 * np.eye(3), 0.05


def run(seed, samples=3000, noise=1.0):
    """Step the equations with noise on states and output.

    Return inputs, output and the output without noise.
    """
    random = np.random.default_rng(seed)
    u = random.standard_normal((samples, 2))
    x, clean, y, truth = np.zeros(3), np.zeros(3), [], []
    for now in u:
        y.append(C @ x + D @ now + noise * np.sqrt(R) * random.standard_normal())
        truth.append(C @ clean + D @ now)
        x = A @ x + B @ now + noise * np.sqrt(0.02) * random.standard_normal(3)
        clean = A @ clean + B @ now
    return u, np.array(y), np.array(truth)


def test_without_noise_it_is_the_system_itself():
    u, y, _ = run(0, 500, 0.0)
    model = state_space(input_output_data(u, y, 1.0), 3, [1, 0]).model
    ours, true = (np.sort_complex(np.linalg.eigvals(a)) for a in (model.a, A))
    assert ours == pytest.approx(true, abs=1e-6)
    assert model.d == pytest.approx(D, abs=1e-6)
    assert fit(y, model.simulate(u, y)) > 99.999
    markov = [C @ np.linalg.matrix_power(A, k) @ B for k in range(10)]
    assert np.array(
        [model.c @ np.linalg.matrix_power(model.a, k) @ model.b for k in range(10)]
    ) == pytest.approx(np.array(markov), abs=1e-5)


def test_in_noise_it_predicts_as_the_kalman_filter_of_the_truth():
    """Whose error has the variance C P C' + R, with P of the Riccati equation."""
    p = solve_discrete_are(A.T, C[:, np.newaxis], Q, np.array([[R]]))
    least = float(C @ p @ C + R)
    gain = A @ p @ C / least
    for seed in range(3):
        u, y, truth = run(seed)
        result = state_space(input_output_data(u, y, 1.0), 3, [1, 0])
        assert result.model.noise_variance == pytest.approx(least, rel=0.06)
        assert fit(truth, result.model.simulate(u)) > 94.0
        true = [1.0, *(C @ np.linalg.matrix_power(A, k) @ gain for k in range(8))]
        assert result.model.noise_response(9) == pytest.approx(np.array(true), abs=0.15)


@pytest.mark.slow
def test_it_is_near_what_the_data_allow():
    """Use as many states as the innovations form of a Box-Jenkins system, paths and noise."""
    fits = []
    for seed in range(5):
        record = box_jenkins_record(seed, offset=0.0)
        data = input_output_data(record.inputs, record.output, 1.0)
        found, best = state_space(data, 4, [1, 2]), box_jenkins(data, [2, 2], [2, 1], 1, 1, [1, 2])
        fits.append(fit(record.truth, found.model.simulate(record.inputs)))
        assert found.loss < 1.1 * best.loss
    assert np.median(fits) > 98.0


@pytest.mark.parametrize("delays", [[1, 1], [3, 1], [1, 4], [2, 2]])
def test_delayed_inputs_act_as_late_as_they_should(delays):
    u, _, truth = run(1, 1000, 0.0)
    late = truth * 0.0
    for i, delay in enumerate(delays):
        only = np.zeros_like(u)
        only[:, i] = u[:, i]
        x = np.zeros(3)
        alone = []
        for now in only:
            alone.append(C @ x)
            x = A @ x + B @ now
        late += np.r_[np.zeros(delay - 1), alone[: len(alone) - delay + 1]]
    model = state_space(input_output_data(u, late, 1.0), 3, delays).model
    assert fit(late, model.simulate(u, late)) > 99.9
    for i, delay in enumerate(delays):
        impulse = np.zeros((8, 2))
        impulse[0, i] = 1.0
        answer = model.simulate(impulse + model.input_offsets) - model.output_offset
        assert np.abs(answer[:delay]).max() < 1e-9 < abs(answer[delay])


def test_it_stays_stable_in_much_noise():
    for seed in range(5):
        u, _, _ = run(seed, 400)
        walk = np.cumsum(np.random.default_rng(seed).standard_normal(400))
        assert state_space(input_output_data(u, walk, 1.0), 4).model.is_stable()


@pytest.mark.slow
def test_a_hundred_thousand_samples_take_seconds():
    record = box_jenkins_record(3, 100_000)
    started = time.process_time()
    result = state_space(input_output_data(record.inputs, record.output, 1.0), 4, [1, 2])
    assert time.process_time() - started < 30.0
    assert fit(record.truth, result.model.simulate(record.inputs)) > 99.0
