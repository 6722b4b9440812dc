"""Claims: Ctrl-C is noted or raised at the end of what it must not fall into, and nothing loses it;
of the master's use of it there is `test_interrupted_run`.
"""

from __future__ import annotations

import os
import signal
import threading

import casadi as ca
import pytest

from fmus.kit import UserError
from fmus.kit.interrupt import deferred, uninterrupted
from fmus.kit.symbolic import trace
from tests.support.kit_samples import Thermostat


def press():
    os.kill(os.getpid(), signal.SIGINT)


def test_the_first_is_noted_and_the_second_interrupts():
    before = signal.getsignal(signal.SIGINT)
    noted = []

    def press_twice():
        with deferred() as interrupt:
            for _ in range(2):
                noted.append(interrupt.pressed)
                press()

    with pytest.raises(KeyboardInterrupt):
        press_twice()
    assert noted == [False, True]
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("error", [None, UserError("of the laws")], ids=["result", "error"])
def test_it_is_raised_at_the_end_however_that_comes(error):
    before = signal.getsignal(signal.SIGINT)
    reached = []

    @uninterrupted()
    def work():
        press()
        reached.append(1)
        if error is not None:
            raise error

    for count in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            work()
        assert len(reached) == count
    assert signal.getsignal(signal.SIGINT) is before


def test_within_another_it_waits_for_the_end_of_that():
    reached = []

    def work():
        uninterrupted()(press)()
        reached.append(1)

    with pytest.raises(KeyboardInterrupt):
        uninterrupted()(work)()
    with deferred() as interrupt:
        work()
    assert interrupt.pressed
    assert reached == [1, 1]


def test_in_another_thread_it_does_nothing():
    """Python interrupts its main thread alone, and no other may set a handler."""
    results = []

    @uninterrupted()
    def work():
        results.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert results == [signal.default_int_handler]


@pytest.fixture
def pressed_in_operator(monkeypatch):
    """Ctrl-C in what the next operator of CasADi calls to learn of its operands."""
    plain = ca.DM_from_array

    def pressing(*arguments):
        monkeypatch.undo()
        press()
        return plain(*arguments)

    monkeypatch.setattr(ca, "DM_from_array", pressing)


def test_an_operator_discards_it(pressed_in_operator):
    """Else there is nothing to be done about it any more."""
    assert str(ca.SX.sym("x") * 2.0) == "(2.*x)"


def test_a_trace_does_not(pressed_in_operator):
    with pytest.raises(KeyboardInterrupt):
        trace(Thermostat)
