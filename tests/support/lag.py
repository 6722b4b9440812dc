"""One lag in closed form, with an input that moves it; the FMU of it is in `hosts`."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

STEP, TAU = 0.1, 0.8
TIME = STEP * np.arange(2000)
U = 2.0 * np.sin(0.3 * TIME) + 1.5 * np.sin(0.91 * TIME + 1.0) + np.sin(2.3 * TIME + 2.0)


def lagged(u, tau=TAU):
    """x of ``tau dx/dt = u - x`` with u held, exactly."""
    p = np.exp(-STEP / tau)
    return lfilter([0.0, 1.0 - p], [1.0, -p], u)


def write_lag(path, x, u=U, time=TIME, seed=1):
    """Write a record of u and x, with a little noise of x."""
    noisy = x + np.random.default_rng(seed).normal(0.0, 0.02, len(x))
    columns = np.column_stack([time, u, noisy])
    np.savetxt(path, columns, delimiter=",", header="time,u,x", comments="")
    return path
