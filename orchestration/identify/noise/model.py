"""The noise model of an output: an autoregression of its residual, and the whitening filter.

Source: Box and Jenkins. Innovations are Gaussian or, where there are too many outliers for that, of
Student's t distribution, which gives each a weight by its likelihood (Lange, Little, Taylor: J.
Amer. Statist. Assoc. 84, 1989).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import comb, inf

import numpy as np
from scipy.linalg import solve_discrete_lyapunov, solve_triangular
from scipy.special import ndtri

from fmus.kit.arrays import Array, Mask
from orchestration.identify.filters import autoregression
from orchestration.identify.noise.autoregression import ORDER, estimate_colour, segments
from orchestration.identify.noise.tails import heavy_tails, weights
from orchestration.identify.probability import student_log_density

# least deviation, for records without noise: values over it must still have a fourth power
_LEAST = 1e-30
_STATIONARY = 1.0 - 1e-9  # largest modulus of a pole; beyond, a first sample would have no variance
_SETTLING = 5  # samples from a step of an input on, in which errors of a model are largest
_FEWEST = 100  # samples that estimate noise away from steps of the inputs
# robust deviations at which a sample of a heavy tail is clipped while correlations are estimated
_FAR = 4.0


@dataclass(frozen=True)
class Noise:
    """``e[k] = sum_i coefficients[i] e[k-1-i] + deviation w[k]`` with white w.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
    deviation : float
        Scale of an innovation in the unit of the output: its standard deviation if it is Gaussian.
    freedom : float
        Degrees of freedom of Student's t distribution; infinite if innovations are Gaussian.
    """

    coefficients: Array
    deviation: float
    freedom: float = inf

    @property
    def parameters(self) -> int:
        """The number of estimated parameters without the deviation."""
        return len(self.coefficients) + int(self.freedom < inf)

    @property
    def information(self) -> float:
        """Fisher information of a sample about a mean, over that of a Gaussian sample.

        Source: Lange, Little, Taylor.
        """
        return 1.0 if self.freedom == inf else (self.freedom + 1.0) / (self.freedom + 3.0)

    def whiten(self, values: Array, present: Mask) -> Array:
        """Filter a residual, or the columns of its Jacobian, into innovations over their deviation.

        The likelihood is exact: the first samples after a gap are scaled by the covariance of the
        stationary process (Box, Jenkins, Reinsel: Time Series Analysis, section 7.1.2), so that
        none is lost.

        Parameters
        ----------
        values : ndarray, shape (m,) or (m, p)
            At the samples that were measured.
        present : ndarray of bool, shape (n,)
            True where a sample was measured; m of them.

        Returns
        -------
        ndarray, shape (m,) or (m, p)
        """
        pieces = [self._whiten_piece(values[a:b]) for a, b in segments(present)]
        if not pieces:
            return values[:0]
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def weights(self, innovation: Array) -> Array:
        """Return the weights with which least squares of innovations maximises the likelihood.

        Parameters
        ----------
        innovation : ndarray, shape (m,)
            Over its deviation.

        Returns
        -------
        ndarray, shape (m,)
        """
        return weights(innovation, self.freedom)

    def deviance(self, innovation: Array, present: Mask) -> float:
        """Return minus twice the log likelihood of innovations, up to ``n log(2 pi)``.

        Parameters
        ----------
        innovation : ndarray, shape (m,)
            As :meth:`whiten` gives it.
        present : ndarray of bool, shape (n,)
        """
        n = len(innovation)
        if self.freedom == inf:
            shape = float(innovation @ innovation)
        else:
            density = float(2.0 * student_log_density(innovation, self.freedom).sum())
            shape = -density - n * float(np.log(2.0 * np.pi))
        first = 0.0  # the first samples scatter more than innovations do
        p = len(self.coefficients)
        if p:
            spread = np.log(np.diag(self._start))
            first = sum(float(spread[: min(b - a, p)].sum()) for a, b in segments(present))
        return shape + 2.0 * n * float(np.log(self.deviation)) + 2.0 * first

    def backwards(self, values: Array) -> Array:
        """Filter the columns of a Jacobian with the noise model, backwards in time.

        With e = H w the scores J'e have the covariance J'HH'J var(w), and this is H'J times the
        deviation of w (Ljung: System Identification, section 9.4).

        Parameters
        ----------
        values : ndarray, shape (m, p)

        Returns
        -------
        ndarray, shape (m, p)
        """
        reversed_result = autoregression([1.0, *-self.coefficients], values[::-1])
        return np.asarray(self.deviation * reversed_result[::-1])

    @cached_property
    def _start(self) -> Array:
        """Cholesky factor (p, p) of the covariance of the first samples, over the variance."""
        p = len(self.coefficients)
        companion = np.eye(p, k=-1)
        companion[0] = self.coefficients
        radius = float(np.abs(np.linalg.eigvals(companion)).max(initial=0.0))
        companion *= min(1.0, _STATIONARY / max(radius, _STATIONARY))
        drive = np.zeros((p, p))
        drive[0, 0] = 1.0
        return np.asarray(
            np.linalg.cholesky(solve_discrete_lyapunov(companion, drive)), dtype=np.float64
        )

    def _whiten_piece(self, piece: Array) -> Array:
        """Whiten a stretch without a gap; its first samples by the inverse Cholesky factor."""
        n = len(piece)
        p = len(self.coefficients)
        first = min(n, p)
        result = piece.copy()
        for lag, coefficient in enumerate(self.coefficients, start=1):
            result[first:] -= coefficient * piece[first - lag : n - lag] if n > p else 0.0
        if first:
            result[:first] = solve_triangular(
                self._start[:first, :first], piece[:first], lower=True
            )
        result /= self.deviation
        return np.asarray(result)


def white_noise(residual: Mapping[str, Array]) -> dict[str, Noise]:
    """Return white Gaussian noise of the size of residuals, (m,) by output."""
    return {
        output: Noise(np.empty(0), max(float(np.sqrt(np.mean(values**2))), _LEAST))
        for output, values in residual.items()
    }


def estimate_noise(
    residual: Array,
    present: Mask,
    order: int = ORDER,
    undisturbed: Mask | None = None,
    freedom: float | None = None,
    colour: Array | None = None,
) -> Noise:
    """Estimate the noise of a residual.

    BIC chooses its order, and between Gaussian and heavy tails.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    order : int
        Highest that is considered; 0 for white noise.
    undisturbed : ndarray of bool, shape (m,), optional
        Samples at which an incomplete model has no reason to be far off, see `noise_samples`. Tails
        are heavy where these and all samples agree; without them noise is Gaussian.
    freedom : float, optional
        Of the distribution of innovations, where it is known; estimated otherwise.
    colour : ndarray, shape (p,), optional
        Coefficients of the autoregression, where they are known; estimated otherwise.

    Returns
    -------
    Noise
    """
    gaussian = _estimate_gaussian(residual, present, order, colour)
    if undisturbed is None:
        return gaussian
    rough = (
        _estimate_freedom(gaussian, residual, present, undisturbed) if freedom is None else freedom
    )
    if rough == inf:
        return gaussian
    # outliers make colour look weaker than it is: it is estimated without them
    far = _FAR * float(np.median(np.abs(residual))) / float(ndtri(0.75))
    clipped = _estimate_gaussian(np.clip(residual, -far, far), present, order, colour)
    final = freedom or _estimate_freedom(clipped, residual, present, undisturbed)
    heavy, scale = heavy_tails(clipped.whiten(residual, present)[undisturbed], final)
    return Noise(clipped.coefficients, max(clipped.deviation * scale, _LEAST), heavy)


def _estimate_freedom(
    noise: Noise,
    residual: Array,
    present: Mask,
    undisturbed: Mask,
) -> float:
    """Return the degrees of freedom of the innovations of a residual.

    Tails are heavy only if they are so in all samples and in the undisturbed ones alone.
    """
    innovation = noise.whiten(residual, present)
    return max(heavy_tails(innovation)[0], heavy_tails(innovation[undisturbed])[0])


def _estimate_gaussian(residual: Array, present: Mask, order: int, colour: Array | None) -> Noise:
    """Estimate Gaussian noise, of an autoregression that is estimated unless it is known."""
    coefficients = estimate_colour(residual, present, order) if colour is None else colour
    innovation = Noise(coefficients, 1.0).whiten(residual, present)
    return Noise(coefficients, max(float(np.sqrt(np.mean(innovation**2))), _LEAST))


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
    return np.asarray(settled if is_enough else changing)
