"""Claims: beside a running rig the estimator sees an actuator age, alarms once at the stated rise
and not before, and rides out what telemetry lacks.
"""

import numpy as np
import pytest

from orchestration.rig.watch import Feed, ageing_observed

PERIOD = 0.1  # s
R2, C = 2.35, 3.2


def telemetry(r1_at, duration):
    """Yield messages of R2 across R1 and C in series, with +-1 A at 0.1 Hz, exactly solved."""
    charge = 0.0
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        current = 1.0 if (t + 2.5) % 10.0 < 5.0 else -1.0
        r1 = r1_at(t)
        voltage = R2 * (r1 * current + charge / C) / (r1 + R2)
        yield {
            "clock": 1000.0 + t,
            "inputs": {"current": current},
            "read_back": {},
            "outputs": {"voltage": voltage},
        }
        decay = np.exp(-PERIOD / ((r1 + R2) * C))
        charge = charge * decay + (1.0 - decay) * R2 * C * current


def alarms(feed):
    items = feed.since(-1).items
    return [item["text"] for item in items if item["kind"] == "event" and item["what"] == "alarm"]


def run(r1_at, rise=0.15, duration=3000.0, lost=lambda k: False):
    feed = Feed()
    told = []
    at = []
    with ageing_observed(feed, rise, told.append) as observe:
        for k, message in enumerate(telemetry(r1_at, duration)):
            if not lost(k):
                observe(message)
            if told and not at:
                at.append(k * PERIOD)
    assert alarms(feed) == told
    return told, at


def impedance(r1):
    """Magnitude of eq. 4.10 at 0.628 rad/s, by complex numbers."""
    branch = r1 + 1.0 / (0.628j * C)
    return abs(R2 * branch / (R2 + branch))


def growing(t):
    """R1 that grows by three quarters in 3000 s."""
    return 0.4 * (1.0 + t / 4000.0)


def test_an_alarm_comes_once():
    told, at = run(lambda t: 0.4 if t < 200.0 else 0.9, duration=400.0)
    assert len(told) == 1
    assert at[0] > 200.0


@pytest.mark.slow
def test_it_comes_after_the_rise_within_two_memories():
    told, at = run(growing)
    assert len(told) == 1
    assert told[0].startswith("ALARM: the impedance has risen by 15.0 %; the derated voltage limit")
    times = np.arange(0.0, 3000.0)
    first = impedance(growing(0.0))
    crossed = times[np.argmax([impedance(growing(t)) > 1.15 * first for t in times])]
    assert crossed < at[0] < crossed + 2 * 260.0


def test_an_actuator_that_stays_is_no_alarm():
    assert run(lambda t: 0.4, rise=0.01, duration=400.0) == ([], [])


@pytest.mark.slow
def test_samples_that_are_lost_delay_the_alarm_and_make_none():
    def lost(k):
        return k % 50 == 7 or 9000 < k < 9200

    assert len(run(growing, lost=lost)[0]) == 1
    assert run(lambda t: 0.4, rise=0.05, duration=1500.0, lost=lost) == ([], [])


def test_a_rig_without_voltage_is_not_observed():
    feed = Feed()
    with ageing_observed(feed, 0.1) as observe:
        for k in range(5):
            observe({"clock": float(k), "inputs": {}, "read_back": {}, "outputs": {}})
    assert alarms(feed) == []
