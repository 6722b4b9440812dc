"""Arithmetic for laws, on floats, NumPy arrays and CasADi symbols alike.

A law is written once; what it computes with is decided by what its component holds. On floats the results follow
C (overflow gives infinity, ``log(0)`` gives ``-inf``) so that the Python and the native build behave alike.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

_SCALARS = (float, int, bool)


def _library(value: Any) -> Any:
    """NumPy for arrays, CasADi for symbols; neither is imported before something of theirs comes along."""
    if type(value).__module__.startswith("casadi"):
        return sys.modules["casadi"]
    return sys.modules["numpy"]


def _unary(name: str, scalar: Callable[[float], float], doc: str) -> Callable[[Any], Any]:
    def function(x: Any) -> Any:
        if not isinstance(x, _SCALARS):
            return getattr(_library(x), name)(x)
        try:
            return scalar(x)
        except OverflowError:
            return x if name == "floor" else math.inf
        except ValueError:  # outside the domain, where C returns a special value
            return -math.inf if name == "log" and x == 0 else math.nan

    function.__name__ = name
    function.__doc__ = doc
    return function


exp = _unary("exp", math.exp, "Exponential.")
log = _unary("log", math.log, "Natural logarithm.")
sqrt = _unary("sqrt", math.sqrt, "Square root.")
sin = _unary("sin", math.sin, "Sine of an angle in rad.")
cos = _unary("cos", math.cos, "Cosine of an angle in rad.")
tanh = _unary("tanh", math.tanh, "Hyperbolic tangent.")
floor = _unary("floor", lambda x: float(math.floor(x)), "Largest integer not above x.")
sign = _unary("sign", lambda x: float((x > 0) - (x < 0)) if x == x else math.nan, "-1, 0 or 1.")


def where(condition: Any, yes: Any, no: Any) -> Any:
    """Choose ``yes`` where the condition holds, else ``no``.

    Both are computed; each must be finite-valued arithmetic over the whole declared range.
    """
    if isinstance(condition, _SCALARS):
        return yes if condition else no
    library = _library(condition)
    return library.if_else(condition, yes, no) if library.__name__ == "casadi" else library.where(condition, yes, no)


def minimum(a: Any, b: Any) -> Any:
    """Smaller of two values, element by element; like C's ``fmin`` it passes over a NaN."""
    if isinstance(a, _SCALARS) and isinstance(b, _SCALARS):
        return a if a < b or b != b else b
    return _library(b if isinstance(a, _SCALARS) else a).fmin(a, b)


def maximum(a: Any, b: Any) -> Any:
    """Larger of two values, element by element; like C's ``fmax`` it passes over a NaN."""
    if isinstance(a, _SCALARS) and isinstance(b, _SCALARS):
        return a if a > b or b != b else b
    return _library(b if isinstance(a, _SCALARS) else a).fmax(a, b)


def clip(x: Any, low: Any, high: Any) -> Any:
    """Limit ``x`` to ``[low, high]``."""
    return minimum(maximum(x, low), high)
