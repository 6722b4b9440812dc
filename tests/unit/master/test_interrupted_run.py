"""Claims: Ctrl-C is heard between steps, and leaves what was computed."""

from __future__ import annotations

import os
import signal

import pytest

from orchestration.master import run
from orchestration.master.step_control import StepDoubling
from tests.support.master.failing import TIME, chain, ones
from tests.support.master.samples import ring


@pytest.mark.parametrize("how", ["key", "exception"])
def test_ctrl_c_leaves_what_was_computed(member, how):
    """As a signal, which is heard after the step; and as the exception, wherever it comes from."""
    before = signal.getsignal(signal.SIGINT)

    def press(done):
        if done >= 20:
            if how == "exception":
                raise KeyboardInterrupt
            os.kill(os.getpid(), signal.SIGINT)
            undisturbed.append(done)

    undisturbed = []
    result = run(chain(member), TIME, ones(), progress=press)
    assert undisturbed == ([20] if how == "key" else [])
    assert not result.complete
    assert result.message.startswith("interrupted at ")
    assert result.message.endswith("of 5 s")
    expected = run(chain(member), TIME, ones())
    count = result.time.size
    assert 20 <= count <= 21
    assert result.signals["bad.x"].tolist() == expected.signals["bad.x"][:count].tolist()
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_is_heard_between_the_steps_that_a_tolerance_demands(member, monkeypatch):
    """One step of the system in thousands of its own: it does not go on to the end."""
    plain, times = StepDoubling._step, []

    def step(adaptive, start, end, k):
        plain(adaptive, start, end, k)
        times.append(end)
        if len(times) == 30:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(StepDoubling, "_step", step)
    system = ring(member, {"a": {"start": 1.0}, "b": {}}, "a.x -> b.u; b.x -> -1 a.u")
    result = run(system, TIME[[0, 50]], tolerance=1e-8)
    assert len(times) <= 32
    assert (result.time.tolist(), result.complete) == ([0.0], False)
    assert result.message == "interrupted at 0 s of 5 s"
    assert result.signals["a.x"].tolist() == [1.0]


def test_ctrl_c_at_the_very_end_leaves_nothing_unchecked(member):
    def press(done):
        if done == TIME.size:
            raise KeyboardInterrupt

    result = run(chain(member), TIME, ones(), progress=press)
    assert (result.time.size, result.complete, result.message) == (
        TIME.size,
        False,
        "interrupted at 5 s of 5 s",
    )
