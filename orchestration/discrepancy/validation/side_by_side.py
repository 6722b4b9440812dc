"""Errors of a model as it came, fitted by plain least squares, refitted and extended, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.validation.prediction import predict
from orchestration.identify.prediction_error import FitResult

Errors = dict[str, dict[str, float]]  # by model and output


def errors_side_by_side(
    base: FittedCandidate, extended: FittedCandidate, validation: ValidationData
) -> tuple[Errors, Errors]:
    """Normalised RMS errors of free runs, where was fitted and where nothing was.

    Parameters
    ----------
    base : FittedCandidate
        Refitted, with its fit by plain least squares.
    extended : FittedCandidate
        The same one if nothing was added.
    validation : ValidationData

    Returns
    -------
    estimation, validation : dict of str to dict of str to float
        By model - ``untouched``, ``least_squares``, ``refitted``, ``extended`` - and output. A model that cannot be
        simulated there, or was not made, is not among them.
    """
    models = {"untouched": _untouched(base), "refitted": base}
    if base.free_run is not None:
        models["least_squares"] = replace(base, fit=base.free_run)
    if extended is not base:
        models["extended"] = extended
    fitted, judged = {}, {}
    for name in ("untouched", "least_squares", "refitted", "extended"):
        if (model := models.get(name)) is None:
            continue
        fitted[name] = {o: _normalised(e, _measured(model, o)) for o, e in model.fit.residual.items()}
        try:
            judged[name] = predict(validation, model).errors
        except UserError:  # it stands for estimation data alone
            continue
    return fitted, judged


def _untouched(base: FittedCandidate) -> FittedCandidate | None:
    problem = base.problem
    q = problem.position(problem.start)
    try:
        residual: Mapping[str, NDArray[np.float64]] = problem.evaluate(q)[0]
    except UserError:
        return None
    fit: FitResult = replace(base.fit, q=q, values=problem.values(q), residual=dict(residual))
    return replace(base, fit=fit)


def _measured(model: FittedCandidate, output: str) -> NDArray[np.float64]:
    return np.asarray(model.problem.measured[output][model.problem.present[output]])


def _normalised(residual: NDArray[np.float64], measured: NDArray[np.float64]) -> float:
    spread = float(np.linalg.norm(measured - measured.mean()))
    return float(np.linalg.norm(residual)) / spread if spread > 0.0 else float("nan")
