"""Calls of a backend, which may raise whatever it likes, and what it may say of itself."""

from __future__ import annotations

import faulthandler
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, NoReturn, TypeVar

from fmus.kit.errors import UserError
from orchestration.rig.backends.backend import Backend
from orchestration.rig.limit import Limit
from orchestration.rig.server.board import SIGNALS, Description

_LONGEST = 200  # characters of somebody else's message
Result = TypeVar("Result")


class BackendError(Exception):
    """A backend failed; the text says in which call and how, in one line."""


def call(name: str, function: Callable[..., Result], *arguments: Any) -> Result:
    """Call a backend.

    Parameters
    ----------
    name : str
        Of the call, for the message.
    function : callable
    *arguments
        For it.

    Returns
    -------
    object
        What it returns.

    Raises
    ------
    BackendError
        Whatever it raises.
    """
    try:
        return function(*arguments)
    except UserError as error:
        raise BackendError(_short(str(error))) from error
    except (Exception, SystemExit) as error:  # a library may even want to end the program
        raise BackendError(f"{name} raised {type(error).__name__}: {_short(str(error))}") from error


@contextmanager
def bounded(seconds: float) -> Iterator[None]:
    """End this process, with exit status 1, if what is in the context takes too long: whatever holds it in a driver.

    Parameters
    ----------
    seconds : float
    """
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        faulthandler.dump_traceback_later(
            seconds, exit=True, file=nowhere
        )  # a thread in C: it needs no lock of Python
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def leave(status: int) -> NoReturn:
    """End this process, even if a thread that a driver has started goes on.

    Parameters
    ----------
    status : int
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):  # a closed one, or none at all
            stream.flush()
    os._exit(status)


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else line[:_LONGEST] + "..."


@dataclass(frozen=True)
class Signals:
    """What a backend says of itself.

    Attributes
    ----------
    inputs, outputs : dict of str to str
        Units.
    limits : dict of str to Limit
    notes : list of str
        What else whoever started the server should know.
    """

    inputs: dict[str, str]
    outputs: dict[str, str]
    limits: dict[str, Limit]
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, backend: Backend) -> Signals:
        """Ask a backend, and check what it says.

        Parameters
        ----------
        backend : Backend

        Returns
        -------
        Signals

        Raises
        ------
        BackendError
            If it is not what :class:`~orchestration.rig.backends.backend.Backend` promises.
        """
        inputs, outputs, limits = call(
            "the backend's description",
            lambda: (dict(backend.inputs), dict(backend.outputs), dict(backend.limits)),
        )
        for what, units in (("inputs", inputs), ("outputs", outputs)):
            if not all(isinstance(text, str) for pair in units.items() for text in pair):
                raise BackendError(f"{what} of the backend must be names and units, both texts")
            if len(units) > SIGNALS:
                raise BackendError(f"the backend has {len(units)} {what}; {SIGNALS} can be served")
        if both := sorted(inputs.keys() & outputs.keys()):
            raise BackendError(
                f"the backend both commands and measures {', '.join(both)}; a signal is one of them"
            )
        for name, limit in limits.items():
            if name not in inputs and name not in outputs:
                raise BackendError(
                    f"the backend has limits of {name!r}, which it neither commands nor measures"
                )
            if not _are_limits(limit):
                raise BackendError(
                    f"limits of {name} are no limits: {limit.min} to {limit.max}, {limit.rate}/s"
                )
        return cls(
            inputs, outputs, {name: Limit(li.min, li.max, li.rate) for name, li in limits.items()}
        )

    def record(self) -> Description:
        """Write it for the board.

        Returns
        -------
        Description

        Raises
        ------
        BackendError
            If there is no room for it.
        """
        limits = {name: (limit.min, limit.max, limit.rate) for name, limit in self.limits.items()}
        text = json.dumps([self.inputs, self.outputs, limits, self.notes]).encode()
        if len(text) > 16384:
            raise BackendError(
                "names and units of the backend's signals are longer than 16384 bytes"
            )
        return Description(text)

    @classmethod
    def read(cls, record: Description) -> Signals:
        """Read it from the board."""
        inputs, outputs, limits, notes = json.loads(record.text.rstrip(b"\0"))
        return cls(
            inputs, outputs, {name: Limit(*bounds) for name, bounds in limits.items()}, notes
        )


def _are_limits(limit: Limit) -> bool:
    try:
        return limit.min <= limit.max and limit.rate >= 0  # false with a NaN
    except TypeError:  # None, say, where infinity stands for no limit
        return False


def reading(backend: Backend, signals: Signals) -> dict[str, float]:
    """Read a backend.

    Parameters
    ----------
    backend : Backend
    signals : Signals

    Returns
    -------
    dict of str to float
        By output, in the order of `signals`; NaN where there is none.

    Raises
    ------
    BackendError
        If it raises, or an output is missing or no number.
    """
    values: Mapping[str, float] = call("read()", backend.read)
    try:
        return {name: float(values[name]) for name in signals.outputs}
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BackendError(
            f"read() did not return numbers for {', '.join(signals.outputs)}: {error}"
        ) from error
