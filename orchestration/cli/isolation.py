"""Isolation of FMUs that are not ours in processes, by the options of a command."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestration.cli.options import IsolationOptions
    from orchestration.fmu.isolation import Limits

_BETWEEN = 0.5  # s between two presses of Ctrl-C, of which the first was not heard


def limits(foreign: bool, options: IsolationOptions) -> Limits | None:
    """Return the limits of the process for a model; None if the model runs in this process.

    Raises
    ------
    UserError
        If limits are given for a run that is not isolated.
    """
    isolate = foreign if options["isolate"] is None else options["isolate"]
    given = given_limits(isolate, options)
    return given if isolate else None


def given_limits(isolate: bool | None, options: IsolationOptions) -> Limits:
    """Return the limits in options, by default the usual ones.

    Raises
    ------
    UserError
        If limits are given for a run that is not isolated.
    """
    from fmus.kit import UserError
    from orchestration.fmu.isolation import STEP_TIMEOUT, Limits

    timeout = options["step_timeout"]
    memory = options["memory_limit"]
    for name, given in (("--step-timeout", timeout), ("--memory-limit", memory)):
        if given is not None and isolate is False:
            raise UserError(f"{name} is for an FMU in a process of its own; give --isolate too")
    return Limits(STEP_TIMEOUT if timeout is None else timeout, memory)


def isolating(isolate: bool | None) -> AbstractContextManager[None]:
    """Isolate foreign FMUs in processes of their own for a context, unless `isolate` is False."""
    from orchestration.fmu.isolation import limits as known

    return known.isolating(None if isolate is False else known.DEFAULT)


@contextmanager
def hearing_ctrl_c(isolated: Limits | None) -> Iterator[None]:
    """End this process at a second Ctrl-C while the context lasts, if the run is not isolated.

    Python handles Ctrl-C between its own instructions only, thus not while an FMU hangs. A thread
    therefore reads the signals.
    """
    handler = signal.getsignal(signal.SIGINT)
    if isolated is not None or handler is not signal.default_int_handler:
        yield
        return
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    before = signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    threading.Thread(target=_listen, args=(read_end,), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(write_end)


def _listen(read_end: int) -> None:
    """Read the numbers of signals from a pipe until it is closed; end with the second Ctrl-C."""
    first = None
    while True:
        number = os.read(read_end, 1)
        if not number:
            break
        if number[0] != signal.SIGINT:
            continue
        if first is not None and time.monotonic() - first > _BETWEEN:
            os.write(2, b"interrupted\n")
            os._exit(130)
        first = first or time.monotonic()
    os.close(read_end)
