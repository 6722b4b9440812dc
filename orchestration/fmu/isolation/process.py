"""Isolated processes from the view of their parent, which calls, watches and kills them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from fmus.kit.storage import scratch
from orchestration.fmu.isolation import shared_progress
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.messages import receive, send
from orchestration.fmu.isolation.shared_progress import ProgressState, SharedProgress
from orchestration.fmu.kernel import load_stepper

if TYPE_CHECKING:
    from io import FileIO

_PERIOD = 0.1  # s between two checks of the progress
_GRACE = 2.0  # s that a call may take after Ctrl-C, and a process to end after its last answer
# share of the memory limit; a process that ends above it very likely exceeded the limit
_MUCH_MEMORY = 0.8
_PAGE = 4096  # bytes


class Ended(Exception):
    """Raised when an isolated process has ended by itself or was killed by its parent.

    Attributes
    ----------
    reason : str
        Description of its end.
    state : ProgressState
        Its last progress.
    interrupted : bool
        Whether Ctrl-C was the cause.
    """

    def __init__(self, reason: str, state: ProgressState, interrupted: bool = False):
        super().__init__(reason)
        self.reason = reason
        self.state = state
        self.interrupted = interrupted


class Process:
    """A new Python interpreter that calls functions one by one; a context manager.

    Parameters
    ----------
    limits : Limits

    Attributes
    ----------
    progress : SharedProgress
        Progress of the process, which can be read after its end too.
    busy : bool
        Whether a call has not returned, also because the process ended.
    """

    def __init__(self, limits: Limits):
        self._limits = limits
        self._resources = ExitStack()
        self._largest_memory = 0  # bytes
        self._closed = False
        self.busy = False

    def __enter__(self) -> Process:
        folder = self._resources.enter_context(scratch.folder("fmu"))
        self.progress = SharedProgress(folder)
        self.progress.clear()
        # compiled here, because a compiler may need more memory than the limit
        load_stepper()
        program = (
            f"import sys; sys.path[:] = {sys.path!r}; from orchestration.fmu.isolation.child import"
            " main; main()"
        )
        self._process = subprocess.Popen(
            [sys.executable, "-c", program, str(folder), str(self._limits.bytes)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # an isolated process and those that it starts are killed together
            start_new_session=shared_progress.current is None,
        )
        buffered: Any = self._process.stdout
        # without a buffer, whose lock a reader that never returns would keep
        self._stream: FileIO = buffered.detach()
        self._answers: SimpleQueue[Any] = SimpleQueue()
        self._reader = threading.Thread(target=self._listen, daemon=True)
        self._reader.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> None:
        process = self._process
        assert process.stdin is not None
        if kind is not None:
            self.kill()
        with suppress(OSError):
            process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            process.wait(_GRACE)
        self.kill()  # including processes that FMUs have started
        process.wait()
        self._closed = True
        self._reader.join(_PERIOD)
        if not self._reader.is_alive():  # a process in another session may keep the pipe open
            self._stream.close()
        self._resources.close()

    def kill(self) -> None:
        """Kill the process and all processes of its group."""
        if self._closed:  # another process may have its id by now
            return
        self._process.kill()
        if sys.platform != "win32":
            with suppress(OSError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _listen(self) -> None:
        """Queue the messages of the process, and None after the last."""
        # an FMU may write to the pipe or close it, after which no message can be read
        with suppress(Exception):
            while (answer := receive(self._stream)) is not None:
                self._answers.put(answer)
        self._answers.put(None)

    def call(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        callbacks: dict[str, Callable[..., None]] | None = None,
    ) -> Any:
        """Call a function in the process and return its result.

        Parameters
        ----------
        function : callable
            Function of a module.
        *arguments
            Objects that can be pickled.
        callbacks : dict of str to callable, optional
            Keyword arguments of the function, whose calls are executed in this process.

        Returns
        -------
        object
            Result of the function.

        Raises
        ------
        Exception
            Any that the function raises, such as UserError.
        KeyboardInterrupt
            If the function ends because of Ctrl-C.
        Ended
            If the process ends, or a call of an FMU takes too long or does not react to Ctrl-C.
        """
        self.busy = True
        self._send((function, arguments, list(callbacks or {})))
        watch = _Watch(self, self._limits.step_timeout)
        answer = self._final_answer(watch, callbacks or {})
        if answer is None:
            raise Ended(self._describe_end(), self.progress.state(), watch.interrupted)
        self.busy = False
        kind, content = answer
        if kind == "result":
            return content
        if kind == "interrupted":
            raise KeyboardInterrupt
        raise content

    def _final_answer(self, watch: _Watch, callbacks: Mapping[str, Callable[..., None]]) -> Any:
        """Execute callbacks until the process sends another message; return that, None at its end.

        The first Ctrl-C is passed on to the process; the second one ends it.
        """
        while True:
            # Ctrl-C may arrive anywhere here, not only while waiting for an answer
            try:
                answer = self._next_answer(watch)
                if answer is None or answer[0] != "callback":
                    return answer
                _, name, values = answer
                callbacks[name](*values)
            except KeyboardInterrupt:
                if watch.interrupted:
                    raise self.end("interrupted", interrupted=True) from None
                watch.interrupted_at = time.monotonic()
                self._send("interrupt")

    def _next_answer(self, watch: _Watch) -> Any:
        """Return the next message of the process; None if it has ended without one."""
        while True:
            has_ended = self._process.poll() is not None  # read before the queue of its messages
            try:
                return self._answers.get(timeout=_PERIOD)
            except Empty:
                if has_ended:  # while a child process of it keeps the pipe open
                    return None
                watch.check()
                self._note_memory()

    def _send(self, message: Any) -> None:
        stream = self._process.stdin
        assert stream is not None
        with suppress(OSError):  # its end is noticed while waiting for its answer
            send(stream, message)

    def end(self, reason: str, interrupted: bool = False) -> Ended:
        """Kill the process and return the error to raise."""
        state = self.progress.state()
        self.kill()
        self._process.wait()
        return Ended(reason, state, interrupted)

    def _note_memory(self) -> None:
        """Update the largest size of the data and stack of the process, which Linux limits."""
        with suppress(OSError, ValueError, IndexError):  # where there is no /proc
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[5])  # proc(5)
            self._largest_memory = max(self._largest_memory, _PAGE * pages)

    def _describe_end(self) -> str:
        """Return a description of the end of the process, which has ended by itself."""
        try:
            status = self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            return "its process did not answer any more and was ended"
        if status < 0:
            with suppress(ValueError):
                name = signal.Signals(-status).name
                return f"its process was ended by {name}{self._memory_remark()}"
        return f"its process ended (exit status {status}{self._memory_remark()})"

    def _memory_remark(self) -> str:
        """Return the part of a message on memory; empty unless the process was near its limit."""
        allowed = self._limits.bytes
        if not allowed or self._largest_memory < _MUCH_MEMORY * allowed:
            return ""
        used = self._largest_memory / 1e9
        return f", with {used:.2g} GB of memory, and {allowed / 1e9:.2g} GB are allowed"


class _Watch:
    """Watch over one call, which kills the process if an FMU hangs or ignores Ctrl-C.

    Parameters
    ----------
    process : Process
    step_timeout : float
        Seconds that one call of an FMU may take.

    Attributes
    ----------
    interrupted_at : float
        Time of Ctrl-C on the monotonic clock in s; 0 before Ctrl-C.
    """

    def __init__(self, process: Process, step_timeout: float):
        self._process = process
        self._step_timeout = step_timeout
        self._state: ProgressState | None = None
        self._since = time.monotonic()  # time of the last change of the progress
        self.interrupted_at = 0.0

    @property
    def interrupted(self) -> bool:
        """True after Ctrl-C."""
        return self.interrupted_at > 0.0

    def check(self) -> None:
        """Compare the progress with that of the last check, and end a process that hangs.

        Raises
        ------
        Ended
            If the progress has not changed for too long, or the call lasts too long after Ctrl-C.
        """
        now = time.monotonic()
        state = self._process.progress.state()
        if state != self._state or not state.doing:
            self._state = state
            self._since = now
        elif now - self._since > self._step_timeout:
            raise self._process.end(f"no answer within {self._step_timeout:g} s") from None
        if self.interrupted and now - self.interrupted_at > _GRACE:
            raise self._process.end("interrupted; it did not answer", interrupted=True) from None
