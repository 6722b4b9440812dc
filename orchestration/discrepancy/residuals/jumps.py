"""Sudden changes of a residual: level shifts where no input steps, excess variance where one does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f, norm

Array = NDArray[np.float64]
ALPHA = 1e-9  # probability of seeing any of it in noise; a slip that matters is far beyond
_FEW = 10  # samples with steps of an input that it takes to judge them
SETTLING_SAMPLES = 4  # samples after a step of an input in which no jump is seen


@dataclass(frozen=True)
class LevelShift:
    """A sudden change of the mean of a residual.

    Attributes
    ----------
    time : float
        Seconds.
    size : float
        In the unit of the residual.
    p_value : float
        Of so large a change anywhere in noise.
    """

    time: float
    size: float
    p_value: float


def level_shifts(residual: Array, time: Array, inputs: Mapping[str, Array]) -> list[LevelShift]:
    """Steps in a residual where no input steps.

    A sample is held against the one before it, unless a gap lies between; in noise their difference scatters as its own
    median tells.

    Parameters
    ----------
    residual, time : ndarray, shape (n,)
        Where something was measured.
    inputs : Mapping of str to ndarray, shape (n,)

    Returns
    -------
    list of LevelShift
        In order of time.
    """
    difference, apart = np.diff(residual), np.diff(time)
    near = apart < 1.5 * np.median(apart)
    spread = float(np.median(np.abs(difference[near] - np.median(difference[near])))) / float(norm.ppf(0.75))
    if spread == 0.0:
        return []
    # a record may show an input a sample early, and what a model makes of a step is least right just after it
    moved = (
        np.convolve(input_steps(inputs, len(time))[1:], np.ones(SETTLING_SAMPLES + 2), "full")[1 : len(difference) + 1]
        > 0.0
    )
    p = np.minimum(1.0, 2.0 * len(difference) * norm.sf(np.abs(difference) / spread))
    return [
        LevelShift(float(time[k + 1]), float(difference[k]), float(p[k]))
        for k in np.flatnonzero((p < ALPHA) & near & ~moved)
    ]


@dataclass(frozen=True)
class ExcessVariance:
    """Whether innovations are larger where an input steps than elsewhere.

    Attributes
    ----------
    ratio : float
        Of the two variances.
    p_value : float
        Of so large a ratio in noise, by an F test; 1 where there are too few steps to tell.
    """

    ratio: float
    p_value: float


def excess_variance_at_input_steps(
    innovation: Array, at: NDArray[np.intp], inputs: Mapping[str, Array]
) -> ExcessVariance:
    """Compare the variance of innovations where an input steps with that elsewhere.

    Parameters
    ----------
    innovation : ndarray, shape (k,)
    at : ndarray of int, shape (k,)
        The samples that they belong to.
    inputs : Mapping of str to ndarray, shape (n,)
    """
    there = input_steps(inputs, int(at.max(initial=-1)) + 1)[at]
    if min(there.sum(), (~there).sum()) < _FEW:
        return ExcessVariance(1.0, 1.0)
    ratio = float(np.mean(innovation[there] ** 2) / np.mean(innovation[~there] ** 2))
    return ExcessVariance(ratio, float(f.sf(ratio, there.sum(), (~there).sum())))


def input_steps(inputs: Mapping[str, Array], count: int) -> NDArray[np.bool_]:
    """Where any input differs from the sample before by more than a hundredth of its range; `count` without inputs."""
    moved = [np.abs(np.diff(u, prepend=u[:1])) > 0.01 * np.ptp(u) for u in inputs.values() if np.ptp(u) > 0.0]
    return np.any(moved, axis=0) if moved else np.zeros(count, dtype=bool)
