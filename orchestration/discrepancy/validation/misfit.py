"""How much surer of its parameters a fit is than a model deserves that has not quite the form of the truth.

What such a model leaves is no noise: it comes back wherever the record does the same. How far single stretches of the
record pull the parameters tells how far another record would (`identify.covariance.clustered`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.residuals.analysis import ResidualAnalysis
from orchestration.discrepancy.selection.stepwise import Selection
from orchestration.identify.covariance import clustered, covariance
from orchestration.identify.simulation_error import error_scales

Array = NDArray[np.float64]
_STRETCHES = 12


def misfit_spread(model: FittedCandidate) -> Array:
    """Standard deviation of the searched coordinates beside that of the fit, shape (p,).

    Parameters
    ----------
    model : FittedCandidate
        That leaves structure.
    """
    problem, fit = model.problem, model.fit
    errors, slopes = problem.evaluate(fit.q)
    scales = error_scales(problem)
    jacobian = np.vstack([slopes[o] / scales[o] for o in errors])
    residual = np.concatenate([errors[o] / scales[o] for o in errors])
    samples = np.concatenate([np.flatnonzero(problem.present[o]) for o in errors])
    stretches = samples * _STRETCHES // (int(samples.max()) + 1)
    found = clustered(
        covariance(jacobian.T @ jacobian, fit.prior_precision), jacobian, residual, stretches
    )
    beyond = np.diag(found.matrix) - np.diag(fit.covariance.matrix)
    return np.asarray(np.sqrt(np.maximum(beyond, 0.0)))


def spread_beside(
    model: FittedCandidate,
    known: Iterable[Array],
    selection: Selection,
    residuals: Mapping[str, ResidualAnalysis],
) -> Array:
    """Deviation of the searched coordinates beside that of the fit, from all that it cannot know of, shape (p,).

    Parameters
    ----------
    model : FittedCandidate
    known : iterable of ndarray, shape (p,)
        For what is known of inputs.
    selection : Selection
        Where it names nothing, a model that leaves structure is what is wrong, and there is nothing to be sure of.
    residuals : Mapping of str to ResidualAnalysis
    """
    amiss = bool(selection.steps) and any(analysis.structure for analysis in residuals.values())
    return np.asarray(np.linalg.norm([*known, *([misfit_spread(model)] if amiss else [])], axis=0))
