"""What is kept of an output's course: a few numbers, or all of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError, suggestion

Array = NDArray[np.float64]
REDUCTIONS: dict[str, Callable[[Array], Array]] = {
    "last": lambda y: y[:, -1],
    "smallest": lambda y: y.min(axis=1),
    "largest": lambda y: y.max(axis=1),
    "mean": lambda y: y.mean(axis=1),
    "rms": lambda y: np.sqrt(np.mean(y * y, axis=1)),
}
TRACE = "trace"  # all of it
KEPT = ("last", "smallest", "largest")  # unless something else is asked for


def checked(names: Sequence[str]) -> list[str]:
    """Names of what is kept.

    Raises
    ------
    UserError
        If one is not known, or there is none.
    """
    known = [*REDUCTIONS, TRACE]
    for name in names:
        if name not in known:
            raise UserError(
                f"--keep {name}: no such reduction{suggestion(name, known)}; there are {', '.join(known)}"
            )
    if not names:
        raise UserError(f"--keep names nothing; there are {', '.join(known)}")
    return list(dict.fromkeys(names))


def reduced(courses: Array, names: Sequence[str]) -> Array:
    """Reduce outputs (k, n, m) of cases over n points to numbers (k, r, m) by r reductions, traces left out."""
    cases, _, outputs = courses.shape
    kept = [REDUCTIONS[name](courses) for name in names if name != TRACE]
    return np.stack(kept, axis=1) if kept else np.empty((cases, 0, outputs))
