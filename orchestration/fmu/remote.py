"""One instance of an FMU in a process of its own, for FMUs that can run only once in a process.

The master binds FMI functions to memory of this process. A call of one sends the function's name
with the contents of that memory, and writes back what the FMU has left there: the numbers are those
of a call in this process, to the last bit.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from math import inf
from operator import attrgetter
from pathlib import Path
from typing import Any

from fmus.kit import UserError
from orchestration.fmu.instance import Fmu
from orchestration.fmu.isolation import Ended, Limits, Process, activity
from orchestration.fmu.message_log import MessageLog

_NO_LIMITS = Limits(step_timeout=inf, memory=inf)  # those of this process hold for its calls too

_instances: list[Fmu] = []  # in the process of an instance: that one


class RemoteFmu(Fmu):
    """One instance of an FMU in a process of its own, beside :class:`orchestration.fmu.Fmu`.

    Its calls raise UserError if the process ends, and KeyboardInterrupt after Ctrl-C.
    """

    _process: Process | None = None

    def _instantiate(self) -> None:
        process = Process(_NO_LIMITS)
        process.__enter__()
        self._process = process
        self._log = _RemoteLog(self._ask)
        self._plain_calls = {}
        self._ask(_open, self.path.resolve(), self.parameters, self.name, self._folder)

    def enter_initialization(self, time: float = 0.0, stop: float | None = None) -> None:
        """Set the parameters and enter initialization mode, in which values can be exchanged."""
        self._ask(_do, "enter_initialization", time, stop)

    def bound(self, function: str, *arguments: Any) -> partial[int]:
        """Return an FMI function with its arguments bound, which only Python can call.

        Parameters
        ----------
        function : str
            Name in the FMI standard.
        *arguments
            Arguments after the component: numbers of ctypes, and `ctypes.byref` of memory, without
            an offset. Their values are read at each call.
        """
        return partial(self._call, function, arguments)

    def _call(self, function: str, arguments: tuple[Any, ...]) -> int:
        memory = [getattr(argument, "_obj", None) for argument in arguments]
        sent = [
            (type(argument).__name__, argument.value) if own is None else bytes(own)
            for argument, own in zip(arguments, memory, strict=True)
        ]
        status, received = self._ask(_call, function, sent)
        for own, content in zip(memory, received, strict=True):
            if own is not None:
                ctypes.memmove(ctypes.addressof(own), content, len(content))
        return int(status)

    def _ask(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of this module in the process of the instance."""
        assert self._process is not None
        try:
            with activity(f"{self.label}: its process"):
                return self._process.call(function, *arguments)
        except Ended as end:
            self.corrupted = True  # nothing can be called any more
            if end.interrupted:
                raise KeyboardInterrupt from end
            raise UserError(f"{end.state.doing or self.label}: {end.reason}") from end

    def close(self) -> None:
        """Terminate and free the instance, and end its process."""
        try:
            super().close()
            if self._process is not None and not self.corrupted:
                self._ask(_do, "close")
        finally:
            process, self._process = self._process, None
            if process is not None:
                process.__exit__(None)


class _RemoteLog(MessageLog):
    """The messages of an instance in a process of its own."""

    def __init__(self, ask: Callable[..., Any]):
        self._ask = ask

    def last(self, otherwise: str) -> str:
        """Return the last messages in one line, or `otherwise` without messages."""
        with suppress(UserError):  # the process has ended
            return str(self._ask(_do, "_log.last", otherwise))
        return otherwise


# --- in the process of the instance


def _open(path: Path, parameters: Any, name: str, folder: str) -> None:
    _instances.append(Fmu(path, parameters, name, folder).__enter__())


def _do(method: str, *arguments: Any) -> Any:
    return attrgetter(method)(_instances[0])(*arguments)


def _call(function: str, arguments: list[Any]) -> tuple[int, list[bytes]]:
    """Call an FMI function; return its status, and what is in the memory of each argument."""
    passed = [
        ctypes.create_string_buffer(argument, len(argument))
        if isinstance(argument, bytes)
        else getattr(ctypes, argument[0])(argument[1])
        for argument in arguments
    ]
    by_reference = [ctypes.byref(p) if isinstance(p, ctypes.Array) else p for p in passed]
    status = _instances[0].bound(function, *by_reference)()
    return status, [p.raw if isinstance(p, ctypes.Array) else b"" for p in passed]
