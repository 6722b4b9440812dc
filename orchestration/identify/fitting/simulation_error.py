"""Errors of a free run, pooled over outputs by the size of their noise (output-error method)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.metrics import rms
from orchestration.identify.noise import noise_std

_FINE = 1e-4  # of the spread of an output: least noise that it is weighted by


def error_scales(problem: Problem) -> dict[str, float]:
    """Return the size of the noise of every output, robustly from its third differences."""
    scales = {}
    for output, y in problem.measured.items():
        scales[output] = max(noise_std(y, 3), _FINE * float(np.nanstd(y))) or 1.0
    return scales


def pooled_error(residual: Signals, scales: Mapping[str, float]) -> float:
    """Return the root mean square error of all outputs, each over the size of its noise.

    Parameters
    ----------
    residual : Mapping of str to ndarray, shape (m,)
        By output.
    scales : Mapping of str to float
        See `error_scales`.
    """
    scaled = np.concatenate([residual[output] / scale for output, scale in scales.items()])
    return rms(scaled)


def error_at(problem: Problem, q: Array) -> float:
    """Return the pooled error at a point; infinite where the model cannot be simulated.

    Parameters
    ----------
    problem : Problem
    q : ndarray, shape (p,)
    """
    try:
        error = pooled_error(problem.evaluate(q)[0], error_scales(problem))
    except UserError:
        return np.inf
    return error if np.isfinite(error) else np.inf
