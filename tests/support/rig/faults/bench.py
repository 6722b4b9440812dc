"""A server, a cable and a client to break, and what is measured of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.kit import UserError
from orchestration.rig import operator
from orchestration.rig.endpoint import read_endpoint
from tests.support.rig.bad_link import LIMITS, BadLink
from tests.support.rig.driver import Driver, refusal
from tests.support.rig.process import Call, Server

WATCHDOG, PERIOD = 0.2, 1 / 30  # s, of the server


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes
    ----------
    kind, promise : str
        For the table.
    quick : bool
        Whether the normal suite tries it.
    provoke : callable
        Brings it about and checks the promise.
    """

    kind: str
    promise: str
    quick: bool
    provoke: Callable[[Bench], None]


KINDS: list[Fault] = []


def fault(
    kind: str, promise: str, *, quick: bool = False
) -> Callable[[Callable[[Bench], None]], Any]:
    """Put a kind of fault into the table."""

    def add(provoke: Callable[[Bench], None]) -> Callable[[Bench], None]:
        KINDS.append(Fault(kind, promise, quick, provoke))
        return provoke

    return add


class Bench:
    """One trial.

    Parameters
    ----------
    folder : Path
        For files.
    allowance : float
        Added to every bound, in s, for a machine that has other things to do.
    watchdog : float
        Of the server, in s.

    Attributes
    ----------
    observed : str
        What was seen, for the table.
    measured, bound : float or None
        Time to the safe state and what it has to be below, in s.
    since : str
        What it was measured from.
    limits : sequence of (float, float)
        Of what may be written.
    """

    def __init__(self, folder: Path, allowance: float = 0.0, watchdog: float = WATCHDOG) -> None:
        self.folder, self.allowance, self.watchdog = folder, allowance, watchdog
        self.observed, self.since = "", ""
        self.limits: Sequence[tuple[float, float]] = LIMITS
        self.measured: float | None = None
        self.bound: float | None = None
        self._open = ExitStack()
        self.server: Server
        self.link: BadLink
        self.driver: Driver

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: Any) -> None:
        self._open.close()

    def serve(self, backend: str = "Logged", *arguments: object, **more: Any) -> Server:
        """Start a server, and wait until it is ready."""
        self.launch(backend, *arguments, **more).wait_ready()
        return self.server

    def launch(self, backend: str = "Logged", *arguments: object, **more: Any) -> Server:
        """Start a server, which whoever speaks to it may drive unless keys are given."""
        usual = ("--watchdog", self.watchdog)
        access = () if "--keys" in arguments else ("--no-keys",)
        self.server = self._open.enter_context(
            Server(self.folder, backend, *usual, *access, *arguments, **more)
        )
        return self.server

    def connect(self, **more: Any) -> Driver:
        """Start a client, with a cable that can be made bad, and let it exchange."""
        self.link = BadLink(self.server.endpoint, watchdog=self.watchdog)
        self._open.callback(self.link.close)
        self.driver = self.another(self.link.endpoint, **more)
        return self.driver

    def another(self, place: str, **more: Any) -> Driver:
        """Start one more client, at an endpoint."""
        driver = Driver(place, **more)
        self._open.callback(driver.stop)
        return driver.start()

    def running(self, where: str, how: str, **options: object) -> Server:
        """Start a server whose backend fails when the trigger is pulled, and a client."""
        trigger = self.folder / "trigger"
        server = self.serve(
            "Faulty", options={"trigger": trigger, "where": where, "how": how, **options}
        )
        self.connect()
        return server

    def pull_trigger(self) -> float:
        """Let the backend fail from now on; return when that was."""
        now = time.monotonic()
        self.server.trigger.touch()
        return now

    def last_fresh(self, before: float) -> float:
        """Return the time at which the last fresh command before another reached the server."""
        return max(when for when in self.link.fresh if when < before)

    def safe_after(self, since: float, timeout: float = 15.0) -> Call:
        """Wait for the safe state."""
        return self.server.wait_call("safe", since, timeout)

    @property
    def promised(self) -> float:
        """Time to the safe state that the server promises in its first line, in s."""
        return self.server.promised()

    def measure(self, start: float, safe: Call, since: str, more: float = 0.0) -> None:
        """Note the time to the safe state, which must be below what the server promises, and
        something more.
        """
        self.note(safe.time - start, self.promised + more, since)

    def note(self, measured: float, bound: float, since: str) -> None:
        """Note a time to the safe state, and what it must be below."""
        self.measured, self.bound, self.since = measured, bound, since
        assert measured < bound + self.allowance, (
            f"{measured:.4f} s; below {bound:.4f} s is promised"
        )

    def measure_from_fresh(self, safe: Call, more: float = 0.0) -> None:
        """Note the time from the last fresh command that the server was handed."""
        self.measure(self.last_fresh(safe.time), safe, "last fresh command", more)

    def measure_from_written(self, safe: Call, more: float = 0.0) -> None:
        """Note the time from the last command that the device carried out."""
        written = max(
            call.time
            for call in self.server.calls()
            if call.what.startswith("write") and call.time < safe.time
        )
        self.measure(written, safe, "last command carried out", more)

    def is_latched(self, part: str) -> None:
        """The safe state must hold, say why, and refuse commands and clients, until it is
        acknowledged.
        """
        self.wait_status(lambda status: status["state"] == "safe" and part in status["reason"])
        assert "in its safe state since" in refusal(self.server.endpoint)
        calls = self.server.calls()
        last = max(k for k, call in enumerate(calls) if call.what == "safe")
        assert not [call for call in calls[last:] if call.what.startswith("write")], (
            "a command after the safe state"
        )

    def recovers(self) -> None:
        """After an acknowledgement a client must be served again."""
        latch = self.wait_status(lambda status: status["state"] == "safe")["latch"]
        answer = operator.acknowledge(read_endpoint(self.server.endpoint), latch, 15.0)
        assert answer["state"] == "idle", answer
        driver = self.another(self.server.endpoint, client="after")
        assert driver.samples[-1]["state"] == "running"
        assert driver.samples[-1]["values"][0] is not None
        driver.stop()

    def status(self) -> dict[str, Any]:
        """Return the status of the server."""
        return operator.ask(read_endpoint(self.server.endpoint), "status", 5.0)

    def wait_status(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Ask for the status until something is true of it, for 10 s at most."""
        until = time.monotonic() + 10.0
        while not holds(status := self.status()):
            assert time.monotonic() < until, status
            time.sleep(0.005)
        return status

    def goes_on(self, exchanges: int = 10) -> None:
        """The client must be served as if nothing had happened."""
        self.driver.wait(exchanges)
        assert self.driver.samples[-1]["state"] == "running", self.driver.samples[-1]

    def all_ended(self, family: set[int], timeout: float = 10.0) -> None:
        """No process of a server may be left, where the system tells."""
        until = time.monotonic() + timeout
        while left := {pid for pid in family if _lives(pid)}:
            assert time.monotonic() < until, f"left behind: {left}"
            time.sleep(0.01)

    def nothing_unsafe(self) -> None:
        """Whatever was written must be within the limits."""
        for call in self.server.calls() if hasattr(self, "server") else []:
            if call.what.startswith("write"):
                for value, (low, high) in zip(
                    map(float, call.what.split()[1:]), self.limits, strict=True
                ):
                    assert low <= value <= high, call


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@dataclass(frozen=True)
class Row:
    """Result of a fault.

    Attributes
    ----------
    fault : Fault
    observed, since : str
    measured, bound : float or None
        As of :class:`Bench`.
    is_met : bool
        Whether the promise was kept.
    """

    fault: Fault
    observed: str
    measured: float | None
    since: str
    bound: float | None
    is_met: bool

    def cells(self) -> list[str]:
        """Return the row of a table."""
        measured, bound = (
            f"{value * 1000:.0f} ms" if value is not None else ""
            for value in (self.measured, self.bound)
        )
        promised = [self.fault.kind, self.fault.promise, self.observed]
        return [*promised, measured, self.since, bound, "yes" if self.is_met else "NO"]


def try_all(
    faults: list[Fault], folder: Path, tell: Callable[[str], None], allowance: float = 0.0
) -> list[Row]:
    """Try kinds of faults, one after another."""
    rows = []
    for number, kind in enumerate(faults):
        place = folder / str(number)
        place.mkdir()
        begun = time.monotonic()
        with Bench(place, allowance) as bench:
            is_met = True
            try:
                kind.provoke(bench)
                bench.nothing_unsafe()
            except (AssertionError, UserError) as error:
                is_met = False
                first, _, _ = str(error).partition("\n")  # what follows is the log
                bench.observed = first.replace(str(place), "")[:300]
        row = Row(kind, bench.observed, bench.measured, bench.since, bench.bound, is_met)
        rows.append(row)
        name, _, *seen, met = row.cells()
        tell(f"{met:3} {name}: {', '.join(filter(None, seen))} ({time.monotonic() - begun:.1f} s)")
    return rows
