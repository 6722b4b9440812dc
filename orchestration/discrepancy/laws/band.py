"""Band of a curve as a whole: what noise leaves open at its knots, and what the knots leave open between them.

The band holds the whole curve in 19 records of 20, rather than each of its points (Krivobokova, Kneib, Claeskens,
JASA 105, 2010): its width is a multiple of the standard deviation that is drawn for all points at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.laws.evidence import Basis, Curve

Array = NDArray[np.float64]
_SURE, _LEAST = 0.95, 1.96  # share of curves, and deviations where all points go together
_DRAWS, _BETWEEN = (
    2000,
    4,
)  # curves that are drawn, and points that are looked at from one knot to the next


class Band:
    """A curve with its 95 % band, in the unit of the law.

    Parameters
    ----------
    basis : Basis
    curve : Curve
    """

    def __init__(self, basis: Basis, curve: Curve):
        self._basis, self._curve = basis, curve
        knots = basis.knots
        shares = np.arange(_BETWEEN) / _BETWEEN
        points = np.append((knots[:-1, None] + shares * np.diff(knots)[:, None]).ravel(), knots[-1])
        self._deviations = _deviations(self._covariance(points))

    def __call__(self, x: Array) -> tuple[Array, Array, Array]:
        """Curve, and the ends of its band, at values (v,) of the signal."""
        values = self._basis(x) @ self._curve.values
        spread = self._deviations * np.sqrt(np.clip(np.diag(self._covariance(x)), 0.0, None))
        return values, values - spread, values + spread

    def _covariance(self, x: Array) -> Array:
        columns = self._basis(x)
        return np.asarray(
            columns @ self._curve.covariance @ columns.T
            + self._curve.bending * self._basis.left_between(x)
        )


def _deviations(covariance: Array) -> float:
    """Standard deviations within which all points of 19 curves of 20 are."""
    variance, axes = np.linalg.eigh(covariance)
    size = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    open_ = size > 0.0
    if not open_.any():
        return _LEAST
    draws = np.random.default_rng(0).standard_normal((len(size), _DRAWS))
    curves = (axes * np.sqrt(np.clip(variance, 0.0, None))) @ draws
    furthest = np.abs(curves[open_] / size[open_, None]).max(axis=0)
    return float(max(np.quantile(furthest, _SURE), _LEAST))
