"""Heavy tails: whether innovations are of Student's t distribution rather than Gaussian, and with what freedom.

Samples far out are heavy tails only where they are scattered. Where they come together the level of the noise varies,
or the model is wrong there, and neither is a reason to look away.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.stats import norm, t

Array = NDArray[np.float64]
_FREEDOMS = (2.2, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 25.0)
_FEW = 50  # samples below which nothing is said of tails
_SUSPECT = 3.0  # standard errors of the kurtosis of Gaussian samples, below which there is nothing to look at
_NEIGHBOURS = 61  # samples that tell the level of the noise about one of them
_ROUNDS = 12  # of the scale and the weights that hang on it, by which it has settled to a percent


def heavy_tails(innovation: Array, freedom: float | None = None) -> tuple[float, float]:
    """Degrees of freedom of innovations, by maximum likelihood; infinite unless BIC asks for heavy tails.

    Parameters
    ----------
    innovation : ndarray, shape (n,)
    freedom : float, optional
        If it is known, so that only the scale is estimated.

    Returns
    -------
    freedom : float
    scale : float
        Of the t distribution, or the standard deviation where it is Gaussian.
    """
    size = float(np.sqrt(np.mean(innovation**2))) if innovation.size else 0.0
    if freedom is not None and freedom < inf and size > 0.0:
        return freedom, _scaled(innovation, freedom)[1]
    if freedom == inf or len(innovation) < _FEW or not size > 0.0 or not _suspect(innovation):
        return inf, size
    local = median_filter(np.abs(innovation), _NEIGHBOURS, mode="nearest")
    freedom = _freedom(innovation / np.maximum(local, 1e-3 * size))
    return (inf, size) if freedom == inf else (freedom, _scaled(innovation, freedom)[1])


def weights(innovation: Array, freedom: float) -> Array:
    """How much every innovation (m,) counts in a sum of squares with the slope of minus the log likelihood."""
    return (
        np.ones_like(innovation)
        if freedom == inf
        else np.asarray((freedom + 1.0) / (freedom + innovation**2))
    )


def rooted(innovation: Array, freedom: float) -> tuple[Array, Array]:
    """Return what has the deviance of innovations as its square, (m,), and its slope by them, (m,).

    Least squares of it are the likelihood's optimum, with no weights to iterate.
    """
    if freedom == inf:
        return innovation, np.ones_like(innovation)
    root = np.sign(innovation) * np.sqrt((freedom + 1.0) * np.log1p(innovation**2 / freedom))
    steepest = np.full_like(root, np.sqrt((freedom + 1.0) / freedom))  # at zero
    return root, np.divide(
        weights(innovation, freedom) * innovation, root, out=steepest, where=root != 0.0
    )


def curvature(innovation: Array, freedom: float) -> Array:
    """Second derivative of minus the logarithm of the density at every innovation, (m,).

    It is negative far out; where the level of the noise varies, it is smaller by far where it is high.
    """
    if freedom == inf:
        return np.ones_like(innovation)
    square = innovation**2
    return np.asarray((freedom + 1.0) * (freedom - square) / (freedom + square) ** 2)


def _suspect(innovation: Array) -> bool:
    """Whether the kurtosis is more than that of so many Gaussian samples."""
    power = np.mean(innovation**2)
    if not power**2 > 0.0:  # nothing is left of a record without noise
        return False
    kurtosis = np.mean(innovation**4) / power**2
    return bool(kurtosis > 3.0 + _SUSPECT * np.sqrt(24.0 / len(innovation)))


def _freedom(innovation: Array) -> float:
    """Degrees of freedom of innovations of one level."""
    if not _suspect(innovation):
        return inf
    n, size = len(innovation), float(np.sqrt(np.mean(innovation**2)))
    likelihoods = [_scaled(innovation, freedom) for freedom in _FREEDOMS]
    best = int(np.argmax([likelihood for likelihood, _ in likelihoods]))
    gaussian = float(norm.logpdf(innovation / size).sum()) - n * float(np.log(size))
    if 2.0 * (likelihoods[best][0] - gaussian) < 2.0 * np.log(n):
        return inf
    return _FREEDOMS[best]


def _scaled(innovation: Array, freedom: float) -> tuple[float, float]:
    """Return the highest likelihood at so much freedom, and the scale that gives it."""
    square = innovation**2
    scale = float(np.median(np.abs(innovation))) / float(norm.ppf(0.75)) or float(
        np.sqrt(square.mean())
    )
    for _ in range(_ROUNDS):
        scale = float(np.sqrt(np.mean(weights(innovation / scale, freedom) * square)))
    return float(t.logpdf(innovation / scale, freedom).sum()) - len(square) * float(
        np.log(scale)
    ), scale
