"""What a fitted model predicts of the validation data: that is what it is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.identify.least_squares import minimise
from orchestration.identify.noise.model import Noise
from orchestration.identify.problem import Problem
from orchestration.records.joined import base_name, names_in

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """A fitted model over the validation data.

    Attributes
    ----------
    model : FittedCandidate
    simulated : dict of str to ndarray, shape (n,)
        Outputs over the whole of the data, SI.
    sensitivities : dict of str to ndarray, shape (n, p)
        Their derivatives by the searched coordinates.
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


def parameters_on(validation: ValidationData, model: FittedCandidate) -> dict[str, float]:
    """Parameters with which a fitted model is simulated over validation data, start values included, SI.

    In records of their own, what is each record's own is estimated on the samples before those that are judged: where
    states start, and parameters that differ from record to record.
    """
    values = model.problem.start | model.fit.values
    if validation.continued:
        return values
    before, own = validation.run_in, own_of_each(model)
    if not own:
        return values
    problem = Problem(
        model.candidate.cls,
        before.time,
        before.inputs,
        before.measured,
        names_in(before.runs, own, own),
        values,
        before.linear or (),
        runs=before.several,
    )
    low, high = problem.bounds()

    def weighted(which: int, q: Array) -> Array:
        parts = problem.evaluate(q)[which]
        return np.concatenate(
            [model.fit.noise[o].from_rest(parts[o], problem.present[o]) for o in parts]
        )

    best = minimise(
        lambda q: weighted(0, q),
        lambda q: weighted(1, q),
        problem.position(problem.start),
        low,
        high,
    )
    return values | problem.values(best.q)


def own_of_each(model: FittedCandidate) -> list[str]:
    """Parameters of a fitted model that every record has for itself: where states start, and what else is asked to."""
    layout = model.candidate.cls.layout
    starts = [layout.start_of[state.name] for state in layout.states]
    return [
        *dict.fromkeys([*starts, *(base_name(n) for n in model.problem.names if base_name(n) != n)])
    ]


def predict(validation: ValidationData, model: FittedCandidate) -> Prediction:
    """Simulate a fitted model over validation data.

    Raises
    ------
    UserError
        If the simulation fails.
    """
    problem, data = model.problem, validation.data
    values = parameters_on(validation, model)
    ran = problem.model.run(data.time, data.inputs, values, runs=data.runs)
    by = np.array([scale.slope(q) for scale, q in zip(problem.scales, model.fit.q, strict=True)])
    signals = {o: ran.signals[o] for o in data.measured}
    slopes = {o: ran.sensitivities[o] * by for o in signals}
    return Prediction(model, signals, slopes, validation.nrmse(signals), values)


def judged_innovations(
    validation: ValidationData, prediction: Prediction, noise: Mapping[str, Noise]
) -> tuple[Array, Array]:
    """Innovations (m,) of a prediction in noise that is given, where nothing was fitted, and their Jacobian (m, p).

    In a record of its own nothing hangs on where the states start, which was estimated on its first samples.
    """
    residuals, slopes = [], []
    declared = prediction.model.problem.declared
    granted = np.array(
        [validation.continued or not declared[n].starts for n in prediction.model.problem.names]
    )
    for output, y in validation.data.measured.items():
        present = np.isfinite(y) & validation.judged
        residuals.append(noise[output].whiten((y - prediction.simulated[output])[present], present))
        slopes.append(
            noise[output].whiten(-prediction.sensitivities[output][present] * granted, present)
        )
    return np.concatenate(residuals), np.concatenate(slopes)
