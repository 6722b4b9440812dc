"""Scheduling: deadlines never drift nor pile up; a note says if priority or core cannot be had."""

from __future__ import annotations

import errno
import gc
import os
import re
import subprocess
import sys
import time
from math import isclose

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.rig.server import scheduling
from orchestration.rig.server.scheduling import Deadlines, ProcessorTime, Suspension

pytestmark = pytest.mark.real_time


@given(st.floats(1e-3, 10.0), st.floats(0.0, 1e6), st.lists(st.floats(0.0, 30.0), max_size=50))
def test_deadlines_are_whole_periods_from_the_start_and_none_is_in_the_past(period, start, delays):
    deadlines, now = Deadlines(period, start), start
    for taken, delay in enumerate(delays, start=1):
        deadlines.advance(now)
        number = (deadlines.next - start) / period
        assert isclose(number, round(number), abs_tol=1e-6 * max(1.0, start / period))
        assert deadlines.next > now - 1e-9 * max(1.0, start)
        assert round(number) == taken + deadlines.missed
        now = deadlines.next + delay


def test_waking_early_is_no_missed_deadline():
    deadlines = Deadlines(1.0, 0.0)
    deadlines.advance(0.0)
    deadlines.advance(0.3)  # woken by an order in the middle
    assert (deadlines.next, deadlines.missed) == (2.0, 0)
    deadlines.advance(5.5)
    assert (deadlines.next, deadlines.missed) == (6.0, 3)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="cores as Linux has them")
def test_a_core_is_taken_or_it_is_noted_why_not():
    """In a process of its own, which this is not to be kept on one core."""
    code = (
        "import os; from orchestration.rig.server.scheduling import prefer; core ="
        " min(os.sched_getaffinity(0)); assert prefer(None, core) == [] and os.sched_getaffinity(0)"
        " == {core}; notes = prefer(None, 100000); assert len(notes) == 1 and"
        " notes[0].startswith('--device-cpu 100000: '), notes; os.setuid(65534) if os.getuid() == 0"
        " else None; notes = prefer(50, None); print(*notes)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    without = done.stdout.strip().split("it goes on without")[:-1]
    priority = "--device-priority 50: Operation not permitted;"
    memory = "--device-priority 50: memory cannot be locked: "
    assert all(line.strip() == priority or line.strip().startswith(memory) for line in without)


def test_a_suspend_is_the_time_by_which_one_clock_is_ahead_of_the_other(monkeypatch):
    """The clocks are the test's own, as a machine that runs tests is not to be suspended."""
    clocks = {"boot": 50.0, "monotonic": 20.0}

    def read(name):
        clocks["monotonic"] += 1e-4  # the two are read one after the other
        clocks["boot"] += 1e-4
        return clocks[name]

    monkeypatch.setattr(time, "CLOCK_BOOTTIME", 7, raising=False)
    monkeypatch.setattr(time, "clock_gettime", lambda number: read("boot"), raising=False)
    monkeypatch.setattr(time, "monotonic", lambda: read("monotonic"))
    suspension = Suspension()
    assert suspension.since() == 0.0
    clocks["boot"] += 12.0
    assert suspension.since() == pytest.approx(12.0, abs=1e-3)
    assert suspension.since() == 0.0


def test_of_a_computer_that_runs_no_suspend_is_seen():
    suspension = Suspension()
    time.sleep(0.05)
    assert suspension.since() == 0.0


def test_the_collector_leaves_what_was_there_and_collects_what_is_new():
    code = (
        "import gc, weakref; from orchestration.rig.server.scheduling import Collector\nclass Knot:"
        " pass\ncollector = Collector(); assert not gc.isenabled() and gc.get_freeze_count() >"
        " 0\nknot = Knot(); knot.itself = knot; seen = weakref.ref(knot); del knot\nassert seen()"
        " is not None; collector.collect(5.0); assert seen() is None\nknot = Knot(); knot.itself ="
        " knot; seen = weakref.ref(knot); del knot\ncollector.collect(5.5); assert seen() is not"
        " None; collector.collect(6.5); assert seen() is None\n"
    )
    assert gc.isenabled()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.real_time(limit=0.005)
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="proc(5)")
@pytest.mark.parametrize(
    ("body", "is_beside_another", "withheld"),
    [
        ("while True: pass", True, True),
        ("while True: pass", False, False),
        ("input()", True, False),
    ],
)
def test_a_process_that_the_machine_does_not_run_is_told_from_one_that_hangs(
    body, is_beside_another, withheld
):
    """On one core, where an idle process gets next to nothing beside another one."""
    core = min(os.sched_getaffinity(0))

    def program(policy, body):
        return (
            f"import os; os.sched_setaffinity(0, {{{core}}}); os.sched_setscheduler(0,"
            f" os.SCHED_{policy}, os.sched_param(0)); print(flush=True)\n{body}"
        )

    bodies = [program("IDLE" if is_beside_another else "OTHER", body)]
    bodies += [program("OTHER", "while True: pass")] * is_beside_another
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    processes = []
    try:
        for body in bodies:  # one by one: beside the other the idle one would not begin
            processes.append(subprocess.Popen([sys.executable, "-c", body], **pipes))
            processes[-1].stdout.readline()
        time.sleep(0.2)  # until they have begun
        processor = ProcessorTime(processes[0].pid)
        seen = []
        for number in range(3):  # other work of this core may be in the way
            processor.note(number)
            time.sleep(0.2)
            seen.append(processor.was_withheld(0.2))
        assert seen.count(withheld) >= 2
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def test_of_a_process_that_has_ended_nothing_is_known():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    processor = ProcessorTime(ended.pid)
    ended.wait()
    processor.note(1.0)
    assert not processor.was_withheld(0.2)


def test_a_watchdog_time_is_that_of_a_busy_machine_where_no_priority_is_permitted(monkeypatch):
    def refuse(priority):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    told = []
    monkeypatch.setattr(scheduling, "_set_priority", refuse)
    watchdog = scheduling.default_watchdog(told.append)
    (line,) = told
    withheld = float(re.search(r"up to (\S+) ms of its time", line)[1])
    assert 0.2 <= watchdog <= 2.0
    assert watchdog == 2.0 or watchdog > 3.9e-3 * withheld
    assert "Operation not permitted" in line
    assert f"watchdog time is {watchdog:g} s" in line
    monkeypatch.setattr(scheduling, "_set_priority", lambda priority: None)
    assert scheduling.default_watchdog(told.append) == 0.2
    assert len(told) == 1


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="this system has no priorities")
def test_a_priority_ends_with_its_context_and_is_not_that_of_a_child():
    code = (
        "import os, subprocess, sys; from orchestration.rig.server.processes import undisturbed;"
        " from orchestration.rig.server.scheduling import preferred; tell = [sys.executable, '-S',"
        " '-c', 'import os; print(os.sched_getscheduler(0))']\n"
        "with preferred(7) as refusal:\n"
        "    mine = os.sched_getscheduler(0)\n"
        "    with undisturbed():\n"
        "        child = subprocess.run(tell, capture_output=True, text=True).stdout\n"
        "    assert os.sched_getscheduler(0) == mine\n"
        "print(refusal or [mine == os.SCHED_FIFO, child, os.sched_getscheduler(0)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout in ("[True, '0\\n', 0]\n", "Operation not permitted\n")
