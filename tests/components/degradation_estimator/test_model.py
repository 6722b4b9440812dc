"""Claims: the impedance of a known circuit is tracked, at one frequency or the current's own; the
voltage limit falls in steps with it.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from demonstrations.emulator.hidden_electrical import GrowingResistance
from fmus.degradation_estimator.model import DegradationEstimator
from orchestration.experiment.waveforms import square_wave
from tests.support.estimator import OMEGA, PERIOD, R1, R2, C, impedance, measured, square


def test_impedance_at_the_tracked_frequency_is_compared_with_the_reference_there(estimate):
    """Constant circuit, other frequency: another impedance, no change of it; a stored magnitude
    would derate.
    """
    current = np.concatenate([square(400.0, frequency=0.1), square(600.0, frequency=0.4)])
    found = estimate(current, measured(current), track_frequency=1.0)
    before, after = (impedance(R1, R2, C, 2 * np.pi * f) for f in (0.1, 0.4))
    assert found["impedance"][3999] == pytest.approx(before, rel=1e-4)
    assert found["impedance"][-1] == pytest.approx(after, rel=1e-4)
    assert before / after - 1 == pytest.approx(0.57, abs=0.005)  # as the README says
    assert np.abs(found["impedance_change"]).max() < 1e-4
    back = estimate(current[::-1], measured(current[::-1]), track_frequency=1.0)
    assert np.abs(back["impedance_change"]).max() < 1e-4
    assert np.all(back["voltage_limit"] == 1.5), (
        "the impedance rose by half, the actuator is as it was"
    )
    fixed = estimate(current, measured(current))
    assert fixed["impedance"][1200:] == pytest.approx(impedance(R1, R2, C), rel=1e-4)


def test_impedance_change_at_the_tracked_frequency_is_that_of_the_circuit(estimate):
    """The current slows down while R1 doubles: the change is that of the true circuits at the
    tracked frequency.
    """
    parts = square(400.0, frequency=0.4), square(4000.0, frequency=0.1)
    current = np.concatenate(parts)
    rise = np.concatenate([np.ones(4000), np.full(40000, 2.0)])
    charge, voltage = 0.0, np.empty_like(current)
    for k, (r, i) in enumerate(zip((R1 * rise).tolist(), current.tolist(), strict=True)):
        voltage[k] = R2 * (r * i + charge / C) / (r + R2)
        charge = R2 * C * i + (charge - R2 * C * i) * math.exp(-PERIOD / ((r + R2) * C))
    found = estimate(current, voltage, track_frequency=1.0, forgetting_time=300.0)
    omega = 0.2 * math.pi
    expected = impedance(2 * R1, R2, C, omega) / impedance(R1, R2, C, omega) - 1
    assert found["impedance_change"][-1] == pytest.approx(expected, rel=1e-3)
    assert found["derating_steps"][-1] == expected // 0.05


def test_a_sine_determines_the_impedance_at_its_own_frequency_only(estimate):
    """Two numbers, amplitude and phase, for three parameters: the README says how far off the rest
    is.
    """
    current = 0.9 * np.sin(2 * np.pi * 0.3 * PERIOD * np.arange(36000))
    voltage = measured(current, 5e-3, seed=1)
    for tracked, omega, least, most in ((1.0, 0.6 * math.pi, 0.0, 0.04), (0.0, OMEGA, 0.3, 0.36)):
        found = estimate(current, voltage, track_frequency=tracked)
        error = found["impedance"] / impedance(R1, R2, C, omega) - 1
        assert least <= np.abs(error[found["estimate_valid"] > 0.5]).max() < most


def test_valid_needs_time_and_reversals(estimate):
    current = square(60.0)
    voltage = measured(current)
    for settling, reversals, expected in ((30.0, 6, 300), (10.0, 6, 125), (10.0, 1, 100)):
        found = estimate(current, voltage, settling_time=settling, minimum_reversals=reversals)
        assert np.argmax(found["estimate_valid"] > 0.5) == expected
        assert np.all(found["impedance_change"][:expected] == 0.0)
        reference = found["impedance"][expected]
        assert found["impedance_change"][expected:] == pytest.approx(
            found["impedance"][expected:] / reference - 1
        )


def life(hours=5.0):
    """Current, voltage and true impedance of an ageing actuator: R1 falls until 2100 s, then grows
    (fig. 4-7).
    """
    time = PERIOD * np.arange(round(hours * 36000))
    current = square_wave(time, 1.3, 0.1)
    r1 = R1 * (0.9 + 0.1 * np.exp(-time / 700.0) + 5e-5 * np.maximum(time - 2100.0, 0.0))
    charge, voltage = 0.0, np.empty_like(time)
    for k, (r, i) in enumerate(zip(r1.tolist(), current.tolist(), strict=True)):
        voltage[k] = R2 * (r * i + charge / C) / (r + R2)
        charge = R2 * C * i + (charge - R2 * C * i) * math.exp(-PERIOD / ((r + R2) * C))
    return time, current, voltage, impedance(r1, R2, C)


def test_impedance_of_a_five_hour_life_is_tracked_and_derated(estimate):
    time, current, voltage, truth = life()
    noisy = voltage + 4e-3 * np.random.default_rng(2).standard_normal(len(time))
    found = estimate(current, noisy)
    valid = found["estimate_valid"] > 0.5
    first = int(np.argmax(valid))
    assert np.all(valid[first:])
    assert time[first] == pytest.approx(120.0, abs=0.2)
    assert np.abs(found["impedance"][first:] / truth[first:] - 1).max() < 0.02
    bottom = time[first + np.argmin(found["impedance"][first:])]
    assert bottom == pytest.approx(2100.0, abs=400.0)
    # the limit falls when the truth crosses a step, late by the memory of the estimate at most
    limit, change = found["voltage_limit"], truth / truth[first] - 1
    assert np.all(np.diff(limit) <= 0.0)
    steps = int(change[-1] // 0.05)
    assert steps >= 3
    for n in range(1, steps + 1):
        due, taken = (
            time[np.argmax(change >= 0.05 * n)],
            time[np.argmax(limit < 1.5 - 0.05 * n + 0.025)],
        )
        assert taken == pytest.approx(due, abs=600.0)


def test_the_limit_falls_in_steps_to_a_floor_and_never_rises(estimate):
    current = square(1500.0, amplitude=1.3)
    voltage = measured(current, hidden=lambda p: GrowingResistance(p, growth=3.0, endurance=400.0))
    options = {
        "impedance_step": 0.1,
        "voltage_step": 0.3,
        "forgetting_time": 60.0,
        "minimum_voltage_limit": 0.8,
    }
    found = estimate(current, voltage, **options)
    change = np.where(found["estimate_valid"] > 0.5, found["impedance_change"], 0.0)
    expected = 1.5 - 0.3 * np.maximum.accumulate(np.maximum(np.floor(change / 0.1), 0.0))
    assert found["voltage_limit"] == pytest.approx(np.maximum(expected, 0.8), abs=1e-12)
    assert found["voltage_limit"][-1] == 0.8
    # the same actuator, healed: the limit stays
    again = np.concatenate([voltage, measured(square(1500.0, amplitude=1.3))])
    assert estimate(np.tile(current, 2), again, **options)["voltage_limit"][-1] == 0.8


@settings(max_examples=60)
@given(data=st.data())
def test_any_parameters_and_inputs_leave_finite_numbers(compiled, data):
    parameters = {}
    for p in DegradationEstimator.layout.parameters:
        if p.name.endswith("_start"):
            continue
        parameters[p.name] = (
            data.draw(st.sampled_from([p.min, p.max, p.start]), label=p.name)
            if p.max < 1e20
            else 0.0
        )
    parameters |= {
        name: data.draw(st.sampled_from([0.0, 1.0]))
        for name in ("instrumental_variable", "zero_order_hold", "track_frequency")
    }
    period = parameters["sample_period"]
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    size = data.draw(st.sampled_from([1e-6, 1.0, 1e3]))
    current, voltage = size * rng.uniform(-1, 1, (2, 301))
    found = compiled.run(
        period * np.arange(301), {"current": current, "voltage": voltage}, parameters
    ).signals
    for name, values in found.items():
        assert np.all(np.isfinite(values)), name
    for name in ("R1", "R2", "C", "impedance"):
        assert np.all(found[name] >= 0.0), name
