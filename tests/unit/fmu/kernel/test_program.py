"""Claims: the pulse lets Ctrl-C be heard, changes no result, and leaves no thread behind."""

from __future__ import annotations

import os
import signal
import threading
import time as clock

import numpy as np
import pytest

from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import program
from orchestration.fmu.simulation import simulate_instance
from tests.support.kernel import (
    CURRENT,
    TIME,
    simulated,
)
from tests.support.master.sleeper import build_sleeper


def test_ctrl_c_is_heard_long_before_progress_is_told(tmp_path):
    """Progress is told every 2 s here; an interrupt waits for a pulse."""
    path = build_sleeper(tmp_path)
    told, pressed = [], []

    def press():
        pressed.append(clock.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    with Fmu(path, {"delay": 0.01, "until": 1e9}) as instance:
        instance.start()
        timer = threading.Timer(0.5, press)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            simulate_instance(instance, 0.01 * np.arange(40_000.0), {}, progress=told.append)
        waited = clock.perf_counter() - pressed[0]
    assert told == [0]
    assert (
        waited < 1.0
    )  # by far less than what is left of the 2 s; 0.1 s on a machine that has nothing else to do
    assert not any(thread.name == "kernel pulse" for thread in threading.enumerate())


def test_pulses_change_nothing(fmu, monkeypatch):
    path = fmu("ppy_actuator", "native")
    expected = simulated(path, TIME, {"current": CURRENT})
    monkeypatch.setattr(program, "PULSE_PERIOD", 1e-6)
    for _ in range(5):
        assert simulated(path, TIME, {"current": CURRENT}) == expected
