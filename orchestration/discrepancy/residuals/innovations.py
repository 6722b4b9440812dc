"""Innovations of a residual and their normal scores, which tests of structure rest on.

Noise comes with heavy tails, single outliers, steps of a converter and a level that varies. None of
it is structure, and every test of a mean or a variance takes it for structure. So innovations are
divided by their local level and replaced by normal scores (van der Waerden). These keep nothing but
the order in which innovations come, and structure is what shows in that order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.identify import autoregression, ranks
from orchestration.identify.noise import Noise, segments

_WINDOW = 80  # samples from which the level about one of them is estimated
_WINDOWS = 40  # at most, in a record
_BINS = 8  # of the signal that the level may depend on
_PASSES = 2
_BOUND = 4.0  # levels beyond which a single innovation says no more
_FAR = 6.0  # levels beyond which a sample is an outlier: one of half a billion in Gaussian noise
_ROUNDING = 1.0 / np.sqrt(12.0)  # standard deviation of the error of rounding, in steps
# of the mean level, below which none is taken to be: where nothing moves a converter shows no noise
_LEAST = 1e-3


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

    at: Indices
    raw: Array
    level: Array
    scores: Array

    @property
    def standardised(self) -> Array:
        """Innovations over their level."""
        return np.asarray(self.raw / self.level)

    @property
    def outliers(self) -> int:
        """Number of innovations that lie far from all others, by their robust deviation."""
        standard = self.standardised
        if not standard.size:
            return 0
        spread = float(np.median(np.abs(standard))) / float(ndtri(0.75))
        return int((np.abs(standard) > _FAR * spread).sum()) if spread > 0.0 else 0

    def bounded(self, residual: Array, present: Mask, noise: Noise) -> Array:
        """Return the residual as it would be if no single innovation were far out.

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
        poles = np.concatenate([[1.0], -noise.coefficients])
        result = residual.copy()
        for start, end in segments(present):
            first = min(end, start + noise.coefficients.size)
            # what makes the first samples what they are
            begun = residual[start:first]
            driven[start:first] = np.convolve(begun, poles)[: begun.size] if begun.size else begun
            result[first:end] = autoregression(poles, driven[start:end])[first - start :]
        return result


def score_innovations(
    residual: Array,
    present: Mask,
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
        Of the converter. Where its noise is not seen because nothing moves, it is there all the
        same.

    Returns
    -------
    Innovations
    """
    raw = noise.whiten(residual, present)
    at = np.flatnonzero(present)
    level = local_level(raw, None if size is None else size[at])
    if step > 0.0:
        whitened = np.hypot(1.0, np.linalg.norm(noise.coefficients)) / noise.deviation
        level = np.maximum(level, _ROUNDING * step * whitened)
    return Innovations(at, raw, level, normal_scores(raw / level))


def local_level(values: Array, size: Array | None = None) -> Array:
    """Estimate how the size of values goes with time, and with the value of a signal.

    Parameters
    ----------
    values : ndarray, shape (k,)
    size : ndarray, shape (k,), optional
        The signal.

    Returns
    -------
    ndarray, shape (k,)
        Local size; one on average.
    """
    level = np.ones(values.size)
    modulus = np.abs(values)
    bin_of = None if size is None or not np.ptp(size) > 0.0 else _bins(size)
    for _ in range(_PASSES):
        level *= _in_time(modulus / level)
        if bin_of is not None:
            level *= _level_by_bin(modulus / level, bin_of)
    return level


def normal_scores(values: Array) -> Array:
    """Return the quantiles of the normal distribution at the ranks of values (k,).

    These are van der Waerden's scores; equal values share one.
    """
    return np.asarray(ndtri(ranks(values) / (values.size + 1.0)))


def robust_power(values: Array) -> float:
    """Return the mean square of values (k,), of which single ones far out are bounded."""
    if not values.size:
        return 0.0
    spread = float(np.median(np.abs(values - np.median(values)))) / float(ndtri(0.75))
    bound = abs(float(np.median(values))) + (_BOUND * spread if spread > 0.0 else np.inf)
    return float(np.mean(np.minimum(np.abs(values), bound) ** 2))


def _in_time(modulus: Array) -> Array:
    """Return the local mean of moduli, linear between the middles of windows."""
    count = int(np.clip(modulus.size // _WINDOW, 1, _WINDOWS))
    return _positive(between_windows(modulus, count, _robust_means))


def between_windows(values: Array, count: int, summary: Callable[[Array], Array]) -> Array:
    """Summarise values (n,) in windows, and go on straight lines between their middles.

    Parameters
    ----------
    values : ndarray, shape (n,)
    count : int
        Windows, as long as each other to a sample.
    summary : callable
        Of the windows of one length (w, l); returns a figure of each (w,).

    Returns
    -------
    ndarray, shape (n,)
    """
    edges = np.linspace(0, values.size, count + 1).astype(np.intp)
    lengths = np.diff(edges)
    levels = np.zeros(count)
    for length in np.unique(lengths):
        alike = lengths == length
        levels[alike] = summary(values[edges[:-1][alike, np.newaxis] + np.arange(length)])
    middles = 0.5 * (edges[:-1] + edges[1:] - 1)
    return np.interp(np.arange(values.size), middles, levels)


def _bins(signal: Array) -> Indices:
    """Return for every sample which range of a signal it is in; they hold equally many samples."""
    inner = np.unique(np.quantile(signal, np.linspace(0.0, 1.0, _BINS + 1)[1:-1]))
    return np.searchsorted(inner, signal, side="right")


def _level_by_bin(modulus: Array, bin_of: Indices) -> Array:
    """Return for every sample the robust mean of the moduli in its bin."""
    counts = np.bincount(bin_of)
    levels = np.full(counts.size, np.nan)
    for k in np.flatnonzero(counts >= _WINDOW // 2):
        levels[k] = _robust_means(modulus[np.newaxis, bin_of == k])[0]
    known = np.isfinite(levels)
    levels = np.where(known, levels, np.nanmean(levels) if known.any() else 1.0)
    return _positive(levels[bin_of])


def _robust_means(moduli: Array) -> Array:
    """Return the means (w,) of rows of moduli (w, l) that a few large ones do not carry away."""
    if not moduli.size:
        return np.zeros(len(moduli))
    middle = np.median(moduli, axis=1, keepdims=True)
    bound = np.where(middle > 0.0, _BOUND * middle, np.inf)
    return np.asarray(np.minimum(moduli, bound).mean(axis=1))


def _positive(level: Array) -> Array:
    """Scale a level to a mean of one, and keep it from being zero anywhere."""
    mean = float(level.mean()) if level.size else 0.0
    return np.maximum(level / mean, _LEAST) if mean > 0.0 else np.ones(level.size)
