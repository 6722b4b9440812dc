"""Table of the poles of a linear model, with frequency and damping."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.reporting import plain_table


def poles_table(A: Array, period: float = 0.0) -> Any:
    """Return a table of poles with their frequencies and, except of integrators, damping ratios.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        State matrix, in 1/s for a continuous model.
    period : float
        Sample period, s; 0 of a continuous model.

    Returns
    -------
    rich.table.Table
    """
    columns = ("pole", "frequency [Hz]", "damping")
    table = plain_table(None, *columns, right=columns)
    computed, errors = _poles(A)
    integrator = 1.0 if period else 0.0
    poles = np.where(np.abs(computed - integrator) <= errors, integrator, computed)
    with np.errstate(divide="ignore", invalid="ignore"):
        continuous = np.log(poles) / period if period else poles  # in the s-plane
    for pole, s in zip(poles, continuous, strict=True):
        omega = abs(s)
        imaginary = f"{pole.imag:+.6g}j" if pole.imag != 0.0 else ""
        damping = f"{-s.real / omega:.4g}" if 0.0 < omega < np.inf else ""
        table.add_row(f"{pole.real:.6g}{imaginary}", f"{omega / (2.0 * pi):.4g}", damping)
    return table


def _poles(A: Array) -> tuple[Array, Array]:
    """Return the poles and the rounding error of each.

    The error is the rounding of the matrix over the cosine between left and right eigenvector
    (Golub, Van Loan: Matrix Computations, 2013, section 7.2.2). For a double pole, where the cosine
    is zero, it is the square root of the rounding.
    """
    from scipy.linalg import eig

    eigen: Any = eig  # its stubs do not know left eigenvectors
    poles, left, right = eigen(A, left=True, right=True)
    eps = float(np.finfo(float).eps)
    cosines = np.abs(np.sum(left.conj() * right, axis=0))
    rounding = len(A) * eps * np.linalg.norm(A)
    return poles, np.asarray(rounding / np.maximum(cosines, np.sqrt(eps)))
