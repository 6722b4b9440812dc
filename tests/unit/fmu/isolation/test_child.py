"""Claims: whatever a function in an isolated process does, there is an answer, and the next call is
answered too.
"""

from __future__ import annotations

import os
import sys

import pytest

from fmus.kit import UserError
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Process


def add(one, other):
    return one + other


def count(to, tell):
    for k in range(to):
        tell(k, k * k)
    return to


def print_and_read():
    """Writes where answers are sent, as an FMU may, and reads where calls are."""
    print("I am an FMU", flush=True)
    os.write(1, b"and I am its library\n")
    return sys.stdin.read()


def refuse():
    raise UserError("not with me")


def fail():
    raise KeyError("nothing")


def take_all_memory():
    raise MemoryError


def return_a_function():
    return lambda: 0


@pytest.fixture(scope="module")
def process():
    with Process(Limits()) as one:
        yield one


def test_results_and_calls_on_the_way(process):
    told = []
    assert process.call(add, 2, 3) == 5
    assert process.call(count, 3, callbacks={"tell": lambda *pair: told.append(pair)}) == 3
    assert told == [(0, 0), (1, 1), (2, 4)]


@pytest.mark.parametrize(
    ("function", "error", "message"),
    [
        (refuse, UserError, "not with me"),
        (fail, KeyError, "nothing"),
        (take_all_memory, UserError, "out of memory"),
        (return_a_function, RuntimeError, "local"),
    ],
)
def test_errors_are_raised_here_and_the_process_goes_on(process, function, error, message):
    with pytest.raises(error, match=message):
        process.call(function)
    assert not process.busy
    assert process.call(add, 1, 1) == 2


def test_what_is_printed_is_no_answer_and_nothing_can_be_read(capfd):
    with Process(Limits()) as process:
        assert process.call(print_and_read) == ""
        assert process.call(add, 1, 1) == 2
    assert "and I am its library" in capfd.readouterr().err
