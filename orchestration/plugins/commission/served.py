"""A rig whose server is started and driven here, so that its protections can be tried."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from math import inf
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any, NamedTuple

import psutil
import zmq

from fmus.kit import UserError, files
from fmus.rig_proxy import IDLE, NOT_REACHED, SAFE, Link, LinkError, protocol
from orchestration.plugins.commission.protocol import (
    FAILED,
    NOT_CONFIRMED,
    PASS,
    Row,
)
from orchestration.reporting.html import facts_about
from orchestration.rig import operator, read_endpoint
from orchestration.rig.backends import Backend, backend_class, device_names, open_backend

PERIOD = 0.01  # s between an answer and the next command
# s by which a client learns later of the safe state than it is reached: a turn of the front, and a
# question
OBSERVATION = 0.05
SAME = 0.01  # of an input's range, as in the server's own comparison
_UNLIMITED = {"min": -1.0, "max": 1.0, "rate": inf}  # moves as far as its unit
_ANSWER = 0.5  # s that the server has for an answer
_PATIENCE = 2.0  # s beyond a bound, after which nothing is waited for any more
_RAMP = 0.95  # of the largest rate: a command that comes early is not refused
_LONGEST_START = 60.0  # s, with an opening of 30 s
_LONGEST_RELEASE = 20.0  # s that a device may take to be opened again
_LONGEST_END = 20.0  # s that a server may take to end in the safe state
_HEARD = ("clock", "state", "inputs", "read_back")  # of telemetry
_READY = re.compile(r"ready: (tcp://\S+) .* safe within ([\d.e-]+) s")


class Device(NamedTuple):
    """A backend as it is before it is opened.

    Attributes
    ----------
    backend : str
    options : Mapping of str to str
    names : tuple of str
        Names of its devices; empty if it commands nothing real.
    facts : Mapping of str to str
        Versions, and SHA-256 of its files: code and calibration.
    has_heartbeat : bool
    """

    backend: str
    options: Mapping[str, str]
    names: tuple[str, ...]
    facts: Mapping[str, str]
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
    beats = backend_class(backend).heartbeat is not Backend.heartbeat
    return Device(backend, options, names, facts_about([*map(Path, found)]), beats)


def _reported(backend: str, options: Mapping[str, str]) -> dict[str, float]:
    """Return what a device reports; opening changes no output of it."""
    with closing(open_backend(backend, options)) as opened:
        return dict(opened.read_back())


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
    status : Mapping of str to object
        Newest status of the server.
    rest, targets : dict of str to float
        Values of the inputs at rest, and those that are commanded, SI.
    limits : dict of str to dict
        Limits of the inputs: ``min``, ``max`` and ``rate``.
    drives : bool
        Whether each turn commands the next values.
    verdict : str
        Verdict of the present check.
    marks : tuple of (float, str)
        Times of the present check that its chart shows, s of the monotonic clock.
    rows : list of Row
        Inputs since the rig was at rest.
    log : list of str
        Lines of the server.
    """

    def __init__(
        self,
        device: Device,
        words: Sequence[str],
        level: float,
        ask: Callable[[str], bool | None],
        credentials: Path | None = None,
    ) -> None:
        self.device = device
        self.words = words
        self.ask = ask
        self.credentials = credentials
        self.drives = False
        self.log: list[str] = []
        self.rows: list[Row] = []
        self.commands: dict[str, float] = {}
        self._taken = 0.0  # when the newest command was, s
        self._folder = TemporaryDirectory()
        self._output = Path(self._folder.name, "server.log")
        self._connections = ExitStack()
        self._session = ExitStack()
        try:
            self.start()
            self.wait(lambda: bool(self.rows), _PATIENCE)
            if self.status["latch"]:
                raise UserError(
                    f"the rig is latched since before: {self.status['reason']}; serve it, and"
                    " release it with ppy rig acknowledge first"
                )
        except BaseException:
            self.close()
            raise
        self.rest = {name: value or 0.0 for name, value in self.rows[-1].applied.items()}
        self.targets = {}
        self.limits = {}
        for name, rest in self.rest.items():
            known = self.status["limits"].get(name, {})
            limit = _UNLIMITED | {key: bound for key, bound in known.items() if bound is not None}
            self.limits[name] = limit
            farthest = limit["max"] if limit["max"] > rest else limit["min"]
            self.targets[name] = rest + level * (farthest - rest)

    def start(self) -> None:
        """Start the server, and connect to it."""
        begun = len(self.log)
        with self._output.open("a") as output:
            self._server = subprocess.Popen(
                [sys.executable, "-m", "orchestration.cli", "rig", "serve", *self.words],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )
        until = monotonic() + _LONGEST_START
        while not (ready := _READY.search("\n".join(self._read_log()[begun:]))):
            if self._server.poll() is not None:
                raise UserError(f"ppy rig serve: {self._read_log()[-1]}")
            if monotonic() > until:
                raise UserError(f"ppy rig serve is not ready after {_LONGEST_START:g} s")
            sleep(PERIOD)
        endpoint, bound = ready.groups()
        self.bound = float(bound)
        self.remote = read_endpoint(endpoint, self.credentials)
        self._monitor = self._connections.enter_context(closing(self.link()))
        context = self._connections.enter_context(zmq.Context())
        self._telemetry = self._connections.enter_context(context.socket(zmq.SUB))
        self.remote.connect(self._telemetry, self.remote.telemetry)
        self._telemetry.subscribe(b"")
        self.status: Mapping[str, Any] = operator.ask(self.remote, "status")
        self.inputs: Mapping[str, str] = self.status["inputs"]

    def _read_log(self) -> list[str]:
        """Read the lines of the server that have come; the newest one may not be complete."""
        self.log = self._output.read_text("utf-8", "replace").splitlines()
        return self.log or ["it has said nothing"]

    def link(self, **inputs: str) -> Link:
        """Return a link of a client without a session, with the units of inputs."""
        address = self.remote.requests
        return Link(address, inputs, {}, self.credentials, "ppy rig commission")

    def describe(self, values: Mapping[str, float]) -> str:
        """Return values of inputs with their units, in words."""
        return ", ".join(
            f"{name} {value:.4g} {self.inputs[name]}".removesuffix(" 1")
            for name, value in values.items()
        )

    def deviations(self, values: Mapping[str, float | None], wanted: Mapping[str, float]) -> str:
        """Return those values in words that differ from wanted ones; empty if none does."""
        differing = {}
        for name, value in values.items():
            limit = self.limits[name]
            allowed = SAME * (limit["max"] - limit["min"])
            if value is not None and abs(value - wanted[name]) > allowed:
                differing[name] = value
        return self.describe(differing)

    def processes(self) -> dict[str, psutil.Process]:
        """Return the processes of the server by role; without some while they are replaced.

        A guard is a child of the front, and the device one of the guard on duty. Only these were
        started as Python starts a process of its own.
        """
        with suppress(psutil.Error, ValueError):
            family = psutil.Process(self._server.pid).children(recursive=True)
            spawned = {one.pid: one for one in family if "spawn_main" in " ".join(one.cmdline())}
            (device,) = (one for one in spawned.values() if one.ppid() in spawned)
            guard = spawned.pop(device.ppid())
            (standby,) = spawned.keys() - {device.pid}
            front = psutil.Process(guard.ppid())
            return {"front": front, "device": device, "guard": guard, "standby": spawned[standby]}
        return {}

    # -- driving

    def begin(self) -> None:
        """Begin a session, and command the targets as fast as the rig allows."""
        self._client = self._session.enter_context(closing(self.link(**self.inputs)))
        self._client.connect(0.0, _ANSWER)
        self._session.callback(self._client.disconnect)
        self.commands = self.rest
        self._taken = monotonic()
        self.drives = True
        self.verdict = PASS
        self.marks: tuple[tuple[float, str], ...] = ()
        self.rows = [self.rows[-1]._replace(commanded=self.rest)]  # the newest one is at rest
        longest = max(
            abs(target - self.rest[name]) / self.limits[name]["rate"]
            for name, target in self.targets.items()
        )
        if not self.wait(lambda: self.rows[-1].applied == self.targets, 2.0 * longest + _PATIENCE):
            raise UserError(
                f"the rig does not follow {self.describe(self.targets)} (--level):"
                f" {self.status['reason'] or dict(self.rows[-1].applied)}"
            )

    def ramp(self, name: str) -> float:
        """Return the time in s in which an input went to its target, by the applied values."""
        last = {row.applied[name]: row.time for row in self.rows}
        first = {row.applied[name]: row.time for row in reversed(self.rows)}
        return first[self.targets[name]] - last[self.rest[name]]

    def exchange(self, values: dict[str, float]) -> bool:
        """Send commands; return True if they are accepted.

        Raises
        ------
        LinkError
            If the session is over, or there is no answer.
        """
        sample = self._client.exchange(list(values.values()), 0.0, PERIOD, _ANSWER / 5)
        if sample is None:
            raise LinkError("no answer to a command")
        if sample["refused"]:
            return False
        self.commands = values
        self._taken = monotonic()
        return True

    def turn(self) -> None:
        """Command the next values if the rig is driven, and take its newest status.

        Raises
        ------
        UserError
            If the server has ended.
        """
        if self._server.poll() is not None:
            raise UserError(f"the server has ended: {self._read_log()[-1]}")
        sleep(PERIOD)
        if self.drives:
            with suppress(LinkError):  # the session ends with a process
                self.exchange(self._next())
        while self._telemetry.poll(0):
            heard = protocol.decode(self._telemetry.recv(), protocol.REPLIES)
            time, state, *values = (heard[key] for key in _HEARD)
            self.rows.append(Row(time, state, self.commands, *values))
        self.status = self._monitor.status(_ANSWER) or self.status

    def _next(self) -> dict[str, float]:
        """Return commands on the way to the targets, by the limits of their rates."""
        elapsed = monotonic() - self._taken
        values = {}
        for name, before in self.commands.items():
            step = _RAMP * self.limits[name]["rate"] * elapsed
            values[name] = min(max(self.targets[name], before - step), before + step)
        return values

    def wait(self, done: Callable[[], bool], timeout: float) -> bool:
        """Take turns until something is so; return False if it is not in time, s."""
        until = monotonic() + timeout
        while not done():
            if monotonic() > until:
                return False
            self.turn()
        return True

    # -- the safe state

    def wait_safe(self, fault: float, latch: str = "") -> str:
        """Wait for the safe state; return how it was confirmed: by read-back or by the operator.

        Parameters
        ----------
        fault : float
            When it had to begin, s of the monotonic clock.
        latch : str
            Name of a latch before, which does not count.

        Raises
        ------
        UserError
            If it was not reached in time, or the device reports other values.
        """
        self.marks = ((fault, "fault"), (fault + self.bound, "bound"))

        def is_decided() -> bool:
            is_new = self.status["latch"] not in ("", latch)
            return is_new and self.status["state"] in (SAFE, NOT_REACHED)

        is_in_time = self.wait(is_decided, self.bound + _PATIENCE)
        took = monotonic() - fault
        state = self.status["state"]
        if not is_in_time:
            raise UserError(f"{state} after {took:.3g} s: no safe state")
        if state == NOT_REACHED:
            raise UserError(self.status["alarm"] or state)
        heard = len(self.rows)
        self.wait(lambda: any(row.read_back for row in self.rows[heard:]), _ANSWER)
        read = self.rows[-1].read_back
        if differing := self.deviations(read, self.rest):
            raise UserError(f"said to be safe, and the device has {differing}")
        measured = f"confirmed after {took:.3f} s"
        if took > self.bound + OBSERVATION:
            raise UserError(measured)
        if self.status.get("verified", True):
            by = f"read back: {self.describe(read)}" if read else "read back by the guard"
            return f"{measured}; {by}"
        verdict = self.answer("The device does not report what it has. Is the rig at rest?")
        return self.found(verdict, f"{measured}, by the server alone; at rest: {verdict}")

    def found(self, verdict: str, measured: str) -> str:
        """Keep the verdict of a check, and return its text; UserError with it if it has failed."""
        if verdict == FAILED:
            raise UserError(measured)
        self.verdict = verdict
        return measured

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
        self.drives = False
        self._session.close()

        def is_ready() -> bool:
            state = self.status["state"]
            if self.status["latch"] and state != NOT_REACHED:
                with suppress(UserError):  # another latch was closed meanwhile
                    operator.acknowledge(self.remote, self.status["latch"], _ANSWER)
            row = self.rows[-1]
            is_idle = state == row.state == IDLE and row.applied == self.rest
            return is_idle and bool(self.processes())

        self.turn()  # what was heard before may be of the last check
        if not self.wait(is_ready, _LONGEST_RELEASE):
            state = f"{self.status['state']}: {self.status['reason']}"
            raise UserError(f"the rig cannot be used {_LONGEST_RELEASE:g} s later: {state}")

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
            asked = pool.apply_async(_reported, self.device[:2])
            asked.wait(_LONGEST_START)
            if not asked.ready():
                raise UserError(f"the device does not open in {_LONGEST_START:g} s")
            return asked.get()

    def kill_front(self) -> bool:
        """Kill the front; return True if all other processes have ended in time."""
        processes = self.processes()
        processes["front"].kill()
        _, alive = psutil.wait_procs(processes.values(), _LONGEST_END)
        self._disconnect()
        self._server.wait(_LONGEST_END)
        return not alive

    def _disconnect(self) -> None:
        self._session.close()
        self._connections.close()

    def close(self) -> int:
        """End the server, and return its exit status; 0 says that the rig is in its safe state.

        A server that does not reach the safe state gets a second signal, which ends it.
        """
        for process in self.processes().values():
            with suppress(psutil.Error):
                process.resume()  # one that a check has stopped
        self._disconnect()
        for end in (self._server.terminate, self._server.terminate, self._server.kill):
            end()
            with suppress(subprocess.TimeoutExpired):
                self._server.wait(_LONGEST_END)
        self._read_log()
        self._folder.cleanup()
        return self._server.returncode
