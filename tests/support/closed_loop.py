"""The bench that keeps an actuator at a force, by the exponential of its matrix: no code of ours.

Equations 2.1, 2.2 and 3.5 of the thesis, linear between two samples of the controller.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

PERIOD = 1.0 / 30.0  # s, of the controller
EVERY = 20  # points of the record in a period
TIME = PERIOD / EVERY * np.arange(40 * EVERY + 1)


def references(seed: int = 3) -> np.ndarray:
    """Return a wanted force in N over `TIME`, which changes between two samples."""
    levels = np.random.default_rng(seed).uniform(0.8, 2.0, 11)
    return levels[(TIME / (4.0 * PERIOD) + 0.1).astype(int)]


def closed_loop(
    reference: np.ndarray,
    k1: float = 6300.0,
    b_vc: float = 6.0,
    b0: float = 0.66,
    b1: float = -0.06,
) -> tuple[np.ndarray, np.ndarray]:
    """Return position in m and tension in N (n,) over `TIME`."""
    K, R, L, m, k2, b2, dashpot = 3.9, 3.0, 1e-3, 0.03, 1e4, 2e6, 1.7e6
    cutoff = 2.0 * np.pi * 100.0
    tension = k1 * np.array([0.0, 1.0, 0.0, 0.0, -1.0, -1.0])
    A = np.zeros((7, 7))  # current, position, velocity, filtered force, creep of both, voltage
    A[0, [0, 2, 6]] = -R / L, -K / L, 1.0 / L
    A[1, 2] = 1.0
    A[2, :6] = -tension / m
    A[2, [0, 2]] += K / m, -b_vc / m
    A[3, :6] = cutoff * tension
    A[3, 3] -= cutoff
    A[4, :6] = tension / b2
    A[4, 4] -= k2 / b2
    A[5, :6] = tension / dashpot
    step = expm(A * PERIOD / EVERY)
    state = np.zeros(7)
    before = 0.0
    rows = []
    for n, wanted in enumerate(reference):
        if n % EVERY == 0:
            error = wanted - state[3]
            state[6] = np.clip(state[6] + b0 * error + b1 * before, 0.0, 10.0)
            before = error
        rows.append((state[1], tension @ state[:6]))
        state = step @ state
    position, force = np.array(rows).T
    return position, force
