"""Options about a process of its own for FMUs that are not ours, and what they come to."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.cli.options import option, seconds

if TYPE_CHECKING:
    from orchestration.fmu.isolation.limits import Limits

_SIZES = {
    "": 1.0,
    "B": 1.0,
    "KB": 1e3,
    "MB": 1e6,
    "GB": 1e9,
    "KIB": 2.0**10,
    "MIB": 2.0**20,
    "GIB": 2.0**30,
}
_APART = 0.5  # s between two presses of Ctrl-C, of which the first was not heard
_LEAST = 256e6  # an interpreter with NumPy takes a third of it


def _size(text: str) -> float:
    """Read an amount of memory: bytes, or a number with MB or GB."""
    parts = re.fullmatch(r"\s*([0-9.]+(?:e[0-9]+)?)\s*([A-Za-z]*)\s*", text)
    unit = parts.group(2).upper() if parts else None
    try:
        size = float(parts.group(1)) * _SIZES[unit] if parts and unit in _SIZES else -1.0
    except ValueError:
        size = -1.0
    if not _LEAST <= size < 1e15:
        raise typer.BadParameter(
            f"{text!r}: an amount of memory such as 2GB or 800MB, at least {_LEAST / 1e6:g}MB"
        )
    return size


def _timeout(text: str) -> float:
    value = seconds(text)
    if not 0.0 < value < 1e9:
        raise typer.BadParameter(f"{text!r}: a time above 0, such as 10s or 2min")
    return value


Isolate = Annotated[
    bool | None,
    typer.Option(
        "--isolate/--no-isolate",
        help="Run the FMU in a process of its own, which may crash or hang; default for FMUs that are not ours.",
        show_default=False,
    ),
]
StepTimeout = Annotated[
    float | None,
    option(
        "--step-timeout",
        metavar="TIME",
        help="How long a call of an isolated FMU may take; default 60 s.",
        parser=_timeout,
    ),
]
MemoryLimit = Annotated[
    float | None,
    option(
        "--memory-limit",
        metavar="SIZE",
        help="Memory of an isolated FMU, such as 2GB; default the machine's.",
        parser=_size,
    ),
]


def limits(
    foreign: bool, isolate: bool | None, timeout: float | None, memory: float | None
) -> Limits | None:
    """Limits of a process of its own for a model; None where it runs in this one.

    Raises
    ------
    UserError
        If limits are given for what is not isolated.
    """
    found = told(foreign if isolate is None else isolate, timeout, memory)
    return found if (foreign if isolate is None else isolate) else None


def told(isolate: bool | None, timeout: float | None, memory: float | None) -> Limits:
    """Limits as they are told.

    Raises
    ------
    UserError
        If they are given for what is not isolated.
    """
    from fmus.kit.errors import UserError
    from orchestration.fmu.isolation.limits import STEP_TIMEOUT, Limits

    for name, given in (("--step-timeout", timeout), ("--memory-limit", memory)):
        if given is not None and isolate is False:
            raise UserError(f"{name} is for an FMU in a process of its own; give --isolate too")
    return Limits(STEP_TIMEOUT if timeout is None else timeout, memory)


def isolating(isolate: bool | None) -> AbstractContextManager[None]:
    """Have FMUs that are not ours in processes of their own, unless that is not wanted, while a command lasts."""
    from orchestration.fmu.isolation import limits as known

    return known.isolating(None if isolate is False else known.DEFAULT)


@contextmanager
def hearing_ctrl_c(isolated: Limits | None) -> Iterator[None]:
    """Have a second Ctrl-C end this process: where the first is not heard, in an FMU that hangs, nothing else does."""
    handler = signal.getsignal(signal.SIGINT)
    if isolated is not None or handler is not signal.default_int_handler:
        yield
        return
    told, tells = os.pipe()
    os.set_blocking(tells, False)
    before = signal.set_wakeup_fd(tells, warn_on_full_buffer=False)
    threading.Thread(target=_listen, args=(told,), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(tells)


def _listen(told: int) -> None:
    first = None
    while pressed := os.read(told, 1):
        if pressed[0] != signal.SIGINT:
            continue
        if first is not None and time.monotonic() - first > _APART:
            os.write(2, b"interrupted\n")
            os._exit(130)
        first = first or time.monotonic()
    os.close(told)
