"""A rig whose server is started and driven here, so that its protections can be tried."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from math import inf
from multiprocessing import TimeoutError as ProcessTimeout
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from time import monotonic, sleep
from typing import Any

import psutil
import zmq

from fmus.kit import UserError, files
from fmus.rig_proxy import IDLE, NOT_REACHED, SAFE, Link, LinkError, protocol
from orchestration.plugins.commission.protocol import (
    FAILED,
    NOT_CONFIRMED,
    PASS,
    Finding,
    Row,
)
from orchestration.rig import operator, read_endpoint
from orchestration.rig.backends import Backend, backend_class, device_names, open_backend

Ask = Callable[[str], bool | None]
PERIOD = 0.02  # s between two commands
# s by which a client learns later of the safe state than it is reached: a turn of the front, and a
# question
OBSERVATION = 0.05
SAME = 0.01  # of an input's range, as in the server's own comparison
_ANSWER = 0.5  # s that the server has for an answer
_PATIENCE = 2.0  # s beyond a bound, after which nothing is waited for any more
_RAMP = 0.95  # of the largest rate: a command that comes early is not refused
_LONGEST_START = 60.0  # s, with an opening of 30 s
LONGEST_RELEASE = 20.0  # s that a device may take to be opened again
_LONGEST_END = 20.0  # s that a server may take to end in the safe state
_READY = re.compile(r"ready: (tcp://\S+) .* safe within ([\d.e-]+) s")


@dataclass(frozen=True)
class Device:
    """A backend as it is before it is opened.

    Attributes
    ----------
    backend : str
    options : Mapping of str to str
    names : tuple of str
        Names of its devices; empty if it commands nothing real.
    digests : Mapping of str to str
        SHA-256 of its files: code and calibration.
    has_heartbeat : bool
    """

    backend: str
    options: Mapping[str, str]
    names: tuple[str, ...]
    digests: Mapping[str, str]
    has_heartbeat: bool


def read_device(backend: str, options: Mapping[str, str]) -> Device:
    """Read what a backend says of its device without opening it.

    Parameters
    ----------
    backend : str
        Name, or ``file.py:Class``.
    options : Mapping of str to str

    Returns
    -------
    Device

    Raises
    ------
    UserError
        If there is no such backend, or an option is wrong.
    """
    with files.kept() as found:
        names = device_names(backend, options)
    digests = {Path(path).name: sha256(data).hexdigest() for path, data in found.items()}
    beats = backend_class(backend).heartbeat is not Backend.heartbeat
    return Device(backend, options, names, digests, beats)


def _reported(backend: str, options: Mapping[str, str]) -> dict[str, float]:
    """Return what a device reports; opening changes no output of it."""
    opened = open_backend(backend, options)
    try:
        return dict(opened.read_back())
    finally:
        opened.close()


class ServedRig:
    """A rig, its server as a child of this process, and a client that drives it.

    Parameters
    ----------
    device : Device
    words : sequence of str
        Options of ``ppy rig serve``.
    level : float
        Share of each input's range that is commanded, from 0 to 1.
    ask : callable
        Puts a question to the operator; returns None if nobody answers.
    credentials : Path, optional
        Keys of a client that may acknowledge.

    Raises
    ------
    UserError
        If the server cannot start, or the rig is latched already.

    Attributes
    ----------
    bound : float
        Longest time to the safe state that the server promises, s.
    rest, targets : dict of str to float
        Values of the inputs at rest, and those that are commanded, SI.
    rows : list of Row
        All that was heard of the inputs.
    log : list of str
        Lines of the server.
    """

    def __init__(
        self,
        device: Device,
        words: Sequence[str],
        level: float,
        ask: Ask,
        credentials: Path | None = None,
    ) -> None:
        self.device = device
        self.ask = ask
        self.log: list[str] = []
        self.rows: list[Row] = []
        self.commands: dict[str, float] = {}
        self.words = words
        self.credentials = credentials
        self._context = zmq.Context()
        self._client: Link | None = None
        self._taken = 0.0  # when the newest command was, s
        self._turned = 0.0  # when the last turn began, s
        self._begun = 0  # index of the row in which the rig was at rest before its newest ramp
        try:
            self.start()
            self._wait_for(lambda: bool(self.rows), _ANSWER)
            if self.status["latch"]:
                raise UserError(
                    f"the rig is latched since before: {self.status['reason']}; serve it, and"
                    " release it with ppy rig acknowledge first"
                )
            self.rest = {name: value or 0.0 for name, value in self.rows[-1].applied.items()}
        except BaseException:
            self.close()
            raise
        self.targets = {name: self._target(name, level) for name in self.rest}
        self.commands = dict(self.rest)

    def start(self) -> None:
        """Start the server, and connect to it."""
        begun = len(self.log)
        self._server = subprocess.Popen(
            [sys.executable, "-m", "orchestration.cli", "rig", "serve", *self.words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
        )
        self._reader = Thread(target=self._read, args=(self._server.stdout,), daemon=True)
        self._reader.start()
        ready = self._wait_ready(begun)
        self.bound = float(ready[2])
        self.remote = read_endpoint(ready[1], self.credentials)
        self._monitor = Link(ready[1], {}, {}, self.credentials)
        self._telemetry = self._context.socket(zmq.SUB)
        self.remote.connect(self._telemetry, self.remote.telemetry)
        self._telemetry.subscribe(b"")
        self.status: Mapping[str, Any] = operator.ask(self.remote, "status")

    def _read(self, stream: Any) -> None:
        with stream:
            for line in stream:
                self.log.append(line.rstrip())

    def _wait_ready(self, begun: int) -> re.Match[str]:
        """Return the line in which the server says that it is ready."""
        until = monotonic() + _LONGEST_START
        while monotonic() < until:
            has_ended = self._server.poll() is not None
            if has_ended:
                self._reader.join(_PATIENCE)
            for line in self.log[begun:]:
                if match := _READY.search(line):
                    return match
            if has_ended:
                raise UserError(f"ppy rig serve: {self.log[-1] if self.log else 'it has ended'}")
            sleep(PERIOD)
        raise UserError(f"ppy rig serve is not ready after {_LONGEST_START:g} s")

    def _target(self, name: str, level: float) -> float:
        low, high = self.range_of(name)
        rest = self.rest[name]
        return rest + level * ((high if high > rest else low) - rest)

    def range_of(self, name: str) -> tuple[float, float]:
        """Return the limits of an input; of one without, those of a unit about rest."""
        limit = self.status["limits"].get(name, {})
        low, high = limit.get("min"), limit.get("max")
        return (-1.0 if low is None else low), (1.0 if high is None else high)

    def describe(self, values: Mapping[str, float]) -> str:
        """Return values of inputs with their units, in words."""
        units = self.status["inputs"]
        texts = (
            f"{name} {value:.4g}" + f" {units[name]}" * (units[name] != "1")
            for name, value in values.items()
        )
        return ", ".join(texts)

    def deviations(self, values: Mapping[str, float | None], wanted: Mapping[str, float]) -> str:
        """Return those values in words that differ from wanted ones; empty if none does."""
        differing = {}
        for name, value in values.items():
            low, high = self.range_of(name)
            if value is not None and abs(value - wanted[name]) > SAME * (high - low):
                differing[name] = value
        return self.describe(differing)

    def processes(self) -> dict[str, psutil.Process]:
        """Return the processes of the server by role; without some while they are replaced.

        A guard is a child of the front, and the device one of the guard on duty. Only these were
        started as Python starts a process of its own.
        """
        try:
            family = psutil.Process(self._server.pid).children(recursive=True)
            spawned = {one.pid: one for one in family if "spawn_main" in " ".join(one.cmdline())}
            parents = {number: one.ppid() for number, one in spawned.items()}
            device = next(number for number, parent in parents.items() if parent in spawned)
            guard = parents[device]
            standby = next(number for number in spawned if number not in (device, guard))
            front = psutil.Process(parents[guard])
        except (psutil.Error, StopIteration):
            return {}
        named = {"device": device, "guard": guard, "standby": standby}
        return {"front": front} | {role: spawned[number] for role, number in named.items()}

    # -- driving

    def begin(self) -> None:
        """Begin a session, and command the targets as fast as the rig allows."""
        self._end_session()
        self._client = Link(
            self.remote.requests, self.status["inputs"], {}, self.credentials, "ppy rig commission"
        )
        self._client.connect(0.0, _ANSWER)
        self.commands = dict(self.rest)
        self._taken = monotonic()
        self._begun = len(self.rows) - 1  # the newest one is at rest
        rates = {name: self._rate(name) for name in self.rest}
        longest = max(abs(self.targets[n] - self.rest[n]) / rate for n, rate in rates.items())
        arrived = self._wait_for(
            lambda: self.rows[-1].applied == self.targets, 2.0 * longest + _PATIENCE, drives=True
        )
        if not arrived:
            raise UserError(
                f"the rig does not follow {self.describe(self.targets)} (--level):"
                f" {self.status['reason'] or dict(self.rows[-1].applied)}"
            )

    def _rate(self, name: str) -> float:
        rate = self.status["limits"].get(name, {}).get("rate")
        return inf if rate is None else rate

    def rates(self) -> dict[str, float]:
        """Return the limits of rates, per s, of those inputs that have one."""
        return {name: rate for name in self.rest if (rate := self._rate(name)) < inf}

    def ramp(self, name: str) -> float:
        """Return the time in s in which an input went to its target, by the applied values."""
        course = [(row.time, row.applied[name]) for row in self.rows[self._begun :]]
        at_rest = max(time for time, value in course if value == self.rest[name])
        return min(time for time, value in course if value == self.targets[name]) - at_rest

    def exchange(self, values: Mapping[str, float]) -> Mapping[str, Any] | None:
        """Send commands; return the answer, None without one.

        Raises
        ------
        LinkError
            If the session is over.
        """
        assert self._client is not None
        sample = self._client.exchange(list(values.values()), 0.0, PERIOD, _ANSWER / 5)
        if sample is not None and not sample["refused"]:
            self.commands = dict(values)
            self._taken = monotonic()
        return sample

    def turn(self, drives: bool = True) -> Mapping[str, Any]:
        """Command the next values if the rig is driven; return its newest status.

        Raises
        ------
        UserError
            If the server has ended.
        """
        if self._server.poll() is not None:
            raise UserError(f"the server has ended: {self.log[-1]}")
        sleep(max(0.0, self._turned + PERIOD - monotonic()))
        self._turned = monotonic()
        if drives and self._client is not None:
            with suppress(LinkError):  # the session ends with a process
                self.exchange(self._next())
        with suppress(zmq.Again):
            while True:
                self._take(protocol.decode(self._telemetry.recv(zmq.DONTWAIT), protocol.REPLIES))
        self.status = self._monitor.status(_ANSWER) or self.status
        return self.status

    def _next(self) -> dict[str, float]:
        """Return commands on the way to the targets, by the limits of their rates."""
        elapsed = monotonic() - self._taken
        values = {}
        for name, before in self.commands.items():
            step = _RAMP * self._rate(name) * elapsed
            values[name] = min(max(self.targets[name], before - step), before + step)
        return values

    def _take(self, message: Mapping[str, Any]) -> None:
        self.rows.append(
            Row(
                message["clock"],
                message["state"],
                self.commands,
                message["inputs"],
                message["read_back"],
            )
        )

    def _wait_for(self, done: Callable[[], bool], timeout: float, drives: bool = False) -> bool:
        """Take turns until something is so; return False if it is not in time, s."""
        until = monotonic() + timeout
        while not done():
            if monotonic() > until:
                return False
            self.turn(drives)
        return True

    def drive_until(self, done: Callable[[], bool], timeout: float) -> bool:
        """Drive until something is so; return False if it is not in time, s."""
        return self._wait_for(done, timeout, drives=True)

    # -- the safe state

    def wait_safe(self, fault: float, drives: bool = True, latch: str = "") -> Finding:
        """Wait for the safe state, and judge it by time, by read-back and by the operator.

        Parameters
        ----------
        fault : float
            When it had to begin, s of the monotonic clock.
        drives : bool
            Whether the client goes on.
        latch : str
            Name of a latch before, which does not count.
        """
        names = ("", latch)

        def is_decided() -> bool:
            return self.status["latch"] not in names and self.status["state"] in (SAFE, NOT_REACHED)

        decided = self._wait_for(is_decided, self.bound + _PATIENCE, drives)
        took = monotonic() - fault
        heard = len(self.rows)
        self._wait_for(lambda: any(row.read_back for row in self.rows[heard:]), _ANSWER)
        marks = ((fault, "fault"), (fault + self.bound, "bound"))
        if not decided:
            trouble = f"{self.status['state']} after {took:.3g} s: no safe state"
            return Finding(FAILED, trouble, marks)
        if self.status["state"] == NOT_REACHED:
            return Finding(FAILED, self.status["alarm"] or NOT_REACHED, marks)
        return self._judged(took, marks)

    def _judged(self, took: float, marks: tuple[tuple[float, str], ...]) -> Finding:
        """Return the finding on a safe state that the server has confirmed."""
        read = self.rows[-1].read_back
        if differing := self.deviations(read, self.rest):
            return Finding(FAILED, f"said to be safe, and the device has {differing}", marks)
        measured = f"confirmed after {took:.3f} s"
        if took > self.bound + OBSERVATION:
            return Finding(FAILED, measured, marks)
        if self.status.get("verified", True):
            by = f"read back: {self.describe(read)}" if read else "read back by the guard"
            return Finding(PASS, f"{measured}; {by}", marks)
        verdict = self.answer("The device does not report what it has. Is the rig at rest?")
        return Finding(verdict, f"{measured}, by the server alone; at rest: {verdict}", marks)

    def answer(self, question: str) -> str:
        """Return the verdict that an operator gives by yes or no."""
        return {True: PASS, False: FAILED, None: NOT_CONFIRMED}[self.ask(question)]

    def release(self) -> None:
        """Acknowledge the latch, and wait until the rig can be tried again.

        Raises
        ------
        UserError
            If it cannot be used.
        """
        self._end_session()
        until = monotonic() + LONGEST_RELEASE
        while monotonic() < until:
            status = self.turn(drives=False)
            row = self.rows[-1]
            is_idle = status["state"] == row.state == IDLE and row.applied == self.rest
            if is_idle and self.processes():
                return
            if status["latch"] and status["state"] != NOT_REACHED:
                with suppress(UserError):  # another latch was closed meanwhile
                    operator.acknowledge(self.remote, status["latch"], _ANSWER)
        state = f"{self.status['state']}: {self.status['reason']}"
        raise UserError(f"the rig cannot be used {LONGEST_RELEASE:g} s later: {state}")

    def _end_session(self) -> None:
        """End the client's session, if there is one."""
        if self._client is not None:
            self._client.disconnect()
            self._client.close()
            self._client = None

    # -- the end

    def read_device(self) -> dict[str, float]:
        """Return what the device reports to a process of its own, after the server's end.

        Raises
        ------
        UserError
            If it does not answer in time.
        """
        ignores = (signal.SIGINT, signal.SIG_IGN)  # which is for this process alone
        with get_context("spawn").Pool(1, signal.signal, ignores) as pool:
            asked = pool.apply_async(_reported, (self.device.backend, self.device.options))
            try:
                return asked.get(_LONGEST_START)
            except ProcessTimeout as error:
                raise UserError(f"the device does not open in {_LONGEST_START:g} s") from error

    def kill_front(self) -> bool:
        """Kill the front; return True if all other processes have ended in time."""
        processes = list(self.processes().values())
        self.processes()["front"].kill()
        _, alive = psutil.wait_procs(processes, _LONGEST_END)
        self._disconnect()
        return not alive

    def _disconnect(self) -> None:
        """Close the connections to the server, and wait for its last line."""
        self._end_session()
        self._monitor.close()
        self._telemetry.close(linger=0)
        self._server.wait(_LONGEST_END)
        self._reader.join(_PATIENCE)

    def close(self) -> int | None:
        """End the server, and return its exit status; 0 says that the rig is in its safe state.

        A server that does not reach the safe state gets a second signal, which ends it.
        """
        if hasattr(self, "_monitor"):
            for process in self.processes().values():
                with suppress(psutil.Error):
                    process.resume()  # one that a check has stopped
            self._end_session()
            self._monitor.close()
        for end in (self._server.terminate, self._server.terminate, self._server.kill):
            if self._server.poll() is None:
                end()
            with suppress(subprocess.TimeoutExpired):
                self._server.wait(_LONGEST_END)
        self._reader.join(_PATIENCE)
        self._context.destroy(linger=0)
        return self._server.returncode
