"""Values of a parameter in one line: ``R1=0.3..0.7:41``, ``C=1e-3..1e-1:7 log``, ``k1=6.3 N/mm, 9 N/mm``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Signal, read_setting

Array = NDArray[np.float64]
MOST = 10_000_000  # values of one parameter
_RANGE = re.compile(r"(?P<low>.+?)\.\.(?P<high>[^:]+?)(:(?P<count>[^:]*?))?(?P<log>\s+log)?$")


@dataclass(frozen=True)
class Range:
    """What a parameter goes through.

    Attributes
    ----------
    name : str
        Parameter, or an input that is held.
    unit : str
        Of the model.
    values : ndarray, shape (n,)
        In that unit; both ends of a range whose values a design chooses.
    logarithmic : bool
        Whether it is divided by ratios.
    counted : bool
        Whether the values are given, and not only the ends.
    """

    name: str
    unit: str
    values: Array
    logarithmic: bool = False
    counted: bool = True

    def between(self, share: Array) -> Array:
        """Values (n,) at shares of the range, each from 0 to 1."""
        low, high = self.values
        if self.logarithmic:
            return np.asarray(low * (high / low) ** share)
        return np.asarray(low + (high - low) * share)


def read_range(text: str, model: Model) -> Range:
    """Read what one parameter goes through.

    Parameters
    ----------
    text : str
        ``NAME=FROM..TO:COUNT``, both ends among the values; ``NAME=FROM..TO`` for a design that chooses them; either
        with ``log`` behind it for equal ratios; or ``NAME=VALUE, VALUE, ...``. Values may have units.
    model : Model

    Raises
    ------
    UserError
        If it is no such line, the model has no such parameter, or a value is not allowed.
    """
    name, equals, given = (part.strip() for part in text.partition("="))
    if not equals or not given:
        raise UserError(f"--over {text!r}: write name=from..to:count or name=value, value, ...")
    signal = _signal(name, model, text)
    found = _RANGE.match(given)
    if found is None:
        values = [_value(one, signal, text) for one in given.split(",")]
        return Range(name, signal.unit, np.array(values))
    low, high = (_value(found[end], signal, text) for end in ("low", "high"))
    return _divided(name, signal, (low, high), found["count"], bool(found["log"]), text)


def given_range(name: str, values: Sequence[float] | Array, model: Model) -> Range:
    """Take values as they are, which costs nothing for a million of them.

    Parameters
    ----------
    name : str
    values : sequence of float, shape (n,)
        In the unit of the model.
    model : Model

    Raises
    ------
    UserError
        If the model has no such parameter, or a value is not allowed.
    """
    signal, array = _signal(name, model, name), np.array(values, dtype=float)
    if array.ndim != 1 or not array.size:
        raise UserError(f"{name}: values of shape {array.shape}; a row of them is swept")
    if not np.isfinite(array).all():
        raise UserError(f"{name}: a value is not a number, or not finite")
    for extreme in (array.min(), array.max()):  # whatever lies between two that are allowed is
        _value(repr(float(extreme)), signal, f"{name}={extreme:g}")
    return Range(name, signal.unit, array)


def _signal(name: str, model: Model, text: str) -> Signal:
    known = {**model.parameters, **model.inputs}
    if name not in known:
        raise UserError(
            f"{model.name}: no parameter or input named {name!r}{suggestion(name, known)}"
        )
    if known[name].type != "real":
        raise UserError(
            f"--over {text!r}: {name} is of type {known[name].type}; real numbers can be swept"
        )
    return known[name]


def _divided(
    name: str, signal: Signal, ends: tuple[float, float], count: str | None, log: bool, text: str
) -> Range:
    low, high = ends
    if not low < high:
        raise UserError(
            f"--over {text!r}: a range goes up, which {low:g} to {high:g} {signal.unit} does not"
        )
    if log and low <= 0.0:
        raise UserError(
            f"--over {text!r}: equal ratios need positive ends, which {low:g} {signal.unit} is not"
        )
    if count is None:
        return Range(name, signal.unit, np.array(ends), log, counted=False)
    if not count.strip().isdigit() or not 2 <= int(count) <= MOST:
        raise UserError(
            f"--over {text!r}: {count.strip() or 'nothing'} is no count of values, which is 2 to {MOST:,}"
        )
    values = np.geomspace(low, high, int(count)) if log else np.linspace(low, high, int(count))
    return Range(name, signal.unit, values, log)


def _value(given: str, signal: Signal, text: str) -> float:
    value = read_setting(given.strip(), signal, f"--over {text}")
    if isinstance(value, str) or not np.isfinite(value):
        raise UserError(f"--over {text!r}: {given.strip()!r} is no number")
    return float(value)
