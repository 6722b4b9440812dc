"""Line 8: any communication step gives the exact solution; samples stay on time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.contract import oracle
from tests.contract.models import Oscillator, Sampler
from tests.contract.raw import instance
from tests.contract.subjects import actuators_only, each_component

# From a hundredth of what a controller would use to longer than any time constant but the slowest.
SIZES = st.floats(-4.0, 1.5).map(lambda power: 10.0**power)
MOVES = st.lists(
    st.tuples(SIZES, st.floats(-1.0, 1.0), st.floats(0.0, 1.0)), min_size=1, max_size=25
)
relaxed = settings(
    max_examples=40,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def loads(name: str, shares: list[float]) -> np.ndarray:
    """Draw held loads: forces up to 2 N; lengths from 1 mm, never falling, which keep it taut."""
    return 2.0 * np.array(shares) if name == "ppy_actuator" else 1e-3 * (1.0 + np.cumsum(shares))


@actuators_only
@relaxed
@given(moves=MOVES)
def test_any_sequence_of_steps_follows_the_matrix_exponential(one, name, load, moves):
    steps = [size for size, _, _ in moves]
    inputs = np.column_stack(
        [[current for _, current, _ in moves], loads(name, [share for *_, share in moves])]
    )
    expected = oracle.solve(name, steps, inputs)
    one.do("fmi2Reset")
    one.initialize()
    found = []
    for size, (current, held) in zip(steps, inputs, strict=True):
        one.set({"current": current, load: held})
        one.step(size)
        found.append(one.get(*oracle.OUTPUTS[name]))
    tolerated = 1e-7 * (oracle.SCALE[name] + np.abs(expected))
    assert np.all(np.abs(np.array(found) - expected) <= tolerated)


@actuators_only
@pytest.mark.parametrize("size", [1e-5, 0.1, 1.0, 7.3, 1000.0])
def test_one_size_after_another(one, name, load, size):
    held = {"force": 2.0, "length_change": 1e-3}[load]
    expected = oracle.solve(name, [size] * 20, np.tile([0.9, held], (20, 1)))
    one.initialize({"current": 0.9, load: held})
    for row in expected:
        one.step(size)
        tolerated = 1e-7 * (oracle.SCALE[name] + np.abs(row))
        assert np.all(np.abs(np.array(one.get(*oracle.OUTPUTS[name])) - row) <= tolerated)


@actuators_only
def test_start_time_changes_nothing(one, name, load):
    one.initialize({"current": 0.9, load: 1e-3}, start=0.0)
    one.step(2.5)
    expected = one.get(*oracle.OUTPUTS[name])
    one.do("fmi2Reset")
    one.initialize({"current": 0.9, load: 1e-3}, start=-1024.0)
    one.step(2.5)
    assert one.get(*oracle.OUTPUTS[name]) == pytest.approx(expected, rel=1e-12), (
        "but for the rounding of times"
    )


@each_component
@pytest.mark.parametrize("sizes", [[0.05] * 20, [0.3, 0.001, 0.199, 0.5], [1e-4, 0.9999]], ids=len)
def test_dividing_a_step_changes_nothing_but_rounding(archive, subject, sizes):
    """With the inputs held, a step of a second and its parts end in the same values."""
    ends = []
    with instance(archive) as one:
        for division in ([1.0], sizes):
            one.do("fmi2Reset")
            one.initialize({**subject.parameters, **subject.inputs})
            for size in division:
                one.step(size)
            ends.append(dict(zip(one.variables, one.everything(), strict=True)))
    for signal, expected in ends[0].items():
        if signal.startswith("der("):
            continue  # differences of what is compared
        assert ends[1][signal] == pytest.approx(expected, rel=1e-6, abs=1e-8), signal


def test_tighter_tolerance_brings_the_result_closer(built, runtime):
    """The accuracy is that of an internal step; a tenth of it gives a fifth of the error."""
    errors = []
    with instance(built(Oscillator, runtime)) as one:
        for tolerance in (1e-9, 1e-10, 1e-11):
            one.do("fmi2Reset")
            one.do("fmi2SetupExperiment", 1, tolerance, 0.0, 0, 0.0)
            one.do("fmi2EnterInitializationMode")
            one.do("fmi2ExitInitializationMode")
            one.time = 0.0
            one.set({"speed": 10.0})
            one.step(5.0)
            errors.append(abs(one.get("position")[0] - math.cos(50.0)))
    assert errors[0] < 2e-6
    assert errors[0] > 5.0 * errors[1] > 25.0 * errors[2]


@pytest.fixture
def oscillating(built, runtime):
    """Open an oscillator that any example may reset."""
    with instance(built(Oscillator, runtime)) as created:
        yield created


@pytest.fixture
def sampling(built, runtime):
    """Open a sampler that any example may reset."""
    with instance(built(Sampler, runtime)) as created:
        yield created


@relaxed
@given(moves=st.lists(st.tuples(SIZES, st.floats(0.1, 100.0)), min_size=1, max_size=15))
def test_a_fast_oscillation_under_changing_steps(oscillating, moves):
    """Closed form: turning by the product of speed and time, which counts the radians."""
    angle, one = 0.0, oscillating
    one.do("fmi2Reset")
    one.initialize()
    for size, speed in moves:
        speed = min(speed, 100.0 / size)
        one.set({"speed": speed})
        one.step(size)
        angle += speed * size
    found = one.get("position", "velocity")
    assert found == pytest.approx(
        [math.cos(angle), -math.sin(angle)], abs=1e-8 * (1.0 + 10.0 * angle)
    )


# --- samples
# --------------------------------------------------------------------------------------------------


def taken(time: float, period: float) -> int:
    """Return the samples taken at the end of a step; one at that time belongs to the next step."""
    return math.ceil(time / period - 1e-9)


def lag(x: float, u: float, rate: float, time: float) -> float:
    return u + (x - u) * math.exp(-rate * time)


@relaxed
@given(
    moves=st.lists(
        st.tuples(SIZES.map(lambda s: min(s, 3.0)), st.floats(-1.0, 1.0)), min_size=1, max_size=15
    ),
    period=st.sampled_from([0.1, 0.25, 1.0 / 30.0, 0.7, math.pi / 10]),
    start=st.sampled_from([0.0, 5.0, -2.0]),
)
def test_samples_fall_on_their_instants_whatever_the_steps(sampling, moves, period, start):
    one = sampling
    one.do("fmi2Reset")
    one.initialize({"period": period, "step": 2}, start=start)
    x, sampled, total, elapsed = 0.25, 0.0, 0.0, 0.0
    fast = slow = 0
    for size, u in moves:
        one.set({"u": u})
        one.step(size)
        end = one.time - start
        # the closed form, walked from instant to instant
        while True:
            due = min(fast * 0.025, slow * period)
            if due >= end - 1e-9 * period:
                break
            due = max(due, elapsed)
            x, elapsed = lag(x, u, 3.0, due - elapsed), due
            if slow * period <= due + 1e-9 * period:
                sampled, slow = x, slow + 1
            if fast * 0.025 <= due + 1e-9 * 0.025:
                total, fast = total + (x - 0.1 * total), fast + 1
        x, elapsed = lag(x, u, 3.0, end - elapsed), end
        instant, count, found_x, last, found_total = one.get(
            "instant", "count", "x", "last", "total"
        )
        assert count == 2 * slow == 2 * taken(end, period)
        assert instant == pytest.approx(
            start + (slow - 1) * period, abs=1e-12 * (1.0 + abs(one.time))
        )
        assert [found_x, last, found_total] == pytest.approx([x, sampled, total], abs=1e-7)
    assert one.get("difference")[0] == pytest.approx(x - sampled, abs=1e-7)


@pytest.mark.parametrize("size", [0.1, 0.05, 0.3, 0.07, 2.0, 1.0 / 3.0])
def test_aligned_or_not_the_number_of_samples_is_right(built, runtime, size):
    with instance(built(Sampler, runtime)) as one:
        one.initialize()
        for k in range(1, 301):
            one.do("fmi2DoStep", (k - 1) * size, size, 1)
            assert one.get("count")[0] == taken(k * size, 0.1)
            latest = (taken(k * size, 0.1) - 1) * 0.1
            assert one.get("instant")[0] == pytest.approx(latest, abs=1e-12 * (1 + latest))


@pytest.mark.parametrize("first", [10**6, 3 * 10**8])
def test_samples_stay_aligned_late_in_a_simulation(built, runtime, first):
    """At times that are rounded to more than a billionth of the period."""
    period = 0.01
    with instance(built(Sampler, runtime)) as one:
        one.initialize({"period": period}, start=first * period)
        for k in range(first, first + 400):
            one.do("fmi2DoStep", k * period, (k + 1) * period - k * period, 1)
            assert one.get("count")[0] == k + 1 - first
            assert one.get("instant")[0] == pytest.approx(k * period, abs=1e-15 * k)


def test_before_the_first_step_nothing_is_sampled(built, runtime):
    with instance(built(Sampler, runtime)) as one:
        one.initialize({"u": 1.0})
        assert one.get("count", "instant", "last") == [0, 0.0, 0.0]
        one.step(1e-3)
        assert one.get("count", "instant", "last") == [1, 0.0, 0.25]
