"""Regression of a residual on all regressors together, tested against noise of its own colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.residuals.correlation import SIGNIFICANCE
from orchestration.discrepancy.residuals.regressors import Regressor
from orchestration.identify import autoregression
from orchestration.identify.noise import Noise, estimate_noise
from orchestration.identify.uncertainty import parameter_covariance

_DRAWS = 40  # of noise, to see what a regression explains of it
_FEW_DRAWS = 8  # of a long record
_EFFORT = 200_000  # samples in all draws, beyond the fewest
_LEAD = 1000  # samples until drawn noise has forgotten its start
_COLOURED = 4  # passes of regression and of estimating the colour of its residual


@dataclass(frozen=True)
class ResidualRegression:
    """The part of a residual that all regressors together explain.

    Attributes
    ----------
    rms : float
        Of the part of the residual that the signals explain, in its unit.
    p_value : float
        Probability that they explain as much of noise.
    fitted : ndarray, shape (n,)
        That part, at every sample of the record.
    """

    rms: float
    p_value: float
    fitted: Array

    @property
    def significant(self) -> bool:
        """True if it is more than chance."""
        return self.p_value < SIGNIFICANCE


def regress(residual: Array, present: Mask, signals: Sequence[Regressor]) -> ResidualRegression:
    """Regress a residual on signals, their squares and cubes.

    Both are whitened by the colour of what the regression leaves unexplained: the colour of the
    residual itself would swallow what there is to explain. A regression also explains some of slow
    noise. So its score, the logarithm of the explained over the unexplained power of the
    innovations, is compared with scores of noise that is drawn with the colour of the residual.

    Parameters
    ----------
    residual : ndarray, shape (m,)
        At the samples that are present.
    present : ndarray of bool, shape (n,)
    signals : sequence of Regressor

    Returns
    -------
    ResidualRegression
    """
    columns = _powers([s.values for s in signals])
    n = residual.size
    if n < 5 * columns.shape[1] or not np.any(residual):
        return ResidualRegression(0.0, 1.0, np.zeros(present.size))
    rows = columns[present]
    score, weights = _regress_whitened(residual, rows, present)
    drawn = _scores_of_noise(estimate_noise(residual, present), rows, present)
    t_statistic = (score - float(np.mean(drawn))) / float(np.std(drawn, ddof=1))
    fitted = columns @ weights
    # of the residual itself, not of innovations, in which a wrong level hardly counts
    explained = float(np.mean(residual**2) - np.mean((residual - fitted[present]) ** 2))
    return ResidualRegression(
        rms=float(np.sqrt(max(explained, 0.0))),
        p_value=float(stdtr(len(drawn) - 1, -t_statistic)),
        fitted=fitted,
    )


def _scores_of_noise(noise: Noise, rows: Array, present: Mask) -> list[float]:
    """Draw noise of a colour some times and regress it; return the scores."""
    n = len(rows)
    random = np.random.default_rng(0)
    scores = []
    for _ in range(max(_FEW_DRAWS, min(_DRAWS, _EFFORT // n))):
        white = random.standard_normal(n + _LEAD)
        coloured = autoregression([1.0, *-noise.coefficients], white)[_LEAD:]
        scores.append(_regress_whitened(coloured, rows, present)[0])
    return scores


def _regress_whitened(residual: Array, rows: Array, present: Mask) -> tuple[float, Array]:
    """Regress a residual (m,) on rows (m, c), both whitened by the colour of what is unexplained.

    Returns
    -------
    score : float
        Logarithm of the explained over the unexplained power of the innovations.
    weights : ndarray, shape (c,)
    """
    weights = np.zeros(rows.shape[1])
    for _ in range(_COLOURED):
        noise = estimate_noise(residual - rows @ weights, present)
        white = noise.whiten(rows, present)
        innovation = noise.whiten(residual, present)
        weights = parameter_covariance(white.T @ white).matrix @ (white.T @ innovation)
    whole = float(innovation @ innovation)
    unexplained = float(((innovation - white @ weights) ** 2).sum())
    return float(np.log(max(whole - unexplained, 1e-300) / max(unexplained, 1e-300))), weights


def _powers(signals: Sequence[Array]) -> Array:
    """Return a constant, and signals of unit size to the powers one to three, as columns."""
    columns = [np.ones_like(signals[0])] if signals else []
    for values in signals:
        centred = (values - values.mean()) / values.std()
        columns += [centred, centred**2, centred**3]
    return np.column_stack(columns) if columns else np.empty((0, 0))
