"""Whether a model follows what was held out as closely as what it was fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.data.intersample import white_noise
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.validation.prediction import Prediction, own_of_each
from orchestration.identify.covariance import covariance
from orchestration.identify.metrics import rms
from orchestration.identify.problem import ModelOverRuns
from orchestration.records.joined import Run, base_name, names_in

Array = NDArray[np.float64]
_BEYOND = 3.0  # times the error to expect, from which on it is not followed
_SINGLE = 0.02  # share of the samples, those farthest off, that are no course of a signal
_FEWEST = 20  # samples that tell an error


def not_followed(validation: ValidationData, prediction: Prediction) -> list[Note]:
    """Tell which outputs a model does not follow where nothing was fitted.

    The error to expect is that of the fit together with what the estimates leave open (Ljung: System Identification,
    section 9.4). Noise may be of another level there, which is no fault of the model.

    Parameters
    ----------
    validation : ValidationData
    prediction : Prediction
        Of the best model.

    Returns
    -------
    list of Note
        One if there are any, with the largest ratio of every such output to what is expected of it.

    Raises
    ------
    UserError
        If the simulation fails.
    """
    data, model = validation.data, prediction.model
    residual = {o: e for o, e in model.fit.residual.items() if o in data.measured and e.any()}
    left = {o: rms(_without_single(e)) for o, e in residual.items()}
    ratios: dict[str, dict[str, float]] = {o: {} for o in left}
    for run in data.runs:
        uncertain = _open(validation, prediction, run, left)
        for output, size in left.items():
            there = validation.judged[run.samples] & np.isfinite(data.measured[output][run.samples])
            if there.sum() < _FEWEST:
                continue
            measured, simulated, slopes = (
                signals[output][run.samples][there]
                for signals in (data.measured, prediction.simulated, prediction.sensitivities)
            )
            misses = measured - simulated
            expected = size * _grown(misses, np.column_stack([simulated, slopes]), residual[output])
            open_left = float(np.sqrt(uncertain[output][there].mean()))
            ratios[output][run.label] = rms(_without_single(misses)) / float(
                np.hypot(expected, open_left)
            )
    beyond = {
        o: {label: r for label, r in by_run.items() if r > _BEYOND} for o, by_run in ratios.items()
    }
    astray = {o: max(by_run.values()) for o, by_run in beyond.items() if by_run}
    if not astray:
        return []
    if validation.continued:
        return [Note(NoteCode.END_NOT_FOLLOWED, "", {"errors": astray})]
    records = tuple(
        run.label for run in data.runs if run.label and any(run.label in b for b in beyond.values())
    )
    return [Note(NoteCode.NOT_FOLLOWED, "", {"errors": astray, "records": records})]


def _without_single(errors: Array) -> Array:
    """Errors without the few that are farthest from zero."""
    return np.sort(np.abs(errors))[: len(errors) - int(_SINGLE * len(errors))]


def _grown(misses: Array, modelled: Array, fitted: Array) -> float:
    """How much higher the level of the noise is than where was fitted, at least 1.

    Of two figures the lower one: what changes from sample to sample, which all of it may be under an input that does;
    and what neither the model's output nor any of its derivatives goes along with.
    """
    usual = white_noise(fitted)
    by_course = white_noise(misses) / usual if usual > 0.0 else np.inf
    columns = modelled / np.maximum(np.abs(modelled).max(axis=0), np.finfo(float).tiny)
    alone = misses - columns @ np.linalg.lstsq(columns, misses)[0]
    return max(1.0, min(by_course, rms(_without_single(alone)) / rms(_without_single(fitted))))


def _open(
    validation: ValidationData, prediction: Prediction, run: Run, left: dict[str, float]
) -> dict[str, Array]:
    """Variance (m,) of what is simulated in a run, as far as the parameters are uncertain, by output.

    What a record of its own has for itself was estimated on its first samples, by whatever the others are: along with
    an error of these goes one of that, which makes up for it there.
    """
    model, data = prediction.model, validation.data
    spread = model.fit.covariance.matrix
    if validation.continued:
        slopes = {o: prediction.sensitivities[o][run.samples] for o in left}
        return {o: _variance(j, spread) for o, j in slopes.items()}
    own, bases = own_of_each(model), list(dict.fromkeys(map(base_name, model.problem.names)))
    names = names_in([run], dict.fromkeys([*bases, *own]), own)
    runs = ModelOverRuns(model.candidate.cls, names, data.linear or (), [run])
    fed = {n: values[run.samples] for n, values in data.inputs.items()}
    ran = runs.run(data.time[run.samples], fed, run.values(prediction.parameters))
    shared = [n for n in model.problem.names if n in names and base_name(n) not in own]
    at = [model.problem.names.index(n) for n in shared]
    by = np.array([model.problem.scales[i].slope(model.fit.q[i]) for i in at])
    columns = (
        [names.index(n) for n in shared],
        [k for k, n in enumerate(names) if base_name(n) in own],
    )
    common = {o: ran.sensitivities[o][:, columns[0]] * by for o in left}
    single = {o: ran.sensitivities[o][:, columns[1]] for o in left}
    before = {
        o: ~validation.judged[run.samples] & np.isfinite(data.measured[o][run.samples])
        for o in left
    }
    s, j = (
        np.vstack([m[o][before[o]] / size for o, size in left.items()]) for m in (single, common)
    )
    known = covariance(s.T @ s).matrix
    along = known @ s.T @ j
    return {
        o: _variance(common[o] - single[o] @ along, spread[np.ix_(at, at)])
        + _variance(single[o], known)
        for o in left
    }


def _variance(slopes: Array, spread: Array) -> Array:
    return np.einsum("ki,ij,kj->k", slopes, spread, slopes).clip(0.0)
