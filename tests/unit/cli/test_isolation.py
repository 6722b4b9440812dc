"""Claims: FMUs that are not ours run in a process of their own unless that is not wanted, and a
second Ctrl-C ends what hears none.
"""

import signal
import subprocess
import sys
import time

import pytest

from fmus.kit import UserError
from orchestration.cli.isolation import given_limits, isolating, limits
from orchestration.fmu.isolation import Limits, limits_of
from tests.support.command import posix


def options(isolate=None, timeout=None, memory=None):
    return {"isolate": isolate, "step_timeout": timeout, "memory_limit": memory}


@pytest.mark.parametrize(
    ("foreign", "given", "expected"),
    [
        (True, options(), Limits()),
        (False, options(), None),
        (True, options(isolate=False), None),
        (False, options(isolate=True, timeout=5.0), Limits(5.0)),
        (True, options(memory=1e9), Limits(memory=1e9)),
    ],
)
def test_what_is_not_ours_is_isolated_unless_the_user_says_otherwise(foreign, given, expected):
    assert limits(foreign, given) == expected


@pytest.mark.parametrize(
    ("given", "flag"),
    [(options(timeout=5.0), "--step-timeout"), (options(memory=1e9), "--memory-limit")],
)
def test_limits_of_what_is_not_isolated_are_refused(given, flag):
    with pytest.raises(UserError, match=f"{flag} is for an FMU in a process of its own"):
        limits(False, given)
    assert given_limits(None, given) != Limits()  # while nobody knows yet whose the FMU is


def test_many_runs_are_isolated_while_the_context_lasts():
    for isolate, expected in ((None, Limits()), (True, Limits()), (False, None)):
        with isolating(isolate):
            assert limits_of(foreign=True) == expected
            assert limits_of(foreign=False) is None
    assert limits_of(foreign=True) is None


# a mutex that is locked twice waits for ever, whatever signals come
DEAF = """
import ctypes
from orchestration.cli.isolation import hearing_ctrl_c

libc, mutex = ctypes.CDLL(None), ctypes.create_string_buffer(128)
libc.pthread_mutex_lock(mutex)
with hearing_ctrl_c(None):
    print("ready", flush=True)
    libc.pthread_mutex_lock(mutex)
"""


@posix
def test_a_second_ctrl_c_ends_what_hears_none():
    with subprocess.Popen(
        [sys.executable, "-c", DEAF], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as deaf:
        try:
            assert deaf.stdout.readline() == "ready\n"
            time.sleep(0.3)  # until it is in the call that hears nothing
            deaf.send_signal(signal.SIGINT)
            time.sleep(0.8)
            assert deaf.poll() is None
            deaf.send_signal(signal.SIGINT)
            _, told = deaf.communicate(timeout=20)
        finally:
            deaf.kill()
    assert (deaf.returncode, told) == (130, "interrupted\n")
