"""Claims: a device that holds its last value is brought to its safe values, whatever dies, whatever
there is none left of, and however often it has been told before; and safe is what it reports.

The oracle is the device itself, a file that no process of the server cleans up.
"""

from __future__ import annotations

import os
import signal
import struct
import time
from contextlib import suppress
from itertools import pairwise
from subprocess import PIPE

import pytest

from fmus.kit import UserError
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask, stop
from tests.support.command import here, posix
from tests.support.rig.driver import Driver
from tests.support.rig.exhausted import frozen, no_descriptors, no_memory, no_threads
from tests.support.rig.process import BACKENDS, Server

pytestmark = [posix, pytest.mark.timeout(120), pytest.mark.real_time]

PATIENCE = 3.0  # s, for what is promised within half a second on a quiet machine
COMMANDS = (0.8, 1.0)
ANOTHER_ORDER = """
import struct

class Own(Reporting):
    inputs = {"force": "N", "current": "A"}

    def _hold(self, values):
        self._hardware[:16] = struct.pack("<2d", values["current"], values["force"])
"""
NO_LONGER_SAFE = """
class Own(Reporting):
    def safe(self):
        self._hold({"current": 4.0, "force": 0.0})
"""


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


def serve(folder, backend="Reporting", *arguments, backends=BACKENDS, stdout=PIPE, **options):
    given = {"trigger": folder / "trigger", **options}
    return Server(folder, backend, *arguments, options=given, backends=backends, stdout=stdout)


def calls_of(server, what):
    return len([call for call in server.calls() if call.what.startswith(what)])


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
            with suppress(ProcessLookupError):  # it may have ended with another
                os.kill(number, signal.Signals[f"SIG{name}"])
        took = wait_held(tmp_path, (0.0, 0.0))
        print(f"{name}: safe after {1e3 * took:.0f} ms")
        driver.stop(orderly=False)


@pytest.mark.slow
def test_an_opening_of_five_seconds_is_waited_for(tmp_path):
    with serve(tmp_path, opening=5.2) as server:
        driver = driven(server, tmp_path)
        os.kill(server.roles()["device"], signal.SIGKILL)
        took = wait_held(tmp_path, (0.0, 0.0), 8.0)
        print(f"safe after {took:.2f} s; promised are {server.promised():.2f} s")
        assert took < server.promised() + 0.2
        driver.stop(orderly=False)


@pytest.mark.slow
@pytest.mark.parametrize("event", ["", "stop", "USR1", "front"])
def test_a_device_that_cannot_be_opened_is_tried_for_ever_and_at_once_at_a_stop(tmp_path, event):
    with serve(tmp_path, "Faulty", where="open", how="raise") as server:
        driver = driven(server, tmp_path)
        (tmp_path / "trigger").touch()
        roles = server.roles()
        os.kill(roles["device"], signal.SIGKILL)
        time.sleep(4.0)
        assert held(tmp_path) == COMMANDS
        if event == "front":
            os.kill(roles["front"], signal.SIGKILL)
            time.sleep(2.0)
        if event in ("stop", "USR1"):
            server.wait_call("fault open", time.monotonic())  # the next one is due later
            before = calls_of(server, "fault open")
            if event == "stop":
                ask(read_endpoint(server.endpoint), "stop", reason="again")
            else:
                server.send(signal.SIGUSR1)
            time.sleep(0.3)
            assert calls_of(server, "fault open") > before
        (tmp_path / "trigger").unlink()
        took = wait_held(tmp_path, (0.0, 0.0), 6.0)
        print(f"{event or 'glitch'}: safe {took:.2f} s after the device was there again")
        driver.stop(orderly=False)


def bring_into(server, state):
    """Bring a rig into a safe state, by a stop and with another backend by a kill."""
    remote = read_endpoint(server.wait_ready())
    if state != "idle":
        stop(remote, "smoke")
    if state == "rescued":
        os.kill(server.roles()["device"], signal.SIGKILL)
        server.wait_line("the guard opened the backend")
    return remote


@pytest.mark.slow
@pytest.mark.parametrize("state", ["idle", "latched", "rescued"])
def test_every_stop_writes_safe_values(tmp_path, state):
    with serve(tmp_path) as server:
        remote = bring_into(server, state)
        for number in range(3):
            before = calls_of(server, "safe")
            if number == 2:
                server.send(signal.SIGUSR1)
                time.sleep(0.3)
            else:
                assert stop(remote, "again")["state"] == "safe"
            assert calls_of(server, "safe") > before, (number, server.lines)


@pytest.mark.slow
@pytest.mark.parametrize("state", ["idle", "latched", "rescued"])
def test_a_device_that_leaves_its_safe_state_is_brought_back(tmp_path, state):
    """As by a write that was queued before the rescue."""
    with serve(tmp_path) as server:
        remote = bring_into(server, state)
        if state == "rescued":
            time.sleep(0.45)
        with (tmp_path / "calls.log.held").open("r+b") as device:
            device.write(struct.pack("<2d", 1.0, 0.0))
        took = wait_held(tmp_path, (0.0, 0.0))
        print(f"{state}: brought back after {1e3 * took:.0f} ms")
        assert took < 0.25
        server.wait_line("in the safe state the device has current = 1 A")
        assert ask(remote, "status")["latch"]


@pytest.mark.slow
@pytest.mark.parametrize("state", ["idle", "commanded", "latched", "rescued"])
def test_safe_is_not_said_where_the_device_reports_something_else(tmp_path, state):
    with serve(tmp_path, "Reporting", "--watchdog", 2.0) as server:
        remote = read_endpoint(server.wait_ready())
        driver = driven(server, tmp_path) if state == "commanded" else None
        if state in ("latched", "rescued"):
            stop(remote, "smoke")
        if state == "rescued":
            os.kill(server.roles()["device"], signal.SIGKILL)
            server.wait_line("the guard opened the backend")
        begun = time.monotonic()
        (tmp_path / "trigger").touch()
        told = stop(remote, "smoke") if state == "commanded" else ask(remote, "status")
        while told["state"] != "not reached":
            assert time.monotonic() - begun < PATIENCE, told
            told = ask(remote, "status")
        took = time.monotonic() - begun
        print(f"{state}: NOT REACHED after {1e3 * took:.0f} ms")
        assert took < 0.6
        assert "current = 1 A" in told["alarm"]
        again = here("rig", "stop", "--endpoint", server.endpoint, cwd=tmp_path)
        assert again.returncode == 1
        assert here("rig", "status", "--endpoint", server.endpoint, cwd=tmp_path).returncode == 1
        assert "NOT REACHED" in again.stdout
        (tmp_path / "trigger").unlink()
        server.wait_line("safe, reached after")
        if driver is not None:
            driver.stop(orderly=False)


def test_a_device_that_reports_nothing_is_commanded_again_and_not_called_verified(tmp_path):
    with Server(tmp_path, "Mute") as server:
        remote = read_endpoint(server.wait_ready())
        told = stop(remote, "smoke")
        assert (told["state"], told["verified"]) == ("safe", False)
        line = "commanded safe, not verified: the device does not report current, force"
        assert line in server.wait_line("safe, reached after")
        assert (
            "commanded safe, not verified"
            in here("rig", "status", "--endpoint", server.endpoint, cwd=tmp_path).stdout
        )
        before = calls_of(server, "safe")
        time.sleep(1.0)
        assert calls_of(server, "safe") >= before + 5


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "class Own(",
        ANOTHER_ORDER,
        NO_LONGER_SAFE,
    ],
    ids=["syntax error", "another order", "no longer safe"],
)
def test_a_file_that_is_changed_while_it_is_served_changes_nothing(tmp_path, text):
    own = tmp_path / "own.py"
    head = "from tests.support.rig.backends import Reporting\n"
    own.write_text(head + "class Own(Reporting): pass\n")
    with serve(tmp_path, "Own", backends=own) as server:
        driver = driven(server, tmp_path)
        own.write_text(head + text)
        os.kill(server.roles()["device"], signal.SIGKILL)
        took = wait_held(tmp_path, (0.0, 0.0))
        print(f"safe after {1e3 * took:.0f} ms")
        driver.stop(orderly=False)
        remote = read_endpoint(server.endpoint)
        while (told := ask(remote, "status"))["state"] != "safe":
            time.sleep(0.01)
        assert acknowledge(remote, told["latch"])["state"] == "idle"
        os.kill(server.roles()["standby"], signal.SIGKILL)
        with Driver(server.endpoint, lambda number: COMMANDS):
            wait_held(tmp_path, COMMANDS)
            os.kill(server.roles()["guard"], signal.SIGKILL)
            wait_held(tmp_path, (0.0, 0.0))


def test_an_input_without_limits_is_refused_at_the_start(tmp_path):
    with serve(tmp_path, "Unlimited") as server:
        assert server.wait_end() == 2
        assert "force is commanded and has no limits" in server.errors()
    assert "write" not in (tmp_path / "calls.log").read_text()


def test_a_real_device_is_not_served_in_lockstep(tmp_path):
    """In lockstep nothing ends a command of a client that goes."""
    with serve(tmp_path, "RealStepped", "--lockstep") as server:
        assert server.wait_end() == 2
        assert "--lockstep" in server.errors()
    assert not (tmp_path / "calls.log").exists()


@pytest.mark.slow
@pytest.mark.parametrize("event", ["stop", "TERM", "device", "guard"])
def test_a_backend_that_prints_blocks_nothing_where_nobody_reads(tmp_path, event):
    reader, writer = os.pipe()
    with serve(tmp_path, "Printing", stdout=writer) as server:
        os.close(writer)
        driver = driven(server, tmp_path)
        driver.wait(100)
        assert {sample["state"] for sample in driver.samples} == {"running"}
        server.wait_line("printed: ")
        if event == "stop":
            assert stop(read_endpoint(server.endpoint), "smoke")["state"] == "safe"
        elif event == "TERM":
            server.process.terminate()
        else:
            os.kill(server.roles()[event], signal.SIGKILL)
        took = wait_held(tmp_path, (0.0, 0.0))
        print(f"{event}: safe after {1e3 * took:.0f} ms")
        if event == "TERM":
            assert server.wait_end() == 0
        driver.stop(orderly=False)
    os.close(reader)


@pytest.mark.slow
@pytest.mark.parametrize(("how", "is_killed"), [("beyond", False), ("nan", False), ("nan", True)])
def test_nothing_is_commanded_as_long_as_the_cause_of_a_latch_persists(tmp_path, how, is_killed):
    with serve(tmp_path, "Faulty", "--watchdog", 0.5, where="read", how=how) as server:
        driver = driven(server, tmp_path)
        (tmp_path / "trigger").touch()
        wait_held(tmp_path, (0.0, 0.0))
        driver.stop(orderly=False)
        if is_killed:
            os.kill(server.roles()["device"], signal.SIGKILL)
            server.wait_line("the guard opened the backend")
        remote = read_endpoint(server.endpoint)
        began = time.monotonic()
        driver = Driver(server.endpoint, lambda number: COMMANDS, reconnect=True)
        driver.start(exchanges=0)
        for _ in range(5):
            told = ask(remote, "status")
            while told["state"] != "safe":
                told = ask(remote, "status")
            with suppress(UserError):  # another latch may have been closed meanwhile
                acknowledge(remote, told["latch"], 0.7)
        assert not [c for c in server.calls() if c.time > began and c.what.startswith("write")]
        (tmp_path / "trigger").unlink()
        while ask(remote, "status")["latch"]:
            with suppress(UserError):
                acknowledge(remote, ask(remote, "status")["latch"], 1.0)
        wait_held(tmp_path, COMMANDS)
        driver.stop()


@pytest.mark.slow
def test_the_last_process_that_could_write_safe_values_is_not_ended(tmp_path):
    """The one before it is, as an attempt may take 5 s."""
    with serve(tmp_path, "Sluggish") as server:
        driver = driven(server, tmp_path)
        (tmp_path / "trigger").touch()
        server.process.kill()
        took = wait_held(tmp_path, (0.0, 0.0), 30.0)
        print(f"safe after {took:.1f} s")
        driver.stop(orderly=False)
        until = time.monotonic() + 15.0
        while server.family():
            assert time.monotonic() < until, "a process was left behind"
            time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.parametrize("role", ["front", "guard", "standby", "device"])
def test_the_heartbeat_stops_when_a_process_does(tmp_path, role):
    """A relay that watches it would drop, as it would were the process killed."""
    with serve(tmp_path, "Beating") as server:
        driver = driven(server, tmp_path)
        time.sleep(0.5)
        beats = [call for call in server.calls() if call.what.startswith("beat")]
        assert len(beats) > 10
        levels = [beat.what for beat in beats]
        assert all(one != other for one, other in pairwise(levels))
        stopped = time.monotonic()
        os.kill(server.roles()[role], signal.SIGSTOP)
        time.sleep(0.8)
        last = max(call.time for call in server.calls() if call.what.startswith("beat"))
        print(f"{role}: the last heartbeat came {1e3 * (last - stopped):.0f} ms after the stop")
        assert last - stopped < 0.4
        for number in server.family():
            os.kill(number, signal.SIGCONT)
        driver.stop(orderly=False)


@pytest.mark.slow
def test_an_interlock_that_opens_stops_the_rig_and_holds_it_until_it_is_closed(tmp_path):
    with serve(tmp_path, "Beating") as server:
        driver = driven(server, tmp_path)
        (tmp_path / "trigger").touch()
        wait_held(tmp_path, (0.0, 0.0))
        driver.stop(orderly=False)
        remote = read_endpoint(server.endpoint)
        server.wait_line("SAFE STATE: measured door 0 1 is below 0.5 1")
        answer = acknowledge(remote, ask(remote, "status")["latch"], timeout=1.0)
        assert answer["latch"]
        (tmp_path / "trigger").unlink()
        time.sleep(0.2)  # a sample with the door closed
        assert acknowledge(remote, ask(remote, "status")["latch"])["state"] == "idle"


@pytest.mark.slow
def test_processes_that_cannot_even_be_killed_are_not_waited_for(tmp_path):
    with serve(tmp_path) as server:
        driver = driven(server, tmp_path)
        roles = server.roles()
        with frozen([roles["device"], roles["guard"]]):
            took = wait_held(tmp_path, (0.0, 0.0))
            print(f"safe after {1e3 * took:.0f} ms; promised are {1e3 * server.promised():.0f} ms")
            told = ask(read_endpoint(server.endpoint), "status")
            assert "NOT REACHED" not in told["alarm"] or took > server.promised()
        driver.stop(orderly=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("safe_values", "part"),
    [("{'current': 5.0}", "current 5 A is above 1.3 A"), ("{'current': 0.5}", "has current = 0 A")],
)
def test_a_safe_state_that_is_none_is_refused_at_the_start(tmp_path, safe_values, part):
    own = tmp_path / "own.py"
    head = "from tests.support.rig.backends import Reporting\n"
    own.write_text(f"{head}class Own(Reporting):\n    safe_values = {safe_values}\n")
    with serve(tmp_path, "Own", backends=own) as server:
        assert server.wait_end() != 0
        assert part in server.errors()
