"""Functions for laws, which accept floats, NumPy arrays and CasADi symbols.

A law computes with floats, arrays or symbols, depending on the attributes of its component. On
floats the results follow C (overflow gives infinity, ``log(0)`` gives ``-inf``), so that the Python
and the native build compute the same.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any

__all__ = [
    "absolute",
    "arccos",
    "arctan2",
    "clip",
    "cos",
    "exp",
    "floor",
    "hypot",
    "log",
    "logical_and",
    "logical_not",
    "logical_or",
    "maximum",
    "minimum",
    "outside",
    "sign",
    "sin",
    "slopes",
    "smooth_table",
    "sqrt",
    "table",
    "tanh",
    "where",
]

_SCALARS = (float, int, bool)
_IN_CASADI = {
    "absolute": "fabs",
    "logical_and": "logic_and",
    "logical_or": "logic_or",
    "logical_not": "logic_not",
    "where": "if_else",
}


def _library_function(name: str, value: Any) -> Any:
    """Return the function of NumPy for an array, or of CasADi for a symbol.

    The library is not imported here: a value of its types shows that it is loaded.
    """
    if type(value).__module__.startswith("casadi"):
        return getattr(sys.modules["casadi"], _IN_CASADI.get(name, name))
    return getattr(sys.modules["numpy"], name)


def _unary(name: str, scalar: Callable[[float], float], doc: str) -> Callable[[Any], Any]:
    """Make a function of a float, an array or a symbol from a function of floats.

    `name` is that of the function in NumPy and, but for `_IN_CASADI`, in CasADi.
    """

    def function(x: Any) -> Any:
        if not isinstance(x, _SCALARS):
            return _library_function(name, x)(x)
        try:
            return scalar(x)
        except OverflowError:
            return x if name == "floor" else math.inf
        except ValueError:  # outside the domain, where C returns a special value
            return -math.inf if name == "log" and x == 0 else math.nan

    function.__name__ = name
    function.__doc__ = doc
    return function


def _binary(
    name: str, scalar: Callable[[Any, Any], Any], doc: str, in_library: str = ""
) -> Callable[[Any, Any], Any]:
    """Make a function of two floats, arrays or symbols from a function of floats; see `_unary`."""

    def function(a: Any, b: Any) -> Any:
        if isinstance(a, _SCALARS) and isinstance(b, _SCALARS):
            return scalar(a, b)
        value = b if isinstance(a, _SCALARS) else a
        return _library_function(in_library or name, value)(a, b)

    function.__name__ = name
    function.__doc__ = doc
    return function


exp = _unary("exp", math.exp, "Return the exponential of x.")
log = _unary("log", math.log, "Return the natural logarithm of x.")
sqrt = _unary("sqrt", math.sqrt, "Return the square root of x.")
sin = _unary("sin", math.sin, "Return the sine of an angle in rad.")
cos = _unary("cos", math.cos, "Return the cosine of an angle in rad.")
arccos = _unary("arccos", math.acos, "Return the angle in rad, from 0 to pi, whose cosine is x.")
arctan2 = _binary(
    "arctan2",
    math.atan2,
    "Return the angle in rad, from -pi to pi, of the point with ordinate a and abscissa b.",
)
hypot = _binary("hypot", math.hypot, "Return the square root of a^2 + b^2 without overflow.")
tanh = _unary("tanh", math.tanh, "Return the hyperbolic tangent of x.")
absolute = _unary("absolute", math.fabs, "Return the magnitude of x.")
floor = _unary("floor", lambda x: float(math.floor(x)), "Return the largest integer not above x.")
sign = _unary(
    "sign",
    lambda x: float(x > 0) - float(x < 0) if x == x else math.nan,
    "Return the sign of x: -1, 0 or 1.",
)
logical_and = _binary(
    "logical_and", lambda a, b: bool(a and b), "Return ``a and b`` for conditions in laws."
)
logical_or = _binary(
    "logical_or", lambda a, b: bool(a or b), "Return ``a or b`` for conditions in laws."
)
logical_not = _unary("logical_not", lambda x: not x, "Return ``not x`` for conditions in laws.")
minimum = _binary(
    "minimum",
    lambda a, b: a if a < b or b != b else b,
    "Return the smaller of two values, element by element; like C's ``fmin`` it ignores a NaN.",
    in_library="fmin",
)
maximum = _binary(
    "maximum",
    lambda a, b: a if a > b or b != b else b,
    "Return the larger of two values, element by element; like C's ``fmax`` it ignores a NaN.",
    in_library="fmax",
)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """Return ``yes`` where a condition is true, else ``no``, element by element.

    Both are computed; each must be finite over the whole declared range.

    Parameters
    ----------
    condition : bool, ndarray or SX
    yes, no : float, ndarray or SX

    Returns
    -------
    float, ndarray or SX
    """
    if isinstance(condition, _SCALARS):
        return yes if condition else no
    return _library_function("where", condition)(condition, yes, no)


def clip(x: Any, low: Any, high: Any) -> Any:
    """Return ``x`` limited to ``[low, high]``, element by element."""
    return minimum(maximum(x, low), high)


def outside(x: Any, low: Any, high: Any) -> Any:
    """Return the excess of ``x`` over ``high``, or below ``low`` as a negative number, else 0.

    If both limits are equal, automatic differentiation gives the slope 1 everywhere. For
    ``x - clip(x, low, high)`` it would give 0.75 at the limits, because it gives half the slope to
    each of two equal values.
    """
    return maximum(x - high, 0.0) + minimum(x - low, 0.0)


def _check_table(xs: Sequence[Any], ys: Sequence[Any]) -> None:
    if not xs or len(xs) != len(ys):
        raise ValueError(f"a table of {len(xs)} abscissae and {len(ys)} values")


def table(x: Any, xs: Sequence[Any], ys: Sequence[Any]) -> Any:
    """Interpolate linearly in a table, with constant values beyond its ends, like ``numpy.interp``.

    The points of the table may be parameters; the sensitivities to them are exact. For NaN the
    result is the first value.

    Parameters
    ----------
    x : float, ndarray or SX
    xs : sequence
        Strictly increasing abscissae.
    ys : sequence
        Values at the abscissae.

    Returns
    -------
    float, ndarray or SX
        In the unit of the values.

    Raises
    ------
    ValueError
        If there are no points, or not as many values as abscissae.
    """
    _check_table(xs, ys)
    if hasattr(x, "looked_up"):  # a number of the unit check, without a value
        return x.looked_up(xs, ys)
    result = ys[0]
    for start, end, low, high in zip(xs, xs[1:], ys, ys[1:], strict=False):
        result = where(x > start, low + (high - low) / (end - start) * (x - start), result)
    return where(x >= xs[-1], ys[-1], result)


def smooth_table(x: Any, xs: Sequence[float], ys: Sequence[Any]) -> Any:
    """Interpolate in a table by cubics with a continuous slope, and linearly beyond its ends.

    The slope at a point is that of the parabola through it and its neighbours (Fritsch, Carlson,
    SIAM J. Numer. Anal. 17, 1980, the scheme that is linear in the values). Around a point at zero
    the curve is straight from the point before to the point after it, and its slope may jump at
    these three points, so that the table can represent a step at zero.

    Parameters
    ----------
    x : float, ndarray or SX
    xs : sequence of float
        Strictly increasing abscissae.
    ys : sequence
        Values at the abscissae.

    Returns
    -------
    float, ndarray or SX
        In the unit of the values.

    Raises
    ------
    ValueError
        If there are no points, or not as many values as abscissae.
    """
    _check_table(xs, ys)
    if hasattr(x, "looked_up"):
        return x.looked_up(xs, ys)
    if len(xs) == 1:
        return ys[0]
    ends = slopes(xs, ys)
    beyond = [*(x > start for start in xs[:-1]), x >= xs[-1]]
    # A sum of terms of which one is not zero: with nested choices instead, the derivative by a
    # value would go through all later choices.
    result = where(beyond[0], 0.0, ys[0] + ends[0][0] * (x - xs[0]))
    for k, (first_slope, last_slope) in enumerate(ends):
        width = xs[k + 1] - xs[k]
        distance = x - xs[k]
        chord = (ys[k + 1] - ys[k]) / width
        # coefficients of the square and the cube of the distance
        second = (3.0 * chord - 2.0 * first_slope - last_slope) / width
        third = (first_slope + last_slope - 2.0 * chord) / (width * width)
        cubic = ys[k] + distance * (first_slope + distance * (second + distance * third))
        inside = logical_and(beyond[k], logical_not(beyond[k + 1]))
        result = result + where(inside, cubic, 0.0)
    return result + where(beyond[-1], ys[-1] + ends[-1][1] * (x - xs[-1]), 0.0)


def slopes(xs: Sequence[float], ys: Sequence[Any]) -> list[tuple[Any, Any]]:
    """Return the slopes of :func:`smooth_table` at both ends of each interval.

    Parameters
    ----------
    xs : sequence of float, shape (k,)
    ys : sequence, shape (k,)

    Returns
    -------
    list of tuple, shape (k - 1, 2)
    """
    widths = [xs[k + 1] - xs[k] for k in range(len(xs) - 1)]
    chords = [(high - low) / width for low, high, width in zip(ys, ys[1:], widths, strict=False)]
    last = len(widths)
    # Points at which the slope is that of the chord: both ends, and a point at zero with its
    # neighbours, so that the intervals at both sides of it are straight lines.
    straight = {0, last}
    for k in range(1, last):
        if xs[k] == 0.0:
            straight |= {k - 1, k, k + 1}

    def slope(k: int, interval: int) -> Any:
        """Return the slope at point k of one of the two intervals that meet there."""
        if k in straight:
            return chords[interval]
        before = widths[k - 1]
        after = widths[k]
        return (after * chords[k - 1] + before * chords[k]) / (before + after)

    return [(slope(k, k), slope(k + 1, k)) for k in range(last)]
