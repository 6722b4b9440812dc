"""Claims: Ctrl-C reaches what runs in a process of its own, which may end with it, go on, or end
its process.
"""

from __future__ import annotations

import os
import random
import signal
import threading
import time

import pytest

from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process
from tests.support.command import posix

pytestmark = posix


def rest(then, begun):
    """Until Ctrl-C is heard, which is between two steps of whatever runs."""
    try:
        begun()
        for _ in range(600):
            time.sleep(0.05)
    except KeyboardInterrupt:
        if then == "ends its process":
            os._exit(7)
        if then == "ends":
            raise
    return then


def identity():
    """Number of the process, which has imported this module when it answers."""
    return os.getpid()


def later(seconds, value):
    """Compute something for a while."""
    time.sleep(seconds)
    return value


def press():
    """Press Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)


def press_soon():
    """Press Ctrl-C while the process rests, at any moment of the wait for its answer."""
    threading.Timer(random.uniform(0.0, 0.3), press).start()


def kill_one_inside():
    """Start an isolated process in this one, kill it, and return its exit status."""
    inner = Process(Limits()).__enter__()
    inner.kill()
    return inner._process.wait(1.0)


@pytest.fixture
def process():
    with Process(Limits()) as one:
        # an interrupt while the module is imported would be heard before there is anything to end
        assert one.call(identity) != os.getpid()
        yield one


def test_only_calls_of_an_fmu_have_a_limited_time():
    """Not the process as it starts, nor what it computes by itself."""
    with Process(Limits(step_timeout=0.1)) as one:
        assert one.call(later, 0.4, "done") == "done"


def test_a_process_inside_another_is_killed_alone(process):
    """It is in the group of the other, which answers."""
    assert process.call(kill_one_inside) == -signal.SIGKILL


def test_what_hears_it_may_still_answer(process):
    assert process.call(rest, "goes on", callbacks={"begun": press_soon}) == "goes on"


def test_what_ends_with_it_is_interrupted(process):
    with pytest.raises(KeyboardInterrupt):
        process.call(rest, "ends", callbacks={"begun": press_soon})


def test_a_process_that_ends_with_it_was_interrupted(process):
    with pytest.raises(Ended) as ended:
        process.call(rest, "ends its process", callbacks={"begun": press_soon})
    assert ended.value.interrupted
    assert "exit status 7" in ended.value.reason


def test_it_reaches_the_process_also_while_a_callback_runs(process):
    assert process.call(rest, "goes on", callbacks={"begun": press}) == "goes on"


def test_it_reaches_the_process_also_while_the_memory_is_looked_at(process, monkeypatch):
    looks = []

    def look():
        looks.append(None)
        if len(looks) == 1:
            press()

    monkeypatch.setattr(process, "_note_memory", look)
    assert process.call(rest, "goes on", callbacks={"begun": lambda: None}) == "goes on"
    assert looks
