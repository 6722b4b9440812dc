"""Ranges: the values of a parameter of a sweep, in a line.

Examples are ``R1=0.3..0.7:41``, ``C=1e-3..1e-1:7 log`` and ``k1=6.3 N/mm, 9 N/mm``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu import Model, Signal
from orchestration.fmu.signal import check_value, read_setting, split_assignment
from orchestration.reporting import option

MOST = 10_000_000  # values of one parameter
_RANGE = re.compile(r"(?P<low>.+?)\.\.(?P<high>[^:]+?)(:(?P<count>[^:]*?))?(?P<log>\s+log)?$")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)


@dataclass(frozen=True)
class Range:
    """The values of a parameter in a sweep.

    Attributes
    ----------
    name : str
        Parameter, or constant input.
    unit : str
        Unit in the model.
    values : ndarray, shape (n,)
        In that unit; only both ends if a design chooses the values.
    logarithmic : bool
        True if values have equal ratios instead of equal differences.
    counted : bool
        True if `values` has all values, not only the ends.
    """

    name: str
    unit: str
    values: Array
    logarithmic: bool = False
    counted: bool = True

    def between(self, share: Array) -> Array:
        """Return values (n,) at shares (n,) of the range, each from 0 to 1."""
        low, high = self.values
        if self.logarithmic:
            return np.asarray(low * (high / low) ** share)
        return np.asarray(low + (high - low) * share)


def read_range(text: str, model: Model) -> Range:
    """Read the range of a parameter.

    Parameters
    ----------
    text : str
        ``NAME=FROM..TO:COUNT``, including both ends; ``NAME=FROM..TO`` for a design that chooses
        the values; either with a final ``log`` for equal ratios; or ``NAME=VALUE, VALUE, ...``.
        Values may have units; a FROM without a unit has that of TO.
    model : Model

    Returns
    -------
    Range

    Raises
    ------
    UserError
        If the text is not of this form, the model has no such parameter, or a value is not allowed.
    """
    name, notation = split_assignment(text, model.settable) or ("", "")
    if not notation:
        raise UserError(f"{_option(text)}: write name=from..to:count or name=value, value, ...")
    signal = _swept_signal(name, model, text)
    match = _RANGE.match(notation)
    if match is None:
        numbers = [_read_value(word, signal, text) for word in notation.split(",")]
        return Range(name, signal.unit, np.array(numbers))
    low = _read_value(_with_unit_of(match["high"], match["low"]), signal, text)
    high = _read_value(match["high"], signal, text)
    is_logarithmic = bool(match["log"])
    if not low < high:
        raise UserError(
            f"{_option(text)}: a range goes up, but {low:g} to {high:g} {signal.unit} does not"
        )
    if is_logarithmic and low <= 0.0:
        raise UserError(
            f"{_option(text)}: equal ratios need positive ends, not {low:g} {signal.unit}"
        )
    if match["count"] is None and signal.type != "real":
        raise UserError(
            f"{_option(text)}: {name} is {signal.type}, of which no design can choose values"
            " between others: list them"
        )
    if match["count"] is None:
        ends = np.array((low, high))
        return Range(name, signal.unit, ends, is_logarithmic, counted=False)
    spaced = np.geomspace if is_logarithmic else np.linspace
    values = spaced(low, high, _read_count(match["count"].strip(), text))
    for value in values.tolist() if signal.type != "real" else ():
        check_value(signal, value, _option(text))
    return Range(name, signal.unit, values, is_logarithmic)


def given_range(name: str, values: Sequence[float] | Array, model: Model) -> Range:
    """Return the range of values that are numbers already.

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
    signal = _swept_signal(name, model, name)
    array = np.array(values, dtype=float)
    if array.ndim != 1 or not array.size:
        raise UserError(f"{name}: values of shape {array.shape}; a row of them is swept")
    if not np.isfinite(array).all():
        raise UserError(f"{name}: a value is not a number, or not finite")
    # if both extremes of reals are allowed, so are values between them
    for value in (array.min(), array.max()) if signal.type == "real" else array:
        check_value(signal, float(value), _option(f"{name}={value:g}"))
    return Range(name, signal.unit, array)


def _swept_signal(name: str, model: Model, text: str) -> Signal:
    """Return the real parameter or input of a name; raise if the model has none."""
    known = model.settable
    if name not in known:
        raise UserError(
            f"{model.name}: no parameter or input named {name!r}{suggestion(name, known)}"
        )
    if known[name].type == "string":
        raise UserError(f"{_option(text)}: {name} is a text; only numbers can be swept")
    return known[name]


def _option(text: str) -> str:
    """Return the option with a range, for messages."""
    name, equals, values = (part.strip() for part in text.partition("="))
    return option("over", {name: values} if equals else name)


def _read_count(word: str, text: str) -> int:
    """Return the number of values of a range; raise if it is not 2 to `MOST`."""
    if not word.isdigit() or not 2 <= int(word) <= MOST:
        raise UserError(
            f"{_option(text)}: {word or 'nothing'} is no number of values (allowed: 2 to {MOST:,})"
        )
    return int(word)


def _with_unit_of(other: str, amount: str) -> str:
    """Return a value with the unit of another one if it has none."""
    return f"{amount} {_unit_of(other)}" if not _unit_of(amount) else amount


def _unit_of(amount: str) -> str:
    number = _NUMBER.match(amount.strip())
    return amount.strip()[number.end() :].strip() if number else ""


def _read_value(word: str, signal: Signal, text: str) -> float:
    """Return a finite value in the unit of a signal."""
    value = read_setting(word.strip(), signal, _option(text))
    if isinstance(value, str) or not np.isfinite(value):
        raise UserError(f"{_option(text)}: {word.strip()!r} is not a number")
    return float(value)
