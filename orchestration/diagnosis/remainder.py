"""What a model leaves of the outputs on samples that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.comparison import Judged

_SLOW = 0.5  # correlation of neighbouring samples from which on a remainder is slow
_LARGE = 0.15  # of the spread, from which on a slow remainder is no noise of an instrument
_WIDTHS = 1.5  # of the noise, from which on a slow remainder is more than noise
_TO_DEVIATION = 1.4826  # of the median of moduli, for normal noise


@dataclass(frozen=True)
class Remainder:
    """The error of one output where nothing was fitted.

    Attributes
    ----------
    output : str
    share : float
        Root mean square over that of the output about its mean.
    noise_widths : float or None
        Root mean square over the standard deviation of the noise; None for an output without noise.
    tests : Mapping of str to float
        Results of `TESTS` by name.
    """

    output: str
    share: float
    noise_widths: float | None
    tests: Mapping[str, float]

    @property
    def correlation(self) -> float:
        """Correlation of neighbouring samples."""
        return self.tests["correlation"]

    @property
    def is_slow(self) -> bool:
        """Whether neighbouring errors are alike, as those of noise from an instrument are not."""
        return self.correlation > _SLOW

    @property
    def is_more_than_noise(self) -> bool:
        """Whether it is slow, and clearly larger than what is independent from sample to sample."""
        return self.is_slow and (self.noise_widths is None or self.noise_widths > _WIDTHS)


def remainders(judged: Judged, sizes: Array | None = None) -> tuple[Remainder, ...]:
    """Return the remainder of every output that is measured where nothing was chosen by.

    Parameters
    ----------
    judged : Judged
    sizes : ndarray, shape (ny,), optional
        RMS of the outputs about their means, in their spreads; NaN of one that does not move. By
        default the spreads.
    """
    result = []
    sizes = np.ones(len(judged.fit.problem.spread)) if sizes is None else sizes
    for j, output in enumerate(judged.fit.problem.model.outputs):
        if not np.isfinite(sizes[j]):
            continue
        error = judged.measuring[:, j]
        if np.isfinite(error).sum() < 4:
            continue
        size = float(np.sqrt(np.nanmean(error**2)))
        noise = noise_of(error)
        widths = size / noise if noise > 1e-6 * size else None
        share = size / float(sizes[j])
        tests = {name: test(error) for name, test in TESTS.items()}
        result.append(Remainder(output.name, share, widths, tests))
    return tuple(result)


def drifts(judged: Judged) -> bool:
    """Return whether a model leaves a large slow error where nothing was fitted."""
    return any(one.share > _LARGE and one.is_slow for one in remainders(judged))


def leaves_more(judged: Judged) -> bool:
    """Return whether a model leaves more than noise of an output where nothing was chosen by."""
    return any(one.is_more_than_noise for one in remainders(judged))


def noise_of(error: Array) -> float:
    """Return the standard deviation of white noise in an error (n,), by its second differences."""
    bends = np.diff(error, 2)
    bends = bends[np.isfinite(bends)]
    if not bends.size:
        return 0.0
    return float(_TO_DEVIATION * np.median(np.abs(bends)) / np.sqrt(6.0))


def _neighbours(error: Array) -> float:
    """Return the correlation about zero of an error (n,) with itself one sample later."""
    products = error[:-1] * error[1:]
    square = np.nanmean(error**2)
    if not np.isfinite(products).any() or not square > 0.0:
        return 0.0
    return float(np.clip(np.nanmean(products) / square, -1.0, 1.0))


# residual tests: functions of the error (n,) of an output, by name in tables and in JSON
TESTS: dict[str, Callable[[Array], float]] = {"correlation": _neighbours}
