"""Where inputs step: what a model lacks is seen most just after, and what a residual does there is its answer to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_STEP = 4.0  # times the median change from sample to sample, above which an input steps
_LEAST = 0.01  # of its range, below which a change is none


def input_steps(inputs: Mapping[str, Array], count: int) -> NDArray[np.bool_]:
    """Where any input leaves its course: by a hundredth of its range, and far more than it usually goes in a sample.

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
