"""Test for a random walk beneath noise of short memory: slow structure that whitening swallows.

The periodogram of the residual is compared with two models of it by Whittle's likelihood (Ark. Mat.
2, 1953): a mixture of white and coloured noise that forgets within some tens of samples, and the
same with a random walk and an integrated random walk added. Both are sums of known spectra with
positive weights, which iteratively reweighted non-negative least squares finds. What a fit has
absorbed of slow noise only lowers the likelihood ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.special import chdtrc

from fmus.kit.arrays import Array, Indices
from orchestration.discrepancy.residuals.residual_test import ResidualTest

if TYPE_CHECKING:
    from orchestration.discrepancy.residuals.output_residual import OutputResidual

_COLOURS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95)  # lag-one correlations; the longest memory is 20 samples
_INTEGRATIONS = (1, 2)
# lowest frequencies that are looked at one by one; the others in groups, equally many in an octave
_SINGLE = 32
_GROUPS = 120
_SHORTEST = 100  # samples
_PASSES = 60
_SHORTEST_STEP = 1e-4  # towards the weights of a pass
_CONVERGED = 1e-6  # fall of the cost that ends the passes


@dataclass(frozen=True)
class RandomWalkTest(ResidualTest):
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

    rank: ClassVar[int] = 1
    is_listed: ClassVar[bool] = False

    ratio: float
    p_value: float
    rms: float
    trend: Array

    @classmethod
    def of(cls, residual: OutputResidual) -> list[RandomWalkTest]:
        """Return the most significant test of any run, its p-value Bonferroni's."""
        cleaned = residual.cleaned
        at = np.flatnonzero(cleaned.present)
        runs = residual.data.runs
        tests = [
            random_walk_test(cleaned.bounded[(run.first <= at) & (at < run.last)]) for run in runs
        ]
        best = min(tests, key=lambda test: test.p_value)
        return [replace(best, p_value=min(1.0, len(tests) * best.p_value))]

    def describe(self, output: str) -> str:
        """Return that the output wanders."""
        return f"{output} wanders slowly"


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
    centred = residual - residual.mean() if n else residual
    size = float(np.mean(centred**2)) if n else 0.0
    if n < _SHORTEST or not size > 0.0:
        return RandomWalkTest(0.0, 1.0, 0.0, np.zeros(n))
    transform = np.fft.rfft(centred)
    coloured, integrated = _model_spectra(n)
    ratio, weights = _likelihood_ratio(transform, n, size, coloured, integrated)
    share = (weights[len(coloured) :] @ integrated) / (weights @ np.vstack([coloured, integrated]))
    trend = np.fft.irfft(transform * share, n)
    p_value = float(chdtrc(len(_INTEGRATIONS), ratio))
    return RandomWalkTest(ratio, p_value, float(np.sqrt(np.mean(trend**2))), trend)


def _likelihood_ratio(
    transform: NDArray[np.complex128], n: int, size: float, coloured: Array, integrated: Array
) -> tuple[float, Array]:
    """Compare the likelihoods of coloured noise with and without integrated noise beside it.

    Parameters
    ----------
    transform : ndarray, shape (f,)
        Of the residual.
    n : int
        Its samples.
    size : float
        Its mean square.
    coloured, integrated : ndarray, shapes (c, f) and (i, f)
        Spectra of both kinds of noise.

    Returns
    -------
    ratio : float
        Twice the logarithm of the likelihood ratio.
    weights : ndarray, shape (c + i,)
        Of all spectra together.
    """
    edges, count = _groups(transform.size)
    spectra = np.array([_averaged(s, edges, count) for s in (*coloured, *integrated)]).T
    power = _averaged(np.abs(transform) ** 2 / n / size, edges, count)
    _, cost_without = _fit_weights(spectra[:, : len(coloured)], power, count)
    weights, cost_with = _fit_weights(spectra, power, count)
    return max(0.0, 2.0 * (cost_without - cost_with)), weights


def _model_spectra(n: int) -> tuple[Array, Array]:
    """Return the spectra of both kinds of noise at the Fourier frequencies of n samples.

    Returns
    -------
    coloured : ndarray, shape (c, f)
        Of autoregressions with unit variance.
    integrated : ndarray, shape (i, f)
        Of integrated white noise; one at the lowest frequency.
    """
    angle = 2.0 * np.pi * np.arange(n // 2 + 1) / n
    angle[0] = angle[1]  # the mean was taken out
    turn = np.exp(-1j * angle)
    coloured = np.array([(1.0 - c * c) / np.abs(1.0 - c * turn) ** 2 for c in _COLOURS])
    integrator = np.abs((1.0 - turn[1]) / (1.0 - turn))
    return coloured, np.array([integrator ** (2 * k) for k in _INTEGRATIONS])


def _groups(size: int) -> tuple[Indices, Array]:
    """Group so many frequencies.

    Returns
    -------
    edges : ndarray of int, shape (g + 1,)
        First frequency of every group, and the end of the last.
    count : ndarray, shape (g,)
        Frequencies in each.
    """
    spaced = np.geomspace(min(_SINGLE, size - 1), size, _GROUPS).astype(np.intp)
    edges = np.unique(np.concatenate([np.arange(1, min(_SINGLE, size - 1)), spaced]))
    return edges, np.diff(edges).astype(float)


def _averaged(values: Array, edges: Indices, count: Array) -> Array:
    return np.asarray(np.add.reduceat(values, edges[:-1]) / count)


def _fit_weights(spectra: Array, power: Array, count: Array) -> tuple[Array, float]:
    """Find the likeliest non-negative weights of spectra.

    Parameters
    ----------
    spectra : ndarray, shape (g, k)
    power : ndarray, shape (g,)
        Of the residual, averaged over the frequencies of each group.
    count : ndarray, shape (g,)
        Frequencies in each group.

    Returns
    -------
    weights : ndarray, shape (k,)
    cost : float
        Minus the logarithm of their likelihood.
    """
    weights = np.full(spectra.shape[1], power.mean() / spectra.sum(axis=1).mean())
    cost = _cost(spectra @ weights, power, count)
    for _ in range(_PASSES):
        target = _reweighted(spectra, power, np.sqrt(count) / (spectra @ weights))
        step = 1.0
        while step > _SHORTEST_STEP:
            trial = (1.0 - step) * weights + step * target
            level = spectra @ trial
            reached = _cost(level, power, count) if np.all(level > 0.0) else np.inf
            if reached < cost:
                break
            step /= 2.0
        else:
            break
        converged = cost - reached < _CONVERGED
        weights = trial
        cost = reached
        if converged:
            break
    return weights, cost


def _reweighted(spectra: Array, power: Array, certainty: Array) -> Array:
    """Return the non-negative least-squares weights of spectra, with a certainty of each group."""
    rows = spectra * certainty[:, np.newaxis]
    scale = np.sqrt((rows**2).sum(axis=0))
    return np.asarray(nnls(rows / scale, power * certainty)[0] / scale)


def _cost(level: Array, power: Array, count: Array) -> float:
    return float((count * (np.log(level) + power / level)).sum())
