"""A pool of isolated processes that work in parallel; one that ends does not end the others."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import Any

from fmus.kit import UserError
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process


class Pool:
    """Processes that are started, and started again, when they are needed; a context manager.

    Parameters
    ----------
    limits : Limits
        Limits of each process.
    count : int
        Largest number of processes.
    begin : callable
        A function of a module, called in each process before anything else.
    *arguments
        Arguments of `begin`: paths and numbers.
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
        if kind is not None:  # nobody waits for the calls that are in progress
            for process in [*self._started]:
                process.kill()
        self._threads.shutdown(cancel_futures=True)
        while True:
            try:
                self._idle.get_nowait().__exit__(kind, *error)
            except Empty:
                return

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Let one of the processes call a function.

        Returns
        -------
        Future
            Of what the function returns; it fails with `Ended` if the process ends.
        """
        return self._threads.submit(self._call, function, arguments)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        try:
            process = self._idle.get_nowait()
        except Empty:
            process = self._start()
        try:
            return process.call(function, *arguments)
        finally:
            if process.busy:  # its next answer would be that of this call
                process.__exit__(Ended, None, None)
            else:
                self._idle.put(process)

    def _start(self, retry: bool = True) -> Process:
        process = Process(self._limits)
        process.__enter__()
        self._started.append(process)
        try:
            process.call(self._begin, *self._arguments)
        except BaseException as error:
            process.__exit__(type(error), error, None)
            if isinstance(error, Ended) and retry:  # something else may have ended it
                return self._start(retry=False)
            if isinstance(error, Ended):
                raise UserError(f"{error.state.doing or 'to begin'}: {error.reason}") from error
            raise
        return process
