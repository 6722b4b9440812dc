"""Covariance of estimated parameters, and which of them the data do not determine."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit.arrays import Array, Mask
from orchestration.identify.noise import Autoregression

# eigenvalue of the scaled matrix, relative to the largest, below which it is zero but for rounding
_SINGULAR = 1e-10
# root of the information on a parameter, in its own unit, below which its variance, or a product of
# that, is beyond every number: nothing is known of it
_UNSEEN = 1e-75
# highest leverage that is granted: a sample that is fitted exactly says nothing of its noise
_LEVERAGE = 0.9
# share of a parameter in a singular direction, from which on it is not identifiable itself
_INVOLVED = 1e-3
_BLOCK = 65_536  # rows of a Jacobian of which a copy is made at once


@dataclass(frozen=True)
class Covariance:
    """Covariance of estimated parameters.

    Attributes
    ----------
    matrix : ndarray, shape (p, p)
        In the directions that the data determine; zero along the others.
    unidentifiable : ndarray of bool, shape (p,)
        Parameters that the data do not determine, or only together with others.
    """

    matrix: Array
    unidentifiable: Mask

    @property
    def standard_errors(self) -> Array:
        """Standard errors (p,); infinite where a parameter is unidentifiable."""
        return np.where(self.unidentifiable, np.inf, np.sqrt(np.diag(self.matrix)))

    def correlations(self, names: Sequence[str]) -> dict[tuple[str, str], float]:
        """Return the correlations of all pairs; zero where one of them is not determined.

        Parameters
        ----------
        names : sequence of str, length p
        """
        sizes = np.sqrt(np.diag(self.matrix))
        with np.errstate(divide="ignore", invalid="ignore"):
            matrix = np.nan_to_num(self.matrix / np.outer(sizes, sizes))
        correlations = {}
        for i, one in enumerate(names):
            for j, other in enumerate(names[:i]):
                correlations[other, one] = float(np.clip(matrix[i, j], -1.0, 1.0))
        return correlations


def parameter_covariance(information: Array) -> Covariance:
    """Invert a normal matrix (Ljung: System Identification, section 9.4).

    It is scaled to a unit diagonal first, so that units do not decide which directions are
    singular, and inverted in the others (Belsley, Kuh, Welsch: Regression Diagnostics,
    chapter 3).

    Parameters
    ----------
    information : ndarray, shape (p, p)
        Normal matrix of whitened derivatives.

    Returns
    -------
    Covariance
    """
    # an observed information may have a diagonal below zero where the data tell nothing, and one
    # that is not finite where a simulation runs away
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    unidentifiable = ~((scale > _UNSEEN) & np.isfinite(scale))
    matrix = np.zeros_like(information)
    seen = np.flatnonzero(~unidentifiable)
    if seen.size:
        block = np.ix_(seen, seen)
        size = np.outer(scale[seen], scale[seen])
        values, directions = np.linalg.eigh(information[block] / size)
        regular = values > _SINGULAR * values[-1]
        inverse = (directions[:, regular] / values[regular]) @ directions[:, regular].T
        matrix[block] = inverse / size
        unidentifiable[seen] = np.abs(directions[:, ~regular]).max(axis=1, initial=0.0) > _INVOLVED
    return Covariance(matrix, unidentifiable)


def weighted_square(jacobian: Array, weights: Array) -> Array:
    """Return J'WJ, by blocks of rows where there are many.

    Parameters
    ----------
    jacobian : ndarray, shape (m, p)
    weights : ndarray, shape (m,)
        The diagonal of W.

    Returns
    -------
    ndarray, shape (p, p)
    """
    count = jacobian.shape[1]
    square = np.zeros((count, count))
    with np.errstate(over="ignore", invalid="ignore"):
        for block in _blocks(len(jacobian)):
            square += (jacobian[block].T * weights[block]) @ jacobian[block]
    return square


def _blocks(rows: int) -> Iterator[slice]:
    """Return slices of rows in blocks, as a copy of all would take much memory of a long record."""
    return (slice(first, first + _BLOCK) for first in range(0, rows, _BLOCK))


def sandwich_covariance(
    bread: Covariance, jacobian: Iterable[Array], noise: Iterable[Autoregression]
) -> Covariance:
    """Return the covariance of parameters fitted as if residuals were white (Ljung, section 9.4).

    It is the covariance of the scores in coloured noise, multiplied by the inverse normal matrix
    from both sides.

    Parameters
    ----------
    bread : Covariance
        Inverse of the normal matrix that was fitted with.
    jacobian : iterable of ndarray, shape (m, p)
        Of the residual of every output, weighted as it was fitted.
    noise : iterable of Autoregression
        Of these residuals.

    Returns
    -------
    Covariance
    """
    matrix = np.zeros_like(bread.matrix)
    for model, slopes in zip(noise, jacobian, strict=True):
        half = model.backwards(slopes) @ bread.matrix
        matrix += half.T @ half
    return replace(bread, matrix=matrix)


def excess_variance(
    bread: Covariance, jacobian: Array, score: Array, curvature: ArrayLike = 1.0
) -> Array:
    """Return the ratio of the variance of parameters in heteroscedastic noise to that assumed.

    White's estimate, with every residual as it would be had its sample not been fitted (HC3 of
    MacKinnon and White, J. Econometrics 29, 1985). A ratio below 1 may come from few samples and is
    not taken.

    Parameters
    ----------
    bread : Covariance
        Inverse of the information.
    jacobian : ndarray, shape (m, p)
        Of every innovation.
    score : ndarray, shape (m,)
        Every innovation times its weight.
    curvature : float or ndarray, shape (m,)
        Second derivative of the loss by every innovation, which decides its leverage.

    Returns
    -------
    ndarray, shape (p,)
        Ratio of variances, at least 1.
    """
    curved = np.broadcast_to(curvature, len(jacobian))
    robust = np.zeros(jacobian.shape[1])
    for block in _blocks(len(jacobian)):
        slopes = jacobian[block]
        influence = slopes @ bread.matrix  # of each sample on the estimates, for a score of one
        leverage = np.clip(curved[block] * np.einsum("ij,ij->i", influence, slopes), 0.0, _LEVERAGE)
        influence *= (score[block] / (1.0 - leverage))[:, np.newaxis]
        robust += np.einsum("ij,ij->j", influence, influence)
    plain = np.diag(bread.matrix)
    ratio = np.divide(robust, plain, out=np.ones_like(plain), where=plain > 0.0)
    return np.maximum(ratio, 1.0)


def heteroscedastic(
    bread: Covariance, jacobian: Array, score: Array, curvature: ArrayLike = 1.0
) -> Covariance:
    """Return a covariance widened by :func:`excess_variance`."""
    wider = np.sqrt(excess_variance(bread, jacobian, score, curvature))
    return replace(bread, matrix=bread.matrix * np.outer(wider, wider))
