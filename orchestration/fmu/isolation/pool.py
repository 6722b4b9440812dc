"""Pools of isolated processes that work in parallel; a crash of one leaves the others alive."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from fmus.kit import UserError
from orchestration.fmu.isolation.child import release
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process


class Pool:
    """A pool of processes, which are started on demand and replaced after a crash.

    It is a context manager that ends the processes.

    Parameters
    ----------
    limits : Limits
        Limits of each process.
    count : int
        Largest number of processes.
    begin : callable
        Function of a module that is called first in each process.
    *arguments
        Arguments of `begin`, which can be pickled.
    """

    def __init__(self, limits: Limits, count: int, begin: Callable[..., None], *arguments: Any):
        self._limits = limits
        self._begin = begin
        self._arguments = arguments
        self._threads = ThreadPoolExecutor(count, "process")
        self._idle: SimpleQueue[Process] = SimpleQueue()
        self._started: list[Process] = []

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> None:
        if kind is not None:  # results of calls in progress are not needed
            for process in [*self._started]:
                if process.busy:
                    process.kill()
        self._threads.shutdown(cancel_futures=True)
        while True:
            try:
                process = self._idle.get_nowait()
            except Empty:
                return
            # all results are there: a failure of the end takes nothing from them
            with suppress(Ended, UserError):
                process.call(release)
            process.__exit__(kind, *error)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call a function in one of the processes, when one is free.

        Returns
        -------
        Future
            The result of the function; it raises `Ended` if the process ends.
        """
        return self._threads.submit(self._call, function, arguments)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a function in an idle process, or in a new one if there is none."""
        try:
            process = self._idle.get_nowait()
        except Empty:
            process = self._start()
        try:
            return process.call(function, *arguments)
        finally:
            if process.busy:  # its next answer would be that of the failed call
                process.__exit__(Ended, None, None)
            else:
                self._idle.put(process)

    def _start(self, retry: bool = True) -> Process:
        """Return a new process after the call of `begin`; UserError if it ends twice in that."""
        process = Process(self._limits)
        process.__enter__()
        self._started.append(process)
        try:
            process.call(self._begin, *self._arguments)
        except BaseException as error:
            process.__exit__(type(error), error, None)
            if not isinstance(error, Ended):
                raise
            if retry:  # the cause may be outside, such as a lack of memory
                return self._start(retry=False)
            raise UserError(f"{error.state.doing or 'to begin'}: {error.reason}") from error
        return process
