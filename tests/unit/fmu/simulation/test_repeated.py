"""Claims: an FMU that is run again and again is as if each run were its first. Oracle: ``tau dx/dt
= u - x``.
"""

from __future__ import annotations

import os
import signal
import threading
import time as clock
from pathlib import Path

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu.kernel import Pulse
from orchestration.fmu.simulation.repeated import RepeatedFmu
from tests.support.hosts import build_one_state_fmu
from tests.support.kernel import without_compiler
from tests.support.master.sleeper import build_sleeper

TIME = 0.1 * np.arange(51)


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return build_one_state_fmu(tmp_path_factory.mktemp("lag"))


def course(level, tau, time=TIME):
    """Exact for an input that is held."""
    return level * (1.0 - np.exp(-time / tau))


def test_what_changes_between_runs_counts(lag):
    """Parameters, inputs, times and outputs, one after the other and back."""
    one, two, short = np.ones(51), np.full(51, 2.0), TIME[:11]
    with RepeatedFmu(lag) as fmu:
        first = fmu.run(TIME, {"u": one}, {"tau": 1.0}, ["x"])
        assert fmu.run(TIME, {"u": one}, {"tau": 3.0}, ["x"])[:, 0] == pytest.approx(
            course(1.0, 3.0), abs=1e-12
        )
        assert fmu.run(TIME, {"u": two}, {"tau": 3.0}, ["x"])[:, 0] == pytest.approx(
            course(2.0, 3.0), abs=1e-12
        )
        found = fmu.run(short, {"u": two[:11]}, {"tau": 1.0}, ["x"])[:, 0]
        assert found == pytest.approx(course(2.0, 1.0, short), abs=1e-12)
        assert fmu.run(TIME, {}, {"tau": 1.0}, ["x"])[:, 0].tolist() == [0.0] * 51
        again = fmu.run(TIME, {"u": one}, {"tau": 1.0}, ["x"])
    assert first[:, 0] == pytest.approx(course(1.0, 1.0), abs=1e-12), (
        "what was handed out is not written over"
    )
    assert again.tobytes() == first.tobytes()


def test_without_a_compiler_it_is_the_same(lag):
    def ran():
        with RepeatedFmu(lag) as fmu:
            return [
                fmu.run(TIME, {"u": np.sin(TIME)}, {"tau": tau}, ["x"]).tobytes()
                for tau in (0.5, 2.0, 0.5)
            ]

    expected = ran()
    with without_compiler():
        assert ran() == expected


def test_what_is_no_input_is_refused(lag):
    with (
        RepeatedFmu(lag) as fmu,
        pytest.raises(UserError, match=r"x is not an input; inputs are u"),
    ):
        fmu.run(TIME, {"x": TIME}, {}, ["x"])


def test_an_interrupt_is_heard_in_any_run_and_no_thread_is_left_behind(tmp_path):
    path, still = build_sleeper(tmp_path), {"delay": 0.0, "until": 1e9}

    def pulses():
        return [thread for thread in threading.enumerate() if thread.name == "kernel pulse"]

    with RepeatedFmu(path) as fmu:
        fmu.run(TIME, {}, still, ["voltage_age"])
        fmu.run(TIME, {}, still, ["voltage_age"])
        assert len(pulses()) == 1, "runs share one"
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        begun = clock.perf_counter()
        with pytest.raises(KeyboardInterrupt):
            fmu.run(0.01 * np.arange(40_000.0), {}, {"delay": 0.01, "until": 1e9}, ["voltage_age"])
        assert clock.perf_counter() - begun < 30.0, "of 400 s"
    assert not pulses()


def test_a_run_that_takes_too_long_is_given_up(tmp_path):
    """Stepped by someone who sleeps; the next run is as ever."""
    path, time = build_sleeper(tmp_path), 0.1 * np.arange(2001)
    with RepeatedFmu(path) as fmu:
        begin = clock.monotonic()
        with pytest.raises(UserError, match=r"takes too long from [0-9.]+ s on") as refused:
            fmu.run(time, {}, {"delay": 0.01, "until": 1e9}, ["voltage_age"], longest=0.3)
        assert clock.monotonic() - begin < 5.0
        assert "\n" not in str(refused.value)
        assert np.isfinite(
            fmu.run(time[:3], {}, {"delay": 0.0, "until": 1e9}, ["voltage_age"])
        ).all()


def test_the_fmu_is_closed_also_if_its_pulse_cannot_be_ended(lag, monkeypatch):
    ends = Pulse.__exit__

    def fails(pulse, *error):
        ends(pulse, *error)
        raise OSError("no thread")

    monkeypatch.setattr(Pulse, "__exit__", fails)
    fmu = RepeatedFmu(lag).__enter__()
    folder = Path(fmu._fmu._folder)
    assert folder.exists()
    with pytest.raises(OSError, match="no thread"):
        fmu.__exit__(None, None, None)
    assert not folder.exists()
