"""Heavy tails: degrees of freedom of innovations that follow Student's t distribution.

Outlying samples are heavy tails only where they are scattered. Where they come together the level
of the noise varies, or the model is wrong there, and neither is a reason to give them less weight.
"""

from __future__ import annotations

from math import inf, log, pi

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import gammaln, ndtri, poch

from fmus.kit.arrays import Array
from orchestration.identify.metrics import rms

# degrees of freedom that are tried; below 2 there is no variance, and 25 are almost Gaussian
_FREEDOMS = np.array([2.2, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 25.0])
_QUARTILE = float(ndtri(0.75))  # of Gaussian samples of unit variance
_FEW = 50  # samples below which noise is taken as Gaussian
# standard errors of the kurtosis of Gaussian samples, below which tails are not tested
_SUSPECT = 3.0
# Gain in twice the log-likelihood that heavy tails need, in BIC's penalties of the one parameter
# that they add. More than one, for a local level is divided out that is itself estimated, which
# makes tails heavier.
_PENALTIES = 2.0
_NEIGHBOURS = 61  # samples about one of them whose median is the level of the noise there
_LEAST_LEVEL = 1e-3  # of the root mean square: the local level is taken as at least that
# iterations of scale and weights, after which the scale changes by less than a percent
_ROUNDS = 12


def heavy_tails(innovation: Array, freedom: float | None = None) -> tuple[float, float]:
    """Estimate the degrees of freedom of innovations by maximum likelihood.

    They are infinite, so that innovations are Gaussian, unless the kurtosis is clearly high and
    the likelihood prefers heavy tails by twice the penalty of BIC.

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
    size = rms(innovation) if innovation.size else 0.0
    if freedom is not None and freedom < inf and size > 0.0:
        return freedom, float(_fit_scales(innovation, np.array([freedom]))[1][0])
    if freedom == inf or len(innovation) < _FEW or not size > 0.0 or not _is_heavy(innovation):
        return inf, size
    local = median_filter(np.abs(innovation), _NEIGHBOURS, mode="nearest")
    level = np.maximum(local, _LEAST_LEVEL * size)
    estimated = _estimate_freedom(innovation / level)
    if estimated == inf:
        return inf, size
    return estimated, float(_fit_scales(innovation, np.array([estimated]))[1][0])


def weights(innovation: Array, freedom: float) -> Array:
    """Return the weights (m,) with which least squares has the slope of minus the log likelihood.

    Parameters
    ----------
    innovation : ndarray, shape (m,)
        Over its deviation.
    freedom : float
        Degrees of freedom.
    """
    if freedom == inf:
        return np.ones_like(innovation)
    return (freedom + 1.0) / (freedom + innovation**2)


def student_log_density(values: Array, freedom: float) -> Array:
    """Return the logarithm of the density of Student's t distribution of unit scale.

    Parameters
    ----------
    values : ndarray, shape (n,)
    freedom : float
        Degrees of freedom, finite.

    Returns
    -------
    ndarray, shape (n,)
    """
    at_zero = log(poch(0.5 * freedom, 0.5)) - 0.5 * log(pi * freedom)
    return at_zero - 0.5 * (freedom + 1.0) * np.log1p(values**2 / freedom)


def deviance_roots(innovation: Array, freedom: float) -> tuple[Array, Array]:
    """Return signed square roots (m,) of the deviance of every innovation, and their slopes (m,).

    The sum of their squares is the deviance, so that least squares needs no iterated weights.
    """
    if freedom == inf:
        return innovation, np.ones_like(innovation)
    root = np.sign(innovation) * np.sqrt((freedom + 1.0) * np.log1p(innovation**2 / freedom))
    at_zero = np.full_like(root, np.sqrt((freedom + 1.0) / freedom))
    slope = np.divide(
        weights(innovation, freedom) * innovation, root, out=at_zero, where=root != 0.0
    )
    return root, slope


def curvature(innovation: Array, freedom: float) -> Array:
    """Return the curvature of minus the logarithm of the density at every innovation, (m,).

    It is negative far out, so that where the level of the noise is high it is far smaller than
    elsewhere.
    """
    if freedom == inf:
        return np.ones_like(innovation)
    square = innovation**2
    return (freedom + 1.0) * (freedom - square) / (freedom + square) ** 2


def _is_heavy(innovation: Array) -> bool:
    """Return whether the kurtosis is clearly more than 3, which Gaussian samples have.

    Its standard error over n Gaussian samples is ``sqrt(24 / n)``.
    """
    power = np.mean(innovation**2)
    if not power**2 > 0.0:  # a record without noise
        return False
    kurtosis = np.mean(innovation**4) / power**2
    return bool(kurtosis > 3.0 + _SUSPECT * np.sqrt(24.0 / len(innovation)))


def _estimate_freedom(innovation: Array) -> float:
    """Return the degrees of freedom of Student's t distribution for innovations of one level.

    Infinite, which is the Gaussian distribution, if the tails are not clearly heavy.
    """
    if not _is_heavy(innovation):
        return inf
    n = len(innovation)
    power = float(np.mean(innovation**2))
    log_likelihoods, _ = _fit_scales(innovation, _FREEDOMS)
    best = int(np.argmax(log_likelihoods))
    gaussian = -0.5 * n * (1.0 + log(2.0 * pi * power))
    if 2.0 * (log_likelihoods[best] - gaussian) < _PENALTIES * np.log(n):
        return inf
    return float(_FREEDOMS[best])


def _fit_scales(innovation: Array, freedoms: Array) -> tuple[Array, Array]:
    """Return the highest log likelihoods (f,) at degrees of freedom (f,), and the scales there.

    The scale is iterated by expectation and maximisation, with the weights of Student's t.
    """
    square = innovation**2
    robust = float(np.median(np.abs(innovation))) / _QUARTILE
    start = robust**2 or float(square.mean())
    # squares of scales; far fewer calls than one freedom after the other
    scales = np.full((len(freedoms), 1), start)
    column = freedoms[:, np.newaxis]
    for _ in range(_ROUNDS):
        shares = square / (column * scales + square)
        scales = (column + 1.0) * scales * shares.mean(axis=1, keepdims=True)
    spread = np.log1p(square / (column * scales)).sum(axis=1)
    constant = gammaln(0.5 * (freedoms + 1.0)) - gammaln(0.5 * freedoms)
    constant = constant - 0.5 * np.log(np.pi * freedoms * scales[:, 0])
    likelihoods = len(square) * constant - 0.5 * (freedoms + 1.0) * spread
    return likelihoods, np.sqrt(scales[:, 0])
