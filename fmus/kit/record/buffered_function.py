"""CasADi functions that are evaluated again and again without converting numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array


class BufferedFunction:
    """A CasADi function whose arguments and result are the same arrays in every call.

    Two threads must not use one at once.

    Parameters
    ----------
    function : casadi.Function
        With one result, which is not sparse.
    arguments : sequence of ndarray
        The memory from which arguments are read, column by column.

    Attributes
    ----------
    result : ndarray, shape (n,)
        Memory that every call overwrites with the result, column by column.
    """

    def __init__(self, function: ca.Function, arguments: Sequence[Array]):
        self.result = np.zeros(function.numel_out(0))
        buffer: Any  # CasADi's stubs want a size beside the memoryview, which has one
        buffer, self._call = function.buffer()
        for i, argument in enumerate(arguments):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, self.result.data)
        self._kept = function, buffer, arguments  # the call borrows their memory

    def __call__(self) -> Array:
        """Evaluate the function, and return its result."""
        self._call()
        return self.result
