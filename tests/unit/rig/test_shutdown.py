"""Shutdown: SIGTERM is taken like Ctrl-C, and what handled it before does so again afterwards."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from orchestration.rig.shutdown import on_termination, until_interrupted
from tests.support.command import posix


def terminate() -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(1.0)  # the signal is handled meanwhile
    pytest.fail("SIGTERM did not arrive")


@posix
def test_a_termination_leaves_the_context_without_an_error():
    before = signal.getsignal(signal.SIGTERM)
    with until_interrupted():
        terminate()
    assert signal.getsignal(signal.SIGTERM) is before


def test_so_does_ctrl_c_and_nothing_else():
    with until_interrupted():
        raise KeyboardInterrupt
    with pytest.raises(ValueError, match="mine"), until_interrupted():
        raise ValueError("mine")


@posix
def test_something_is_done_on_every_termination():
    times: list[int] = []
    with on_termination(lambda: times.append(1)):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
    assert len(times) == 2


def test_in_another_thread_it_does_nothing():
    before = signal.getsignal(signal.SIGTERM)
    inside: list[object] = []

    def work() -> None:
        with on_termination(lambda: None):
            inside.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert inside == [before]
