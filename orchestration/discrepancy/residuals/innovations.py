"""Innovations that tests can rest on: of one level throughout, and as far apart as those of Gaussian noise would be.

Noise comes with heavy tails, single outliers, steps of a converter and a level that varies. None of it is structure,
and every test of a mean or a variance takes it for structure. So innovations are divided by their local level and
replaced by normal scores (van der Waerden): what is left is in which order they come, and that is what structure is.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfiltic
from scipy.stats import norm, rankdata

from orchestration.identify.noise.autoregression import segments
from orchestration.identify.noise.model import Noise

Array = NDArray[np.float64]
_WINDOW = 80  # samples that tell the level about one of them
_WINDOWS = 40  # at most, in a record
_BINS = 8  # of the signal that the level may depend on
_PASSES = 2
_BOUND = 4.0  # levels beyond which a single innovation says no more
_FAR = 6.0  # levels beyond which a sample is an outlier: one of half a billion in Gaussian noise
_ROUNDING = 1.0 / np.sqrt(12.0)  # standard deviation of the error of rounding, in steps
_LEAST = 1e-3  # of the mean level, below which none is taken to be: where nothing moves a converter shows no noise


@dataclass(frozen=True)
class Innovations:
    """Innovations of one output.

    Attributes
    ----------
    at : ndarray of int, shape (k,)
        Samples of the record that they belong to.
    raw : ndarray, shape (k,)
        In standard deviations.
    level : ndarray, shape (k,)
        Local size of them; one on average.
    scores : ndarray, shape (k,)
        Normal scores of the innovations over their level.
    """

    at: NDArray[np.intp]
    raw: Array
    level: Array
    scores: Array

    @property
    def standardised(self) -> Array:
        """Innovations over their level."""
        return np.asarray(self.raw / self.level)

    @property
    def outliers(self) -> int:
        """How many lie far from all others, by the robust deviation of the rest."""
        standard = self.standardised
        spread = (
            float(np.median(np.abs(standard))) / float(norm.ppf(0.75)) if standard.size else 0.0
        )
        return int((np.abs(standard) > _FAR * spread).sum()) if spread > 0.0 else 0

    def bounded(self, residual: Array, present: NDArray[np.bool_], noise: Noise) -> Array:
        """The residual as it would be if no single innovation were far out.

        Parameters
        ----------
        residual : ndarray, shape (k,)
            As it is.
        present : ndarray of bool, shape (n,)
            Where there is one.
        noise : Noise
            Of the residual.

        Returns
        -------
        ndarray, shape (k,)
            In its unit.
        """
        driven = np.clip(self.standardised, -_BOUND, _BOUND) * self.level * noise.deviation
        poles, result = np.concatenate([[1.0], -noise.coefficients]), residual.copy()
        for a, b in segments(present):
            first = min(b, a + noise.coefficients.size)
            state = lfiltic([1.0], poles, residual[a:first][::-1])
            result[first:b] = lfilter([1.0], poles, driven[first:b], zi=state)[0]
        return result


def innovations_of(
    residual: Array,
    present: NDArray[np.bool_],
    noise: Noise,
    size: Array | None = None,
    step: float = 0.0,
) -> Innovations:
    """Whiten a residual and score it.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where there is one.
    noise : Noise
        Of the residual.
    size : ndarray, shape (n,), optional
        Signal on whose value the level may depend: the output as it is simulated.
    step : float
        Of the converter. Where its noise is not seen because nothing moves, it is there all the same.

    Returns
    -------
    Innovations
    """
    raw, at = noise.whiten(residual, present), np.flatnonzero(present)
    level = local_level(raw, None if size is None else size[at])
    if step > 0.0:
        whitened = np.hypot(1.0, np.linalg.norm(noise.coefficients)) / noise.deviation
        level = np.maximum(level, _ROUNDING * step * whitened)
    return Innovations(at, raw, level, normal_scores(raw / level))


def local_level(values: Array, size: Array | None = None) -> Array:
    """Local size of values (k,), one on average: how it goes with time, and with the value of a signal (k,)."""
    level, modulus = np.ones(values.size), np.abs(values)
    for _ in range(_PASSES):
        level *= _in_time(modulus / level)
        if size is not None and np.ptp(size) > 0.0:
            level *= _by_value(modulus / level, size)
    return level


def normal_scores(values: Array) -> Array:
    """Quantiles of the normal distribution at the ranks of values (k,): van der Waerden's scores; equal ones share."""
    return np.asarray(norm.ppf(rankdata(values) / (values.size + 1.0)))


def power(values: Array) -> float:
    """Mean square of values (k,), as far as single ones far out do not make it."""
    if not values.size:
        return 0.0
    spread = float(np.median(np.abs(values - np.median(values)))) / float(norm.ppf(0.75))
    bound = abs(float(np.median(values))) + (_BOUND * spread if spread > 0.0 else np.inf)
    return float(np.mean(np.minimum(np.abs(values), bound) ** 2))


def _in_time(modulus: Array) -> Array:
    """Local mean of moduli, from window to window and linearly between their middles."""
    count = int(np.clip(modulus.size // _WINDOW, 1, _WINDOWS))
    edges = np.linspace(0, modulus.size, count + 1).astype(np.intp)
    levels = np.array([_mean(modulus[a:b]) for a, b in pairwise(edges)])
    return _positive(np.interp(np.arange(modulus.size), 0.5 * (edges[:-1] + edges[1:] - 1), levels))


def _by_value(modulus: Array, size: Array) -> Array:
    """Mean of moduli where a signal is about as large, in ranges of equally many samples."""
    inner = np.unique(np.quantile(size, np.linspace(0.0, 1.0, _BINS + 1)[1:-1]))
    which = np.searchsorted(inner, size, side="right")
    counts = np.bincount(which, minlength=inner.size + 1)
    levels = np.array(
        [
            _mean(modulus[which == k]) if counts[k] >= _WINDOW // 2 else np.nan
            for k in range(counts.size)
        ]
    )
    levels = np.where(
        np.isfinite(levels), levels, np.nanmean(levels) if np.isfinite(levels).any() else 1.0
    )
    return _positive(levels[which])


def _mean(modulus: Array) -> float:
    """Mean that a few large ones do not carry away."""
    if not modulus.size:
        return 0.0
    middle = float(np.median(modulus))
    return float(np.minimum(modulus, _BOUND * middle if middle > 0.0 else np.inf).mean())


def _positive(level: Array) -> Array:
    """A level of mean one that is nowhere zero."""
    mean = float(level.mean()) if level.size else 0.0
    return np.maximum(level / mean, _LEAST) if mean > 0.0 else np.ones(level.size)
