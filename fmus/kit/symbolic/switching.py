"""Event indicators: functions of order one that change their sign where laws switch.

Laws switch at comparisons, minima, maxima, magnitudes and signs, which are taken from the traced
laws. Values at random points show which indicators are equal and give their scales.
"""

from __future__ import annotations

import math
import random
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from fmus.kit.declare import Declaration, ParameterDeclaration
from fmus.kit.layout import Layout
from fmus.kit.symbolic.instructions import apply_to_symbols, carry_out

_COMPARED = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX}
_AT_ZERO = {ca.OP_FABS, ca.OP_SIGN}
_BOUNDS = {ca.OP_FMIN, ca.OP_FMAX}
# mean difference between a value and the rounded value
_ROUNDED = {ca.OP_FLOOR: 0.5, ca.OP_CEIL: -0.5}

# hosts see no smaller difference of indicators; see `keep_off_zero` in exchange.c
_NO_DIFFERENCE = 1e-10
_FAR = 1e6  # largest scale of an indicator relative to its changes
_POINTS = 32  # number of random points, and of changed ones, for each indicator
_SEED = 36  # any; the C code depends on the points through the scales


@dataclass(frozen=True)
class _Term:
    """An operand in the laws.

    Attributes
    ----------
    value : casadi.SX
    moves : bool
        Whether it changes between events.
    inner : casadi.SX
        The value without constant bounds: ``x`` for ``clip(x, low, high)``.
    """

    value: ca.SX
    moves: bool
    inner: ca.SX


def event_indicators(
    laws: Sequence[ca.SX], arguments: Sequence[ca.SX], layout: Layout, moving: Collection[int]
) -> ca.SX:
    """Return functions that change their sign where laws switch from one expression to another.

    Switches that depend only on parameters and discrete states are omitted. Rounding is omitted
    too: the output of a converter steps at every count of its signal, where no solver should stop.
    Each function is multiplied by a power of two, so that for typical inputs and states it is about
    one.

    Parameters
    ----------
    laws : sequence of casadi.SX
    arguments : sequence of casadi.SX
        Symbols of the laws: time, parameters, inputs, states and discrete states.
    layout : Layout
    moving : collection of int
        Indices of the arguments that change between events.

    Returns
    -------
    casadi.SX
        A column, one function for each switch.
    """
    expressions = _switching_expressions(laws, arguments, moving)
    if not expressions:
        return ca.SX(0, 1)
    indicators = []
    known: list[npt.NDArray[np.float64]] = []  # values of the indicators
    values_at_points = _at_random_points(expressions, arguments, layout, moving)
    for expression, values in zip(expressions, values_at_points, strict=True):
        scale = _scale(values)
        if not any(_are_same_but_for_sign(scale * values, others) for others in known):
            indicators.append(scale * expression)
            known.append(scale * values)
    return ca.vertcat(*indicators)


def _switching_expressions(
    laws: Sequence[ca.SX], arguments: Sequence[ca.SX], moving: Collection[int]
) -> list[ca.SX]:
    """Return an expression for each operation that switches, which is zero where it switches."""
    function = ca.Function("laws", list(arguments), ca.cse([ca.densify(law) for law in laws]))
    expressions: dict[frozenset[int], ca.SX] = {}

    def apply(operation: int, operands: list[_Term]) -> _Term:
        """Return the result of an operation, adding the expression where it switches."""
        expression = _switching_expression(operation, operands)
        if expression is not None:
            # a magnitude switches where a comparison of the same value with zero does
            key = frozenset(o.value.element_hash() for o in operands if not o.value.is_zero())
            expressions.setdefault(key, expression)
        return _apply(operation, operands)

    terms = [
        [_Term(symbol, k in moving, symbol) for symbol in ca.vertsplit(column)]
        for k, column in enumerate(arguments)
    ]
    carry_out(function, terms, _constant, apply)
    return list(expressions.values())


def _constant(value: float) -> _Term:
    number = ca.SX(value)
    return _Term(number, False, number)


def _switching_expression(operation: int, operands: Sequence[_Term]) -> ca.SX | None:
    """Return the expression that is zero where an operation switches; None if it never switches."""
    if not any(o.moves for o in operands):
        return None
    if operation in _AT_ZERO:
        return operands[0].inner
    has_infinity = any(o.value.is_constant() and math.isinf(float(o.value)) for o in operands)
    if operation not in _COMPARED or has_infinity:
        return None
    first, second = operands
    if first.moves and second.moves:
        return first.value - second.value
    # against a constant level, a value beyond its constant bounds does not switch
    return first.inner - second.inner


def _apply(operation: int, operands: Sequence[_Term]) -> _Term:
    """Return the result of an operation; for rounding, the operand less the mean difference."""
    moves = any(o.moves for o in operands)
    if moves and operation in _ROUNDED:
        rounded = operands[0].value - _ROUNDED[operation]
        return _Term(rounded, moves, rounded)
    value = apply_to_symbols(operation, [o.value for o in operands])
    free = [o for o in operands if o.moves]
    is_bound = operation in _BOUNDS and len(free) == 1
    return _Term(value, moves, free[0].inner if is_bound else value)


def _at_random_points(
    expressions: Sequence[ca.SX],
    arguments: Sequence[ca.SX],
    layout: Layout,
    moving: Collection[int],
) -> npt.NDArray[np.float64]:
    """Return the values of n expressions at random points, (n, 2, points).

    The second values are at points that differ from the first only in moving arguments.
    """
    draw = random.Random(_SEED)  # NumPy's generators may change from version to version

    def arguments_at_points() -> list[npt.NDArray[np.float64]]:
        times = [draw.random() for _ in range(_POINTS)]
        columns = [times]
        for group in layout.arguments:
            columns.append([_draw_typical(v, draw) for v in group for _ in range(_POINTS)])
        return [np.reshape(column, (-1, _POINTS)) for column in columns]

    first = arguments_at_points()
    second = arguments_at_points()
    for i, column in enumerate(first):
        if i not in moving:
            second[i] = column
    function = ca.Function("expressions", list(arguments), [ca.vertcat(*expressions)])
    return np.stack([function(*points).full() for points in (first, second)], axis=1)


def _draw_typical(variable: Declaration, draw: random.Random) -> float:
    """Draw a value of typical magnitude within the range of a variable."""
    share = draw.random()
    if variable.type == "boolean":
        return float(share < 0.5)
    start = float(getattr(variable, "start", 0.0))
    if isinstance(variable, ParameterDeclaration) and start:
        drawn = start * (0.5 + share)
    else:
        drawn = max(variable.nominal, abs(start)) * (2.0 * share - 1.0)
    # one below the minimum becomes as far above the minimum as it is from zero
    above = variable.min + abs(drawn) if drawn < variable.min else drawn
    value = min(above, variable.max)
    return float(round(value)) if variable.type == "integer" else value


def _scale(values: npt.NDArray[np.float64]) -> float:
    """Return the power of two that scales the values of an indicator, (2, points), to about one.

    It is larger if the values are far above their changes, as for a limit of 1e9 that means no
    limit, because a user may set another limit.
    """
    change = _median(values[1] - values[0])
    size = min(max(change, _median(values)), _FAR * change)
    return float(2.0 ** -round(math.log2(size))) if size else 1.0


def _median(values: npt.NDArray[np.float64]) -> float:
    """Return the median magnitude of the finite nonzero numbers; 0 if there are none."""
    sizes = np.abs(values[np.isfinite(values) & (values != 0.0)])
    return float(np.median(sizes)) if sizes.size else 0.0


def _are_same_but_for_sign(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> bool:
    """Return whether two indicators are equal at all points, except for the sign.

    A NaN is equal only to a NaN.
    """
    if not np.isfinite(one).any():
        return False
    tolerance = _NO_DIFFERENCE * np.maximum(1.0, np.abs(one))
    both_nan = np.isnan(one) & np.isnan(other)
    return any(
        bool(np.all((np.abs(one - sign * other) <= tolerance) | both_nan)) for sign in (1.0, -1.0)
    )
