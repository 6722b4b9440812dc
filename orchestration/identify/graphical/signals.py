"""What is read off a curve has to be one: signals over an increasing time, without gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmus.kit.errors import UserError

Array = NDArray[np.float64]


def over_time(time: ArrayLike, **signals: ArrayLike) -> tuple[Array, ...]:
    """Check a time and signals over it.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    **signals : array_like, shape (n,)
        By the names that messages have for them.

    Returns
    -------
    tuple of ndarray, shape (n,)
        The time, then the signals.

    Raises
    ------
    UserError
        If they are no vectors of one length, not finite, or time does not increase.
    """
    given = {"time": np.asarray(time, dtype=float)} | {
        n: np.asarray(s, dtype=float) for n, s in signals.items()
    }
    t = given["time"]
    for name, values in given.items():
        if values.ndim != 1 or values.shape != t.shape or values.size < 2:
            raise UserError(
                f"{name} has the shape {values.shape}: time and signals must be vectors of one length"
            )
        if (bad := np.flatnonzero(~np.isfinite(values))).size:
            raise UserError(
                f"{name}: sample {bad[0]} is {values[bad[0]]:g}, and must be a finite number"
            )
    if (late := np.flatnonzero(np.diff(t) <= 0.0)).size:
        raise UserError(f"time: must increase, and does not after sample {late[0]}")
    return tuple(given.values())
