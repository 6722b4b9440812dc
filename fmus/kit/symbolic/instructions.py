"""Execution of the instructions of a CasADi function on values of any type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import casadi as ca

_T = TypeVar("_T")


def carry_out(
    function: ca.Function,
    arguments: Sequence[Sequence[_T]],
    constant: Callable[[float], _T],
    apply: Callable[[int, list[_T]], _T],
) -> list[list[_T]]:
    """Execute the instructions of a function on values of any type.

    An instruction reads registers and writes one. A common subexpression of several results is one
    instruction, so that its value is one object.

    Parameters
    ----------
    function : casadi.Function
        Function of scalar expressions (SX).
    arguments : sequence of sequence
        Values of the elements of each argument.
    constant : callable
        Returns the value for a number.
    apply : callable
        Returns the value of an operation (``casadi.OP_...``) on the values of its operands.

    Returns
    -------
    list of list
        For each result of the function, the values of its nonzero elements in order.
    """
    registers: list[Any] = [None] * function.sz_w()
    results: list[list[Any]] = [[None] * function.nnz_out(i) for i in range(function.n_out())]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        inputs = function.instruction_input(k)
        outputs = function.instruction_output(k)
        if operation == ca.OP_INPUT:
            argument, element = inputs
            registers[outputs[0]] = arguments[argument][element]
        elif operation == ca.OP_CONST:
            registers[outputs[0]] = constant(function.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            result, element = outputs
            results[result][element] = registers[inputs[0]]
        else:
            registers[outputs[0]] = apply(operation, [registers[i] for i in inputs])
    return results


def apply_to_symbols(operation: int, operands: Sequence[ca.SX]) -> ca.SX:
    """Return the expression of an operation on expressions.

    Parameters
    ----------
    operation : int
        ``casadi.OP_...``.
    operands : sequence of casadi.SX
        One or two scalars.

    Returns
    -------
    casadi.SX
    """
    apply = ca.SX.unary if len(operands) == 1 else ca.SX.binary
    return apply(operation, *operands)


def column(values: Iterable[Any]) -> ca.SX:
    """Return numbers and expressions as a column, which may be empty."""
    return ca.vertcat(ca.SX(0, 1), *values)
