"""Claims: Ctrl-C reaches what runs in a process of its own, which may end with it, go on, or end its process."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process
from tests.support.command import posix

pytestmark = posix


def rest(then):
    """Until Ctrl-C is heard, which is between two steps of whatever runs."""
    try:
        for _ in range(600):
            time.sleep(0.05)
    except KeyboardInterrupt:
        if then == "ends its process":
            os._exit(7)
        if then == "ends":
            raise
    return then


@pytest.fixture
def process():
    with Process(Limits()) as one:
        assert one.call(os.getpid) != os.getpid()  # it is up
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        yield one


def test_what_hears_it_may_still_answer(process):
    assert process.call(rest, "goes on") == "goes on"


def test_what_ends_with_it_is_interrupted(process):
    with pytest.raises(KeyboardInterrupt):
        process.call(rest, "ends")


def test_a_process_that_ends_with_it_was_interrupted(process):
    with pytest.raises(Ended) as ended:
        process.call(rest, "ends its process")
    assert ended.value.interrupted
    assert "exit status 7" in ended.value.reason
