"""A limit on the processor time of each test that is not marked slow.

Processor time and not the clock's, so that other work on the machine fails no test; and where the
machine is slower or shares its cores, in proportion. It covers the whole test: fixtures count with
the test that needs them first, and children count once they have ended. What the next run of the
suite finds in a cache, modules and compiled libraries, is charged to no test.
"""

from __future__ import annotations

import functools
import os
import statistics
import time
from collections.abc import Callable, Generator
from importlib.machinery import ExtensionFileLoader, SourceFileLoader

import pytest

from fmus.kit.build import toolchain

LIMIT = 2.0  # s, on a machine that runs `_reference_loop` in `_REFERENCE` s
_REFERENCE = 0.0135


class _Uncharged:
    """Processor time (s) of calls that no test pays for; of nested ones the outermost counts."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0

    def exempt(self, owner: object, name: str) -> None:
        """Exempt the calls of a function, which is an attribute of a module or a class."""
        function: Callable[..., object] = getattr(owner, name)

        @functools.wraps(function)
        def measured(*args: object, **kwargs: object) -> object:
            begin = _used()
            self._depth += 1
            try:
                return function(*args, **kwargs)
            finally:
                self._depth -= 1
                if self._depth == 0:
                    self.seconds += _used() - begin

        setattr(owner, name, measured)


def _used() -> float:
    """Return the processor time (s) of this process, its threads and its ended children."""
    return sum(os.times()[:4])


_uncharged = _Uncharged()
_uncharged.exempt(SourceFileLoader, "exec_module")
_uncharged.exempt(ExtensionFileLoader, "create_module")
_uncharged.exempt(ExtensionFileLoader, "exec_module")
_uncharged.exempt(toolchain, "compile_library")


def _charged() -> float:
    return _used() - _uncharged.seconds


def _reference_loop() -> float:
    """Return the processor time (s) of a fixed piece of work."""
    begin = time.process_time()
    total = 0
    for k in range(300_000):
        total += k * k
    return time.process_time() - begin


def _slowness() -> float:
    """Return how much slower than the reference this machine is now, at least 1."""
    return max(1.0, statistics.median(_reference_loop() for _ in range(5)) / _REFERENCE)


class ProcessorTimeLimit:
    """Plugin of pytest: a test that is not slow fails if it takes more processor time.

    Parameters
    ----------
    limit : float
        s.
    """

    def __init__(self, limit: float = LIMIT) -> None:
        self._limit = limit
        self._begin = self._end = 0.0
        self._passed = True

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self) -> Generator[None, object, object]:
        """Begin to measure, before the fixtures."""
        self._begin = _charged()
        self._passed = True
        return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> Generator[None, object, object]:
        """Measure up to the end, but not of fixtures that end here because no more tests share
        them.
        """
        self._end = _charged()
        result = yield
        if nextitem is not None and nextitem.parent is item.parent:
            self._end = _charged()
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Judge a test that passed, once its fixtures are torn down."""
        report = yield
        self._passed &= not report.failed
        is_judged = self._passed and item.get_closest_marker("slow") is None
        taken = self._end - self._begin
        is_over = report.when == "teardown" and is_judged and taken > self._limit
        if is_over and taken > self._limit * _slowness():
            report.outcome = "failed"
            report.longrepr = (
                f"{item.nodeid} took {taken:.1f} s of processor time, fixtures included;"
                f" a fast test has {self._limit:g} s: make it quicker, or mark it slow"
            )
        return report
