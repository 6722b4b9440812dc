"""Signals of a rig: their names, units and limits, and checks of values given for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

from fmus.kit import registry
from fmus.kit.errors import UserError, suggestion
from fmus.rig_proxy import protocol


@dataclass(frozen=True)
class Limit:
    """Hard limits of one signal, SI.

    Attributes
    ----------
    min, max : float
        Inclusive.
    rate : float
        Largest change per second.
    warn_min, warn_max : float
        Limits of warning of a measured value: beyond them there is an alarm, and the rig goes on.
    """

    min: float = -inf
    max: float = inf
    rate: float = inf
    warn_min: float = -inf
    warn_max: float = inf

    def finite(self) -> dict[str, float | None]:
        """Return the limits as messages have them: None for infinity, and no alarm that is none."""
        return {
            key: bound if isfinite(bound) else None
            for key, bound in vars(self).items()
            if isfinite(bound) or key in protocol.LIMIT_KEYS
        }


SIGNALS = registry.rigs()
"""Signals of the rigs that packages of components declare, by the name of the rig."""
UNITS: dict[str, str] = {}
"""SI unit of every signal of these rigs; of a name in several, that of the first."""
KNOWN_LIMITS: dict[str, Limit] = {}
"""Limits of commands, and of measured values: beyond them the rig goes to its safe state."""
for _rig in SIGNALS.values():
    UNITS = {**_rig.inputs, **_rig.outputs, **UNITS}
    KNOWN_LIMITS = {name: Limit(*limits) for name, limits in _rig.limits.items()} | KNOWN_LIMITS


def checked_attributes(given: Any) -> dict[str, dict[str, float | str]]:
    """Return what a backend or a server states about its signals, by signal and name.

    Raises
    ------
    UserError
        If it is anything but finite numbers and texts.
    """
    attributes: dict[str, dict[str, float | str]] = {}
    try:
        for signal, stated in given.items():
            attributes[signal] = {name: _attribute(value) for name, value in stated.items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise UserError(
            "attributes of signals must be finite numbers and texts, by signal and name"
        ) from error
    return attributes


def _attribute(value: Any) -> float | str:
    if isinstance(value, str):
        return value
    if not abs(value) < inf:
        raise ValueError
    return float(value)


def one_of(option: str, value: str, allowed: Mapping[str, object] | tuple[str, ...]) -> str:
    """Return the value of an option that is one of those allowed.

    Raises
    ------
    UserError
        If it is not.
    """
    if value not in allowed:
        raise UserError(f"option {option} = {value!r}{suggestion(value, list(allowed))}")
    return value


def integer(option: str, value: str) -> int:
    """Return the value of an option that is a whole number of at least 0.

    Raises
    ------
    UserError
        If it is not.
    """
    if not (value.isascii() and value.isdigit() and len(value) < 19):
        raise UserError(f"option {option} = {value!r}: must be a whole number of at least 0")
    return int(value)


def seconds(option: str, value: str, most: float) -> float:
    """Return the value of an option that is a duration above zero, s.

    Raises
    ------
    UserError
        If it is not.
    """
    try:
        duration = float(value)
    except ValueError:
        duration = 0.0
    if not 0 < duration <= most:
        raise UserError(
            f"option {option} = {value!r}: must be a number of seconds above 0, at most {most:g}"
        )
    return duration


def commands(values: Mapping[str, float], inputs: Mapping[str, str]) -> dict[str, float]:
    """Return the commanded value of every input.

    Raises
    ------
    UserError
        If one is missing, is not known, or is not a finite number.
    """
    for name in values:
        if name not in inputs:
            raise UserError(
                f"command {name!r}: not an input of this rig{suggestion(name, list(inputs))}"
            )
    for name in inputs:
        value = values.get(name)
        if value is None or not abs(value) < inf:
            given = "missing" if value is None else value
            raise UserError(f"command {name} = {given}: must be a finite number")
    return {name: float(values[name]) for name in inputs}


def checked_step(step: float, most: float) -> float:
    """Return a step of time that a rig can take, s.

    Raises
    ------
    UserError
        If it is negative, not finite or longer than `most`.
    """
    if not 0 <= step <= most:
        raise UserError(f"step = {step} s: must be from 0 to {most:g} s")
    return float(step)
