"""The record of a motor of first order, sampled exactly, by hand."""

from __future__ import annotations

import numpy as np

from tests.support.measured import Measured

STEP, COUNT, LAG = 0.1, 1500, 0.8


def wired(noise=0.02):
    """Return the record of a motor of 1.9 times the gain."""
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.uniform(-1.0, 1.0, COUNT // 15), 15)
    decay = np.exp(-STEP / LAG)
    speed = np.zeros(COUNT)
    for k in range(COUNT - 1):
        speed[k + 1] = decay * speed[k] + (1.0 - decay) * 3.0 * drive[k]
    shown = speed + noise * rng.normal(size=COUNT)
    return Measured(STEP * np.arange(COUNT), {"drive": drive}, {"shown": shown})
