"""A naive search for the signal that the residual of a fitted model is a curve of.

It can name no law.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from fmus.kit.arrays import Array, Mask

KNOTS = 9
_STILL = 1e-9  # of its size, below which a signal does not move


def least_bic(
    residuals: Mapping[str, Array],
    signals: Mapping[str, Array],
    used: Mapping[str, Mask] | None = None,
) -> list[str]:
    """Return signals ordered by the BIC of their splines through the residuals of all outputs.

    Parameters
    ----------
    residuals : Mapping of str to ndarray, shape (n,)
        By output; NaN where nothing was measured.
    signals : Mapping of str to ndarray, shape (n,)
        Those that stand still are left out.
    used : Mapping of str to ndarray of bool, optional
        Samples of the outputs that count.
    """
    scores = {}
    for name, x in signals.items():
        if not np.isfinite(x).all() or np.ptp(x) <= _STILL * np.abs(x).max():
            continue
        columns = spline(x)
        bic = 0.0
        for output, e in residuals.items():
            kept = np.isfinite(e) & (used[output] if used else True)
            part = columns[kept]
            wanted = e[kept]
            left = wanted - part @ np.linalg.lstsq(part, wanted, rcond=None)[0]
            bic += left.size * float(np.log(np.mean(left**2) + 1e-300)) + columns.shape[1] * float(
                np.log(left.size)
            )
        scores[name] = bic
    return sorted(scores, key=lambda name: scores[name])


def spline(x: Array) -> Array:
    """Return natural cubic splines (n, k) over quantiles of a signal.

    There is one column for each value where the signal takes few.
    """
    several = np.unique(x)
    if len(several) <= 3:
        return np.asarray((x[:, None] == several).astype(float))
    knots = np.unique(np.quantile(x, np.linspace(0.0, 1.0, KNOTS)))
    if len(knots) < 3:
        knots = np.linspace(several[0], several[-1], 3)
    return np.asarray(CubicSpline(knots, np.eye(len(knots)), bc_type="natural")(x))
