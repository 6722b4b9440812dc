"""The project's own client at a steady rate, in a thread of this process or as a process of its
own.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import sin
from pathlib import Path
from secrets import token_hex
from typing import Any

from fmus.rig_proxy.link import Link, LinkError
from tests.support.rig.backends import Logged

INPUTS, OUTPUTS = Logged.inputs, Logged.outputs
PERIOD = 0.02  # s


def usual(number: int) -> Sequence[float]:
    """Commands well within the limits."""
    return [0.8 * sin(0.2 * number), 1.0]


class Driver:
    """A client in a thread; a context, in which it exchanges.

    Parameters
    ----------
    endpoint : str
    values : callable
        Commands by number of the exchange.
    credentials : Path, optional
    timeout : float
        Of an exchange, in s.
    reconnect : bool
        Begin another session when one is over.

    Attributes
    ----------
    samples : list of dict
        Every answer.
    unanswered : int
    silences : list of float
        Times at which an exchange or a connection was given up, in s of the monotonic clock.
    errors : list of str
    longest : float
        Duration of the longest call, in s.
    """

    def __init__(
        self,
        endpoint: str,
        values: Callable[[int], Sequence[float]] = usual,
        credentials: Path | None = None,
        reconnect: bool = False,
        timeout: float = 0.1,
        client: str = "driver",
    ) -> None:
        self.values, self._reconnect, self._timeout = values, reconnect, timeout
        self.samples: list[Mapping[str, Any]] = []
        self.errors: list[str] = []
        self.silences: list[float] = []
        self.unanswered, self.longest = 0, 0.0
        self._new_link = partial(Link, endpoint, INPUTS, OUTPUTS, credentials, client, token_hex(8))
        self._link = self._new_link()
        self._ending, self._thread = (
            threading.Event(),
            threading.Thread(target=self._run, daemon=True),
        )
        self._orderly = True

    def start(self, exchanges: int = 10, timeout: float = 10.0) -> Driver:
        """Begin, and wait for the first answers."""
        self._thread.start()
        self.wait(exchanges, timeout)
        return self

    def wait(self, exchanges: int, timeout: float = 10.0) -> None:
        """Wait for some more answers."""
        wanted, until = len(self.samples) + exchanges, time.monotonic() + timeout
        while len(self.samples) < wanted:
            assert time.monotonic() < until, (
                f"{len(self.samples)} of {wanted} answers; {self.errors}"
            )
            time.sleep(0.005)

    def _run(self) -> None:
        try:
            self._drive()
            while self._reconnect and not self._ending.wait(0.05):
                self._link.close()
                self._link = self._new_link()
                self._drive()
            if self._orderly:
                self._link.disconnect()
        finally:
            self._link.close()

    def _drive(self) -> None:
        """Exchange as long as the session lasts."""
        try:
            self._link.connect(0.0, 0.5)
            number, due = 0, time.monotonic()
            while not self._ending.is_set():
                begun = time.monotonic()
                sample = self._link.exchange(
                    self.values(number), PERIOD * number, PERIOD, self._timeout
                )
                self.longest = max(self.longest, time.monotonic() - begun)
                if sample is None:
                    self.unanswered += 1
                    self.silences.append(time.monotonic())
                else:
                    self.samples.append(sample)
                number, due = number + 1, max(due + PERIOD, time.monotonic() - 1.0)
                self._ending.wait(max(0.0, due - time.monotonic()))
        except LinkError as error:
            self.errors.append(str(error))
            self.silences.append(time.monotonic())

    def hang(self) -> None:
        """Say nothing any more, with the connection open."""
        self._orderly = False
        self.values = self._sleep

    def _sleep(self, number: int) -> Sequence[float]:
        self._ending.wait(60.0)
        raise LinkError("woken up at the end of the test")

    def __enter__(self) -> Driver:
        return self.start()

    def __exit__(self, *error: object) -> None:
        self.stop()

    def stop(self, *, orderly: bool = True) -> None:
        """End the thread."""
        self._orderly = self._orderly and orderly
        self._ending.set()
        self._thread.join(10.0)
        assert not self._thread.is_alive(), "the client hangs"


def refusal(endpoint: str, credentials: Path | None = None, timeout: float = 2.0) -> str:
    """Return the reason for which one more client is refused; empty if it is accepted."""
    link = Link(endpoint, INPUTS, OUTPUTS, credentials, "another")
    try:
        link.connect(0.0, timeout)
    except LinkError as error:
        return str(error)
    finally:
        link.disconnect()
        link.close()
    return ""


def main() -> None:
    """Exchange until killed: a client as a process of its own."""
    driver = Driver(sys.argv[1])
    driver.start()
    print("started", flush=True)
    time.sleep(60.0)


if __name__ == "__main__":
    main()
