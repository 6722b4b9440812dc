"""Exact solutions of the actuator for held inputs, by matrix exponential, without our code."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm

# Defaults of both components, typed in again from the table and the figure of the source.
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6
OUTPUTS = {
    "ppy_actuator": (
        "voltage",
        "electrochemical_displacement",
        "mechanical_displacement",
        "displacement",
    ),
    "ppy_actuator_length_driven": (
        "voltage",
        "electrochemical_displacement",
        "tension",
        "mechanical_displacement",
    ),
}
# What is typical of each output, for relative comparisons
SCALE = {
    "ppy_actuator": np.array([1.0, 1e-4, 1e-4, 1e-4]),
    "ppy_actuator_length_driven": np.array([1.0, 1e-4, 1.0, 1e-4]),
}


def matrices(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the state-space matrices from current and load to ``OUTPUTS``.

    The states are charge, Kelvin and Maxwell elongation.
    """
    share = R2 / (R1 + R2)
    a = np.diag([-1.0 / ((R1 + R2) * C), -K2 / B2, 0.0])
    b = np.array([[share, 0.0], [0.0, 1.0 / B2], [0.0, 1.0 / B1]])
    voltage, film = [1.0 / C - R1 / ((R1 + R2) * C), 0.0, 0.0], [ALPHA, 0.0, 0.0]
    if name == "ppy_actuator":
        c = np.array([voltage, film, [0.0, 1.0, 1.0], [ALPHA, 1.0, 1.0]])
        d = np.array([[R1 * share, 0.0], [0.0, 0.0], [0.0, 1.0 / K1], [0.0, 1.0 / K1]])
        return a, b, c, d
    # Taut: the spring K1 carries what remains of the imposed length.
    force, direct = K1 * np.array([-ALPHA, -1.0, -1.0]), K1
    a = a + np.outer([0.0, 1.0 / B2, 1.0 / B1], force)
    b[1:, 1] *= direct
    c = np.array([voltage, film, force, [-ALPHA, 0.0, 0.0]])
    d = np.array([[R1 * share, 0.0], [0.0, 0.0], [0.0, direct], [0.0, 1.0]])
    return a, b, c, d


def solve(name: str, steps: Sequence[float], inputs: np.ndarray) -> np.ndarray:
    """Return the outputs at the end of every step with the inputs held over it, from rest.

    Parameters
    ----------
    name : str
        Component.
    steps : sequence of float
        n step sizes in seconds.
    inputs : ndarray, shape (n, 2)

    Returns
    -------
    ndarray, shape (n, 4)
    """
    a, b, c, d = matrices(name)
    state, rows = np.zeros(3), []
    for step, held in zip(steps, inputs, strict=True):
        grown = expm(np.block([[a, b], [np.zeros((2, 5))]]) * step) @ np.concatenate([state, held])
        state = grown[:3]
        rows.append(c @ state + d @ held)
    return np.array(rows)
