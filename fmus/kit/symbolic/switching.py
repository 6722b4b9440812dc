"""Event indicators: functions of order one that change their sign where laws switch.

Laws switch at comparisons, at the smaller and the larger of two values, at magnitudes and signs.
These places are read off the traced laws; which of them are the same, and how large each is, is
seen at random points.
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
# what rounding takes away on average
_ROUNDED = {ca.OP_FLOOR: 0.5, ca.OP_CEIL: -0.5}

_ALIKE = 1e-10  # of order one; hosts see no smaller difference, see `keep_off_zero` in exchange.c
_FAR = 1e6  # times what it changes by, an indicator may be
_POINTS = 32
_SEED = 36


@dataclass(frozen=True)
class _Term:
    """A value of the laws, of which switches are made.

    Attributes
    ----------
    value : casadi.SX
    moves : bool
        Whether it changes between events.
    inner : casadi.SX
        The value without bounds that do not move: ``x`` of ``clip(x, low, high)``.
    """

    value: ca.SX
    moves: bool
    inner: ca.SX


def event_indicators(
    laws: Sequence[ca.SX], arguments: Sequence[ca.SX], layout: Layout, moving: Collection[int]
) -> ca.SX:
    """Make functions that change their sign where laws switch from one expression to another.

    Places that depend on parameters and discrete states only are omitted, and so is rounding: a
    converter steps at every count of its signal, and no solver should stop there. Each function is
    multiplied by a power of two, so that with typical inputs and states it is about one.

    Parameters
    ----------
    laws : sequence of casadi.SX
    arguments : sequence of casadi.SX
        Time, parameters, inputs, states and discrete states, the symbols of the laws.
    layout : Layout
    moving : collection of int
        Which of the arguments change between events.

    Returns
    -------
    casadi.SX
        A column, one function for each place.
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
    """Return an expression for each operation of the laws that switches, zero where it does."""
    function = ca.Function("laws", list(arguments), ca.cse([ca.densify(law) for law in laws]))
    places: dict[frozenset[int], ca.SX] = {}

    def apply(operation: int, operands: list[_Term]) -> _Term:
        place = _place(operation, operands)
        if place is not None:
            # the magnitude of a value that is compared with zero switches at the same place
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
    """Return the expression that is zero where an operation switches; None if it never does."""
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
    # beyond bounds that stand still nothing happens at a level that does
    return first.inner - second.inner


def _result(operation: int, operands: Sequence[_Term]) -> _Term:
    """Return the value of an operation; of rounding what is rounded, less what that takes away."""
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
    """Return values of expressions, shape (n, 2, points): pairs differ in what moves alone."""
    draw = random.Random(_SEED)  # NumPy's generators may change from version to version
    groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)

    def drawn() -> list[npt.NDArray[np.float64]]:
        times = [draw.random() for _ in range(_POINTS)]
        values = [[_typical(v, draw) for v in group for _ in range(_POINTS)] for group in groups]
        return [np.reshape(column, (-1, _POINTS)) for column in (times, *values)]

    first = drawn()
    second = [
        new if i in moving else old for i, (old, new) in enumerate(zip(first, drawn(), strict=True))
    ]
    function = ca.Function("places", list(arguments), [ca.vertcat(*places)])
    return np.stack([function(*given).full() for given in (first, second)], axis=1)


def _typical(variable: Declaration, draw: random.Random) -> float:
    """Draw a value of a size that a variable has, within its range."""
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
    """Return a factor that makes values, shape (2, points), about one.

    Where they are far beyond what they change by, as at a limit that stands for none, the factor is
    larger: the limit may be set to another.
    """
    change = _median(values[1] - values[0])
    size = min(max(change, _median(values)), _FAR * change)
    return float(2.0 ** -round(math.log2(size))) if size else 1.0


def _median(values: npt.NDArray[np.float64]) -> float:
    """Return the median of the magnitudes of the finite numbers but zero; 0 without any."""
    sizes = np.abs(values[np.isfinite(values) & (values != 0.0)])
    return float(np.median(sizes)) if sizes.size else 0.0


def _alike(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> bool:
    """Return whether two indicators are the same everywhere but for the sign.

    One without a number at a point is like another without a number there, not like any.
    """
    tolerance = _ALIKE * np.maximum(1.0, np.abs(one))
    neither = np.isnan(one) & np.isnan(other)
    return bool(np.any(np.isfinite(one))) and any(
        bool(np.all((np.abs(one - sign * other) <= tolerance) | neither)) for sign in (1.0, -1.0)
    )
