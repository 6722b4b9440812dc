"""Claims: answers of a pool are those of what was asked, whatever goes wrong between question and
answer.
"""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

import orchestration as ppy
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.pool import Pool
from orchestration.fmu.isolation.process import Ended
from orchestration.fmu.isolation.shared_progress import SharedProgress
from tests.support.hosts import build_one_state_fmu


def begin():
    """Nothing to begin with."""


def later(seconds, value):
    time.sleep(seconds)
    return value


def wrong(value):
    raise ValueError(value)


@pytest.mark.slow
def test_an_answer_that_nobody_waited_for_is_no_answer_to_the_next_question(monkeypatch):
    looked = []

    def once(box):
        if not looked:
            looked.append(box)
            raise EOFError("looked at the wrong moment")
        return original(box)

    original = SharedProgress.state
    with Pool(Limits(), 1, begin) as pool:
        assert pool.submit(later, 0.0, 1).result() == 1
        monkeypatch.setattr(SharedProgress, "state", once)
        with pytest.raises(EOFError):
            pool.submit(later, 0.5, "stale").result()
        assert pool.submit(later, 0.0, 2).result() == 2
        assert looked


def test_a_process_whose_function_fails_is_asked_again():
    with Pool(Limits(), 1, begin) as pool:
        first = pool.submit(later, 0.0, "x")
        assert first.result() == "x"
        with pytest.raises(ValueError, match="told"):
            pool.submit(wrong, "told").result()
        assert pool.submit(later, 0.0, 3).result() == 3
        assert len(pool._started) == 1


def test_a_process_that_has_ended_is_replaced():
    with Pool(Limits(), 1, begin) as pool:
        with pytest.raises(Ended, match="exit status 3"):
            pool.submit(os._exit, 3).result()
        assert pool.submit(later, 0.0, 2).result() == 2


@pytest.mark.slow
def test_whoever_looks_at_a_worker_at_any_moment_sees_what_it_does(monkeypatch, tmp_path):
    """Looks without a pause: what a run is described by is there whenever the run goes on."""
    monkeypatch.setattr("orchestration.fmu.isolation.process._PERIOD", 1e-5)
    fmu = build_one_state_fmu(tmp_path)
    clock = 0.01 * np.arange(11)
    values = np.linspace(0.5, 4.0, 3000)
    found = ppy.sweep(
        str(fmu),
        {"tau": values.tolist()},
        {"u": np.ones(11)},
        time=clock,
        outputs=["x"],
        keep=["last"],
        workers=2,
    )
    np.testing.assert_allclose(found["x_last"], 1.0 - np.exp(-0.1 / values), rtol=1e-9)
