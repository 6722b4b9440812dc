"""Types of NumPy arrays for annotations, and a limit on the threads of linear algebra."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Signals = Mapping[str, Array]
"""Values by name, over time or over samples: of shape (n,) each."""
Interval = tuple[float, float]
"""Both ends of an interval or a range, the lower one first."""
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def single_threaded(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Make a function compute its matrix products in one thread.

    Fits run in parallel and their matrices are narrow: several threads for one product would only
    wait for one another.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
        Takes the same arguments.
    """

    @wraps(function)
    def limited(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1):
            return function(*arguments, **named)

    return limited
