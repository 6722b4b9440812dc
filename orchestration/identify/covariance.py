"""The inverse of a normal matrix: covariance of what was estimated, and what of it the data do not determine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orchestration.identify.noise.model import Noise

Array = NDArray[np.float64]
_SINGULAR = 1e-10  # eigenvalue of the scaled matrix, relative to the largest, below which it is zero but for rounding
_LEVERAGE = (
    0.9  # highest that is granted: a sample that is fitted exactly tells nothing of its noise
)
_INVOLVED = (
    1e-3  # share of a parameter in such a direction, from which on it is not identifiable itself
)


@dataclass(frozen=True)
class Covariance:
    """Covariance of estimated parameters.

    Attributes
    ----------
    matrix : ndarray, shape (p, p)
        In the directions that the data determine; zero along the others, in which nothing is to be learnt.
    unidentifiable : ndarray of bool, shape (p,)
        Parameters that the data do not determine, or only together with others.
    """

    matrix: Array
    unidentifiable: NDArray[np.bool_]

    @property
    def standard_errors(self) -> Array:
        """Standard errors (p,); infinite where a parameter is unidentifiable."""
        return np.where(self.unidentifiable, np.inf, np.sqrt(np.diag(self.matrix)))

    def correlations(self, names: Sequence[str]) -> dict[tuple[str, str], float]:
        """Correlations of pairs of parameters, of which there are names (p,); zero where one is not determined."""
        sizes = np.sqrt(np.diag(self.matrix))
        with np.errstate(divide="ignore", invalid="ignore"):
            matrix = np.nan_to_num(self.matrix / np.outer(sizes, sizes))
        pairs = ((i, j) for i in range(len(names)) for j in range(i))
        return {(names[j], names[i]): float(np.clip(matrix[i, j], -1.0, 1.0)) for i, j in pairs}


def covariance(information: Array, prior: ArrayLike = 0.0) -> Covariance:
    """Invert a normal matrix (Ljung: System Identification, section 9.4).

    It is scaled to a unit diagonal before, so that units do not decide what is singular, and inverted in the directions
    that it determines (Belsley, Kuh, Welsch: Regression Diagnostics, chapter 3).

    Parameters
    ----------
    information : ndarray, shape (p, p)
        Normal matrix of whitened derivatives.
    prior : float or ndarray, shape (p,)
        Precision of a Gaussian prior of every parameter, zero for none.

    Returns
    -------
    Covariance
    """
    known = information + np.diag(np.broadcast_to(prior, len(information)))
    scale = np.sqrt(np.diag(known))
    unidentifiable = scale <= 0.0
    matrix = np.zeros_like(known)
    if (seen := np.flatnonzero(~unidentifiable)).size:
        size = np.outer(scale[seen], scale[seen])
        values, directions = np.linalg.eigh(known[np.ix_(seen, seen)] / size)
        regular = values > _SINGULAR * values[-1]
        matrix[np.ix_(seen, seen)] = (
            (directions[:, regular] / values[regular]) @ directions[:, regular].T / size
        )
        unidentifiable[seen] = np.abs(directions[:, ~regular]).max(axis=1, initial=0.0) > _INVOLVED
    return Covariance(matrix, unidentifiable)


def sandwich(bread: Covariance, jacobian: Iterable[Array], noise: Iterable[Noise]) -> Covariance:
    """Covariance of parameters that were fitted as if their residuals were white (Ljung, section 9.4).

    Between two halves of the inverse normal matrix stands the covariance of the scores, in coloured noise.

    Parameters
    ----------
    bread : Covariance
        Inverse of the normal matrix that was fitted with.
    jacobian : iterable of ndarray, shape (m, p)
        Of the residual of every output, weighted as it was fitted.
    noise : iterable of Noise
        Of these residuals.

    Returns
    -------
    Covariance
    """
    scores = np.vstack([n.backwards(j) for n, j in zip(noise, jacobian, strict=True)])
    halves = scores @ bread.matrix
    return replace(bread, matrix=halves.T @ halves)


def excess_variance(
    bread: Covariance, jacobian: Array, score: Array, curvature: ArrayLike = 1.0
) -> Array:
    """How much more parameters scatter than a covariance says where the level of the noise varies with what they do.

    White's estimate, with every residual as it would be had its sample not been fitted (HC3 of MacKinnon and White,
    J. Econometrics 29, 1985). Few samples tell little of their spread, so that it is never taken to be less.

    Parameters
    ----------
    bread : Covariance
        Inverse of the information.
    jacobian : ndarray, shape (m, p)
        Of every innovation.
    score : ndarray, shape (m,)
        Every innovation times its weight.
    curvature : float or ndarray, shape (m,)
        Of what is minimised, by every innovation; with it a sample pulls the fit to itself.

    Returns
    -------
    ndarray, shape (p,)
        Ratio of variances, at least 1.
    """
    along = jacobian @ bread.matrix
    leverage = np.clip(curvature * (along * jacobian).sum(axis=1), 0.0, _LEVERAGE)
    robust = ((along * (score / (1.0 - leverage))[:, np.newaxis]) ** 2).sum(axis=0)
    plain = np.diag(bread.matrix)
    return np.asarray(
        np.maximum(np.divide(robust, plain, out=np.ones_like(plain), where=plain > 0.0), 1.0)
    )


def heteroscedastic(
    bread: Covariance, jacobian: Array, score: Array, curvature: ArrayLike = 1.0
) -> Covariance:
    """Widen a covariance by :func:`excess_variance`, which see."""
    wider = np.sqrt(excess_variance(bread, jacobian, score, curvature))
    return replace(bread, matrix=bread.matrix * np.outer(wider, wider))


def clustered(
    bread: Covariance, jacobian: Array, residual: Array, stretches: NDArray[np.intp]
) -> Covariance:
    """Covariance of parameters from how far single stretches of a record pull them (CR2 of Bell and McCaffrey).

    Whatever the residual is, coloured, of changing level, or what a model gets wrong, it counts as often as it is
    repeated independently, and no oftener: from stretch to stretch. Nothing is assumed of it but that stretches are
    longer than what it remembers (Survey Methodology 28, 2002; Cameron and Miller, J. Human Resources 50, 2015).

    Parameters
    ----------
    bread : Covariance
        Inverse of the normal matrix J'J that was fitted with.
    jacobian : ndarray, shape (m, p)
        Of the residual, weighted as it was fitted.
    residual : ndarray, shape (m,)
        Weighted alike.
    stretches : ndarray of int, shape (m,)
        Which stretch every sample is of.

    Returns
    -------
    Covariance
    """
    middle = np.zeros_like(bread.matrix)
    for stretch in np.unique(stretches):
        within = stretches == stretch
        slopes, errors = jacobian[within], residual[within]
        frame, triangle = np.linalg.qr(slopes)
        leverage, directions = np.linalg.eigh(triangle @ bread.matrix @ triangle.T)
        # what was fitted of a stretch is missing in its residual: (I - H)^(-1/2) brings it back
        more = 1.0 / np.sqrt(1.0 - np.clip(leverage, 0.0, _LEVERAGE)) - 1.0
        missing = directions @ (more * (directions.T @ (frame.T @ errors)))
        score = slopes.T @ errors + triangle.T @ missing
        middle += np.outer(score, score)
    return replace(bread, matrix=bread.matrix @ middle @ bread.matrix)
