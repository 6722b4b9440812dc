"""Check that signals are finite vectors over an increasing time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError
from fmus.kit.arrays import Array


def over_time(time: ArrayLike, **signals: ArrayLike) -> tuple[Array, ...]:
    """Return a time and signals over it as arrays, after checks.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    **signals : array_like, shape (n,)
        By their names in messages.

    Returns
    -------
    tuple of ndarray, shape (n,)
        The time, then the signals.

    Raises
    ------
    UserError
        If they are not vectors of one length, not finite, or time does not increase.
    """
    given = {"time": np.asarray(time, dtype=float)}
    for name, signal in signals.items():
        given[name] = np.asarray(signal, dtype=float)
    t = given["time"]
    for name, values in given.items():
        if values.ndim != 1 or values.shape != t.shape or values.size < 2:
            raise UserError(
                f"{name} has the shape {values.shape}: time and signals must be vectors of one"
                " length"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise UserError(
                f"{name}: sample {bad[0]} is {values[bad[0]]:g}, and must be a finite number"
            )
    late = np.flatnonzero(np.diff(t) <= 0.0)
    if late.size:
        raise UserError(f"time: must increase, and does not after sample {late[0]}")
    return tuple(given.values())
