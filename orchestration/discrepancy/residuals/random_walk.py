"""Slow structure that whitening swallows: whether a residual holds a random walk beneath noise of short memory.

The periodogram of the residual is held against two models of it (Whittle's likelihood, Ark. Mat. 2, 1953): a mixture of
white and coloured noise that forgets within some tens of samples, and the same with a random walk and an integrated
random walk added. Both are sums of known spectra with positive weights, which iteratively reweighted non-negative least
squares finds. What a fit has absorbed of slow noise only makes the second model needed less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import chi2

Array = NDArray[np.float64]
ALPHA = 1e-4  # probability in noise; where a random walk is as large as the noise it is smaller by many orders of magnitude
_COLOURS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95)  # lag-one correlations; the longest memory is 20 samples
_INTEGRATIONS = (1, 2)
_SINGLE = 32  # lowest frequencies that are looked at one by one; the others in groups, equally many in an octave
_GROUPS = 120
_SHORTEST = 100  # samples
_PASSES = 60


@dataclass(frozen=True)
class RandomWalkTest:
    """A random walk in a residual, tested against noise of short memory.

    Attributes
    ----------
    ratio : float
        Twice the logarithm of the likelihood ratio of noise with a random walk to noise without.
    p_value : float
        Of such a ratio without any random walk.
    rms : float
        Of the slow part, in the unit of the residual.
    trend : ndarray, shape (n,)
        The slow part, the best estimate of it (Wiener's filter).
    """

    ratio: float
    p_value: float
    rms: float
    trend: Array

    @property
    def significant(self) -> bool:
        """Whether there is one beyond doubt."""
        return self.p_value < ALPHA


def random_walk_test(residual: Array) -> RandomWalkTest:
    """Test a residual for a random walk.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Equally spaced; short gaps may have been left out.

    Returns
    -------
    RandomWalkTest
    """
    n = residual.size
    nothing = RandomWalkTest(0.0, 1.0, 0.0, np.zeros(n))
    centred = residual - residual.mean() if n else residual
    size = float(np.mean(centred**2)) if n else 0.0
    if n < _SHORTEST or not size > 0.0:
        return nothing
    transform = np.fft.rfft(centred)
    angle = 2.0 * np.pi * np.arange(transform.size) / n
    angle[0] = angle[1]  # the mean was taken out
    turn = np.exp(-1j * angle)
    ar_spectra = np.array([(1.0 - c * c) / np.abs(1.0 - c * turn) ** 2 for c in _COLOURS])
    integrated_spectra = np.array(
        [np.abs((1.0 - turn[1]) / (1.0 - turn)) ** (2 * k) for k in _INTEGRATIONS]
    )
    edges, count = _groups(transform.size)
    spectra = np.array([_averaged(s, edges, count) for s in (*ar_spectra, *integrated_spectra)]).T
    power = _averaged(np.abs(transform) ** 2 / n / size, edges, count)
    _, without = _weights(spectra[:, : len(ar_spectra)], power, count)
    weights, with_it = _weights(spectra, power, count)
    ratio = max(0.0, 2.0 * (without - with_it))
    share = (weights[len(ar_spectra) :] @ integrated_spectra) / (
        weights @ np.vstack([ar_spectra, integrated_spectra])
    )
    trend = np.fft.irfft(transform * share, n)
    freedom = len(_INTEGRATIONS)
    return RandomWalkTest(
        ratio, float(chi2.sf(ratio, freedom)), float(np.sqrt(np.mean(trend**2))), trend
    )


def _groups(size: int) -> tuple[NDArray[np.intp], Array]:
    """First frequency of every group, the end of the last, and how many are in each."""
    spaced = np.geomspace(min(_SINGLE, size - 1), size, _GROUPS).astype(np.intp)
    edges = np.unique(np.concatenate([np.arange(1, min(_SINGLE, size - 1)), spaced]))
    return edges, np.diff(edges).astype(float)


def _averaged(values: Array, edges: NDArray[np.intp], count: Array) -> Array:
    return np.asarray(np.add.reduceat(values, edges[:-1]) / count)


def _weights(spectra: Array, power: Array, count: Array) -> tuple[Array, float]:
    """Return the likeliest non-negative weights of spectra, and minus the logarithm of their likelihood."""

    def cost(weights: Array) -> float:
        level = spectra @ weights
        return float((count * (np.log(level) + power / level)).sum())

    weights = np.full(spectra.shape[1], power.mean() / spectra.sum(axis=1).mean())
    least = cost(weights)
    for _ in range(_PASSES):
        certain = np.sqrt(count) / (spectra @ weights)
        rows = spectra * certain[:, np.newaxis]
        scale = np.sqrt((rows**2).sum(axis=0))
        target = nnls(rows / scale, power * certain)[0] / scale
        step, trial, reached = 1.0, target, np.inf
        while step > 1e-4:
            trial = (1.0 - step) * weights + step * target
            if np.all(spectra @ trial > 0.0) and (reached := cost(trial)) < least:
                break
            step /= 2.0
        else:
            break
        converged = least - reached < 1e-6
        weights, least = trial, reached
        if converged:
            break
    return weights, least
