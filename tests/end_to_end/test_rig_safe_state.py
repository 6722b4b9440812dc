"""Claims: a device that holds its last value is brought to its safe values, whatever dies, whatever
there is none left of, and however often it has been told before; and safe is what it reports.

The oracle is the device itself, a file that no process of the server cleans up.
"""

from __future__ import annotations

import os
import signal
import struct
import time

import pytest

from tests.support.command import posix
from tests.support.rig.driver import Driver
from tests.support.rig.exhausted import no_descriptors, no_memory, no_threads
from tests.support.rig.process import Server

pytestmark = [posix, pytest.mark.timeout(120), pytest.mark.real_time]

PATIENCE = 3.0  # s, for what is promised within half a second on a quiet machine
COMMANDS = (0.8, 1.0)


def held(folder):
    """Return the commands that the device holds."""
    return struct.unpack("<2d", (folder / "calls.log.held").read_bytes())


def wait_held(folder, values, patience=PATIENCE):
    """Wait until the device holds some values; return after how many seconds it did."""
    begun = time.monotonic()
    while held(folder) != values:
        assert time.monotonic() - begun < patience, f"still {held(folder)} after {patience:g} s"
        time.sleep(0.001)
    return time.monotonic() - begun


def driven(server, folder):
    """Drive a server until its device holds the commands; return the client."""
    driver = Driver(server.wait_ready(), lambda number: COMMANDS)
    driver.start()
    wait_held(folder, COMMANDS)
    return driver


@pytest.mark.slow
@pytest.mark.parametrize("event", ["INT", "TERM", "HUP", "front", "guard", "standby", "device"])
@pytest.mark.parametrize("without", [no_threads, no_memory, no_descriptors])
def test_nothing_on_the_way_to_safe_has_to_be_started_or_opened(tmp_path, without, event):
    with Server(tmp_path) as server:
        driver = driven(server, tmp_path)
        roles = server.roles()
        with without(server.family()):
            if event in roles:
                os.kill(roles[event], signal.SIGKILL)
            else:
                server.process.send_signal(signal.Signals[f"SIG{event}"])
            if (without, event) == (no_memory, "standby"):  # a new process has its own
                driver.wait(50)
                assert driver.samples[-1]["state"] == "running"
                driver.stop()
            took = wait_held(tmp_path, (0.0, 0.0))
            print(f"{without.__name__} {event}: safe after {1e3 * took:.0f} ms")
            time.sleep(0.3)
            assert held(tmp_path) == (0.0, 0.0)
        driver.stop(orderly=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ALRM", "XCPU", "VTALRM", "PROF", "ABRT", "SEGV", "BUS", "RTMIN"])
def test_a_signal_to_all_processes_ends_safe(tmp_path, name):
    with Server(tmp_path) as server:
        driver = driven(server, tmp_path)
        for number in server.family():
            os.kill(number, signal.Signals[f"SIG{name}"])
        took = wait_held(tmp_path, (0.0, 0.0))
        print(f"{name}: safe after {1e3 * took:.0f} ms")
        driver.stop(orderly=False)
