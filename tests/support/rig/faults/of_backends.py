"""The backend, or the device behind it, fails."""

from __future__ import annotations

import re
import time

from orchestration.rig import operator
from orchestration.rig.endpoint import read_endpoint
from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.process import Server


def _fails(bench: Bench, where: str, how: str, part: str, more: float = 0.0) -> str:
    """Let the backend fail once; safe, latched, and after an acknowledgement served again."""
    server = bench.running(where, how)
    pulled = bench.pull_trigger()
    server.wait_call("fault", pulled)
    safe = bench.safe_after(pulled)
    line = server.wait_line(part)
    bench.measure_from_written(safe, more)
    bench.is_latched(part)
    server.trigger.unlink()
    bench.recovers()
    return line.partition("SAFE STATE: ")[2].partition(" (last fresh")[0]


@fault(
    "the backend raises in read",
    "safe at once, latched; opened anew after the acknowledgement",
    quick=True,
)
def raises_in_read(bench: Bench) -> None:
    bench.observed = _fails(
        bench, "read", "raise", "read() raised OSError: [Errno 5] the cable of read is out"
    )


@fault(
    "the backend raises in write", "safe at once, latched; opened anew after the acknowledgement"
)
def raises_in_write(bench: Bench) -> None:
    bench.observed = _fails(bench, "write", "raise", "write() raised OSError")


@fault(
    "the backend wants to end the program",
    "safe at once, latched; opened anew after the acknowledgement",
)
def exits(bench: Bench) -> None:
    bench.observed = _fails(bench, "read", "exit", "read() raised SystemExit: 3")


@fault(
    "the backend's process dies in a call",
    "the guard opens the backend and brings it to the safe state, latched",
    quick=True,
)
def dies(bench: Bench) -> None:
    _fails(bench, "write", "die", "exit status 7")
    bench.observed = _rescue(bench)


@fault(
    "the backend returns no number", "safe at once, latched; opened anew after the acknowledgement"
)
def returns_nothing(bench: Bench) -> None:
    bench.observed = _fails(bench, "read", "nothing", "read() did not return numbers")


@fault(
    "the backend returns NaN",
    "sent as the last finite value, growing older; after the watchdog time safe",
    quick=True,
)
def returns_nan(bench: Bench) -> None:
    server = bench.running("read", "nan")
    pulled = bench.pull_trigger()
    begun = server.wait_call("fault", pulled)
    bench.measure(begun.time, bench.safe_after(pulled), "first NaN")
    server.wait_line("no finite voltage")
    bench.is_latched(f"no finite voltage for {bench.watchdog:g} s")
    bench.driver.wait(5)
    last = bench.driver.samples[-1]
    assert last["values"][0] is not None
    assert last["ages"][0] > bench.watchdog
    server.trigger.unlink()
    bench.recovers()
    bench.observed = (
        f"last finite value sent with its age, up to {last['ages'][0]:.2f} s; then safe"
    )


def _hangs(bench: Bench, where: str) -> None:
    server = bench.running(where, "hang")
    pulled = bench.pull_trigger()
    hung = server.wait_call("fault", pulled)
    safe = bench.safe_after(pulled)
    server.wait_line("the guard opened")
    bench.measure_from_written(safe)
    bench.is_latched("the device hangs")
    assert safe.process != hung.process
    assert bench.driver.longest < 0.2 + bench.allowance, "the front waited for the device"
    bench.all_ended({hung.process})
    server.trigger.unlink()
    bench.recovers()
    bench.observed = _rescue(bench)


def _rescue(bench: Bench) -> str:
    return (
        bench.server.wait_line("the guard opened")
        .partition("SAFE STATE: ")[2]
        .partition(" (last fresh")[0]
    )


@fault(
    "a driver call in read never returns",
    "the guard kills the device and brings the rig to the safe state",
    quick=True,
)
def hangs_in_read(bench: Bench) -> None:
    _hangs(bench, "read")


@fault(
    "a driver call in write never returns",
    "the guard kills the device and brings the rig to the safe state",
)
def hangs_in_write(bench: Bench) -> None:
    _hangs(bench, "write")


@fault(
    "a driver call never returns, and SIGTERM",
    "the guard brings the rig to the safe state; exit status 0",
)
def hangs_at_the_end(bench: Bench) -> None:
    server = bench.running("read", "hang")
    pulled = bench.pull_trigger()
    server.wait_call("fault", pulled)
    family = server.family()
    server.process.terminate()
    safe = bench.safe_after(pulled)
    assert server.wait_end() == 0
    bench.measure_from_written(safe)
    bench.all_ended(family)
    bench.observed = "safe, exit status 0, no process left"


@fault(
    "the safe state raises at first",
    "tried again, by the guard with a backend of its own, until it is reached",
)
def safe_raises_twice(bench: Bench) -> None:
    server = bench.running("safe", "raise", times=3)
    pulled = bench.pull_trigger()
    bench.driver.stop(orderly=False)
    server.wait_call("safe", pulled)
    reached = server.wait_line("safe, reached after")
    bench.is_latched("brought it to the safe state")
    failed = [line for line in server.lines if "its safe state cannot be reached" in line]
    assert failed
    bench.recovers()
    bench.observed = f"{reached[24:]}; {len(failed)} loud lines before"


@fault(
    "the safe state raises for ever",
    "state `not reached` and an alarm, within the bound; safe when the cable is whole",
    quick=True,
)
def safe_raises(bench: Bench) -> None:
    server = bench.running("safe", "raise")
    bench.pull_trigger()
    bench.driver.stop(orderly=False)
    _alarms(bench)
    server.trigger.unlink()
    bench.recovers()
    bench.observed = "the alarm held until the acknowledgement; served again after it"


@fault(
    "the safe state never returns",
    "state `not reached` and an alarm, within the bound; tried by one process after another",
)
def safe_hangs(bench: Bench) -> None:
    server = bench.running("safe", "hang", times=2)
    pulled = bench.pull_trigger()
    bench.driver.stop(orderly=False)
    _alarms(bench)
    server.wait_call("safe", pulled, 30.0)
    reached = server.wait_line("safe, reached after")
    bench.is_latched("the guard opened the backend")
    assert "NOT REACHED" in bench.status()["alarm"], "the alarm is over without an operator"
    bench.recovers()
    bench.observed = f"device and guard hung in it; {reached[24:]} by a third process"


def _alarms(bench: Bench) -> None:
    """The safe state is not reached: that must be an alarm within what was promised for it."""
    latched = bench.wait_status(lambda status: bool(status["latch"]))
    alarmed = bench.wait_status(lambda status: status["state"] == "not reached")
    took = alarmed["clock"] - latched["clock"]
    assert "NOT REACHED" in alarmed["alarm"], alarmed
    assert took < bench.promised + 0.1 + bench.allowance, f"an alarm after {took:.3f} s"


@fault(
    "the safe state never returns, and SIGTERM",
    "told loudly, and tried for on; at a second one all processes end, exit status 1",
)
def safe_hangs_at_the_end(bench: Bench) -> None:
    server = bench.running("safe", "hang")
    bench.pull_trigger()
    family, begun = server.family(), time.monotonic()
    server.process.terminate()
    server.wait_line("the server goes on trying", 20.0)
    took = time.monotonic() - begun
    family |= server.family()
    server.process.terminate()
    assert server.wait_end() == 1
    server.wait_line("given up by SIGTERM: THE SAFE STATE WAS NOT REACHED")
    bench.all_ended(family)
    bench.observed = f"told after {took:.1f} s; ended at the second, exit status 1, no process left"


@fault(
    "a slow backend: 60 ms in a period of 33 ms",
    "served with what there is; missed deadlines are counted",
)
def slow(bench: Bench) -> None:
    server = bench.running("read", "slow")
    pulled = bench.pull_trigger()
    bench.driver.wait(50)
    assert bench.driver.samples[-1]["state"] == "running"
    missed = bench.status()["counts"]["missed"]
    assert missed > 5
    assert bench.driver.longest < 0.2 + bench.allowance
    bench.driver.stop(orderly=False)
    bench.measure_from_fresh(server.wait_call("safe", pulled), 0.06)
    bench.observed = (
        f"{missed} deadlines missed, every exchange answered; safe when the client went"
    )


@fault(
    "a measured value beyond its limit", "safe within a period, latched, with the value", quick=True
)
def measured_beyond(bench: Bench) -> None:
    server = bench.running("read", "beyond")
    pulled = bench.pull_trigger()
    begun = server.wait_call("fault", pulled)
    bench.measure(begun.time, bench.safe_after(pulled), "the reading")
    server.wait_line("measured voltage 2.5 V is above 2 V")
    bench.is_latched("measured voltage 2.5 V is above 2 V")
    server.trigger.unlink()
    bench.recovers()
    bench.observed = "safe: measured voltage 2.5 V is above 2 V"


def _cannot_open(bench: Bench, how: str) -> str:
    (bench.folder / "trigger").touch()
    options = {"trigger": bench.folder / "trigger", "where": "open", "how": how}
    with Server(bench.folder, "Faulty", options=options) as server:
        assert server.wait_end() == 2
        lines = server.errors().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


@fault(
    "the backend raises at open", "the server does not start: one line, exit status 2", quick=True
)
def raises_at_open(bench: Bench) -> None:
    line = _cannot_open(bench, "raise")
    assert "the cable of open is out" in line
    bench.observed = re.sub(r"\S*/backends\.py", "backends.py", line)


@fault("the backend is in use", "the server does not start: its own line, exit status 2")
def refuses_at_open(bench: Bench) -> None:
    line = _cannot_open(bench, "refuse")
    assert "the device is in use by another program" in line
    bench.observed = re.sub(r"\S*/backends\.py", "backends.py", line)


@fault(
    "the backend cannot be opened again", "still safe after the acknowledgement, with the reason"
)
def does_not_open_again(bench: Bench) -> None:
    server = bench.running("read", "raise")
    pulled = bench.pull_trigger()
    bench.measure_from_written(bench.safe_after(pulled))
    server.wait_line("read() raised")
    latch = bench.status()["latch"]
    operator.acknowledge(read_endpoint(server.endpoint), latch, 3.0)
    bench.is_latched("read() raised")
    assert not bench.status()["alarm"]
    server.trigger.unlink()
    bench.recovers()
    bench.observed = "safe, and said why; served again when the cable was back and acknowledged"
