"""Noise of known colour, and the signals of a bench that a residual may depend on."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.discrepancy.residuals.regressors import Regressor, make_regressors
from orchestration.experiment.waveforms import multilevel

N, STEP = 3000, 0.1
TIME = STEP * np.arange(N)
EVERY = np.ones(N, dtype=bool)
COLOURS = pytest.mark.parametrize("colour", [0.0, 0.9])


def noise(colour: float, seed: int, n: int = N) -> np.ndarray:
    """Innovations of unit size, coloured by one pole."""
    white = np.random.default_rng(seed).standard_normal(n + 300)
    return np.asarray(lfilter([1.0], [1.0, -colour], white))[300:]


def bench(seed: int) -> list[Regressor]:
    """Signals of a bench with a charge that follows a multilevel current and a creep that follows a
    force.
    """
    current = multilevel(TIME, [-1.0, -0.5, 0.2, 1.0], (1.0, 6.0), seed)
    force = multilevel(TIME, [0.4, 1.0, 2.0, 3.0], (8.0, 30.0), seed + 1)
    charge, creep = lfilter([0.1], [1.0, -0.98], current), lfilter([0.1], [1.0, -0.999], force)
    units = {"current": "A", "force": "N", "charge": "C", "creep": "m", "voltage": "V"}
    return make_regressors(
        TIME,
        {"current": current, "force": force},
        {"charge": charge, "creep": creep},
        {"voltage": current + charge},
        units,
    )
