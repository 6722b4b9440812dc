"""Claims: memories of sampled signals solve their equations, and repeats are left out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit.arrays import Array
from orchestration.diagnosis.signals import (
    distinct,
    lagged,
    remembered_by,
    scale_of_signal,
    seen,
)
from orchestration.diagnosis.terms import Memory

TIME = np.linspace(0.0, 20.0, 401)
RNG = np.random.default_rng(2)
UNEVEN = np.cumsum(np.random.default_rng(3).uniform(0.005, 0.2, 401))
WAVE = np.sin(1.1 * TIME) + 0.5 * np.sin(2.7 * TIME + 1.0)
OTHER = np.cumsum(RNG.standard_normal(401))
KINDS = [Memory.LAG, Memory.FADING, Memory.PLAY, Memory.DAHL, Memory.BACKLASH]


@pytest.mark.parametrize("constant", [0.1, 1.3, 8.0])
@pytest.mark.parametrize("time", [TIME, UNEVEN], ids=["even", "uneven"])
def test_a_lag_solves_its_equation(constant: float, time: Array) -> None:
    """Of a signal in straight lines between samples, from equilibrium."""

    z = [WAVE[0]]
    for k in range(60):
        step = time[k], time[k + 1]

        def rate(t: float, z: float, step: tuple = step, k: int = k) -> float:
            return (np.interp(t, step, WAVE[k : k + 2]) - z) / constant

        z.append(solve_ivp(rate, step, [z[-1]], rtol=1e-9, atol=1e-11).y[0, -1])
    assert lagged(WAVE, time, constant)[:61] == pytest.approx(z, abs=1e-8)


def test_a_lag_of_a_step_is_an_exponential_at_any_instants() -> None:
    """In closed form, over steps of a thousandth to thirty time constants."""
    time = np.append(0.0, np.cumsum(np.geomspace(1e-3, 30.0, 50)))
    values = np.append(0.0, np.ones(50))
    first = time[1]  # the signal rises along the first step
    begun = 1.0 + np.expm1(-first) / first
    expected = 1.0 - (1.0 - begun) * np.exp(-(time[1:] - first))
    assert lagged(values, time, 1.0)[1:] == pytest.approx(expected, abs=1e-12)


def memories(kind: Memory) -> list:
    views = seen([("a", WAVE), ("b", OTHER)], [TIME], [kind])
    return [view for view in views if view.memory is kind and view.signal == "a"]


def test_lag_and_fading_are_of_the_time_constants_that_they_name() -> None:
    for view in memories(Memory.LAG):
        assert view.values == pytest.approx(lagged(WAVE, TIME, view.constants[0]))
    for view in memories(Memory.FADING):
        assert view.values == pytest.approx(WAVE - lagged(WAVE, TIME, view.constants[0]))
    assert len(memories(Memory.LAG)) >= 3
    assert memories(Memory.FADING)


def test_play_follows_at_the_distance_that_it_names() -> None:
    """The constant is in scales of what the term sees."""
    views = memories(Memory.PLAY)
    assert [v.constants[0] * v.scale / WAVE.std() for v in views] == pytest.approx([0.2, 0.6])
    for view in views:
        way = view.constants[0] * view.scale
        z, expected = WAVE[0], []
        for x in WAVE:
            z = z + max(x - z - way, 0.0) + min(x - z + way, 0.0)
            expected.append(z)
        assert view.values == pytest.approx(expected)


def test_backlash_is_the_way_against_the_direction_however_far_the_signal_goes() -> None:
    """Of a way a hundred thousandth as wide as the signal, too; it is silent without a share."""
    turns = 100.0 * np.sin(0.7 * TIME)
    for share in (1e-5, 1e-3):
        views = seen([("a", turns)], [TIME], [Memory.BACKLASH], [share])
        (view,) = (view for view in views if view.memory is Memory.BACKLASH)
        way = view.constants[0] * view.scale
        assert way == pytest.approx(share * turns.std())
        moves = np.abs(np.diff(turns)) > 2.0 * way
        against = way * np.sign(np.diff(turns))
        assert view.values[1:][moves] == pytest.approx(against[moves], rel=1e-6)
        assert np.abs(view.values).max() <= way * (1.0 + 1e-9)
    assert all(v.memory is Memory.NONE for v in seen([("a", turns)], [TIME], [Memory.BACKLASH]))


def test_a_bristle_is_straight_at_first_and_ends_at_its_way() -> None:
    """In closed form along one direction: w (1 - exp(-s / w))."""
    ramp = np.linspace(0.0, 3.0, 401)
    view = next(v for v in seen([("a", ramp)], [TIME], [Memory.DAHL]) if v.memory is Memory.DAHL)
    way = view.constants[0] * view.scale
    assert way == pytest.approx(0.2 * ramp.std())
    assert view.values == pytest.approx(way * (1.0 - np.exp(-ramp / way)))
    assert (view.scale, view.middle) == (1.0, 0.0)
    for turned in memories(Memory.DAHL):
        assert np.abs(turned.values).max() <= turned.constants[0] + 1e-12
        assert turned.values.min() < 0.0 < turned.values.max()


def test_a_memory_begins_anew_in_every_record() -> None:
    shifted = WAVE + 5.0
    views = seen([("a", np.concatenate([WAVE, shifted]))], [TIME, TIME], KINDS, [0.01])
    assert {v.memory for v in views} >= {Memory.LAG, Memory.PLAY, Memory.DAHL}
    for view in views:
        if view.memory in (Memory.LAG, Memory.PLAY):
            assert view.values[401] == shifted[0], view
        if view.memory in (Memory.FADING, Memory.DAHL, Memory.BACKLASH):
            assert view.values[401] == 0.0, view


def test_a_signal_that_repeats_another_is_left_out() -> None:
    still = np.full(401, 3.0)
    named = [("a", WAVE), ("twice", -2.0 * WAVE + 1.0), ("b", OTHER), ("still", still)]
    assert [name for name, _ in distinct(named)] == ["a", "b"]
    noisy = WAVE + 0.1 * RNG.standard_normal(401)
    assert [name for name, _ in distinct([("a", WAVE), ("noisy", noisy)])] == ["a", "noisy"]


def test_memories_that_are_another_signal_are_left_out() -> None:
    """The lag of a signal that is there, and of one that stands still beside its time constant."""
    late = lagged(WAVE, TIME, 20.0 / 4.0)
    views = seen([("a", WAVE), ("late", late)], [TIME], [Memory.LAG])
    pairs = [(v, w) for v in views for w in views if v is not w]
    assert all(abs(np.corrcoef(v.values, w.values)[0, 1]) <= 0.999 for v, w in pairs)
    assert not any(v.signal == "a" and v.constants == (5.0,) for v in views)
    slow = seen([("a", WAVE), ("time", TIME)], [TIME], KINDS)
    assert all(v.memory is Memory.NONE for v in slow if v.signal == "time")


def test_scale_and_middle() -> None:
    assert scale_of_signal(np.array([-3.0, 4.0, 3.0, -4.0])) == pytest.approx((np.sqrt(12.5), 0.0))
    far = np.array([100.0, 101.0, 99.0, 100.0])
    assert scale_of_signal(far) == pytest.approx((far.std(), 100.0))
    assert scale_of_signal(-far) == pytest.approx((far.std(), -100.0))
    assert scale_of_signal(np.array([0.0, 1.0, 2.0]))[1] == 0.0


@pytest.mark.parametrize("kind", [Memory.LAG, Memory.FADING, Memory.HEAT])
def test_a_memory_of_several_records_is_that_of_each(kind: Memory) -> None:
    """Whose times begin anew."""
    cut = len(WAVE) // 3
    parts, times = (WAVE[:cut], WAVE[cut:]), [TIME[:cut], TIME[cut:] - TIME[cut]]
    views = [v for v in seen([("a", WAVE)], times, [kind]) if v.memory is kind]
    assert views
    for view in views:
        (constant,) = view.constants
        expected = []
        for v, t in zip(parts, times, strict=True):
            if kind is Memory.HEAT:
                rest = v[0] ** 2 * np.exp(-t / constant)
                expected.append(lagged(v**2, t, constant) - rest)
            else:
                late = lagged(v, t, constant)
                expected.append(late if kind is Memory.LAG else v - late)
        assert view.values == pytest.approx(np.concatenate(expected), abs=1e-12)


def test_a_signal_of_one_sign_is_one_sided() -> None:
    (positive,) = seen([("a", WAVE**2)], [TIME], [])
    (both,) = seen([("a", WAVE)], [TIME], [])
    assert positive.one_sided
    assert not both.one_sided
    assert both.scaled * both.scale + both.middle == pytest.approx(WAVE)


def test_counts_are_integrals_since_the_start_of_each_record() -> None:
    """Of 3 sin(t) they are 3 (1 - cos(t)), and of its modulus 6 a half wave."""
    time = np.linspace(0.0, 3.0 * np.pi, 3001)
    wave = 3.0 * np.sin(time)
    views = seen([("a", np.tile(wave, 2))], [time, time], [Memory.INTEGRAL, Memory.THROUGHPUT])
    (net,) = (view for view in views if view.memory is Memory.INTEGRAL)
    (whole,) = (view for view in views if view.memory is Memory.THROUGHPUT)
    assert net.constants == whole.constants == ()
    assert net.values == pytest.approx(np.tile(3.0 - 3.0 * np.cos(time), 2), abs=1e-4)
    assert whole.values[[1000, 2000, 3000]] == pytest.approx([6.0, 12.0, 18.0], abs=1e-4)
    assert whole.values[3001:] == pytest.approx(whole.values[:3001], abs=1e-12)
    used = (Memory.INTEGRAL, np.tile(wave, 2), [time, time], np.zeros(0))
    assert remembered_by(*used) == pytest.approx(net.values, abs=0.0)


def test_a_throughput_that_is_the_time_is_left_out() -> None:
    even = np.where(np.arange(401) % 2, 1.0, -1.0)
    views = seen([("a", even), ("time", TIME)], [TIME], [Memory.THROUGHPUT])
    assert all(view.memory is Memory.NONE for view in views)


def test_heat_lags_the_square_from_rest() -> None:
    """Of a constant signal s it is s^2 (1 - exp(-t / T))."""
    switched = np.where(TIME < 10.0, 2.0, -2.0)
    views = seen([("a", switched)], [TIME], [Memory.HEAT])
    heats = [view for view in views if view.memory is Memory.HEAT]
    assert heats
    for view in heats:
        expected = 4.0 * (1.0 - np.exp(-TIME / view.constants[0]))
        assert view.values == pytest.approx(expected, abs=1e-9)
