"""Times of effects follow the record. Oracle: by hand."""

from __future__ import annotations

import pytest

from fmus.kit.sampling import DELAY_SAMPLES, Sampling, sampling_of


@pytest.mark.parametrize(
    "sampling", [Sampling(), Sampling(0.01, 60.0), Sampling(0.02, 3600.0), Sampling(0.015, 20.0)]
)
def test_on_a_bench_they_are_the_usual_ones(sampling):
    assert (sampling.at_once, sampling.delay_period) == (0.01, 0.02)
    assert sampling.time_constant == 1.0


@pytest.mark.parametrize("step", [1e-6, 25e-6, 1e-3, 0.1, 1.0, 60.0, 3600.0])
@pytest.mark.parametrize("samples", [500, 2000, 100_000])
def test_a_few_samples_are_within_reach_whatever_the_clock(step, samples):
    sampling = Sampling(step, step * samples)
    assert 0.01 * step <= sampling.at_once <= step
    assert sampling.delay_period >= step
    reach = DELAY_SAMPLES * sampling.delay_period
    assert 60.0 * step <= reach <= max(1.28, 0.1 * step * samples, 64.0 * step)
    longest = max(0.1 * step * samples, 10.0 * step)
    assert 10.0 * step <= sampling.time_constant <= longest * (1.0 + 1e-9)


def test_a_register_for_a_known_delay_is_as_fine_as_the_record():
    sampling = Sampling(25e-6, 0.05)
    for delay, period in ((1.5e-4, 25e-6), (3.2e-3, 1e-4 * 25 / 32), (2e-3, 6.25e-5)):
        found = sampling.holding(delay).delay_period
        assert found == pytest.approx(period)
        assert DELAY_SAMPLES * found >= min(2.0 * delay, 5e-3) * (1.0 - 1e-9)


def test_a_record_of_40_khz_and_one_of_a_sample_a_minute():
    fast, slow = Sampling(25e-6, 0.05), Sampling(60.0, 86400.0)
    assert (fast.at_once, slow.at_once) == pytest.approx((25e-6, 0.6))
    assert (fast.delay_period, slow.delay_period) == pytest.approx((0.005 / 64, 60.0))
    assert (fast.time_constant, slow.time_constant) == pytest.approx((0.005, 600.0))


@pytest.mark.parametrize(
    ("experiment", "reach"), [((10.0, 0.01), 1.28), ((100.0, 0.1), 1.28), ((3600.0, 10.0), 640.0)]
)
def test_a_component_has_delays_of_its_experiment_unless_that_is_of_a_bench(experiment, reach):
    assert DELAY_SAMPLES * sampling_of(experiment).delay_period == pytest.approx(reach)
