"""Recursive estimation of three parameters, with matrices written out for floats and symbols alike.

A vector is a tuple of 3, a matrix a tuple of 9 by rows. The estimate belongs to ``y = phi . theta +
noise``; the instrument ``zeta`` is the regressor ``phi`` itself for least squares.
"""

from __future__ import annotations

from typing import Any

from ..kit import where

Vector = tuple[Any, Any, Any]
Matrix = tuple[Any, Any, Any, Any, Any, Any, Any, Any, Any]

# A denominator below this share of the forgetting factor comes from an instrument that opposes the
# regressor, and the update is skipped; with least squares it is at least the factor itself.
_LEAST_DENOMINATOR = 0.1


def dot(a: Vector, b: Vector) -> Any:
    """Return the inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def times(p: Matrix, x: Vector) -> Vector:
    """Return matrix times column, ``P x``."""
    return dot(p[0:3], x), dot(p[3:6], x), dot(p[6:9], x)


def transposed_times(p: Matrix, x: Vector) -> Vector:
    """Return row times matrix, ``x' P``."""
    return dot((p[0], p[3], p[6]), x), dot((p[1], p[4], p[7]), x), dot((p[2], p[5], p[8]), x)


def trace(p: Matrix) -> Any:
    """Return the sum of the diagonal."""
    return p[0] + p[4] + p[8]


def gain(p: Matrix, phi: Vector, zeta: Vector, forgetting: Any) -> Vector:
    """Return the gain ``P zeta / (alpha + phi' P zeta)``, zero where the denominator is NaN or not
    clearly positive.

    Eq. 4.7, corrected by ``phi`` and the forgetting factor ``alpha`` (errata 6).
    """
    numerator = times(p, zeta)
    denominator = forgetting + dot(phi, numerator)
    usable = denominator > _LEAST_DENOMINATOR * forgetting
    divisor = where(usable, denominator, 1.0)
    x, y, z = (where(usable, element / divisor, 0.0) for element in numerator)
    return x, y, z


def update(theta: Vector, gain: Vector, residual: Any) -> Vector:
    """Return the estimate after a sample, ``theta + K (y - phi' theta)`` (eq. 4.7)."""
    b0, b1, a = theta
    return b0 + gain[0] * residual, b1 + gain[1] * residual, a + gain[2] * residual


def bound(trace: Any, largest: Any) -> Any:
    """Return the factor that scales a trace down to its largest value; 1 where it is below."""
    return where(trace > largest, largest / where(trace > largest, trace, 1.0), 1.0)
