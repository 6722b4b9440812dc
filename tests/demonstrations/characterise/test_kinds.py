"""Claims: a record is the test that it was made as, and its parameters are read off it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from demonstrations.characterise import kind_of
from orchestration.records import Record

R1, R2, C, ALPHA = 0.5, 2.0, 3.0, 7e-5
BURGERS = {"k1": 6000.0, "b1": 1.5e6, "k2": 1e4, "b2": 2e6}
CIRCUIT = {"R1": R1, "R2": R2, "C": C}


def record(time, **signals) -> Record:
    return Record(time, signals, dict.fromkeys(signals, ""), Path("r.csv"))


def noise(size: int, deviation: float, seed: int = 0):
    return deviation * np.random.default_rng(seed).standard_normal(size)


def held_force(
    load: float = 2.0, rest: float = 5.0, bias: float = 0.0, held: float = 2400.0, seed: int = 0
) -> Record:
    """The closed form of the creep of a Burgers body, whose creep under a bias has ended."""
    time = np.arange(rest + held)
    since = np.maximum(time - rest, 0.0)
    k1, b1, k2, b2 = BURGERS.values()
    creep = load * ((time >= rest) / k1 + (1 - np.exp(-since * k2 / b2)) / k2)
    force = np.where(time < rest, bias, bias + load)
    flow = force / b1 * (time - rest)
    measured = creep + flow + 2e-4 + noise(time.size, 3e-6, seed)
    return record(time, force=force, displacement=measured)


def held_voltage(volts: float = 0.6) -> Record:
    """The closed form of the current at a step of the voltage: V/R2 + V/R1 exp(-t/(R1 C))."""
    time = 0.02 * np.arange(1500)
    since = time - time[100]
    current = np.where(since < 0, 0.0, volts / R2 + volts / R1 * np.exp(-since / (R1 * C)))
    voltage = np.where(since < 0, 0.0, volts) + noise(1500, 4e-3)
    return record(time, current=current, voltage=voltage)


def charge_of(time, current):
    """Charge by small steps of Euler's method, within a percent of a percent."""
    fine = 100
    step = (time[1] - time[0]) / fine
    charge = np.zeros_like(time)
    q = 0.0
    for k, i in enumerate(current[:-1]):
        for _ in range(fine):
            q += step * (R2 * i - q / C) / (R1 + R2)
        charge[k + 1] = q
    return charge


def driven(current, **more) -> Record:
    time = 0.1 * np.arange(current.size)
    charge = charge_of(time, current)
    # R1 dQ/dt + Q/C
    voltage = R1 * (R2 * current - charge / C) / (R1 + R2) + charge / C
    measured = voltage + noise(current.size, 4e-3)
    elongation = ALPHA * charge + noise(current.size, 3e-6, 1)
    return record(time, current=current, voltage=measured, displacement=elongation, **more)


def square(cycles: int = 10):
    return np.tile(np.repeat([0.9, -0.9], 25), cycles)


def random_bits(count: int = 120):
    return np.repeat(np.where(np.random.default_rng(3).random(count) < 0.5, -0.5, 0.5), 8)


@pytest.mark.parametrize(
    ("made", "title", "true"),
    [
        (held_force(), "held force with creep", BURGERS),
        (held_force(rest=30.0, bias=0.4), "held force with creep", BURGERS),
        (held_voltage(), "held voltage", CIRCUIT),
        (driven(square()), "triangle of charge", {"alpha": ALPHA}),
        (driven(random_bits()), "PRBS", CIRCUIT),
        (driven(np.concatenate([np.zeros(30), square(), np.zeros(20)])), "triangle of charge", {}),
    ],
)
def test_a_test_is_recognised_and_read(made, title, true):
    kind = kind_of(made)
    assert kind is not None
    assert kind.title == title
    read = kind.read(made, CIRCUIT)
    assert set(true) <= set(kind.tells)
    for name, value in true.items():
        assert read[name].value == pytest.approx(value, rel=0.05), name
        low, high = read[name].interval
        assert low < read[name].value < high, name


@pytest.mark.slow
@pytest.mark.parametrize("bias", [0.0, 0.4])
def test_intervals_of_the_creep_hold_the_truth_although_the_reading_is_biased(bias):
    """Five time constants before the line of eq. 3.3, k2 and b2 are off by more than noise is."""
    held = dict.fromkeys(BURGERS, 0)
    for seed in range(20):
        made = held_force(rest=20.0, bias=bias, held=1500.0, seed=seed)
        for name, estimate in kind_of(made).read(made, {}).items():
            low, high = estimate.interval
            held[name] += low <= BURGERS[name] <= high
            assert high - low < 0.2 * BURGERS[name], name
    assert min(held.values()) >= 17, held  # 95 % of 20, with 98 %


@pytest.mark.parametrize(
    "made",
    [
        driven(np.linspace(-0.9, 0.9, 500)),
        driven(np.full(500, 0.9)),
        driven(np.zeros(500), force=np.full(500, 1.0)),
        driven(0.9 * np.sin(np.arange(500) / 10.0)),
    ],
    ids=["ramp", "constant current", "rest", "sine"],
)
def test_what_is_no_test_of_the_thesis_is_not_called_one(made):
    assert kind_of(made) is None


def test_two_steps_of_the_load_are_no_held_force():
    made = held_force()
    force = made.signals["force"].copy()
    force[1200:] = 0.0
    twice = record(made.time, force=force, displacement=made.signals["displacement"])
    assert kind_of(twice) is None
