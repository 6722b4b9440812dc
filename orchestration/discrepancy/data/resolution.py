"""The steps in which a channel was recorded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAME = 1e-9  # of the range: what unit conversion may split one value into


def resolution_of(values: Array) -> float:
    """Least step between different values (n,), in their unit; NaN is a gap, and 0 is for a constant."""
    known = values[np.isfinite(values)]
    spread = float(np.ptp(known)) if known.size else 0.0
    steps = np.diff(np.unique(known))
    steps = steps[steps > SAME * spread]
    return float(steps.min()) if len(steps) else 0.0
