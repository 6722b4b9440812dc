"""The noise of an output: an autoregression of its residual, and the filter that makes it white (Box and Jenkins).

Innovations are Gaussian, or where samples far out are too many for that, of Student's t distribution, which weighs them
by how likely they are (Lange, Little, Taylor: J. Amer. Statist. Assoc. 84, 1989).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import comb, inf

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov, solve_triangular
from scipy.signal import lfilter
from scipy.stats import norm
from scipy.stats import t as student

from orchestration.identify.noise.autoregression import ORDER, colour_of, segments
from orchestration.identify.noise.tails import heavy_tails, weights

Array = NDArray[np.float64]
_LEAST = 1e-30  # deviation, of records without noise: what is measured in units of it must still have a fourth power
_STATIONARY = 1.0 - 1e-9  # largest modulus of a pole; beyond, a first sample would have no variance
_SETTLING = 5  # samples from a step of an input on, in which what a model lacks is seen most
_FEWEST_CALM = 100  # samples
_FAR = 4.0  # robust deviations at which a sample of a heavy tail is held while correlations are estimated


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
        """How many were estimated beside the deviation."""
        return len(self.coefficients) + int(self.freedom < inf)

    @property
    def information(self) -> float:
        """What a sample tells of a mean, times its variance if it were Gaussian (Lange, Little, Taylor)."""
        return 1.0 if self.freedom == inf else (self.freedom + 1.0) / (self.freedom + 3.0)

    def whiten(self, values: Array, present: NDArray[np.bool_]) -> Array:
        """Filter a residual, or every column of its Jacobian, into innovations over their deviation.

        The likelihood is exact: the first samples after a gap are held against what the stationary process lets them
        be (Box, Jenkins, Reinsel: Time Series Analysis, section 7.1.2), so that none is lost.

        Parameters
        ----------
        values : ndarray, shape (m,) or (m, p)
            Where something was measured.
        present : ndarray of bool, shape (n,)
            Where that was; m of them.

        Returns
        -------
        ndarray, shape (m,) or (m, p)
        """
        pieces = [self._filtered(values[a:b]) for a, b in segments(present)]
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces) if pieces else values[:0]

    def from_rest(self, values: Array, present: NDArray[np.bool_]) -> Array:
        """Filter like :meth:`whiten`, as if everything before the first sample had been zero.

        What a simulation gets wrong grows from where it starts, so that the first samples tell most of the start.
        """
        whole = [1.0, *-self.coefficients]
        pieces = [
            lfilter(whole, [1.0], values[a:b], axis=0) / self.deviation
            for a, b in segments(present)
        ]
        return np.concatenate(pieces) if pieces else values[:0]

    def weights(self, innovation: Array) -> Array:
        """How much every innovation counts in a sum of squares that has its optimum where the likelihood has.

        Parameters
        ----------
        innovation : ndarray, shape (m,)
            Over its deviation.

        Returns
        -------
        ndarray, shape (m,)
        """
        return weights(innovation, self.freedom)

    def deviance(self, innovation: Array, present: NDArray[np.bool_]) -> float:
        """Minus twice the logarithm of a likelihood, less that of as many Gaussian samples of unit density at zero.

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
            shape = -float(2.0 * student.logpdf(innovation, self.freedom).sum()) - n * float(
                np.log(2.0 * np.pi)
            )
        first = 0.0  # the first samples scatter more than innovations do
        if p := len(self.coefficients):
            spread = np.log(np.diag(self._start))
            first = sum(float(spread[: min(b - a, p)].sum()) for a, b in segments(present))
        return shape + 2.0 * n * float(np.log(self.deviation)) + 2.0 * first

    def backwards(self, values: Array) -> Array:
        """Filter the columns of a Jacobian by the noise model, backwards in time.

        With e = H w the scores J'e have the covariance J'HH'J var(w), and this is H'J times the deviation of w (Ljung:
        System Identification, section 9.4).

        Parameters
        ----------
        values : ndarray, shape (m, p)

        Returns
        -------
        ndarray, shape (m, p)
        """
        return np.asarray(
            lfilter([self.deviation], [1.0, *-self.coefficients], values[::-1], axis=0)[::-1]
        )

    @cached_property
    def _start(self) -> Array:
        """Lower Cholesky factor (p, p) of the covariance of as many samples as the memory is long, over its square."""
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

    def _filtered(self, piece: Array) -> Array:
        n, p = len(piece), len(self.coefficients)
        k = min(n, p)
        result = piece.copy()
        for lag, coefficient in enumerate(self.coefficients, start=1):
            result[k:] -= coefficient * piece[k - lag : n - lag] if n > p else 0.0
        if k:
            result[:k] = solve_triangular(self._start[:k, :k], piece[:k], lower=True)
        result /= self.deviation
        return np.asarray(result)


@dataclass(frozen=True)
class Whitening:
    """A filter for the residuals of all outputs, and a weight for every innovation.

    Attributes
    ----------
    noise : Mapping of str to Noise
        By output.
    present : Mapping of str to ndarray of bool, shape (n,)
        Where an output was measured.
    weights : Mapping of str to ndarray, shape (m,)
    """

    noise: Mapping[str, Noise]
    present: Mapping[str, NDArray[np.bool_]]
    weights: Mapping[str, Array]

    @classmethod
    def of(
        cls,
        noise: Mapping[str, Noise],
        residual: Mapping[str, Array],
        present: Mapping[str, NDArray[np.bool_]],
    ) -> Whitening:
        """Weigh innovations by how likely the noise makes those of a residual."""
        return cls(
            noise,
            present,
            {o: n.weights(n.whiten(residual[o], present[o])) for o, n in noise.items()},
        )

    def __call__(self, values: Mapping[str, Array]) -> Array:
        """Stack residuals (m,), or Jacobians (m, p), of all outputs."""
        rows = []
        for output, noise in self.noise.items():
            white = noise.whiten(values[output], self.present[output])
            if noise.freedom < inf:
                weight = np.sqrt(self.weights[output])
                white = white * (weight if white.ndim == 1 else weight[:, np.newaxis])
            rows.append(white)
        return np.concatenate(rows)


def white(residual: Mapping[str, Array]) -> dict[str, Noise]:
    """White Gaussian noise of the size of residuals, (m,) by output."""
    return {
        o: Noise(np.empty(0), max(float(np.sqrt(np.mean(e**2))), _LEAST))
        for o, e in residual.items()
    }


def estimate(
    residual: Array,
    present: NDArray[np.bool_],
    order: int = ORDER,
    calm: NDArray[np.bool_] | None = None,
    freedom: float | None = None,
    colour: Array | None = None,
) -> Noise:
    """Noise of a residual; its order is chosen by BIC, and so are heavy tails.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    order : int
        Highest that is considered; 0 for white noise.
    calm : ndarray of bool, shape (m,), optional
        Samples at which a model that lacks something has no reason to be far off. Tails are heavy where these and all
        samples tell it; without them noise is Gaussian.
    freedom : float, optional
        Of the distribution of innovations, where it is known; estimated otherwise.
    colour : ndarray, shape (p,), optional
        Coefficients of the autoregression, where they are known; estimated otherwise.

    Returns
    -------
    Noise
    """
    noise = _gaussian(residual, present, order, colour)
    if calm is None:
        return noise

    def tails(noise: Noise) -> float:
        """Heavy ones are seen in all samples, and in those too at which a model has no reason to be far off."""
        innovation = noise.whiten(residual, present)
        return max(heavy_tails(innovation)[0], heavy_tails(innovation[calm])[0])

    if (tails(noise) if freedom is None else freedom) == inf:
        return noise
    # far samples make colour look weaker than it is
    far = _FAR * float(np.median(np.abs(residual))) / float(norm.ppf(0.75))
    noise = _gaussian(np.clip(residual, -far, far), present, order, colour)
    freedom, scale = heavy_tails(noise.whiten(residual, present)[calm], freedom or tails(noise))
    return Noise(noise.coefficients, max(noise.deviation * scale, _LEAST), freedom)


def _gaussian(
    residual: Array, present: NDArray[np.bool_], order: int, colour: Array | None
) -> Noise:
    coefficients = colour_of(residual, present, order) if colour is None else colour
    innovation = Noise(coefficients, 1.0).whiten(residual, present)
    return Noise(coefficients, max(float(np.sqrt(np.mean(innovation**2))), _LEAST))


def noise_std(values: Array, differences: int = 2) -> float:
    """Standard deviation of white noise on a signal, robustly from its differences; steps of the signal do no harm.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN is a gap.
    differences : int
        How often the signal is differenced: the k-th difference of white noise has its variance times (2k)! / k!^2.

    Returns
    -------
    float
        In the unit of the signal; zero if there are too few samples.
    """
    steps = np.diff(values[np.isfinite(values)], differences)
    scale = float(norm.ppf(0.75)) * np.sqrt(comb(2 * differences, differences))
    return float(np.median(np.abs(steps)) / scale) if steps.size else 0.0


def calm(moved: NDArray[np.bool_], measured: Array) -> NDArray[np.bool_]:
    """Return samples (n,) of which the noise, and little else, makes what a model leaves.

    Parameters
    ----------
    moved : ndarray of bool, shape (n,)
        Where an input steps.
    measured : ndarray, shape (n,)
    """
    alive = np.diff(measured, prepend=np.nan) != 0.0
    far = alive & ~(np.convolve(moved, np.ones(_SETTLING))[: len(moved)] > 0.0)
    return np.asarray(far if far.sum() > max(_FEWEST_CALM, 0.1 * alive.sum()) else alive)
