"""Claims: intervals of all that is read off a response are those of its error, drawn at random; a
phase has no jumps.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.identify.spectral import Response

DRAWS = 200_000


def response(values, variance=1.0, unit="N/m", freedom=1e9, model=None):
    values = np.atleast_1d(np.asarray(values, dtype=complex))
    every = np.ones(values.size)
    frequency = np.arange(1.0, values.size + 1.0)
    return Response("a/b", unit, frequency, values, variance * every, freedom * every, model, {})


READ_OFF = {
    "magnitude": np.abs,
    "phase": lambda g: np.degrees(np.angle(g)),
    "real": np.real,
    "imaginary": np.imag,
    "storage": np.real,
    "loss": np.imag,
    "loss_tangent": lambda g: g.imag / g.real,
}


@pytest.mark.parametrize("name", READ_OFF)
def test_an_interval_is_that_of_errors_drawn_at_random(name):
    random = np.random.default_rng(1)
    error = random.normal(size=DRAWS) + 1j * random.normal(size=DRAWS)  # of the variance 2
    values = 100.0 * np.exp(0.5j)
    drawn = np.quantile(READ_OFF[name](values + error), [0.025, 0.975])
    interval = getattr(response(values, 2.0), name)
    half = 0.5 * (interval.high - interval.low)[0]
    assert interval.value[0] == pytest.approx(READ_OFF[name](values))
    assert half == pytest.approx(0.5 * (drawn[1] - drawn[0]), rel=0.01)


def test_the_region_holds_as_many_as_it_says_for_a_variance_from_few_lines():
    random = np.random.default_rng(2)
    freedom = 16
    variance = random.chisquare(freedom, DRAWS) / freedom
    error = (random.normal(size=DRAWS) + 1j * random.normal(size=DRAWS)) / np.sqrt(2.0)
    many = Response("a/b", "1", variance, error, variance, np.full(DRAWS, 16.0), None, {})
    assert np.mean(many.radius >= np.abs(error)) == pytest.approx(0.95, abs=0.002)
    real = many.real
    assert np.mean((real.low <= 0.0) & (real.high >= 0.0)) == pytest.approx(0.95, abs=0.002)
    assert np.mean(~many.seen) == pytest.approx(0.95, abs=0.002)


def test_covariance_is_that_of_real_and_imaginary_part():
    assert response(1.0, 4.0).covariance.tolist() == [[[2.0, 0.0], [0.0, 2.0]]]


def test_a_phase_goes_on_over_half_a_turn_and_over_what_is_lost_in_noise():
    turned = np.linspace(0.0, -500.0, 26)
    values = 100.0 * np.exp(1j * np.radians(turned))
    values[13] = 1e-3  # of any phase
    phase = response(values).phase
    others = np.arange(26) != 13
    assert phase.value[others] == pytest.approx(turned[others])
    assert (phase.high - phase.value)[13] == 180.0
    assert abs(phase.value[13] - turned[13]) <= 180.0


def test_a_model_agrees_within_the_region():
    one = response([10.0, 10.0j], 1.0, model=np.array([10.0 + 2.4, 10.0j + 2.5]))
    assert one.radius[0] == pytest.approx(np.sqrt(-np.log(0.05)) * np.sqrt(2.0) / np.sqrt(2.0))
    assert one.agrees.tolist() == [False, False]
    assert response([10.0], 1.0, model=np.array([11.7])).agrees.tolist() == [True]
    assert one.model_phase == pytest.approx(np.degrees(np.angle([12.4, 2.5 + 10.0j])))


def test_storage_and_loss_are_those_of_a_stiffness_only():
    assert list(response(1.0).quantities) == [
        "magnitude",
        "phase",
        "storage",
        "loss",
        "loss_tangent",
    ]
    assert list(response(1.0, unit="ohm").quantities)[2:] == ["real", "imaginary"]
    assert [response(1.0).unit_of(c) for c in ("frequency", "phase_low", "loss_tangent")] == [
        "Hz",
        "deg",
        "1",
    ]
