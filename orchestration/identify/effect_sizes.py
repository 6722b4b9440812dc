"""Sizes of effects, in quantities that an engineer can compare with a rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import Effect, Size
from fmus.kit.arrays import Interval
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.units import Described, format_prefixed, write_prefixed
from orchestration.identify.metrics import finite_or_none
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting.html import format_ends

NOT_DETERMINED = "not determined"  # in place of an interval
_USUAL_DIGITS, _MOST_DIGITS = 4, 8
_FINENESS = 0.5  # of half an interval, to which its ends are rounded or finer

Writer = Callable[[float, int], str]  # of a value and its digits


class FittedSize(NamedTuple):
    """A size of an effect as it was fitted.

    Attributes
    ----------
    size : Size
    value : float
        In the unit of the size.
    interval : tuple of float, optional
        95 %, from the interval of the parameter by the function of the size; None for a size of
        several parameters.
    unit : str
        SI, or ``%``.
    text : str
        The phrase with value, unit and interval.
    """

    size: Size
    value: float
    interval: Interval | None
    unit: str
    text: str

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: None for an open end of ``ci95``."""
        ends = self.interval or (math.nan, math.nan)
        return {
            "phrase": self.size.phrase,
            "value": finite_or_none(self.value),
            "ci95": [finite_or_none(end) for end in ends],
            "unit": self.unit,
        }


def fitted_sizes(
    effect: type[Effect],
    estimates: Mapping[str, Estimate],
    declared: Mapping[str, ParameterDeclaration],
) -> list[FittedSize]:
    """Return the sizes of an effect of which a parameter was fitted.

    Parameters
    ----------
    effect : type[Effect]
    estimates : mapping of str to Estimate
        Of fitted parameters by name; others have their start value.
    declared : mapping of str to ParameterDeclaration
        Parameters of the effect, and perhaps others, by name.
    """
    fitted = [s for s in effect.sizes if any(name in estimates for name in s.parameters)]
    return [_fitted(size, estimates, declared) for size in fitted]


def _fitted(
    size: Size, estimates: Mapping[str, Estimate], declared: Mapping[str, ParameterDeclaration]
) -> FittedSize:
    first, *others = size.parameters
    values = [
        estimates[name].value if name in estimates else declared[name].start
        for name in size.parameters
    ]
    value = _through(size, *values)
    unit = size.unit or declared[first].unit
    write = _writer(size, declared[first], value)
    if others:
        return FittedSize(size, value, None, unit, size.phrase.format(write(value, 3)))
    interval = estimates[first].interval
    if np.isfinite(interval).any():
        ends = sorted(_through(size, max(end, declared[first].min)) for end in interval)
        interval = (ends[0], ends[1])
    text = size.phrase.format(with_interval(value, interval, write))
    return FittedSize(size, value, interval, unit, text)


def _writer(size: Size, declared: Described, like: float) -> Writer:
    """Return the function that writes numbers in the unit that suits the value `like`."""
    if size.unit:
        return lambda value, digits: write_prefixed(value, size.unit, digits, like)
    return lambda value, digits: format_prefixed(value, declared, digits, like)


def _through(size: Size, *values: float) -> float:
    """Return the quantity of a size, infinite where it has a pole."""
    with np.errstate(all="ignore"):
        return float(size.quantity(*map(np.float64, values)))


def with_interval(value: float, interval: Interval, write: Writer) -> str:
    """Return a value with its 95 % interval as text, with the significant digits only.

    An interval without length, as of a record without noise, is left out.

    Parameters
    ----------
    value : float
    interval : tuple of float
    write : callable
        Of a value and its digits.
    """
    low, high = interval
    half = 0.5 * (high - low)
    if not math.isfinite(half):
        return f"{write(value, 2)} ({_open(low, high, write)})"
    if not half > 0.0:
        return write(value, 3)
    digits = _significant(value, interval)
    ends = format_ends(write(low, digits), write(high, digits))
    return f"{write(value, digits)} (95 %: {ends})"


def interval_cells(value: float, interval: Interval, declared: Described) -> tuple[str, str]:
    """Return a value and its 95 % interval as two texts in one unit, with significant digits only.

    Parameters
    ----------
    value : float
        SI.
    interval : tuple of float
        Ends that are open are infinite.
    declared : Described
        Its unit.
    """
    digits = _significant(value, interval)
    ends = (format_prefixed(end, declared, digits, like=value) for end in interval)
    return format_prefixed(value, declared, digits), format_ends(*ends)


def _significant(value: float, interval: Interval) -> int:
    """Return the digits of a value and its interval, by which both ends differ from the value.

    An interval that is open, or has no length, tells no digits.
    """
    low, high = interval
    half = 0.5 * (high - low)
    if not (0.0 < half < math.inf):
        return _USUAL_DIGITS
    largest = max(abs(value), abs(low), abs(high))
    digits = 1 + math.floor(math.log10(largest)) - math.floor(math.log10(_FINENESS * half))
    return min(max(digits, 2), _MOST_DIGITS)


def _open(low: float, high: float, write: Writer) -> str:
    """Return an interval with an open end as text."""
    if math.isfinite(low):
        return f"95 %: above {write(low, 2)}"
    if math.isfinite(high):
        return f"95 %: below {write(high, 2)}"
    return NOT_DETERMINED
