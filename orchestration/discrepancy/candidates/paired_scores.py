"""Paired predictive score: by how much one model makes unseen data likelier than another.

A model that was fitted predicts unseen data block by block, each given those before it (Dawid, J.
R. Stat. Soc. A 147, 1984). With the covariance P of what its fit left open and the derivatives J of
its innovations r by the parameters, the innovations of a block have the mean -J m and the
covariance I + J P J', and m and P are brought up to date by each (recursive least squares; Ljung:
System Identification, section 11.2). So the densities of all blocks multiply to that of the whole,
and blocks are independent where the model is right.

P is kept by its root (the same, section 11.7): in a simulation, whose only noise is its rounding,
I + P J' J itself is singular to working precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from fmus.kit.arrays import Array, Indices


@dataclass(frozen=True)
class PairedInnovations:
    """PairedInnovations of a fitted model on unseen data.

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
    """Logarithm of the predictive density of a richer model, less that of a simpler one.

    Attributes
    ----------
    gain : float
        Sum over all blocks: positive where the richer model makes the data likelier.
    standard_error : float
        Of that, over blocks: of how far they deviate from each other, or from what they should gain
        were the better of the two models right, whichever is less; and no less than the likelihood
        itself says. An effect may act in a few blocks only, and none is of quite the form that a
        model gives it.
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
    """A block of innovations, as predicted from the blocks before.

    Attributes
    ----------
    deviation : ndarray, shape (n,)
        With the covariance I + J P J'.
    jacobian : ndarray, shape (n, p)
        J.
    root : ndarray, shape (p, p)
        S, with the covariance P = S S' of the parameters given the blocks before.
    """

    deviation: Array
    jacobian: Array
    root: Array

    @property
    def covariance(self) -> Array:
        """P (p, p), of the parameters given the blocks before."""
        return np.asarray(self.root @ self.root.T)

    @cached_property
    def _growth_root(self) -> Array:
        """R (p, p), upper triangular, with R' R = I + S' J' J S."""
        # the larger rows first, which loses less
        rows = np.vstack([self.jacobian @ self.root, np.eye(len(self.root))])
        return np.asarray(np.linalg.qr(rows, mode="r"))

    @cached_property
    def updated_root(self) -> Array:
        """Root (p, p) of the covariance of the parameters once the block is known."""
        return np.asarray(solve_triangular(self._growth_root, self.root.T, trans="T").T)

    @property
    def updated_covariance(self) -> Array:
        """Covariance (p, p) of the parameters once the block is known."""
        return np.asarray(self.updated_root @ self.updated_root.T)

    @property
    def log_determinant(self) -> float:
        """Log-determinant of the covariance of the block, by the determinant lemma."""
        return 2.0 * float(np.log(np.abs(np.diag(self._growth_root))).sum())

    def weigh(self, values: Array) -> Array:
        """Return values (n,) times the inverse of the covariance of the block."""
        known = self.jacobian @ self.updated_root
        return np.asarray(values - known @ (known.T @ values))

    @property
    def log_density(self) -> float:
        """Logarithm of the density of the block, without a constant that all models share."""
        return -0.5 * (float(self.deviation @ self.weigh(self.deviation)) + self.log_determinant)


def paired_score(
    simpler: PairedInnovations, richer: PairedInnovations, blocks: Indices
) -> PairedScore:
    """Compare two fitted models on unseen data.

    Parameters
    ----------
    simpler, richer : PairedInnovations
        Of the same samples, in the same noise.
    blocks : ndarray of int, shape (m,)
        The block that every innovation belongs to, from zero on, in time.

    Returns
    -------
    PairedScore
    """
    pairs = list(zip(_predicted(simpler, blocks), _predicted(richer, blocks), strict=True))
    gains = np.array([b.log_density - a.log_density for a, b in pairs])
    mean, variance = np.array([_divergence(b, a) for a, b in pairs]).T
    expected = mean
    if not gains.sum() > 0.0:
        expected = -np.array([_divergence(a, b)[0] for a, b in pairs])
    least = float(np.sqrt(variance.sum()))
    error = float(np.linalg.norm(gains - expected))
    if len(gains) > 1:
        error = min(error, float(np.std(gains, ddof=1)) * len(gains) ** 0.5)
    return PairedScore(float(gains.sum()), max(least, error), float(mean.sum()), least)


def _predicted(model: PairedInnovations, blocks: Indices) -> Sequence[_Block]:
    """Return every block, given those before."""
    step = np.zeros(model.jacobian.shape[1])
    root = _root(model.covariance)
    predicted = []
    for k in range(int(blocks.max()) + 1):
        jacobian = model.jacobian[blocks == k]
        block = _Block(model.values[blocks == k] + jacobian @ step, jacobian, root)
        root = block.updated_root
        step = step - root @ (root.T @ (jacobian.T @ block.deviation))
        predicted.append(block)
    return predicted


def _root(covariance: Array) -> Array:
    """Return S (p, p) with S S' a covariance, whose parameters may differ by any power of ten."""
    sizes = np.sqrt(np.diag(covariance))
    scales = np.where(sizes > 0.0, sizes, 1.0)
    shares, directions = np.linalg.eigh(covariance / np.outer(scales, scales))
    return np.asarray(scales[:, np.newaxis] * directions * np.sqrt(np.maximum(shares, 0.0)))


def _divergence(true: _Block, other: _Block) -> tuple[float, float]:
    """Return mean and variance of the gain of the right model over another, in one block.

    The mean is the divergence of Kullback and Leibler of two Gaussian densities; C of the right one
    over C of the other differs from one by a matrix of low rank, U W U' with U the Jacobians of
    both.
    """
    between = other.deviation - true.deviation
    weighed = other.weigh(between)
    columns = np.hstack([other.jacobian, true.jacobian])
    across = other.updated_covariance @ other.jacobian.T @ true.jacobian @ true.covariance
    weights = np.block(
        [[-other.updated_covariance, -across], [np.zeros_like(across.T), true.covariance]]
    )
    excess = weights @ (columns.T @ columns)
    projected = true.jacobian.T @ weighed
    mean = np.trace(excess) + between @ weighed + other.log_determinant - true.log_determinant
    variance = (
        weighed @ weighed
        + projected @ true.covariance @ projected
        + 0.5 * np.trace(excess @ excess)
    )
    return 0.5 * float(mean), max(float(variance), 0.0)
