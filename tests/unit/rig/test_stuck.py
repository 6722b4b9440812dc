"""Claims: a sensor that stays the same out of its character is an alarm, once, and no other is.

So is a write that the device ignores.
"""

from __future__ import annotations

from math import nan, sin

import numpy as np
import pytest

from orchestration.rig.signals import Limit
from orchestration.rig.stuck import StuckMonitor

AFTER = 10  # samples
FROZEN = 50  # sample from which on the sensor is stuck
NOISE = np.random.default_rng(7).standard_normal(200)


def alarms(
    sensor, current=lambda k: sin(0.3 * k), force=lambda k: 1.0, back=nan, after=AFTER, unit="V"
):
    """Return at which of 100 samples there was an alarm, and the alarms."""
    signals = {"current": "A", "force": "N"}, {"shown": unit}
    limits = {"current": Limit(-1.0, 1.0), "force": Limit(0.0, 3.0)}
    monitor = StuckMonitor(signals, limits, after)
    found = []
    for k in range(100):
        applied = current(k), force(k)
        shown = {"shown": sensor(k, *applied)}
        found += [(k, text) for _, text in monitor.check(applied, [back, nan], shown)]
    return found


def frozen(sensor):
    """Return a sensor that sticks."""
    return lambda k, *applied: sensor(k, *applied) if k < FROZEN else 0.5


def of_current(k, current, force):
    return 2.0 * current


def of_force(k, current, force):
    return 0.5 * force


def noisy(k, current, force):
    return 0.5 * force + 1e-3 * NOISE[k]


def coarse(k, current, force):
    """Shows steps of a quarter, as a converter with few of them does."""
    return round(4.0 * current) / 4.0


@pytest.mark.parametrize(
    "about",
    [
        {"sensor": frozen(of_current)},
        {"sensor": frozen(of_current), "current": lambda k: 0.008 * k},  # slowly
        {"sensor": frozen(coarse)},
        {"sensor": frozen(of_force), "force": lambda k: 1.0 + sin(0.2 * k)},
        {"sensor": frozen(noisy), "current": lambda k: 0.0 if k < 40 else sin(0.3 * k)},
    ],
)
def test_a_sensor_that_sticks_is_an_alarm_once(about):
    ((when, text),) = alarms(**about)
    assert when == FROZEN + AFTER - 1
    assert text.startswith("shown has been 0.5 V for 10 samples, while ")
    assert text.endswith(" changed: is its sensor stuck?")


def test_a_sensor_that_has_never_changed_is_an_alarm_once_all_inputs_have():
    ((when, text),) = alarms(lambda k, *applied: 0.5, force=lambda k: 1.0 + 0.1 * max(0, k - 20))
    assert when == 21 + AFTER - 1
    assert text.startswith("shown has been 0.5 V for 31 samples, while current and force changed")


@pytest.mark.parametrize(
    "about",
    [
        {"sensor": lambda k, *applied: 0.5},  # the force has not changed, which it may show
        {"sensor": of_force},  # the current changes, which it does not depend on
        {"sensor": of_force, "force": lambda k: 1.0 + min(1.0, 0.1 * k)},  # nor any more
        {"sensor": of_current, "current": lambda k: min(0.9, 0.1 * k)},  # nothing changes any more
        {"sensor": of_current, "current": lambda k: 0.7 + 0.0049 * (k % 2)},  # by little
        {"sensor": noisy},
        {"sensor": coarse},
        {"sensor": lambda k, *applied: nan},  # none is there, which is told elsewhere
        {"sensor": frozen(of_current), "after": 0},
        {"sensor": frozen(of_current), "unit": "1"},  # a switch may stay as it is
    ],
)
def test_a_sensor_that_has_no_reason_to_change_is_no_alarm(about):
    assert alarms(**about) == []


def test_a_write_that_the_device_ignores_is_an_alarm_once():
    found = alarms(noisy, current=lambda k: 0.5, back=0.0)
    text = "current was written as 0.5 A in 10 samples, and the device has 0 A"
    assert found == [(9, text)]


def test_a_device_that_rounds_ignores_nothing():
    assert alarms(noisy, current=lambda k: 0.5, back=0.519) == []
