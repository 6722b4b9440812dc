"""The paired predictive score: how much likelier one model makes unseen data than another, and how sure that is.

A model that was fitted predicts unseen data block by block, each given those before it (Dawid, J. R. Stat. Soc. A 147,
1984). With the covariance P of what its fit left open and the derivatives J of its innovations r by the parameters, the
innovations of a block have the mean -J m and the covariance I + J P J', and m and P are brought up to date by each
(recursive least squares; Ljung: System Identification, section 11.2). So the densities of all blocks multiply to that
of the whole, and blocks are independent where the model is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Innovations:
    """What a fitted model leaves of unseen data.

    Attributes
    ----------
    values : ndarray, shape (m,)
        Innovations over their deviation.
    jacobian : ndarray, shape (m, p)
        Their derivatives by the parameters.
    covariance : ndarray, shape (p, p)
        Of the parameters as fitted; zero along what was not determined, which stays where it is.
    """

    values: Array
    jacobian: Array
    covariance: Array


@dataclass(frozen=True)
class PairedScore:
    """Difference of the logarithms of two predictive densities, of the richer model less the simpler one.

    Attributes
    ----------
    gain : float
        Sum over all blocks: positive where the richer model makes the data likelier.
    standard_error : float
        Of that, over blocks: of how far they deviate from each other, or from what they should gain were the better of
        the two models right, whichever is less; and no less than the likelihood itself says. An effect may act in a few
        blocks only, and none is of quite the form that a model gives it.
    expected : float
        What the gain should be, were the richer model right.
    expected_error : float
        Standard deviation of the gain then, in noise as fitted.
    """

    gain: float
    standard_error: float
    expected: float
    expected_error: float


@dataclass(frozen=True)
class _Block:
    """A block as predicted from those before: deviations (n,) have the covariance I + J P J'; P (p, p) is ``open``."""

    deviation: Array
    jacobian: Array
    open: Array

    @property
    def _grown(self) -> Array:
        return np.eye(len(self.open)) + self.open @ (self.jacobian.T @ self.jacobian)

    @property
    def left(self) -> Array:
        """Covariance (p, p) of the parameters once the block is known, by Woodbury's formula."""
        return np.asarray(np.linalg.solve(self._grown, self.open))

    @property
    def log_determinant(self) -> float:
        """Of the covariance of the block, by the determinant lemma."""
        return float(np.linalg.slogdet(self._grown)[1])

    def weighed(self, values: Array) -> Array:
        """Values (n,) times the inverse of the covariance of the block."""
        return np.asarray(values - self.jacobian @ (self.left @ (self.jacobian.T @ values)))

    @property
    def log_density(self) -> float:
        """Logarithm of how likely the block is, but for a constant that all models have."""
        return -0.5 * (float(self.deviation @ self.weighed(self.deviation)) + self.log_determinant)


def paired_score(simpler: Innovations, richer: Innovations, blocks: Indices) -> PairedScore:
    """Hold two fitted models against each other on unseen data.

    Parameters
    ----------
    simpler, richer : Innovations
        Of the same samples, in the same noise.
    blocks : ndarray of int, shape (m,)
        Which block every innovation belongs to, from zero on, in time.

    Returns
    -------
    PairedScore
    """
    pairs = list(zip(_predicted(simpler, blocks), _predicted(richer, blocks), strict=True))
    gains = np.array([b.log_density - a.log_density for a, b in pairs])
    mean, variance = np.array([_divergence(b, a) for a, b in pairs]).T
    by_better = mean if gains.sum() > 0.0 else -np.array([_divergence(a, b)[0] for a, b in pairs])
    least = float(np.sqrt(variance.sum()))
    error = float(np.linalg.norm(gains - by_better))
    if len(gains) > 1:
        error = min(error, float(np.std(gains, ddof=1)) * len(gains) ** 0.5)
    return PairedScore(float(gains.sum()), max(least, error), float(mean.sum()), least)


def _predicted(model: Innovations, blocks: Indices) -> Sequence[_Block]:
    """Every block, given those before."""
    moved, still_open, result = np.zeros(model.jacobian.shape[1]), model.covariance, []
    for k in range(int(blocks.max()) + 1):
        j = model.jacobian[blocks == k]
        block = _Block(model.values[blocks == k] + j @ moved, j, still_open)
        still_open = block.left
        moved = moved - still_open @ (j.T @ block.deviation)
        result.append(block)
    return result


def _divergence(true: _Block, other: _Block) -> tuple[float, float]:
    """Mean and variance of how much likelier one model makes a block than another, if it is right.

    The mean is the divergence of Kullback and Leibler of two Gaussian densities; C of the right one over C of the other
    differs from one by a matrix of low rank, U W U' with U the Jacobians of both.
    """
    between = other.deviation - true.deviation
    weighed = other.weighed(between)
    columns = np.hstack([other.jacobian, true.jacobian])
    across = other.left @ other.jacobian.T @ true.jacobian @ true.open
    weights = np.block([[-other.left, -across], [np.zeros_like(across.T), true.open]])
    excess = weights @ (columns.T @ columns)
    projected = true.jacobian.T @ weighed
    mean = np.trace(excess) + between @ weighed + other.log_determinant - true.log_determinant
    variance = (
        weighed @ weighed + projected @ true.open @ projected + 0.5 * np.trace(excess @ excess)
    )
    return 0.5 * float(mean), max(float(variance), 0.0)
