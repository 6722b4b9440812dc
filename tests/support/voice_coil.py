"""The bench of the thesis typed in again: numbers of appendix A1, and eq. 2.1 as printed."""

import numpy as np

# appendix A1, typed in again
R, L, K, M, B = 3.0, 1e-3, 3.9, 0.03, 6.0
K1, K2, B2 = 3860.0, 300.0, 2300.0
CORNER = 2 * np.pi * 100.0
T = 1.0 / 30.0
S = 2j * np.pi * np.logspace(-3, 3, 61)


def equation_2_1(s):
    """Coil force over voltage, as printed."""
    mechanical = (M * s**2 + K1 + B * s) * (B2 * s + K2) + B2 * K2 * s
    return K / (R + s * L + K**2 * s * (B2 * s + K2) / mechanical)
