"""White noise of a measured output, Gaussian or of Student's t distribution.

A residual with too many outliers for Gaussian noise is of Student's t distribution, which weights
each sample by its likelihood (Lange, Little, Taylor: J. Amer. Statist. Assoc. 84, 1989).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, inf, log, pi

import numpy as np
from scipy.special import ndtri

from fmus.kit.arrays import Array, Mask
from orchestration.identify.metrics import rms
from orchestration.identify.noise.tails import heavy_tails, student_log_density

# least deviation, for records without noise: values over it must still have a fourth power
_LEAST = 1e-30
_SETTLING = 5  # samples from a step of an input on, in which errors of a model are largest
_FEWEST = 100  # samples that estimate noise away from steps of the inputs
# robust deviations at which a sample of a heavy tail is clipped while the scale is estimated
_FAR = 4.0


@dataclass(frozen=True)
class Noise:
    """White noise of one output.

    Attributes
    ----------
    deviation : float
        Scale of a sample in the unit of the output: its standard deviation if it is Gaussian.
    freedom : float
        Degrees of freedom of Student's t distribution; infinite if samples are Gaussian.
    """

    deviation: float
    freedom: float = inf

    @property
    def parameters(self) -> int:
        """The number of estimated parameters without the deviation."""
        return int(self.freedom < inf)

    @property
    def information(self) -> float:
        """Fisher information of a sample about a mean, over that of a Gaussian sample.

        Source: Lange, Little, Taylor.
        """
        return 1.0 if self.freedom == inf else (self.freedom + 1.0) / (self.freedom + 3.0)

    def deviance(self, innovation: Array) -> float:
        """Return minus twice the log likelihood of innovations, up to ``n log(2 pi)``.

        Parameters
        ----------
        innovation : ndarray, shape (n,)
            A residual over the deviation.
        """
        n = len(innovation)
        if self.freedom == inf:
            shape = float(innovation @ innovation)
        else:
            density = float(2.0 * student_log_density(innovation, self.freedom).sum())
            shape = -density - n * log(2.0 * pi)
        return shape + 2.0 * n * log(self.deviation)


def estimate_noise(residual: Array, undisturbed: Mask, freedom: float | None = None) -> Noise:
    """Estimate the noise of a residual; BIC decides between Gaussian and heavy tails.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    undisturbed : ndarray of bool, shape (m,)
        Samples at which an incomplete model has no reason to be far off, see `noise_samples`. Tails
        are heavy where these and all samples agree.
    freedom : float, optional
        Degrees of freedom that are known; infinite for Gaussian noise.

    Returns
    -------
    Noise
    """
    gaussian = _estimate_gaussian(residual)
    if freedom is not None:
        _, scale = heavy_tails(residual / gaussian.deviation, freedom)
        return Noise(max(gaussian.deviation * scale, _LEAST), freedom)
    if _estimate_freedom(residual / gaussian.deviation, undisturbed) == inf:
        return gaussian
    # outliers inflate the deviation: it is estimated without them
    far = _FAR * float(np.median(np.abs(residual))) / float(ndtri(0.75))
    deviation = _estimate_gaussian(np.clip(residual, -far, far)).deviation
    innovation = residual / deviation
    freedom = _estimate_freedom(innovation, undisturbed)
    heavy, scale = heavy_tails(innovation[undisturbed], freedom)
    return Noise(max(deviation * scale, _LEAST), heavy)


def _estimate_gaussian(residual: Array) -> Noise:
    return Noise(max(rms(residual), _LEAST))


def _estimate_freedom(innovation: Array, undisturbed: Mask) -> float:
    """Return the degrees of freedom of innovations.

    Tails are heavy only if they are so in all samples and in the undisturbed ones alone.
    """
    return max(heavy_tails(innovation)[0], heavy_tails(innovation[undisturbed])[0])


def noise_std(values: Array, differences: int = 2) -> float:
    """Return the standard deviation of white noise on a signal, robustly from its differences.

    Steps of the signal do no harm.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN is a gap.
    differences : int
        How often the signal is differenced: the k-th difference of white noise has its variance
        times (2k)! / k!^2.

    Returns
    -------
    float
        In the unit of the signal; zero if there are too few samples.
    """
    steps = np.diff(values[np.isfinite(values)], differences)
    scale = float(ndtri(0.75)) * np.sqrt(comb(2 * differences, differences))
    return float(np.median(np.abs(steps)) / scale) if steps.size else 0.0


def noise_samples(moved: Mask, measured: Array) -> Mask:
    """Return the samples (n,) at which the noise dominates the error of an incomplete model.

    They are those where the output changes and no input has stepped within `_SETTLING` samples; if
    these are too few, all where the output changes.

    Parameters
    ----------
    moved : ndarray of bool, shape (n,)
        True where an input steps.
    measured : ndarray, shape (n,)
    """
    changing = np.diff(measured, prepend=np.nan) != 0.0
    after_step = np.convolve(moved, np.ones(_SETTLING))[: len(moved)] > 0.0
    settled = changing & ~after_step
    is_enough = settled.sum() > max(_FEWEST, 0.1 * changing.sum())
    return settled if is_enough else changing
