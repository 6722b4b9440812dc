"""Where laws switch: a function of each place that changes its sign there, for the event indicators of FMI."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import casadi as ca

_COMPARED = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX}
_AT_ZERO = {ca.OP_FABS, ca.OP_SIGN}


def switches(laws: Sequence[ca.SX], arguments: Sequence[ca.SX], moving: Sequence[ca.SX]) -> ca.SX:
    """Functions that change their sign where laws switch from one expression to another.

    Comparisons, the smaller and the larger of two values, magnitudes and signs are such places. Those that nothing
    moves but parameters and discrete states are left out, and so is rounding: a converter steps at every count of what
    it measures, and no solver should stop there.

    Parameters
    ----------
    laws : sequence of casadi.SX
    arguments : sequence of casadi.SX
        All symbols of the laws.
    moving : sequence of casadi.SX
        Those of them that change between events.

    Returns
    -------
    casadi.SX
        A column, each place once.
    """
    function = ca.Function("laws", list(arguments), ca.cse([ca.densify(law) for law in laws]))
    work: list[Any] = [None] * function.sz_w()
    found: dict[frozenset[int], ca.SX] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_INPUT:
            argument, element = inputs
            work[outputs[0]] = arguments[argument].nz[element]
        elif operation == ca.OP_CONST:
            work[outputs[0]] = ca.SX(function.instruction_constant(k))
        elif operation != ca.OP_OUTPUT:
            operands = [work[i] for i in inputs]
            if (place := _place(operation, operands)) is not None:
                # the magnitude of what is compared with zero switches at the same place
                key = frozenset(
                    operand.element_hash() for operand in operands if not operand.is_zero()
                )
                found.setdefault(key, place)
            work[outputs[0]] = (ca.SX.unary if len(operands) == 1 else ca.SX.binary)(
                operation, *operands
            )
    moved = ca.vertcat(*moving)
    return ca.vertcat(
        ca.SX(0, 1), *(place for place in found.values() if ca.depends_on(place, moved))
    )


def _place(operation: int, operands: list[ca.SX]) -> ca.SX | None:
    if operation in _COMPARED and not any(
        each.is_constant() and math.isinf(float(each)) for each in operands
    ):
        return operands[0] - operands[1]
    if operation in _AT_ZERO:
        return operands[0]
    return None
