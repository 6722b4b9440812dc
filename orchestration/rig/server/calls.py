"""Calls of a backend, which may raise any exception, and checks of its declarations."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite, nan
from typing import Any, NoReturn, TypeVar

from fmus.kit import UserError
from orchestration.rig.backends import Backend
from orchestration.rig.safety import beyond
from orchestration.rig.server.shared_memory import LONGEST_DESCRIPTION, SIGNALS, Description
from orchestration.rig.signals import Limit, checked_attributes

_LONGEST = 200  # characters of somebody else's message
Result = TypeVar("Result")


class BackendError(Exception):
    """A failure of a backend, described in one line with the call."""


def call(name: str, function: Callable[..., Result], *arguments: Any) -> Result:
    """Call a function of a backend; any exception becomes a BackendError of one line.

    Parameters
    ----------
    name : str
        Name of the call, for the message.
    function : callable
    *arguments
        Arguments of the function.

    Returns
    -------
    object
        Result of the function.

    Raises
    ------
    BackendError
        In place of any exception that the function raises.
    """
    try:
        return function(*arguments)
    except UserError as error:
        raise BackendError(_short(str(error))) from error
    except (Exception, SystemExit) as error:  # a library may even want to end the program
        raise BackendError(f"{name} raised {type(error).__name__}: {_short(str(error))}") from error


def leave(status: int) -> NoReturn:
    """End this process at once, even if threads of a driver are still running.

    Parameters
    ----------
    status : int
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):  # a closed one, or none at all
            stream.flush()
    os._exit(status)


def _short(text: str) -> str:
    """Return a text in one line of bounded length."""
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else line[:_LONGEST] + "..."


@dataclass(frozen=True)
class BackendSignals:
    """The signals of a backend, as it describes them.

    Attributes
    ----------
    inputs, outputs : dict of str to str
        Units.
    limits : dict of str to Limit
    notes : list of str
        Further remarks for the user who started the server.
    safe_values : tuple of float
        Value of each input in the safe state.
    unreported : list of str
        Inputs of which the device does not report its value.
    attributes : dict of str to dict
        Numbers and texts by signal and name.
    """

    inputs: dict[str, str]
    outputs: dict[str, str]
    limits: dict[str, Limit]
    notes: list[str] = field(default_factory=list)
    safe_values: tuple[float, ...] = ()
    unreported: list[str] = field(default_factory=list)
    attributes: dict[str, dict[str, float | str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.safe_values:
            object.__setattr__(self, "safe_values", (0.0,) * len(self.inputs))

    @classmethod
    def from_backend(cls, backend: Backend) -> BackendSignals:
        """Read the description of a backend, and check it.

        Parameters
        ----------
        backend : Backend

        Returns
        -------
        BackendSignals

        Raises
        ------
        BackendError
            If it breaks a promise of :class:`~orchestration.rig.backends.backend.Backend`.
        """
        inputs, outputs, limits, safe, attributes = call(
            "the backend's description",
            lambda: (
                dict(backend.inputs),
                dict(backend.outputs),
                dict(backend.limits),
                {name: float(value) for name, value in backend.safe_values.items()},
                checked_attributes(backend.attributes),
            ),
        )
        for kind, units in (("inputs", inputs), ("outputs", outputs)):
            if not all(isinstance(text, str) for pair in units.items() for text in pair):
                raise BackendError(f"{kind} of the backend must be names and units, both texts")
            if len(units) > SIGNALS:
                raise BackendError(f"the backend has {len(units)} {kind}; {SIGNALS} can be served")
        both = sorted(inputs.keys() & outputs.keys())
        if both:
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
        plain = {name: Limit(**_bounds(one)) for name, one in limits.items()}
        safe_values = tuple(safe.pop(name, 0.0) for name in inputs)
        fault = beyond(inputs, plain, safe_values)
        if safe:
            fault = f"{', '.join(map(repr, safe))} is not commanded"
        if fault:
            raise BackendError(f"safe values of the backend: {fault}")
        return cls(inputs, outputs, plain, safe_values=safe_values, attributes=attributes)

    def check_real(self) -> None:
        """Refuse an input without limits, as one of a real device.

        Raises
        ------
        BackendError
        """
        for name in self.inputs:
            limit = self.limits.get(name, Limit())
            if not isfinite(limit.max - limit.min):
                raise BackendError(
                    f"{name} is commanded and has no limits: `limits` of the backend must have a"
                    " minimum and a maximum of it, as it moves a real device"
                )

    def same_as(self, first: BackendSignals) -> BackendSignals:
        """Return the signals of the first opening, which hold as long as the server runs.

        Raises
        ------
        BackendError
            If these have other names or units.
        """
        if (self.inputs, self.outputs) != (first.inputs, first.outputs):
            raise BackendError(
                f"the backend has other signals than at the start of the server:"
                f" {self.inputs | self.outputs}, not {first.inputs | first.outputs}; start the"
                " server anew"
            )
        return first

    def to_record(self) -> Description:
        """Return the description as a record for the shared memory.

        Returns
        -------
        Description

        Raises
        ------
        BackendError
            If it is longer than the shared memory has room for.
        """
        limits = {name: vars(limit) for name, limit in self.limits.items()}
        given = [self.inputs, self.outputs, limits, self.notes, self.safe_values, self.unreported]
        text = json.dumps([*given, self.attributes]).encode()
        if len(text) > LONGEST_DESCRIPTION:
            raise BackendError(
                "names, units and attributes of the backend's signals are longer than"
                f" {LONGEST_DESCRIPTION} bytes"
            )
        return Description(text)

    @classmethod
    def from_record(cls, record: Description) -> BackendSignals:
        """Return the description that a record of the shared memory has."""
        inputs, outputs, bounds, notes, safe, *others = json.loads(record.text.rstrip(b"\0"))
        limits = {name: Limit(**one) for name, one in bounds.items()}
        return cls(inputs, outputs, limits, notes, tuple(safe), *others)


def _bounds(limit: Limit) -> dict[str, float]:
    """Return the attributes of a limit, of which a class of somebody else may lack the latest."""
    return {name: getattr(limit, name, bound) for name, bound in vars(Limit()).items()}


def _are_limits(limit: Limit) -> bool:
    """Return whether the attributes of a limit are numbers, none of them NaN, in their order."""
    bounds = _bounds(limit)
    try:  # false with a NaN
        return (
            limit.min <= limit.max and limit.rate >= 0 and bounds["warn_min"] <= bounds["warn_max"]
        )
    except TypeError:  # None, say, where infinity stands for no limit
        return False


def measure(backend: Backend, signals: BackendSignals) -> dict[str, float]:
    """Read every output of a backend.

    Parameters
    ----------
    backend : Backend
    signals : BackendSignals

    Returns
    -------
    dict of str to float
        Values by output, in the order of `signals`; NaN for one without a value.

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


def read_back(backend: Backend, signals: BackendSignals) -> list[float]:
    """Return the values of the inputs that a backend reports.

    Parameters
    ----------
    backend : Backend
    signals : BackendSignals

    Returns
    -------
    list of float
        Values in the order of the inputs; NaN for one that is not reported.

    Raises
    ------
    BackendError
        If it raises, or reports something that is no number.
    """
    values = call("read_back()", backend.read_back)
    try:
        return [float(values.get(name, nan)) for name in signals.inputs]
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise BackendError(f"read_back() did not return numbers by input: {error}") from error
