"""Signals that laws may hang on: lags and integrals against SciPy and closed forms, and none that
tells nothing new.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson
from scipy.signal import lsim

from orchestration.discrepancy.laws.linear.response import Sides, SimulatedCourse, continuous
from orchestration.discrepancy.laws.signals import (
    LAGS,
    LawSignal,
    current_signals,
    integrated,
    is_new,
    lagged,
    remembered_signals,
    signal_along,
)

TIME = np.linspace(0.0, 20.0, 401)
WAVE = np.sin(1.3 * TIME) + 0.4 * np.cos(0.2 * TIME)


def settled_lag(values, constant, interp):
    """SciPy's, from equilibrium with the first value."""
    a = [[-1.0 / constant]]
    return lsim(
        (a, [[1.0 / constant]], [[1.0]], [[0.0]]), values, TIME, X0=[values[0]], interp=interp
    )[1]


@pytest.mark.parametrize("constant", [0.01, 0.2, 3.0, 1e3])
def test_a_lag_is_scipys(constant):
    steps = np.diff(TIME)
    straight = lagged(continuous(WAVE), steps, constant)
    assert straight.begin == pytest.approx(settled_lag(WAVE, constant, True), abs=1e-9)
    held = lagged(Sides(WAVE, WAVE), steps, constant)
    assert held.begin == pytest.approx(settled_lag(WAVE, constant, False), abs=1e-9)
    assert np.array_equal(held.end[:-1], held.begin[1:]), "a lag does not jump"


def test_a_lag_over_uneven_steps_in_closed_form():
    """Of a ramp from 2: a t + 2 - a T (1 - exp(-t / T))."""
    time = np.append(0.0, np.cumsum(np.random.default_rng(1).choice([0.01, 0.3, 2.0], 300)))
    found = lagged(continuous(2.0 + 0.7 * time), np.diff(time), 0.9)
    assert found.begin == pytest.approx(
        2.0 + 0.7 * time - 0.7 * 0.9 * (1.0 - np.exp(-time / 0.9)), rel=1e-10
    )


def test_a_step_over_uneven_steps_in_closed_form():
    time = np.append(0.0, np.cumsum(np.random.default_rng(2).choice([0.01, 0.3, 2.0], 300)))
    values = np.where(np.arange(301) < 100, 1.0, 3.0)
    since = np.clip(time - time[100], 0.0, None)
    found = lagged(Sides(values, values), np.diff(time), 0.9)
    assert found.begin == pytest.approx(3.0 - 2.0 * np.exp(-since / 0.9), rel=1e-10)


@settings(max_examples=50)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30),
    st.floats(1e-3, 1e3),
    st.lists(st.floats(1e-3, 1e2), min_size=29, max_size=29),
)
def test_a_lag_stays_between_what_it_follows(values, constant, steps):
    values = np.array(values)
    found = lagged(continuous(values), np.array(steps[: len(values) - 1]), constant).begin
    slack = 1e-9 * max(1.0, np.abs(values).max())
    assert found.min() >= values.min() - slack
    assert found.max() <= values.max() + slack
    assert found[0] == values[0]


def test_integrals():
    steps = np.diff(TIME)
    exact = (1.0 - np.cos(1.3 * TIME)) / 1.3 + 2.0 * np.sin(0.2 * TIME)
    found = integrated(continuous(WAVE), steps)
    assert found.begin == pytest.approx(exact, abs=2e-3), "of what is straight between samples"
    assert found.begin == pytest.approx(cumulative_simpson(WAVE, x=TIME, initial=0.0), abs=2e-3)
    assert np.array_equal(found.end[:-1], found.begin[1:])
    held = integrated(Sides(WAVE, WAVE), steps).begin
    assert held == pytest.approx(np.append(0.0, np.cumsum(WAVE[:-1] * steps)))


def course(**inputs):
    return SimulatedCourse.of(
        TIME, {"held": np.sign(WAVE)} | inputs, {"state": WAVE**2}, ["smooth"]
    )


def test_what_is_remembered_of_each():
    one = course(smooth=WAVE)
    signals = current_signals(one, {}, ())
    found = dict(remembered_signals(one, signals))
    assert {s.name for s in found} == {"held", "smooth", "state"}, "of the time nothing"
    for name in ("held", "smooth", "state"):
        kinds = [s.memory for s in found if s.name == name]
        assert kinds == ["lagged"] * LAGS + ["leading"] * LAGS + ["heat"] * LAGS + [
            "integrated",
            "throughput",
        ]
    constants = sorted({s.constant for s in found if s.memory == "lagged"})
    assert constants[0] == pytest.approx(4 * 0.05)
    assert constants[-1] == pytest.approx(5.0)
    assert np.diff(np.log(constants)) == pytest.approx(np.log(25.0) / (LAGS - 1))
    for signal, sides in found.items():
        again = signal_along(signal, one, {})
        assert np.array_equal(sides.begin, again.begin)
        assert np.array_equal(sides.end, again.end)


def test_a_signal_over_a_run():
    one = course(smooth=WAVE)
    behind = settled_lag(WAVE, 0.7, True)
    assert signal_along(LawSignal("smooth"), one, {}).begin is one.inputs["smooth"].begin
    assert signal_along(LawSignal("smooth", "lagged", 0.7), one, {}).begin == pytest.approx(
        behind, abs=1e-9
    )
    assert signal_along(LawSignal("smooth", "leading", 0.7), one, {}).begin == pytest.approx(
        WAVE - behind, abs=1e-9
    )
    warm = settled_lag(WAVE**2, 0.7, True) - WAVE[0] ** 2 * np.exp(-(one.time - one.time[0]) / 0.7)
    assert signal_along(LawSignal("smooth", "heat", 0.7), one, {}).begin == pytest.approx(
        warm, abs=1e-9
    ), "cold at first"
    jumps = signal_along(LawSignal("held", "leading", 0.7), one, {})
    rest = settled_lag(np.sign(WAVE), 0.7, False)
    assert jumps.begin == pytest.approx(np.sign(WAVE) - rest, abs=1e-9)
    assert jumps.end[:-1] == pytest.approx(np.sign(WAVE)[:-1] - rest[1:], abs=1e-9), (
        "the input before it jumps"
    )
    through = signal_along(LawSignal("held", "throughput"), one, {})
    assert through.begin == pytest.approx(TIME, abs=0.06)
    assert signal_along(LawSignal("time"), one, {}).begin.tolist() == TIME.tolist()
    assert signal_along(LawSignal("time"), one, {}).end[:-1].tolist() == TIME[1:].tolist()
    law = continuous(np.exp(WAVE))
    assert signal_along(LawSignal("law"), one, {"law": law}) is law
    assert signal_along(LawSignal("state"), one, {"state": law}) is one.states["state"], (
        "a state goes before a law of its name"
    )
    with pytest.raises(KeyError, match="nothing"):
        signal_along(LawSignal("nothing"), one, {})


def test_what_moves_is_listed():
    one = course(
        smooth=WAVE,
        still=7.0,
        same=5.0 - 2.0 * WAVE,
        ramp=3.0 * TIME,
        broken=np.where(TIME > 3, np.nan, TIME),
    )
    laws = {
        "drop": continuous(np.exp(WAVE)),
        "voltage": continuous(WAVE**3),
        "twice": continuous(2.0 * WAVE**2 + 1e3),
    }
    found = current_signals(one, laws, {"voltage"})
    moving = ["held", "smooth", "same", "ramp", "state", "drop", "twice", "time"]
    assert [s.name for s in found] == moving, "whatever runs in proportion in this record"
    assert all(s.memory == "" for s in found)
    assert found[LawSignal("drop")] is laws["drop"]
    assert [s.name for s in current_signals(course(), {}, ())][-1] == "time"


@settings(max_examples=50)
@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e3), st.booleans(), st.integers(0, 99))
def test_what_is_in_proportion_is_not_new(offset, factor, turned, seed):
    values = np.random.default_rng(seed).normal(size=50)
    told: list[np.ndarray] = []
    assert is_new(continuous(values), told)
    assert len(told) == 1
    assert not is_new(continuous(offset + (-factor if turned else factor) * values), told)
    assert is_new(continuous(values + 0.05 * np.arange(50.0)), told)
    assert len(told) == 2


@pytest.mark.parametrize(
    "values", [np.zeros(9), np.full(9, 1e9), 1.0 + 1e-12 * np.arange(9.0), np.full(9, np.inf)]
)
def test_what_stands_still_tells_nothing(values):
    told: list[np.ndarray] = []
    assert not is_new(continuous(values), told)
    assert told == []


def test_what_is_remembered_may_stand_still():
    """A signal that moves at the last sample only, held until then, is behind any lag what it
    was.
    """
    one = SimulatedCourse.of(TIME, {"late": np.where(TIME < 20.0, 1.0, 2.0)}, {}, False)
    told: list[np.ndarray] = []
    signals = current_signals(one, {}, ())
    assert LawSignal("late") in signals
    kept = [s for s, sides in remembered_signals(one, signals) if is_new(sides, told)]
    assert "lagged" not in {s.memory for s in kept}
    assert "leading" in {s.memory for s in kept}


def test_labels():
    assert LawSignal("current").label == "current"
    assert LawSignal("current", "lagged", 0.25).label == "current lagged by 0.25 s"
    assert LawSignal("current", "leading", 12.0).label == "current less itself lagged by 12 s"
    assert LawSignal("current", "integrated").label == "current integrated"
    assert LawSignal("current", "throughput").label == "current integrated in modulus"
