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

_ALIKE = 1e-10  # hosts see no smaller difference of indicators; see `keep_off_zero` in exchange.c
_FAR = 1e6  # largest scale of an indicator relative to its changes
_POINTS = 32
_SEED = 36


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
    places = _places(laws, arguments, moving)
    if not places:
        return ca.SX(0, 1)
    values = _at_random_points(places, arguments, layout, moving)
    scaled = []
    rows: list[npt.NDArray[np.float64]] = []
    for place, row in zip(places, values, strict=True):
        scale = _power_of_two(row)
        if not any(_alike(scale * row, other) for other in rows):
            scaled.append(scale * place)
            rows.append(scale * row)
    return ca.vertcat(*scaled)


def _places(
    laws: Sequence[ca.SX], arguments: Sequence[ca.SX], moving: Collection[int]
) -> list[ca.SX]:
    """Return an expression for each operation that switches, which is zero where it switches."""
    function = ca.Function("laws", list(arguments), ca.cse([ca.densify(law) for law in laws]))
    places: dict[frozenset[int], ca.SX] = {}

    def apply(operation: int, operands: list[_Term]) -> _Term:
        place = _place(operation, operands)
        if place is not None:
            # a magnitude switches where a comparison of the same value with zero does
            key = frozenset(o.value.element_hash() for o in operands if not o.value.is_zero())
            places.setdefault(key, place)
        return _result(operation, operands)

    terms = [
        [_Term(symbol, k in moving, symbol) for symbol in ca.vertsplit(column)]
        for k, column in enumerate(arguments)
    ]
    carry_out(function, terms, _constant, apply)
    return list(places.values())


def _constant(value: float) -> _Term:
    number = ca.SX(value)
    return _Term(number, False, number)


def _place(operation: int, operands: Sequence[_Term]) -> ca.SX | None:
    """Return the expression that is zero where an operation switches; None if it never switches."""
    if not any(o.moves for o in operands):
        return None
    is_bounded = not any(o.value.is_constant() and math.isinf(float(o.value)) for o in operands)
    if operation in _AT_ZERO:
        return operands[0].inner
    if operation not in _COMPARED or not is_bounded:
        return None
    first, second = operands
    if first.moves and second.moves:
        return first.value - second.value
    # against a constant level, a value beyond its constant bounds does not switch
    return first.inner - second.inner


def _result(operation: int, operands: Sequence[_Term]) -> _Term:
    """Return the result of an operation; for rounding, the operand less the mean difference."""
    moves = any(o.moves for o in operands)
    if moves and operation in _ROUNDED:
        value = operands[0].value - _ROUNDED[operation]
        return _Term(value, moves, value)
    value = apply_to_symbols(operation, [o.value for o in operands])
    free = [o for o in operands if o.moves]
    is_bound = operation in _BOUNDS and len(free) == 1
    return _Term(value, moves, free[0].inner if is_bound else value)


def _at_random_points(
    places: Sequence[ca.SX],
    arguments: Sequence[ca.SX],
    layout: Layout,
    moving: Collection[int],
) -> npt.NDArray[np.float64]:
    """Return values of expressions, (n, 2, points); the two differ only in moving arguments."""
    draw = random.Random(_SEED)  # NumPy's generators may change from version to version
    groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)

    def arguments_at_points() -> list[npt.NDArray[np.float64]]:
        times = [draw.random() for _ in range(_POINTS)]
        values = [[_typical(v, draw) for v in group for _ in range(_POINTS)] for group in groups]
        return [np.reshape(column, (-1, _POINTS)) for column in (times, *values)]

    first = arguments_at_points()
    second = arguments_at_points()
    for i, column in enumerate(first):
        if i not in moving:
            second[i] = column
    function = ca.Function("places", list(arguments), [ca.vertcat(*places)])
    return np.stack([function(*points).full() for points in (first, second)], axis=1)


def _typical(variable: Declaration, draw: random.Random) -> float:
    """Draw a value of typical magnitude within the range of a variable."""
    share = draw.random()
    if variable.type == "boolean":
        return float(share < 0.5)
    start = float(getattr(variable, "start", 0.0))
    if isinstance(variable, ParameterDeclaration) and start:
        value = start * (0.5 + share)
    else:
        value = max(variable.nominal, abs(start)) * (2.0 * share - 1.0)
    if value < variable.min:
        value = min(variable.max, variable.min + abs(value))
    value = min(max(value, variable.min), variable.max)
    return float(round(value)) if variable.type == "integer" else value


def _power_of_two(values: npt.NDArray[np.float64]) -> float:
    """Return a power of two that scales values, shape (2, points), to about one.

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


def _alike(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> bool:
    """Return whether two indicators are equal at all points, except for the sign.

    A NaN is equal only to a NaN.
    """
    tolerance = _ALIKE * np.maximum(1.0, np.abs(one))
    neither = np.isnan(one) & np.isnan(other)
    return bool(np.any(np.isfinite(one))) and any(
        bool(np.all((np.abs(one - sign * other) <= tolerance) | neither)) for sign in (1.0, -1.0)
    )
