"""Single samples far from their neighbours: they are told, and nothing else is judged by them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.discrepancy.residuals.innovations import local_level
from orchestration.discrepancy.residuals.jumps import SETTLING_SAMPLES
from orchestration.records.input_steps import input_steps

Array = NDArray[np.float64]
_FAR = 6.0  # standard deviations by which a sample leaves the middle between its neighbours
_OFTEN = 0.15  # of the steps of inputs, above which what is seen just after them is no outlier of a sensor
_ALONE = 1.3  # times as far as either of them does: a step leaves two samples behind alike, an outlier is twice as far


def outlying(residual: Array, inputs: Mapping[str, Array], step: float = 0.0) -> NDArray[np.bool_]:
    """Find samples far from the middle between their neighbours.

    Far is by the robust deviation there (Hampel's identifier). An outlier of a sensor is one sample long, and an
    autoregression that takes it for an innovation expects it to last.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    inputs : Mapping of str to ndarray, shape (n,)
        At the same samples.
    step : float
        Of the converter, whose rounding alone moves a sample by as much from the middle between its neighbours.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    aside = np.zeros(residual.size)
    aside[1:-1] = np.abs(residual[1:-1] - 0.5 * (residual[:-2] + residual[2:]))
    level = local_level(aside)
    spread = float(np.median(aside / level)) / float(norm.ppf(0.75)) if aside.size else 0.0
    if not spread > 0.0:
        return np.zeros(residual.size, dtype=bool)
    beside = np.maximum(np.roll(aside, 1), np.roll(aside, -1))
    far = (aside > _FAR * spread * level + step) & (aside > _ALONE * beside)
    steps = input_steps(inputs, residual.size)
    moved = np.convolve(steps, np.ones(SETTLING_SAMPLES), "full")[: residual.size] > 0.0
    # what happens again and again just after an input steps may be the model's doing
    return np.asarray(far & ~moved if (far & moved).sum() > _OFTEN * steps.sum() else far)


def without(residual: Array, where: NDArray[np.bool_]) -> Array:
    """The residual with some of its samples on straight lines between the others."""
    if not where.any() or where.all():
        return residual
    at = np.arange(residual.size)
    return np.asarray(np.where(where, np.interp(at, at[~where], residual[~where]), residual))
