"""Reductions of the trace of an output to numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from orchestration.reporting import option

REDUCTIONS: dict[str, Callable[[Array], Array]] = {
    "last": lambda y: y[:, -1],
    "smallest": lambda y: y.min(axis=1),
    "largest": lambda y: y.max(axis=1),
    "mean": lambda y: y.mean(axis=1),
    "rms": lambda y: np.sqrt(np.mean(y * y, axis=1)),
}
TRACE = "trace"  # keeps the whole trace
KEPT = ("last", "smallest", "largest")  # by default


def checked_reductions(names: Sequence[str]) -> list[str]:
    """Return names of reductions without repeats.

    Raises
    ------
    UserError
        If a name is not known, or there are no names.
    """
    known = [*REDUCTIONS, TRACE]
    for name in names:
        if name not in known:
            raise UserError(
                f"{option('keep', [name])}: no such reduction{suggestion(name, known, few=0)};"
                f" there are {', '.join(known)}"
            )
    if not names:
        raise UserError(f"{option('keep')} names nothing; there are {', '.join(known)}")
    return list(dict.fromkeys(names))


def reduce_traces(traces: Array, names: Sequence[str]) -> Array:
    """Return the reductions of traces to numbers.

    Parameters
    ----------
    traces : ndarray, shape (k, n, m)
        Traces of m outputs in k cases, at n points.
    names : sequence of str
        Names of r reductions; ``trace`` is ignored.

    Returns
    -------
    ndarray, shape (k, r, m)
    """
    cases, _, outputs = traces.shape
    numbers = [REDUCTIONS[name](traces) for name in names if name != TRACE]
    return np.stack(numbers, axis=1) if numbers else np.empty((cases, 0, outputs))
