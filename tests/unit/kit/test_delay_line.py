"""Claims: a delay line gives the signal of a while ago, as far as its samples tell.

Oracle: the signal itself, as a function of time.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit.delay_line import DelayLine
from fmus.kit.sampling import DELAY_SAMPLES

PERIOD = 0.5
ABOUT = {"unit": "V", "nominal": 1.0, "display": None}


def shown(line, signal, delay, instants):
    """Return what a line shows of a signal that is sampled every period from 0 on."""
    start = {name: variable.start for name, variable in line.variables("delay").items()}
    component = SimpleNamespace(**start, time=0.0)
    setattr(component, line.delay, delay)
    laws = {name.removesuffix("_update"): law for name, law in line.updates().items()}
    begin = f"{line.delay}_begin"
    values, sample = [], 0
    for instant in instants:
        while sample * PERIOD <= instant:
            component.time = sample * PERIOD
            value = signal(component.time)
            found = {
                n: law(component, value) for n, law in laws.items() if sample == 0 or n != begin
            }
            vars(component).update(found)
            sample += 1
        component.time = instant
        values.append(line.delayed(component, signal(instant)))
    return np.array(values)


@pytest.mark.parametrize("delay", [0.0, 0.2, 1.0, 3.7, 32.0])
def test_a_ramp_is_late_by_the_delay(delay):
    instants = np.arange(0.0, 80.0, 0.13)
    values = shown(DelayLine("u", PERIOD, ABOUT), lambda t: 2.0 + 3.0 * t, delay, instants)
    assert values == pytest.approx(2.0 + 3.0 * np.maximum(instants - delay, 0.0), abs=1e-8)


@pytest.mark.parametrize("delay", [0.5, 2.0, 3.7])
def test_a_jump_of_a_held_signal_is_a_ramp_about_its_arrival(delay):
    """One of a signal that is not held ends there, since the sample at the jump sees it."""
    instants = np.arange(0.0, 12.0, 0.013)

    def jump(t):
        return 0.0 if t < 5.0 else 1.0

    arrival = 5.0 + delay
    for is_held, middle in ((True, arrival), (False, arrival - 0.5 * PERIOD)):
        values = shown(DelayLine("u", PERIOD, ABOUT, is_held), jump, delay, instants)
        expected = np.clip(0.5 + (instants - middle) / PERIOD, 0.0, 1.0)
        assert values == pytest.approx(expected, abs=1e-8)


def test_the_longest_delay_is_as_long_as_the_register():
    delay = DelayLine("u", PERIOD, ABOUT).variables("delay")["u_delay"]
    assert delay.max == DELAY_SAMPLES * PERIOD
    assert not delay.tunable
