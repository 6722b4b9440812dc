"""Claims: processes of the server are out of reach of its terminal, and one is never taken for
another that has its number."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from multiprocessing import get_context

import pytest

from orchestration.rig.server.processes import OtherProcess, Output, undisturbed
from tests.support.command import posix

pytestmark = [posix, pytest.mark.real_time]

SLEEPER = "import time; print('up', flush=True); time.sleep(60.0)"
DETACHED = f"from orchestration.rig.server.processes import detach; detach(); {SLEEPER}"
FOR_ALL = {signal.SIGTERM, signal.SIGCHLD, signal.SIGKILL, signal.SIGSTOP}
OTHERS = sorted(signal.valid_signals() - FOR_ALL)


def started(code):
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    return process


def is_running(process):
    """Return whether it has not ended, and is not stopped."""
    time.sleep(0.01)
    ended, status = os.waitpid(process.pid, os.WNOHANG | os.WUNTRACED)
    return ended == 0, status


def test_a_detached_process_is_indifferent_to_every_signal_for_the_front():
    process = started(DETACHED)
    assert process.stdout.readline() == b"up\n"
    assert os.getsid(process.pid) == process.pid
    for number in OTHERS:
        process.send_signal(number)
        assert is_running(process) == (True, 0), number
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_process_that_is_being_started_is_out_of_reach_from_its_first_instruction_on():
    with undisturbed():
        process = started(DETACHED)
    for number in OTHERS:  # while Python starts
        process.send_signal(number)
    assert process.stdout.readline() == b"up\n"
    assert is_running(process) == (True, 0)
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_signal_that_comes_meanwhile_is_not_lost():
    came = []
    before = signal.signal(signal.SIGUSR1, lambda *_: came.append(1))
    try:
        with undisturbed():
            os.kill(os.getpid(), signal.SIGUSR1)
        assert came == [1]
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_a_peer_is_alive_until_it_ends_even_if_it_is_stopped_or_nobody_has_waited_for_it():
    process = started(SLEEPER)
    peer = OtherProcess(process.pid)
    process.send_signal(signal.SIGSTOP)
    assert peer.is_alive()
    peer.kill()
    peer.join(10.0)
    assert not peer.is_alive(), "a zombie has ended"
    process.wait()
    assert not peer.is_alive()
    peer.kill()  # of which nothing comes
    process.stdout.close()


def test_a_peer_that_never_was_is_not_alive():
    process = started("pass")
    process.wait()
    process.stdout.close()
    peer = OtherProcess(process.pid)
    assert not peer.is_alive()
    peer.join(60.0)


def test_a_deadline_ends_a_process_in_a_call_and_starts_no_thread():
    code = (
        "import os, threading, time; from orchestration.rig.server.processes import deadline;"
        " threading._start_new_thread = None\n"
        "with deadline(9.0): pass\n"
        "with deadline(0.05): assert len(os.listdir('/proc/self/task')) == 1; time.sleep(60.0)"
    )
    process = started(code)
    assert process.wait(10.0) == -signal.SIGALRM
    process.stdout.close()


def test_what_is_reserved_is_there_when_nothing_else_is():
    code = (
        "import mmap, os, resource; from orchestration.rig.server.processes import Reserve\n"
        "reserve = Reserve()\n"
        "size = int(open('/proc/self/statm').read().split()[0]) * mmap.PAGESIZE\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size, size))\n"
        "files = []\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (20, 20))\n"
        "def take():\n"
        "    mmap.mmap(-1, 2**25)\n"
        "    files.append(os.open(os.devnull, os.O_RDONLY))\n"
        "try:\n"
        "    take()\n"
        "except OSError:\n"
        "    reserve.release(); take(); print('up')\n"
    )
    process = started(code)
    assert process.stdout.read() == b"up\n"
    process.stdout.close()
    assert process.wait() == 0


def test_a_peer_is_seen_and_ended_where_no_descriptor_is_left():
    code = (
        "import resource, subprocess, sys; from orchestration.rig.server.processes import"
        " OtherProcess\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60.0)'])\n"
        "known = OtherProcess(child.pid)\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))\n"
        "late = OtherProcess(child.pid)\n"
        "print(known.is_alive(), late.is_alive())\n"
        "late.kill(); known.join(10.0); child.wait(); print(known.is_alive(), late.is_alive())\n"
    )
    process = started(code)
    assert process.stdout.read() == b"True True\nFalse False\n"
    process.stdout.close()
    assert process.wait() == 0


def test_whoever_prints_where_nobody_reads_goes_on():
    output = Output()
    process = get_context("spawn").Process(target=_print_much, args=(output,))
    process.start()
    process.join(30.0)
    assert process.exitcode == 0
    printed = output.read()
    assert 0 < len(printed) <= 900
    assert output.read() == "", "the pipe held no more"


def _print_much(output):
    output.redirect()
    print("first")
    for _ in range(100):
        print("x" * 2000, flush=True)
        print("y" * 2000, file=sys.stderr)
        ctypes.CDLL(None).write(1, b"z" * 2000, 2000)
