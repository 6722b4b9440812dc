"""CasADi functions that are evaluated repeatedly without conversion of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array


class BufferedFunction:
    """A CasADi function whose arguments and result are the same arrays in every call.

    It must not be called by two threads at once.

    Parameters
    ----------
    function : casadi.Function
        Function with one dense result.
    arguments : sequence of ndarray
        Memory from which arguments are read, column by column.

    Attributes
    ----------
    result : ndarray, shape (n,)
        Memory that every call overwrites with the result, column by column.
    """

    def __init__(self, function: ca.Function, arguments: Sequence[Array]):
        self.result = np.zeros(function.numel_out(0))
        buffer: Any  # CasADi's stubs require a size in addition to the memoryview
        buffer, self._call = function.buffer()
        for i, argument in enumerate(arguments):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, self.result.data)
        self._references = function, buffer, arguments  # the call uses their memory

    def __call__(self) -> Array:
        """Evaluate the function and return its result."""
        self._call()
        return self.result
