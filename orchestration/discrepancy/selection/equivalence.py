"""Equivalence of extended models: effects with which a model answers any input alike are one cause.

Two lags in series are two in parallel with other amounts, and a lag of a current is one of the
charge that has passed. No experiment tells such effects apart, so that neither is an alternative to
the other: they are one model in other parameters (Ljung: System Identification, section 4.5).
Whether two are is tried under an input that neither was fitted to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit import Effect
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.experiment.waveforms import multilevel
from orchestration.identify.fitting import Method, error_at, fit_in_noise
from orchestration.identify.noise import white_noise
from orchestration.records.runs import base_name

# of the power that an effect adds to the answer, in which equivalent models may differ
_ALIKE = 1e-3
# the same of a law and an input, which takes no credit for what a law explains about as well: no
# effect has quite the form of the truth, by a tenth of its amplitude
_ABOUT = 1e-2
_LEVELS = 25  # of every input, over what it was in the record
_STAYS = (1 / 600.0, 1 / 150.0, 1 / 40.0, 1 / 10.0)  # of the trial, rising from part to part
_SAMPLES = 1500  # of the trial at most
# of a fit to an answer: where two are equivalent it could go on until nothing but rounding is left
_EFFORT = Method(passes=1, trials=40, restarts=0)


def is_of_input(effect: type[Effect]) -> bool:
    """Return whether an effect changes an input, and no law."""
    return bool(effect.term.signal) and not effect.term.law


def as_another(
    search: Search, one: FittedCandidate, other: FittedCandidate, below: FittedCandidate
) -> dict[str, float] | None:
    """Return the parameters with which a model answers as another does.

    Either is simulated under an input that neither was fitted to, and the other one is fitted to
    its answer. They are equivalent where that leaves next to nothing of what either has more than
    the model below.

    Parameters
    ----------
    search : Search
        In which they were fitted.
    one, other : FittedCandidate
        Each with one effect more than the model below.
    below : FittedCandidate

    Returns
    -------
    dict of str to float or None
        Values of the first model by name, SI; None where the two are not equivalent.
    """
    is_same_kind = is_of_input(one.effect) is is_of_input(other.effect)
    most = _ALIKE if is_same_kind else _ABOUT
    values, left = _reproducing(search, one, other, below)
    if left < most and _reproducing(search, other, one, below)[1] < most:
        return values
    return None


def _reproducing(
    search: Search, fitted: FittedCandidate, truth: FittedCandidate, below: FittedCandidate
) -> tuple[dict[str, float], float]:
    """Return the parameters with which a model answers as a true one, as far as it can.

    Returns
    -------
    values : dict of str to float
    left : float
        Of the power of the answer that the model below cannot give, what this one cannot; infinite
        where one of them cannot be simulated.
    """
    try:
        trial = replace(search, data=_answer(search, truth))
        values, left = _fitted_to(trial, fitted)
        _, without = _fitted_to(trial, below)
    except FAILURES:
        return {}, np.inf
    return values, left**2 / without**2 if without else np.inf


def _answer(search: Search, truth: FittedCandidate) -> Dataset:
    """Return the answer of a model to a trial input, as if it had been measured."""
    data = search.data
    run = data.runs[0]
    step = float(np.median(np.diff(data.time)))
    time: Array = step * np.arange(float(min(run.last - run.first, _SAMPLES)))
    inputs = {
        name: _levels(time, values[run.samples], seed)
        for seed, (name, values) in enumerate(data.inputs.items())
    }
    values = truth.problem.start | run.values(truth.fit.values)
    simulated = truth.problem.model.run(time, inputs, values, truth.problem.effort)
    measured = {output: simulated.signals[output] for output in truth.problem.measured}
    return Dataset(time, inputs, measured, data.linear)


def _levels(time: Array, values: Array, seed: int) -> Array:
    """Return random levels over the range of an input, with ever longer stays."""
    low, high = float(values.min()), float(values.max())
    if not low < high:
        return np.full(time.size, low)
    levels = np.linspace(low, high, _LEVELS).tolist()
    parts = []
    for number, part in enumerate(np.array_split(time, len(_STAYS))):
        stay = max(_STAYS[number] * float(time[-1]), float(time[1]))
        parts.append(multilevel(part, levels, (stay, 3.0 * stay), (seed, number)))
    return np.concatenate(parts)


def _fitted_to(trial: Search, fitted: FittedCandidate) -> tuple[dict[str, float], float]:
    """Fit a model to an answer from where it stands; return its values, and the error it leaves."""
    run = fitted.problem.runs[0]
    names = list(dict.fromkeys(map(base_name, fitted.problem.names)))
    values = {**trial.fixed, **run.values(fitted.fit.values)}
    problem = trial.problem(fitted.candidate, names, values)
    start = problem.inside(problem.position(problem.start))
    q, _ = fit_in_noise(problem, start, white_noise(problem.evaluate(start)[0]), _EFFORT)
    return problem.values(q), error_at(problem, q)
