"""Steps of inputs: just after them a residual shows most of what a model lacks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_STEP = 4.0  # times the median change from sample to sample, above which an input steps
_LEAST = 0.01  # of its range, below which a change is none


def input_steps(inputs: Mapping[str, Array], count: int) -> NDArray[np.bool_]:
    """Find where any input steps: by 1 % of its range, and far more than it usually changes.

    Parameters
    ----------
    inputs : Mapping of str to ndarray, shape (n,)
    count : int
        Samples, n; among those of no inputs there are no steps.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    moved = [_steps(u) for u in inputs.values() if np.ptp(u) > 0.0]
    return np.any(moved, axis=0) if moved else np.zeros(count, dtype=bool)


def _steps(values: Array) -> NDArray[np.bool_]:
    change = np.abs(np.diff(values, prepend=values[:1]))
    return np.asarray(
        change > max(_LEAST * float(np.ptp(values)), _STEP * float(np.median(change)))
    )
