"""How far off models are: all of them beside each other, and the best one in each of several records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.validation.prediction import predict
from orchestration.identify.metrics import normalised_rms, number

_MODELS = {
    "untouched": "untouched",
    "least_squares": "least squares",
    "refitted": "refitted",
    "extended": "extended",
}


@dataclass(frozen=True)
class RunError:
    """Errors of the best model in one record.

    Attributes
    ----------
    label : str
    held_out : bool
    samples : int
    nrmse : dict of str to float
        Normalised RMS error of every output; of a record held out, where it is judged.
    """

    label: str
    held_out: bool
    samples: int
    nrmse: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        errors = {output: number(error) for output, error in self.nrmse.items()}
        return {
            "record": self.label,
            "held_out": self.held_out,
            "samples": self.samples,
            "nrmse": errors,
        }


def run_errors(result: Result) -> list[RunError]:
    """Errors by record, in the order in which they were given; none where there is one record only."""
    diagnosis, best = result.diagnosis, result.diagnosis.selection.best
    estimation, validation = diagnosis.estimation, diagnosis.validation
    if not (estimation.several or validation.data.several):
        return []
    simulated = result.gain.extended if result.gain else predict(validation, best).simulated
    errors = []
    for run in estimation.runs:
        nrmse = {}
        for output, e in best.fit.residual.items():
            residual, y = (
                np.full(len(estimation.time), np.nan),
                estimation.measured[output][run.samples],
            )
            residual[best.problem.present[output]] = e
            nrmse[output] = normalised_rms(y, y - np.where(np.isnan(y), 0.0, residual[run.samples]))
        errors.append(RunError(run.label or result.files, False, run.last - run.first, nrmse))
    for run in validation.data.runs:
        nrmse = validation.nrmse(simulated, run.samples)
        errors.append(RunError(run.label, not validation.continued, run.last - run.first, nrmse))
    return errors


def error_rows(diagnosis: Diagnosis) -> tuple[list[str], list[list[str]]]:
    """Head and rows of a table: normalised RMS errors of free runs, a row for every output and part of the data."""
    models = [name for name in _MODELS if name in diagnosis.fitted_errors]
    rows = []
    for where, errors in (
        ("fitted", diagnosis.fitted_errors),
        ("held out", diagnosis.judged_errors),
    ):
        for output in next(iter(errors.values()), {}):
            figures = [f"{errors[name][output]:.4g}" if name in errors else "" for name in models]
            rows.append([output, where, *figures])
    return ["output", "where", *(_MODELS[name] for name in models)], rows
