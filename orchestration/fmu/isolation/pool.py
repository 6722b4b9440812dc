"""Several processes beside this one that do what is asked side by side; one that ends takes nothing with it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any

from fmus.kit.errors import UserError
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process


class Pool:
    """Processes, each started when it is needed first, or needed again; a context manager.

    Parameters
    ----------
    limits : Limits
        Of each.
    count : int
        How many there are at most.
    begin : callable
        Of a module, called in each process before anything else.
    *arguments
        Its arguments: paths and numbers.
    """

    def __init__(self, limits: Limits, count: int, begin: Callable[..., None], *arguments: Any):
        self._limits, self._begin, self._arguments = limits, begin, arguments
        self._threads = ThreadPoolExecutor(count, "process")
        self._idle: SimpleQueue[Process] = SimpleQueue()
        self._all: list[Process] = []  # that were started

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if (
            kind is not None
        ):  # an interrupt, or nobody wants more: they are in the middle of something
            for process in [*self._all]:
                process.kill()
        self._threads.shutdown(cancel_futures=True)
        while True:
            try:
                self._idle.get_nowait().__exit__(kind, error, trace)
            except Empty:
                return

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Let one of them call a function.

        Returns
        -------
        Future
            Of what it returns; of `Ended`, if its process ends.
        """
        return self._threads.submit(self._call, function, arguments)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        try:
            process = self._idle.get_nowait()
        except Empty:
            process = self._started()
        try:
            return process.call(function, *arguments)
        finally:
            if (
                process.asked
            ):  # it has ended, or is still at it: the next answer would be of this question
                process.__exit__(Ended, None, None)
            else:
                self._idle.put(process)

    def _started(self, again: bool = True) -> Process:
        process = Process(self._limits)
        process.__enter__()
        self._all.append(process)
        try:
            process.call(self._begin, *self._arguments)
        except BaseException as error:
            process.__exit__(type(error), error, None)
            if isinstance(error, Ended) and again:  # somebody else may have ended it
                return self._started(again=False)
            if isinstance(error, Ended):
                raise UserError(f"{error.state.doing or 'to begin'}: {error.reason}") from error
            raise
        return process
