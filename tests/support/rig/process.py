"""The project's own server as a user starts it, in processes of its own: its log, and the calls of
its backend. Modules of the tests run as processes as well.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import psutil

if TYPE_CHECKING:
    from tests.support.rig.terminal import Terminal  # needs POSIX

BACKENDS = Path(__file__).with_name("backends.py")
ROOT = Path(__file__).parents[3]
_MARK = "PPY_TEST_SERVER"  # in the environment of all processes of a server
_START = 30.0  # s, on a busy machine
_END = 30.0  # s, likewise


@contextlib.contextmanager
def module_process(module: str, *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Run a module of the tests in a process, from when it says ``ready`` until it is killed."""
    command = [sys.executable, "-m", module, *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


def hil_bench(endpoint: str, duration: float) -> list[str]:
    """Return the command that runs the system ``hil_bench`` in real time, for some seconds."""
    command = [sys.executable, "-m", "orchestration.cli", "run", "hil_bench", "--runtime", "python"]
    command += ["--real-time", "--lag", "2", "--out", "run.nc"]
    settings = [f"proxy.endpoint={endpoint}", f"duration={duration:g}"]
    settings += ["step=20ms", "master.rates.bench=100", "inputs.current.initial=0.4"]
    return [*command, *(word for setting in settings for word in ("--set", setting))]


@dataclass(frozen=True)
class Call:
    """One call of the backend: when, by which process, and what."""

    time: float
    process: int
    what: str


class Server:
    """``ppy rig serve`` with a backend that keeps a log.

    Parameters
    ----------
    folder : Path
        For its files.
    backend : str
        Class in `backends`, a file, or one by name.
    arguments : str
        More of the command line.
    options : dict
        Of the backend, beside its log.
    environment : dict, optional
    stdout : int
        Another place for its lines; then they are read from its log file.
    prefix : sequence of str
        Command that runs this one, and becomes it.
    terminal : Terminal, optional
        Terminal in whose foreground it runs; then its lines are read from its log file.
    """

    def __init__(
        self,
        folder: Path,
        backend: str = "Logged",
        *arguments: object,
        options: dict[str, object] | None = None,
        environment: dict[str, str] | None = None,
        stdout: int = subprocess.PIPE,
        terminal: Terminal | None = None,
        prefix: Sequence[str] = (),
        backends: Path = BACKENDS,
    ) -> None:
        self.terminal = terminal
        self._mark = uuid4().hex
        self.trigger, self._calls = folder / "trigger", folder / "calls.log"
        spec, given = backend, options or {}
        if backend[0].isupper():
            spec, given = f"{backends}:{backend}", {"log": self._calls, **given}
        command = [
            *prefix,
            sys.executable,
            "-m",
            "orchestration.cli",
            "rig",
            "serve",
            "--backend",
            spec,
            *(text for key, value in given.items() for text in ("--option", f"{key}={value}")),
            *map(str, arguments),
        ]
        if terminal is not None:
            stdout = terminal.screen
        self._log = None if stdout == subprocess.PIPE else folder / "server.log"
        if self._log is not None:
            command += ["--log", str(self._log)]
        if not {"--port", "--endpoint"} & set(command):
            command += ["--port", "0"]
        if "--state" not in command:
            command += ["--state", str(folder / "state")]
        self.process = subprocess.Popen(
            command if terminal is None else terminal.command(command),
            stdin=subprocess.DEVNULL if terminal is None else terminal.screen,
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), _MARK: self._mark, **(environment or {})},
            start_new_session=terminal is not None,
        )
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.endpoint = ""

    def _read(self) -> None:
        if self.process.stdout is not None:
            for line in self.process.stdout:
                self.lines.append(line.rstrip("\n"))
        while self._log is not None and self.process.poll() is None:
            sealed = self._log.read_text().splitlines() if self._log.exists() else []
            self.lines[:] = [line.rpartition(" #")[0] for line in sealed]  # without digests
            time.sleep(0.01)

    def wait_ready(self) -> str:
        """Wait for the line that says where it is; return that."""
        line = self.wait_line("ready: ", _START)
        found = re.search(r"ready: (tcp://\S+) ", line)
        assert found is not None
        self.endpoint = found[1]
        return self.endpoint

    def wait_line(self, part: str, timeout: float = 10.0) -> str:
        """Wait for a line of the log that holds a text."""
        until = time.monotonic() + timeout
        while time.monotonic() < until:
            for line in self.lines:
                if part in line:
                    return line
            if self.process.poll() is not None and not self._reader.is_alive():
                break
            time.sleep(0.005)
        for line in self.lines:
            if part in line:
                return line
        errors = self.errors() if self.process.poll() is not None else ""
        raise AssertionError(
            f"no line with {part!r} in {timeout:g} s; there were:\n"
            + "\n".join([*self.lines, errors])
        )

    def promised(self) -> float:
        """Return the time to the safe state that its first line promises, s."""
        stated = re.search(r"safe within ([\d.]+) s", self.wait_line("ready: "))
        assert stated is not None, "the server does not say in what time it is safe"
        return float(stated[1])

    def calls(self) -> list[Call]:
        """Return the calls of the backend so far."""
        if not self._calls.exists():
            return []
        lines = self._calls.read_text().splitlines(keepends=True)
        parts = [line.rstrip("\n").split(" ", 2) for line in lines if line.endswith("\n")]
        return [Call(float(t), int(p), what) for t, p, what in parts]

    def processes(self) -> set[int]:
        """Those that ever had the backend."""
        return {call.process for call in self.calls()}

    def wait_call(self, what: str, after: float, timeout: float = 15.0) -> Call:
        """Wait for a call that begins later than a time."""
        until = time.monotonic() + timeout
        while True:
            for call in self.calls():
                if call.what.startswith(what) and call.time > after:
                    return call
            if time.monotonic() > until:
                raise AssertionError(f"no {what} in {timeout:g} s; log:\n" + "\n".join(self.lines))
            time.sleep(0.005)

    def family(self) -> set[int]:
        """All processes of the server, whoever is their parent by now."""
        return {process.pid for process in psutil.process_iter() if self._is_ours(process)}

    def _is_ours(self, process: psutil.Process) -> bool:
        try:
            alive = process.status() != psutil.STATUS_ZOMBIE
            return alive and process.environ().get(_MARK) == self._mark
        except psutil.Error:
            return False

    def roles(self) -> dict[str, int]:
        """Process numbers of front, device, guard, and the guard that stands by, if all is well."""
        device = [call.process for call in self.calls() if call.what == "open"][-1]
        guard = psutil.Process(device).parent()
        assert guard is not None
        front = guard.parent()
        assert front is not None
        standby = next(
            child for child in front.children() if child != guard and _is_spawned(child.cmdline())
        )
        named = {"front": front, "guard": guard, "standby": standby}
        return {"device": device, **{name: process.pid for name, process in named.items()}}

    def send(self, number: signal.Signals) -> None:
        """Send the front a signal, or all that is in the foreground of its terminal."""
        if self.terminal is None:
            self.process.send_signal(number)
        else:
            self.terminal.send(number)

    def wait_end(self) -> int:
        """Wait for its exit status."""
        code = self.process.wait(_END)
        self._reader.join(5.0)
        return code

    def errors(self) -> str:
        """Read standard error, after its end."""
        assert self.process.stderr is not None
        return self.process.stderr.read()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: Any) -> None:
        for stop in (self.process.terminate, self.process.kill):
            if self.process.poll() is None and self.terminal is None:
                stop()
                if os.name == "posix":  # one that is stopped ends when it goes on
                    self.process.send_signal(signal.SIGCONT)
                try:
                    self.process.wait(_END)
                except subprocess.TimeoutExpired:
                    continue
        for left in self.family():
            with contextlib.suppress(ProcessLookupError):
                os.kill(left, signal.SIGKILL)
        self.process.wait(_END)
        self._reader.join(5.0)
        if self.terminal is not None:
            self.terminal.close()
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()


def _is_spawned(command: list[str]) -> bool:
    """Return True for a process that does our work, and is no helper of multiprocessing's own."""
    return any("spawn_main" in part for part in command)
