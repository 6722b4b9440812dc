"""Claims: delays are those of the filters that made the data, and none is seen where none is.

Oracles: scipy's filters, with delays put before them.
"""

import numpy as np
import pytest
from scipy.signal import chirp, lfilter

from orchestration.identify.black_box import input_output_data
from orchestration.identify.black_box.delays import estimate_delays

SAMPLES = 600


def steps(rng, held):
    return np.repeat(rng.normal(size=SAMPLES // held + 1), held)[:SAMPLES]


def response(u, delay, pole):
    return lfilter(np.r_[np.zeros(delay), 1.0 - pole], [1.0, -pole], u)


def made(inputs, output):
    return input_output_data(np.column_stack(inputs), output, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 1, 2, 17])
@pytest.mark.parametrize("remembers", [0.0, 0.9])
def test_a_delay_is_told_in_noise_of_any_colour(delay, remembers):
    """In noise that remembers, differences of the criterion are overrated: to a sample."""
    rng = np.random.default_rng(int(10 * remembers) + delay)
    u = steps(rng, 15)
    noise = lfilter([1.0], [1.0, -remembers], 0.02 * rng.normal(size=SAMPLES))
    data = made([u], response(u, delay, 0.9) + noise)
    (estimate,) = estimate_delays(data, [1, 2])
    assert abs(estimate - delay) <= (remembers > 0.0)


@pytest.mark.slow
def test_each_input_has_a_delay_of_its_own():
    rng = np.random.default_rng(4)
    u, v = steps(rng, 7), steps(rng, 20)
    y = response(u, 9, 0.8) + response(v, 0, 0.95) + 0.02 * rng.normal(size=SAMPLES)
    assert estimate_delays(made([u, v], y), [1]) == (9, 0)


def delays_by_arx(y, inputs, longest=40):
    """The naive way: ARX models of order 3, by turns as well, from one sample of every input."""
    n, first = len(y), longest + 3
    past = [y[first - i : n - i] for i in (1, 2, 3)]
    delays = [1] * len(inputs)
    for i in [*range(len(inputs))] * 3:
        costs = []
        for delay in range(longest + 1):
            delays[i] = delay
            rows = [
                u[first - d - j : n - d - j]
                for u, d in zip(inputs, delays, strict=True)
                for j in range(3)
            ]
            columns = np.column_stack([*past, *rows, np.ones(n - first)])
            costs.append(np.linalg.lstsq(columns, y[first:], rcond=None)[1][0])
        delays[i] = int(np.argmin(costs))
    return tuple(delays)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "seed"), [(2, 44), (2, 46), (3, 45), (3, 47)])
def test_delays_of_several_inputs_are_found_by_turns(count, seed):
    """One input after the other, once, the first input's was drawn off by those to come."""
    rng = np.random.default_rng(seed)
    right = right_by_arx = 0
    for _ in range(3):
        inputs = [steps(rng, int(rng.integers(5, 40))) for _ in range(count)]
        delays = tuple(int(d) for d in rng.integers(0, 31, size=count))
        paths = [
            response(u, d, np.exp(-1.0 / rng.uniform(4.0, 30.0)))
            for u, d in zip(inputs, delays, strict=True)
        ]
        clean = np.sum(paths, axis=0)
        y = clean + 0.04 * clean.std() * rng.normal(size=SAMPLES)
        found = estimate_delays(made(inputs, y), [1])
        by_arx = delays_by_arx(y, inputs)
        print(delays, found, by_arx)
        right += found == delays
        right_by_arx += by_arx == delays
    print(f"{count} inputs: {right} of 3 exact, by ARX {right_by_arx}")
    assert right >= 2
    assert right >= right_by_arx


def test_a_delay_that_was_found_is_the_start_of_a_further_turn():
    rng = np.random.default_rng(1)
    u, v = steps(rng, 4)[:160], steps(rng, 9)[:160]
    y = response(u, 11, 0.8) + 3.0 * response(v, 6, 0.7)
    assert estimate_delays(made([u, v], y), [1]) == (11, 6)


@pytest.mark.slow
def test_a_bump_has_the_delay_of_the_smallest_model_that_follows_it():
    """With the poles of a higher order every delay up to the true one follows a bump alike."""
    u = np.where((np.arange(SAMPLES) > 60) & (np.arange(SAMPLES) < 300), 1.0, 0.0)
    y = response(u, 18, 0.97) + 0.02 * np.random.default_rng(7).normal(size=SAMPLES)
    (estimate,) = estimate_delays(made([u], y), [1, 2, 3])
    assert abs(estimate - 18) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8, 9])
def test_a_delay_is_not_taken_for_a_zero(seed):
    """A zero more stands for a sample of delay less: BIC prefers the model without it."""
    u = np.where((np.arange(SAMPLES) > 80) & (np.arange(SAMPLES) < 300), 1.0, 0.0)
    noise = 0.03 * np.random.default_rng(seed).normal(size=SAMPLES)
    y = response(response(u, 9, 0.975), 0, 0.92) + noise
    assert estimate_delays(made([u], y), [2]) == (9,)


def test_a_record_without_noise_tells_its_delay():
    u = steps(np.random.default_rng(5), 5)[:200]
    assert estimate_delays(made([u], response(u, 6, 0.8)), [1]) == (6,)


@pytest.mark.slow
def test_records_without_more_than_the_usual_delay_are_told_of_none():
    """Models of two poles, drawn: of ten records at most one is given another."""
    others = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        u = steps(rng, int(rng.integers(1, 30)))
        poles = np.exp(-1.0 / np.exp(rng.uniform(1.0, 4.0, size=2)))
        y = response(lfilter([1.0 - poles[0]], [1.0, -poles[0]], u), 1, poles[1])
        others += estimate_delays(made([u], y + 0.05 * rng.normal(size=SAMPLES)), [1, 2, 3]) != (1,)
    assert others <= 1


def delay_by_arx(y, u, longest=60):
    """The naive way: the delay of the ARX model of order 3 with the least squares, none clearly."""
    n, first = len(y), longest + 3
    past = [y[first - i : n - i] for i in (1, 2, 3)]
    costs = []
    for delay in range(longest + 1):
        driven = [u[first - delay - j : n - delay - j] for j in range(3)]
        rows = np.column_stack([*past, *driven, np.ones(n - first)])
        costs.append(np.linalg.lstsq(rows, y[first:], rcond=None)[1][0])
    best = int(np.argmin(costs))
    return best if n * np.log(costs[1] / costs[best]) > 4.0 else 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["telegraph", "chirp"])
def test_delays_of_drawn_records_are_right_more_often_than_those_of_arx(kind):
    rng = np.random.default_rng(881)
    right = right_by_arx = 0
    for i in range(12):
        flips = np.cumsum(rng.random(SAMPLES) < 0.04) % 2
        sweep = chirp(np.arange(SAMPLES), 0.002, SAMPLES, 0.08)
        u = np.where(flips, 1.0, -1.0) if kind == "telegraph" else sweep
        delay = 1 if i % 2 else int(rng.integers(2, 35))
        clean = u
        for k, time_constant in enumerate(rng.uniform(3.0, 40.0, size=rng.integers(1, 3))):
            clean = response(clean, 0 if k else delay, np.exp(-1.0 / time_constant))
        y = clean + 0.04 * clean.std() * rng.normal(size=SAMPLES)
        right += estimate_delays(made([u], y), [1, 2, 3]) == (delay,)
        right_by_arx += delay_by_arx(y, u) == delay
    print(f"{kind}: {right} of 12 exact, by ARX {right_by_arx}")
    assert right >= 10
    assert right > right_by_arx


def test_too_few_samples_for_the_order_leave_the_usual_delay():
    rng = np.random.default_rng(6)
    assert estimate_delays(made([rng.normal(size=20)], rng.normal(size=20)), [3]) == (1,)
