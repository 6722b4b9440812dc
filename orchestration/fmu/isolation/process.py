"""An isolated process seen from its parent: called, watched, and ended if it does not answer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from fmus.kit.storage import scratch
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.messages import receive, send
from orchestration.fmu.isolation.shared_progress import ProgressState, SharedProgress
from orchestration.fmu.kernel import load_stepper

if TYPE_CHECKING:
    from io import FileIO

_PERIOD = 0.1  # s between two looks at the progress
_GRACE = 2.0  # s that a call may go on after Ctrl-C, and a process after its last answer
# share of the allowed memory; a process that ends with more of it very likely wanted too much
_MUCH_MEMORY = 0.8


class Ended(Exception):
    """The error that an isolated process has ended, by itself or because its parent ended it.

    Attributes
    ----------
    reason : str
        How it ended, in words.
    state : ProgressState
        Its last progress.
    interrupted : bool
        Whether it ended because of Ctrl-C.
    """

    def __init__(self, reason: str, state: ProgressState, interrupted: bool = False):
        super().__init__(reason)
        self.reason = reason
        self.state = state
        self.interrupted = interrupted


class Process:
    """A fresh interpreter in which functions are called one after the other; a context manager.

    Parameters
    ----------
    limits : Limits

    Attributes
    ----------
    progress : SharedProgress
        Readable also after the process has ended.
    busy : bool
        Whether an answer is due: a call has not returned, or the process ended during one.
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
        # compiled here if need be: a compiler may take more memory than an FMU is allowed
        load_stepper()
        program = (
            f"import sys; sys.path[:] = {sys.path!r}; from orchestration.fmu.isolation.child import"
            " main; main()"
        )
        self._process = subprocess.Popen(
            [sys.executable, "-c", program, str(folder), str(self._limits.bytes)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        buffered: Any = self._process.stdout
        # a buffer has a lock, which a reader that never returns would hold for good
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
        if not self._reader.is_alive():  # else a process in another session holds the other end
            self._stream.close()
        self._resources.close()

    def kill(self) -> None:
        """End the process at once, and those that were started in it."""
        if self._closed:  # its number may belong to another process by now
            return
        if sys.platform == "win32":
            self._process.kill()
            return
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def _listen(self) -> None:
        # FMUs may write anything to any file, and then no message can be read any more
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
        """Call a function in the process.

        Parameters
        ----------
        function : callable
            A function of a module.
        *arguments
            Objects that can be pickled.
        callbacks : dict of str to callable, optional
            Keyword arguments that are called in this process when the function calls them.

        Returns
        -------
        Any
            What the function returns.

        Raises
        ------
        Exception
            Any that the function raises, such as UserError.
        KeyboardInterrupt
            After Ctrl-C, if the function ends with that.
        Ended
            If the process ends, a call of an FMU takes too long, or does not react to Ctrl-C.
        """
        self.busy = True
        self._send((function, arguments, list(callbacks or {})))
        watch = _Watch(self, self._limits.step_timeout)
        while True:
            # Ctrl-C may arrive anywhere in here, not only while an answer is awaited
            try:
                answer = self._next_answer(watch)
                if answer is not None and answer[0] == "callback":
                    _, name, values = answer
                    (callbacks or {})[name](*values)
                    continue
            except KeyboardInterrupt:
                if watch.interrupted:
                    raise self.end("interrupted", interrupted=True) from None
                watch.interrupted_at = time.monotonic()
                self._send("interrupt")
                continue
            if answer is None:
                raise self._ended(watch.interrupted)
            self.busy = False
            kind, content = answer
            if kind == "result":
                return content
            if kind == "interrupted":
                raise KeyboardInterrupt
            raise content

    def _next_answer(self, watch: _Watch) -> Any:
        """Return what the process sends next; None if it has ended and sent nothing more."""
        while True:
            over = self._process.poll() is not None  # before the look at what it has sent
            try:
                return self._answers.get(timeout=_PERIOD)
            except Empty:
                if over:  # and a process that it has started holds the other end
                    return None
                watch.look()
                self._look_at_memory()

    def _send(self, message: Any) -> None:
        stream = self._process.stdin
        assert stream is not None
        with suppress(OSError):  # where its answer is awaited, its end is noticed
            send(stream, message)

    def end(self, reason: str, interrupted: bool = False) -> Ended:
        """Kill the process, and return the error to raise."""
        state = self.progress.state()
        self.kill()
        self._process.wait()
        return Ended(reason, state, interrupted)

    def _ended(self, interrupted: bool) -> Ended:
        """Return the error for a process that has ended by itself."""
        return Ended(self._describe_end(), self.progress.state(), interrupted)

    def _look_at_memory(self) -> None:
        with suppress(OSError, ValueError, IndexError):  # where there is no /proc
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[5])
            self._largest_memory = max(self._largest_memory, 4096 * pages)

    def _describe_end(self) -> str:
        try:
            status = self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            return "its process could not be heard any more, and was ended"
        if status < 0:
            with suppress(ValueError):
                name = signal.Signals(-status).name
                return f"its process was ended by {name}{self._memory_remark()}"
        return f"its process ended (exit status {status}{self._memory_remark()})"

    def _memory_remark(self) -> str:
        """Return the end of "its process ended": that it was near its limit of memory, if so."""
        allowed = self._limits.bytes
        if not allowed or self._largest_memory < _MUCH_MEMORY * allowed:
            return ""
        taken = self._largest_memory / 1e9
        return f", with {taken:.2g} GB of memory, and {allowed / 1e9:.2g} GB are allowed"


class _Watch:
    """The watch over one call: it ends the process if an FMU is stuck or does not react to Ctrl-C.

    Parameters
    ----------
    process : Process
    step_timeout : float
        Seconds that one call of an FMU may take.

    Attributes
    ----------
    interrupted_at : float
        Time of Ctrl-C on the monotonic clock in s; 0 before it was pressed.
    """

    def __init__(self, process: Process, step_timeout: float):
        self._process = process
        self._step_timeout = step_timeout
        self._state: ProgressState | None = None
        self._since = time.monotonic()  # when the progress was last seen to change
        self.interrupted_at = 0.0

    @property
    def interrupted(self) -> bool:
        """True after Ctrl-C was pressed."""
        return self.interrupted_at > 0.0

    def look(self) -> None:
        """Compare the progress with that of the last look.

        Raises
        ------
        Ended
            If the call has taken too long since, or has gone on too long after Ctrl-C.
        """
        now = time.monotonic()
        state = self._process.progress.state()
        if state != self._state or not state.doing:
            self._state = state
            self._since = now
        elif now - self._since > self._step_timeout:
            raise self._process.end(f"no answer within {self._step_timeout:g} s") from None
        if self.interrupted and now - self.interrupted_at > _GRACE:
            raise self._process.end(
                "interrupted, for it did not answer", interrupted=True
            ) from None
