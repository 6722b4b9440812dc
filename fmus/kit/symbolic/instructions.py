"""Instructions of a CasADi function, carried out on values of any kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import casadi as ca

_T = TypeVar("_T")


def carry_out(
    function: ca.Function,
    arguments: Sequence[Sequence[_T]],
    constant: Callable[[float], _T],
    apply: Callable[[int, list[_T]], _T],
) -> list[list[_T]]:
    """Carry out the instructions of a function, which CasADi has as a list.

    An instruction reads registers and writes one. An expression that several results share is one
    instruction, so that what is made of it is one object.

    Parameters
    ----------
    function : casadi.Function
        Of scalar expressions (SX).
    arguments : sequence of sequence
        Values of the elements of each argument.
    constant : callable
        Makes a value of a number.
    apply : callable
        Makes a value of an operation (``casadi.OP_...``) and the values of its operands.

    Returns
    -------
    list of list
        For each result of the function, the values of its nonzero elements in their order.
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
    """Apply an operation to expressions.

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
