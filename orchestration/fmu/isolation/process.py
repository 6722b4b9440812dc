"""A process beside this one, from here: it is asked, watched, and ended if it does not answer."""

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
from types import TracebackType
from typing import TYPE_CHECKING, Any

from fmus.kit.storage import scratch
from orchestration.fmu.isolation.box import Box, State
from orchestration.fmu.isolation.frames import receive, send
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.kernel.library import stepper

if TYPE_CHECKING:
    from io import FileIO

_LOOK = 0.1  # s between two looks at how far it is
_GRACE = 2.0  # s that a call has to end after Ctrl-C, and a process that answers no more
_MUCH = 0.8  # of the memory that is allowed: whoever ends with more of it has very likely asked for too much


class Ended(Exception):
    """The process has ended, by itself or because it was ended from here.

    Attributes
    ----------
    reason : str
        How, in words.
    state : State
        What it was doing.
    interrupted : bool
        Whether that was because of Ctrl-C.
    """

    def __init__(self, reason: str, state: State, interrupted: bool = False):
        super().__init__(reason)
        self.reason, self.state, self.interrupted = reason, state, interrupted


class Process:
    """A fresh interpreter in which functions are called one after the other; a context manager.

    Parameters
    ----------
    limits : Limits

    Attributes
    ----------
    box : Box
        What it leaves, whatever becomes of it.
    asked : bool
        Whether it has something to answer: it is still at it, or has ended.
    """

    def __init__(self, limits: Limits):
        self._limits, self._open, self._memory, self._over = limits, ExitStack(), 0, False
        self.asked = False

    def __enter__(self) -> Process:
        folder = self._open.enter_context(scratch.folder("fmu"))
        self.box = Box(folder)
        self.box.clear()
        stepper()  # compiled here if need be: a compiler may take more memory than an FMU is allowed
        program = f"import sys; sys.path[:] = {sys.path!r}; from orchestration.fmu.isolation.child import main; main()"
        self._process = subprocess.Popen(
            [sys.executable, "-c", program, str(folder), str(self._limits.bytes)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        buffered: Any = self._process.stdout
        self._stream: FileIO = (
            buffered.detach()
        )  # a buffer has a lock, and a reader that stays would keep it
        self._answers: SimpleQueue[Any] = SimpleQueue()
        self._reader = threading.Thread(target=self._listen, daemon=True)
        self._reader.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        process = self._process
        assert process.stdin is not None
        if kind is not None:
            self.kill()
        with suppress(OSError):
            process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            process.wait(_GRACE)
        self.kill()  # with what FMUs have started
        process.wait()
        self._over = True
        self._reader.join(_LOOK)
        if not self._reader.is_alive():  # else somebody in a session of its own holds the other end
            self._stream.close()
        self._open.close()

    def kill(self) -> None:
        """End it at once, and what was started in it."""
        if self._over:  # its number may be another's
            return
        if sys.platform == "win32":
            self._process.kill()
            return
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def _listen(self) -> None:
        with suppress(
            Exception
        ):  # FMUs may write anything to any file, and then there is no telling what follows
            while (answer := receive(self._stream)) is not None:
                self._answers.put(answer)
        self._answers.put(None)

    def call(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        told: dict[str, Callable[..., None]] | None = None,
    ) -> Any:
        """Call a function there.

        Parameters
        ----------
        function : callable
            Of a module.
        *arguments
            What can be pickled.
        told : dict of str to callable, optional
            Keyword arguments that are called here when the function calls them there.

        Returns
        -------
        Any
            What it returns.

        Raises
        ------
        UserError
            What it raises.
        KeyboardInterrupt
            After Ctrl-C, if the function ends with that.
        Ended
            If the process ends, a call of an FMU takes too long, or Ctrl-C is not heard.
        """
        callbacks = told or {}
        self.asked = True
        self._send((function, arguments, list(callbacks)))
        before, since, interrupted = None, time.monotonic(), 0.0
        while True:
            over = self._process.poll() is not None
            try:
                answer = self._answers.get(timeout=_LOOK)
            except Empty:
                if over:  # and somebody whom it has started holds the other end
                    raise Ended(self._how(), self.box.state(), interrupted > 0.0) from None
                now, state = time.monotonic(), self.box.state()
                if state != before or not state.doing:
                    before, since = state, now
                elif now - since > self._limits.step_timeout:
                    raise self._end(f"no answer within {self._limits.step_timeout:g} s") from None
                if interrupted and now - interrupted > _GRACE:
                    raise self._end(
                        "interrupted, for it did not answer", interrupted=True
                    ) from None
                self._look_at_memory()
                continue
            except KeyboardInterrupt:
                if interrupted:
                    raise self._end("interrupted", interrupted=True) from None
                interrupted = time.monotonic()
                self._send("interrupt")
                continue
            if answer is None:
                raise Ended(self._how(), self.box.state(), interrupted > 0.0)
            kind, *what = answer
            self.asked = kind == "told"
            if kind == "told":
                callbacks[what[0]](*what[1])
            elif kind == "result":
                return what[0]
            elif kind == "interrupted":
                raise KeyboardInterrupt
            else:
                raise what[0]

    def _send(self, what: Any) -> None:
        stream = self._process.stdin
        assert stream is not None
        with suppress(OSError):  # that it has ended is told where its answer is waited for
            send(stream, what)

    def _end(self, reason: str, interrupted: bool = False) -> Ended:
        state = self.box.state()
        self.kill()
        self._process.wait()
        return Ended(reason, state, interrupted)

    def _look_at_memory(self) -> None:
        with suppress(OSError, ValueError, IndexError):  # where there is no /proc
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[5])
            self._memory = max(self._memory, 4096 * pages)

    def _how(self) -> str:
        """Say how it ended."""
        try:
            status = self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            return "its process could not be heard any more, and was ended"
        if status < 0:
            with suppress(ValueError):
                name = signal.Signals(-status).name
                return f"its process was ended by {name}{self._remark()}"
        return f"its process ended (exit status {status}{self._remark()})"

    def _remark(self) -> str:
        allowed = self._limits.bytes
        if not allowed or self._memory < _MUCH * allowed:
            return ""
        return (
            f", with {self._memory / 1e9:.2g} GB of memory, and {allowed / 1e9:.2g} GB are allowed"
        )
