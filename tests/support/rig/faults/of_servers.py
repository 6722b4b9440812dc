"""The server, or one of its processes, fails."""

from __future__ import annotations

import os
import signal
import subprocess
import time

import pytest

from fmus.rig_proxy.link import Link, LinkError
from tests.support.rig.driver import INPUTS, OUTPUTS
from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.process import Server
from tests.support.rig.small_rig import free_port


@fault(
    "the server never starts", "the client gives up within its timeout, with a message", quick=True
)
def never_starts(bench: Bench) -> None:
    link = Link(f"tcp://127.0.0.1:{free_port()}", INPUTS, OUTPUTS)
    begun = time.monotonic()
    try:
        with pytest.raises(LinkError, match="no answer within"):
            link.connect(0.0, 0.5)
    finally:
        link.close()
    took = time.monotonic() - begun
    assert took < 0.6 + bench.allowance
    bench.observed = f"gave up after {took:.2f} s with a timeout of 0.5 s"


@fault(
    "SIGKILL of the server, and back",
    "safe by itself, no process is left; a new server is latched until it is acknowledged",
    quick=True,
)
def killed(bench: Bench) -> None:
    server = bench.serve()
    driver, family = bench.connect(reconnect=True), server.family()
    driver.wait(5)
    now = time.monotonic()
    server.process.kill()
    bench.measure_from_written(bench.safe_after(now))
    bench.all_ended(family)
    server.process.wait(5.0)
    before = len(driver.samples)
    bench.serve("Logged", "--endpoint", server.endpoint)
    bench.is_latched("did not end in order")
    assert not [c for c in server.calls() if c.time > now + 1.0 and c.what.startswith("write")]
    driver.stop(orderly=False)
    bench.recovers()
    bench.observed = (
        f"safe, all {len(family)} processes gone; the client that tried again got nothing, after"
        f" {before} samples before, until the new server's latch was released"
    )


@fault(
    "SIGKILL of the guard",
    "the device goes safe by itself, latched; another guard after the acknowledgement",
    quick=True,
)
def guard_killed(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    device = server.processes().copy().pop()
    guard = _parent(device)
    now = time.monotonic()
    os.kill(guard, signal.SIGKILL)
    bench.measure_from_written(bench.safe_after(now))
    server.wait_line("SAFE STATE: ")
    bench.is_latched("guard")
    bench.all_ended({device, guard})
    server.wait_line("guard opened the backend")
    bench.recovers()
    bench.observed = "safe and latched; served again after the acknowledgement"


@fault(
    "SIGKILL of the device process",
    "the guard opens the backend and brings it to the safe state, latched",
)
def device_killed(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    device = server.processes().copy().pop()
    now = time.monotonic()
    os.kill(device, signal.SIGKILL)
    bench.measure_from_written(bench.safe_after(now))
    line = server.wait_line("the guard opened")
    bench.is_latched("ended")
    bench.recovers()
    bench.observed = "safe" + line.rpartition("safe state")[2]


@fault("the server is stopped (SIGSTOP) and goes on", "the device goes safe by itself, latched")
def front_stopped(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    now = time.monotonic()
    server.send(signal.SIGSTOP)
    try:
        safe = bench.safe_after(now)
    finally:
        server.send(signal.SIGCONT)
    bench.link.fresh[:] = [
        when for when in bench.link.fresh if when < now
    ]  # later ones it did not take any more
    bench.measure_from_fresh(safe)
    server.wait_line("SAFE STATE: the server's front shows no sign of life")
    bench.is_latched("no sign of life")
    bench.recovers()
    bench.observed = "safe without it, and latched when it went on"


def _ends_in_order(bench: Bench, number: signal.Signals) -> None:
    server = bench.serve()
    bench.connect()
    family, now = server.family(), time.monotonic()
    server.send(number)
    safe = bench.safe_after(now)
    code = server.wait_end()
    bench.measure_from_written(safe)
    assert (code, server.errors()) == (0, "")
    bench.all_ended(family)
    server.wait_line(f"ended, in the safe state: {number.name}")
    assert [call.what for call in server.calls()][-2:] == ["safe", "close"]
    bench.observed = f"safe, exit status 0, all {len(family)} processes gone"


@fault("SIGTERM", "the safe state, all processes end, exit status 0", quick=True)
def terminated(bench: Bench) -> None:
    _ends_in_order(bench, signal.SIGTERM)


@fault("Ctrl-C", "as SIGTERM")
def interrupted(bench: Bench) -> None:
    _ends_in_order(bench, signal.SIGINT)


@fault("Ctrl-C in a terminal: all processes get it", "as SIGTERM")
def interrupted_together(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    family, now = server.family(), time.monotonic()
    for pid in family:
        os.kill(pid, signal.SIGINT)
    safe = bench.safe_after(now)
    assert (server.wait_end(), server.errors()) == (0, "")
    bench.measure_from_written(safe)
    bench.all_ended(family)
    bench.observed = "safe, exit status 0, nothing on standard error"


@fault("its port is in use", "one line, exit status 2; the server that is there goes on")
def port_in_use(bench: Bench) -> None:
    first = bench.serve()
    bench.connect()
    folder = bench.folder / "second"
    folder.mkdir()
    with Server(folder, "Logged", "--endpoint", first.endpoint) as other:
        assert other.wait_end() == 2
        errors = other.errors().splitlines()
    assert len(errors) == 1, errors
    assert "in use" in errors[0]
    bench.goes_on()
    bench.observed = errors[0].removeprefix("error: ")


def _parent(pid: int) -> int:
    done = subprocess.run(
        ["ps", "-o", "ppid=", "-p", str(pid)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)
