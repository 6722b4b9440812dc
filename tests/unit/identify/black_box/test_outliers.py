"""Claims: bad readings are found, and nothing else is taken for one.

Oracles: SciPy's filters made the records, and the test put the readings in.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.identify.black_box import input_output_data
from orchestration.identify.black_box.delays import estimate_delays
from orchestration.identify.black_box.outliers import find_outliers

SAMPLES = 500


def response(u, delay, pole):
    return lfilter(np.r_[np.zeros(delay), 1.0 - pole], [1.0, -pole], u)


def steps(rng, held):
    return np.repeat(rng.choice([-1.0, 0.0, 1.0], size=SAMPLES // held + 1), held)[:SAMPLES]


def made(u, y):
    return input_output_data(u, y, 1.0)


def drawn(seed):
    """Return an input, the output of one or two poles with noise, its delay and deviation."""
    rng = np.random.default_rng(seed)
    u = steps(rng, int(rng.integers(6, 40)))
    delay = 22 if seed % 2 else int(rng.integers(1, 31))
    clean = response(u, delay, np.exp(-1.0 / rng.uniform(4.0, 30.0)))
    if seed % 3:
        clean = response(clean, 0, np.exp(-1.0 / rng.uniform(3.0, 10.0)))
    deviation = 0.04 * clean.std()
    return u, clean + deviation * rng.normal(size=SAMPLES), delay, deviation


def spoilt(seed, y, deviation):
    """Return an output with one to three bursts of bad readings, and their samples."""
    rng = np.random.default_rng(10_000 + seed)
    output = y.copy()
    bad = set()
    for first in rng.choice(
        np.arange(40, SAMPLES - 40, 40), size=rng.integers(1, 4), replace=False
    ):
        burst = range(first, first + rng.integers(1, 6))
        sizes = (10.0, 50.0) if seed % 2 else (100.0, 500.0)
        output[burst] += rng.choice([-1.0, 1.0]) * rng.uniform(*sizes) * deviation
        bad |= {*burst}
    return output, sorted(bad)


def test_bad_readings_are_found_to_the_sample():
    exact = 0
    for seed in range(12):
        u, y, _, deviation = drawn(seed)
        output, bad = spoilt(seed, y, deviation)
        found, expected = find_outliers(made(u, output))
        exact += found.tolist() == bad
        assert set(found) >= set(bad)
        assert np.abs(expected - y).max() < 8.0 * deviation
    assert exact >= 11


def test_a_reading_beyond_all_others_is_found_and_named():
    u, y, _, _ = drawn(3)
    output = 65.0 + y
    output[200] = 850.0
    output[300:303] = 0.0
    assert find_outliers(made(u, output))[0].tolist() == [200, 300, 301, 302]


def tank(u):
    level = [1.0]
    for value in u[:-1]:
        level.append(level[-1] + 0.05 * (1.0 + 0.8 * value - np.sqrt(level[-1])))
    return np.array(level)


def test_what_a_process_does_is_no_bad_reading():
    """Loads that come and stay, noise that remembers, a tank's root, one step, coarse steps."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        u = steps(rng, 15)
        e = 0.02 * rng.normal(size=SAMPLES)
        once = np.where(np.arange(SAMPLES) > 150, 1.0, 0.0)
        load = response(10.0 * (rng.random(SAMPLES) < 0.005), 0, 0.95)
        records = {
            "noise": (u, response(u, 9, 0.9) + e),
            "no noise": (u, response(u, 9, 0.9)),
            "load": (u, response(u, 9, 0.9) + load + e),
            "step of load": (u, response(u, 9, 0.9) + once + e),
            "colour": (u, response(u, 9, 0.9) + lfilter([1.0], [1.0, -0.95], e)),
            "tank": (u, tank(u) + e),
            "coarse tank": (u, np.round(tank(u), 1)),
            "one step": (once, response(once, 12, 0.97) + e),
            "oscillation": (u, lfilter([0.1], [1.0, -1.8, 0.9], u) + e),
        }
        for name, (driven, y) in records.items():
            assert find_outliers(made(driven, y))[0].size == 0, (seed, name)


def test_a_short_or_constant_record_has_none():
    u = steps(np.random.default_rng(0), 5)
    for data in (made(u[:40], u[:40]), made(u, np.full(SAMPLES, 3.0))):
        found, expected = find_outliers(data)
        assert found.size == 0
        assert (expected == data.output).all()


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(0, 5), range(5, 10), range(10, 15), range(15, 20)])
def test_delays_are_those_of_the_record_without_bad_readings(seeds):
    right = {"without": 0, "with": 0, "left out": 0}
    for seed in seeds:
        u, y, delay, deviation = drawn(seed)
        output, _ = spoilt(seed, y, deviation)
        cleaned = find_outliers(made(u, output))[1]
        for name, values in (("without", y), ("with", output), ("left out", cleaned)):
            right[name] += estimate_delays(made(u, values), [1, 2]) == (delay,)
    print(f"delays that are exact, of {len(seeds)}: {right}")
    assert right["left out"] == right["without"] >= 4
    assert right["with"] <= right["left out"]
