"""Reductions of an output's trace to the numbers that a sweep keeps of it."""

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
    """Return the names of what is kept, each once.

    Raises
    ------
    UserError
        If a name is not known, or there is none.
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
    """Reduce traces to numbers.

    Parameters
    ----------
    traces : ndarray, shape (k, n, m)
        Of k cases, over n points, of m outputs.
    names : sequence of str
        Reductions, r of them; ``trace`` is ignored.

    Returns
    -------
    ndarray, shape (k, r, m)
    """
    cases, _, outputs = traces.shape
    kept = [REDUCTIONS[name](traces) for name in names if name != TRACE]
    return np.stack(kept, axis=1) if kept else np.empty((cases, 0, outputs))
