"""Errors of a model as it came, fitted by plain least squares, refitted and extended, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.validation.prediction import Prediction, predict
from orchestration.identify.prediction_error import FitResult

Errors = dict[str, dict[str, float]]  # by model and output


def errors_side_by_side(
    predictions: Sequence[Prediction], validation: ValidationData
) -> tuple[Errors, Errors]:
    """Normalised RMS errors of free runs, where was fitted and where nothing was.

    Parameters
    ----------
    predictions : sequence of Prediction
        Of the refitted model, which has its fit by plain least squares with it, and of those with one effect after the
        other, over the validation data.
    validation : ValidationData

    Returns
    -------
    estimation, validation : dict of str to dict of str to float
        By model - ``untouched``, ``least_squares``, ``refitted``, ``extended`` - and output. A model that cannot be
        simulated there, or was not made, is not among them.
    """
    base, fitted, judged = predictions[0].model, {}, {}
    least_squares = None if base.free_run is None else replace(base, fit=base.free_run)
    for name, model in (("untouched", _untouched(base)), ("least_squares", least_squares)):
        if model is None:
            continue
        fitted[name] = _fitted_errors(model)
        try:
            judged[name] = predict(validation, model).errors
        except UserError:  # it stands for estimation data alone
            continue
    made = {"refitted": predictions[0]} | (
        {"extended": predictions[-1]} if len(predictions) > 1 else {}
    )
    fitted |= {name: _fitted_errors(prediction.model) for name, prediction in made.items()}
    judged |= {name: prediction.errors for name, prediction in made.items()}
    return fitted, judged


def _fitted_errors(model: FittedCandidate) -> dict[str, float]:
    return {o: _normalised(e, _measured(model, o)) for o, e in model.fit.residual.items()}


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
