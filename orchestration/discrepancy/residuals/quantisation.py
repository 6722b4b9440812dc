"""What the steps of a converter may look like in a residual, when there is little noise to hide them."""

from __future__ import annotations

import numpy as np

_ENOUGH = 10.0  # squared steps of noise, of which nothing is left


def systematic_error(step: float, deviation: float) -> float:
    """Largest mean error that rounding can leave where a signal passes again and again.

    Noise of the deviation s before the converter leaves ``step / pi * exp(-2 (pi s / step)^2)`` of it and less (Widrow
    and Kollár: Quantization Noise, 2008, chapter 4); without any it is half a step. Both are bounded by half a step
    times that exponential, which from half a step of noise on is next to nothing.

    Parameters
    ----------
    step : float
        Of the converter; 0 if there is none.
    deviation : float
        Standard deviation of the innovations after the converter, in the same unit. Rounding is in it.

    Returns
    -------
    float
        In the same unit.
    """
    if not step > 0.0:
        return 0.0
    before = np.clip(np.square(deviation / step) - 1.0 / 12.0, 0.0, _ENOUGH)
    return 0.5 * step * float(np.exp(-2.0 * np.pi**2 * before))
