"""Prediction of validation data by fitted models: errors, and outputs that are not predicted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.record import Trajectory
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset, ValidationData, white_noise
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.identify import rms
from orchestration.identify.fitting import ModelOverRuns, Problem, minimise
from orchestration.identify.noise import Noise
from orchestration.identify.uncertainty import parameter_covariance
from orchestration.records.runs import MeasuredRun, base_name, names_in

Errors = dict[str, dict[str, float]]  # by model and output
_BEYOND = 3.0  # times the error to expect, from which on an output is not predicted
_SINGLE = 0.02  # share of the samples, those farthest off, that are no course of a signal
_FEWEST = 20  # samples from which an error is estimated


@dataclass(frozen=True)
class Prediction:
    """A fitted model over the validation data.

    Attributes
    ----------
    model : FittedCandidate
    simulated : dict of str to ndarray, shape (n,)
        Outputs over the whole of the data, SI.
    sensitivities : dict of str to ndarray, shape (j, p)
        Their derivatives by the searched coordinates, at the samples that are judged.
    errors : dict of str to float
        Normalised RMS error of every output, where nothing was fitted.
    parameters : dict of str to float
        That it was simulated with, SI.
    """

    model: FittedCandidate
    simulated: dict[str, Array]
    sensitivities: dict[str, Array]
    errors: dict[str, float]
    parameters: dict[str, float]


def predict(validation: ValidationData, model: FittedCandidate) -> Prediction:
    """Simulate a fitted model over validation data.

    Raises
    ------
    UserError
        If the simulation fails.
    """
    problem = model.problem
    data = validation.data
    values = validation_parameters(validation, model)
    ran = _simulated(problem, data, values)
    slopes = np.array(
        [scale.slope(q) for scale, q in zip(problem.scales, model.fit.q, strict=True)]
    )
    simulated = _outputs(ran, data)
    sensitivities = {o: ran.sensitivities[o][validation.judged] * slopes for o in simulated}
    return Prediction(model, simulated, sensitivities, validation.nrmse(simulated), values)


def simulated_outputs(validation: ValidationData, model: FittedCandidate) -> dict[str, Array]:
    """Simulate a fitted model over validation data for its outputs (n,) alone; see `predict`."""
    data = validation.data
    values = validation_parameters(validation, model)
    return _outputs(_simulated(model.problem, data, values), data)


def _simulated(problem: Problem, data: Dataset, values: Mapping[str, float]) -> Trajectory:
    """Simulate as accurately as an FMU is; where a bend is too sharp for that, as it was fitted."""
    try:
        return problem.model.run(data.time, data.inputs, values, runs=data.runs)
    except UserError:
        coarse = problem.tolerance
        return problem.model.run(data.time, data.inputs, values, runs=data.runs, tolerance=coarse)


def _outputs(ran: Trajectory, data: Dataset) -> dict[str, Array]:
    """Return the measured outputs of a simulation."""
    # copies, as a column of all signals and derivatives would keep all of them in memory
    return {o: ran.signals[o].copy() for o in data.measured}


def validation_parameters(validation: ValidationData, model: FittedCandidate) -> dict[str, float]:
    """Return the parameters with which a fitted model is simulated over validation data, SI.

    Where these are records of their own, start values of states, and parameters that differ from
    record to record, are estimated anew on the samples before those that are judged.
    """
    values = model.parameters
    own = _own_of_each_record(model)
    if validation.continued or not own:
        return values
    return values | _estimate_own_values(validation.run_in, model, own, values)


def _estimate_own_values(
    run_in: Dataset, model: FittedCandidate, own: Sequence[str], values: Mapping[str, float]
) -> dict[str, float]:
    """Fit each record's own parameters to its run-in, all others held at the given values."""
    problem = Problem(
        model.candidate.cls,
        run_in.time,
        run_in.inputs,
        run_in.measured,
        names_in(run_in.runs, own, own),
        values,
        linear=run_in.linear or (),
        runs=run_in.several,
    )
    if not problem.measured:  # all of a run-in may be missing
        return {}
    noise = model.fit.noise

    def whitened(parts: Mapping[str, Array]) -> Array:
        pieces = [noise[o].whiten_from_rest(part, problem.present[o]) for o, part in parts.items()]
        return np.concatenate(pieces)

    low, high = problem.bounds()
    best = minimise(
        lambda q: whitened(problem.evaluate(q)[0]),
        lambda q: whitened(problem.evaluate(q)[1]),
        problem.position(problem.start),
        low,
        high,
    )
    return problem.values(best.q)


def _own_of_each_record(model: FittedCandidate) -> list[str]:
    """Return the parameters of which every record has its own value, start values first."""
    layout = model.candidate.cls.layout
    starts = [layout.start_of[state.name] for state in layout.states]
    differing = [base_name(n) for n in model.problem.names if base_name(n) != n]
    return list(dict.fromkeys([*starts, *differing]))


def judged_innovations(
    validation: ValidationData, prediction: Prediction, noise: Mapping[str, Noise]
) -> tuple[Array, Array]:
    """Return the innovations of a prediction where nothing was fitted, and their Jacobian.

    In a record of its own, start values of states do not count: they were estimated on its first
    samples.

    Parameters
    ----------
    validation : ValidationData
    prediction : Prediction
    noise : Mapping of str to Noise
        By output.

    Returns
    -------
    innovations : ndarray, shape (m,)
        Of all outputs, one after the other.
    jacobian : ndarray, shape (m, p)
    """
    problem = prediction.model.problem
    counted = np.array(
        [validation.continued or not problem.declared[n].starts for n in problem.names]
    )
    residuals = []
    slopes = []
    for output, y in validation.data.measured.items():
        present = np.isfinite(y) & validation.judged
        residual = (y - prediction.simulated[output])[present]
        slope = -prediction.sensitivities[output][present[validation.judged]] * counted
        residuals.append(noise[output].whiten(residual, present))
        slopes.append(noise[output].whiten(slope, present))
    return np.concatenate(residuals), np.concatenate(slopes)


def model_errors(
    predictions: Sequence[Prediction], validation: ValidationData
) -> tuple[Errors, Errors]:
    """Return the normalised RMS errors of free runs, where was fitted and where nothing was.

    Parameters
    ----------
    predictions : sequence of Prediction
        Of the refitted model, which has its fit by plain least squares with it, and of those with
        one effect after the other, over the validation data.
    validation : ValidationData

    Returns
    -------
    estimation, validation : dict of str to dict of str to float
        By model - ``untouched``, ``least_squares``, ``refitted``, ``extended`` - and output. A
        model that cannot be simulated there, or was not made, is not among them.
    """
    base = predictions[0].model
    fitted: Errors = {}
    judged: Errors = {}
    least_squares = None if base.free_run is None else replace(base, fit=base.free_run)
    for name, model in (("untouched", _untouched(base)), ("least_squares", least_squares)):
        if model is None:
            continue
        fitted[name] = _fitted_errors(model)
        try:
            judged[name] = validation.nrmse(simulated_outputs(validation, model))
        except UserError:  # it stands for estimation data alone
            continue
    predicted = {"refitted": predictions[0]}
    if len(predictions) > 1:
        predicted["extended"] = predictions[-1]
    fitted |= {name: _fitted_errors(prediction.model) for name, prediction in predicted.items()}
    judged |= {name: prediction.errors for name, prediction in predicted.items()}
    return fitted, judged


def _untouched(base: FittedCandidate) -> FittedCandidate | None:
    """Return the model with its start values, if it can be simulated with them."""
    problem = base.problem
    q = problem.position(problem.start)
    try:
        residual = problem.evaluate(q)[0]
    except UserError:
        return None
    problem.forget_simulation()
    return replace(
        base, fit=replace(base.fit, q=q, values=problem.values(q), residual=dict(residual))
    )


def _fitted_errors(model: FittedCandidate) -> dict[str, float]:
    """Return the error of every output over its spread, on the data that were fitted to."""
    errors = {}
    for output, residual in model.fit.residual.items():
        measured = model.problem.measured[output][model.problem.present[output]]
        spread = float(np.linalg.norm(measured - measured.mean()))
        errors[output] = float(np.linalg.norm(residual)) / spread if spread > 0.0 else float("nan")
    return errors


def unpredicted_output_notes(validation: ValidationData, prediction: Prediction) -> list[Note]:
    """Return a note on the outputs that a model does not predict where nothing was fitted.

    An output is not predicted where its error is several times the error to expect: that of the fit
    together with what the estimates leave open (Ljung: System Identification, section 9.4). Noise
    may be of another level there, which is no fault of the model.

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
    by_output = _unpredicted_runs(validation, prediction)
    errors = {output: max(ratios.values()) for output, ratios in by_output.items()}
    if not errors:
        return []
    if validation.continued:
        return [Note(NoteCode.END_NOT_FOLLOWED, "", {"errors": errors})]
    labels = {label for ratios in by_output.values() for label in ratios}
    records = tuple(run.label for run in validation.data.runs if run.label and run.label in labels)
    return [Note(NoteCode.NOT_FOLLOWED, "", {"errors": errors, "records": records})]


def _unpredicted_runs(
    validation: ValidationData, prediction: Prediction
) -> dict[str, dict[str, float]]:
    """Return the outputs that are not predicted: by run, the error over the error to expect."""
    data = validation.data
    residual = prediction.model.fit.residual
    sizes = {o: rms(_without_largest(e)) for o, e in residual.items() if o in data.measured}
    sizes = {o: size for o, size in sizes.items() if size > 0.0}
    beyond: dict[str, dict[str, float]] = {o: {} for o in sizes}
    for run in data.runs if sizes else ():
        for output, ratio in _ratios_to_expected(validation, prediction, run, sizes).items():
            if ratio > _BEYOND:
                beyond[output][run.label] = ratio
    return {output: ratios for output, ratios in beyond.items() if ratios}


def _ratios_to_expected(
    validation: ValidationData,
    prediction: Prediction,
    run: MeasuredRun,
    sizes: Mapping[str, float],
) -> dict[str, float]:
    """Return the error of every output in a run, over the error to expect there.

    Parameters
    ----------
    validation : ValidationData
    prediction : Prediction
    run : MeasuredRun
    sizes : Mapping of str to float
        RMS of the residual of the fit, by output.
    """
    slopes_in_run = _judged_slopes(validation, prediction, run)
    variance = _variance_of_estimates(validation, prediction, run, sizes)
    fitted = prediction.model.fit.residual
    ratios = {}
    judged = validation.judged[run.samples]
    for output, size in sizes.items():
        measured = validation.data.measured[output][run.samples][judged]
        present = np.isfinite(measured)
        if present.sum() < _FEWEST:
            continue
        simulated = prediction.simulated[output][run.samples][judged][present]
        slopes = slopes_in_run[output][present]
        errors = measured[present] - simulated
        modelled = np.column_stack([simulated, slopes])
        expected = size * _noise_growth(errors, modelled, fitted[output])
        uncertain = float(np.sqrt(variance[output][present].mean()))
        ratios[output] = rms(_without_largest(errors)) / float(np.hypot(expected, uncertain))
    return ratios


def _judged_slopes(
    validation: ValidationData, prediction: Prediction, run: MeasuredRun
) -> dict[str, Array]:
    """Return the derivatives (j, p) of outputs at the samples of a run that are judged."""
    inside = np.zeros(len(validation.judged), dtype=bool)
    inside[run.samples] = True
    return {o: s[inside[validation.judged]] for o, s in prediction.sensitivities.items()}


def _without_largest(errors: Array) -> Array:
    """Return the moduli of errors without the few that are farthest from zero."""
    return np.sort(np.abs(errors))[: len(errors) - int(_SINGLE * len(errors))]


def _noise_growth(errors: Array, modelled: Array, fitted: Array) -> float:
    """Return how much higher the level of the noise is than where was fitted, at least 1.

    Of two figures the lower one: what changes from sample to sample, which all of it may be under
    an input that does; and what neither the model's output nor any of its derivatives goes along
    with.

    Parameters
    ----------
    errors : ndarray, shape (m,)
        Of the prediction.
    modelled : ndarray, shape (m, 1 + p)
        The output and its derivatives.
    fitted : ndarray, shape (k,)
        Residual of the fit.
    """
    usual = white_noise(fitted)
    by_course = white_noise(errors) / usual if usual > 0.0 else np.inf
    columns = modelled / np.maximum(np.abs(modelled).max(axis=0), np.finfo(float).tiny)
    unmodelled = errors - columns @ np.linalg.lstsq(columns, errors)[0]
    by_model = rms(_without_largest(unmodelled)) / rms(_without_largest(fitted))
    return max(1.0, min(by_course, by_model))


def _variance_of_estimates(
    validation: ValidationData, prediction: Prediction, run: MeasuredRun, sizes: Mapping[str, float]
) -> dict[str, Array]:
    """Return the variance (j,) of outputs in a run that uncertain estimates make, by output.

    It is at the samples that are judged.

    A record's own values were estimated on its first samples, given the shared parameters: an error
    of these comes with an error of the own values, which makes up for it there.

    Parameters
    ----------
    validation : ValidationData
    prediction : Prediction
    run : MeasuredRun
    sizes : Mapping of str to float
        RMS of the residual of the fit, by output.
    """
    model = prediction.model
    covariance = model.fit.covariance.matrix
    if validation.continued:
        slopes_in_run = _judged_slopes(validation, prediction, run)
        return {o: _variance(slopes_in_run[o], covariance) for o in sizes}
    slopes = _slopes_in_run(validation.data, prediction, run, list(sizes))
    judged = validation.judged[run.samples]
    before = {o: ~judged & np.isfinite(validation.data.measured[o][run.samples]) for o in sizes}
    own = np.vstack([slopes.by_own[o][before[o]] / size for o, size in sizes.items()])
    common = np.vstack([slopes.by_shared[o][before[o]] / size for o, size in sizes.items()])
    own_covariance = parameter_covariance(own.T @ own).matrix
    along = own_covariance @ own.T @ common
    shared = [model.problem.names.index(n) for n in slopes.shared]
    shared_covariance = covariance[np.ix_(shared, shared)]
    return {
        o: _variance((slopes.by_shared[o] - slopes.by_own[o] @ along)[judged], shared_covariance)
        + _variance(slopes.by_own[o][judged], own_covariance)
        for o in sizes
    }


@dataclass(frozen=True)
class _Slopes:
    """Derivatives of outputs in one run, by parameters of all records and by its own.

    Attributes
    ----------
    shared : list of str
        Searched parameters that all records share.
    by_shared : dict of str to ndarray, shape (m, s)
        By their searched coordinates.
    by_own : dict of str to ndarray, shape (m, o)
        By the values that the run has for itself.
    """

    shared: list[str]
    by_shared: dict[str, Array]
    by_own: dict[str, Array]


def _slopes_in_run(
    data: Dataset, prediction: Prediction, run: MeasuredRun, outputs: Sequence[str]
) -> _Slopes:
    """Simulate a run with derivatives by all parameters, searched or its own."""
    model = prediction.model
    problem = model.problem
    own = _own_of_each_record(model)
    bases = dict.fromkeys(map(base_name, problem.names))
    names = names_in([run], dict.fromkeys([*bases, *own]), own)
    runs = ModelOverRuns(model.candidate.cls, names, data.linear or (), [run], outputs)
    inputs = {n: values[run.samples] for n, values in data.inputs.items()}
    values = run.values(prediction.parameters)
    ran = runs.run(data.time[run.samples], inputs, values, tolerance=problem.tolerance)
    shared = [n for n in problem.names if n in names and base_name(n) not in own]
    at = [problem.names.index(n) for n in shared]
    by = np.array([problem.scales[i].slope(model.fit.q[i]) for i in at])
    shared_columns = [names.index(n) for n in shared]
    own_columns = [k for k, n in enumerate(names) if base_name(n) in own]
    return _Slopes(
        shared,
        {o: ran.sensitivities[o][:, shared_columns] * by for o in outputs},
        {o: ran.sensitivities[o][:, own_columns] for o in outputs},
    )


def _variance(slopes: Array, covariance: Array) -> Array:
    return np.einsum("ki,ij,kj->k", slopes, covariance, slopes).clip(0.0)
