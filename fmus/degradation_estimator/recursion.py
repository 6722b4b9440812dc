"""Recursive estimation of three parameters, with the matrices written out so that floats and
symbols serve alike.

A vector is a tuple of 3, a matrix a tuple of 9 by rows. The estimate belongs to ``y = phi . theta +
noise``; the instrument ``zeta`` is the regressor ``phi`` itself for least squares.
"""

from __future__ import annotations

from typing import Any

from ..kit import where

Vector = tuple[Any, Any, Any]
Matrix = tuple[Any, Any, Any, Any, Any, Any, Any, Any, Any]

# A denominator below this share of the forgetting factor comes from an instrument that opposes the
# regressor; least squares never has one below that factor. The update is left out then.
_LEAST_DENOMINATOR = 0.1


def dot(a: Vector, b: Vector) -> Any:
    """Inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def times(p: Matrix, x: Vector) -> Vector:
    """Matrix times column, ``P x``."""
    return dot(p[0:3], x), dot(p[3:6], x), dot(p[6:9], x)


def transposed_times(p: Matrix, x: Vector) -> Vector:
    """Row times matrix, ``x' P``."""
    return dot((p[0], p[3], p[6]), x), dot((p[1], p[4], p[7]), x), dot((p[2], p[5], p[8]), x)


def trace(p: Matrix) -> Any:
    """Sum of the diagonal."""
    return p[0] + p[4] + p[8]


def gain(p: Matrix, phi: Vector, zeta: Vector, forgetting: Any) -> Vector:
    """Gain ``P zeta / (alpha + phi' P zeta)``, zero where the denominator is not safely positive or
    not a number.

    Eq. 4.7 with the ``phi`` and the forgetting factor that it lacks (errata 6).
    """
    x, y, z = direction = times(p, zeta)
    denominator = forgetting + dot(phi, direction)
    usable = denominator > _LEAST_DENOMINATOR * forgetting
    below = where(usable, denominator, 1.0)
    return (
        where(usable, x / below, 0.0),
        where(usable, y / below, 0.0),
        where(usable, z / below, 0.0),
    )


def corrected(theta: Vector, by: Vector, residual: Any) -> Vector:
    """Estimate after a sample, ``theta + K (y - phi' theta)`` (eq. 4.7)."""
    return theta[0] + by[0] * residual, theta[1] + by[1] * residual, theta[2] + by[2] * residual


def bound(trace: Any, most: Any) -> Any:
    """Factor that brings a trace down to its largest value; 1 if it is below."""
    return where(trace > most, most / where(trace > most, trace, 1.0), 1.0)
