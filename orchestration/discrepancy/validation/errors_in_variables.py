"""What noise on measured inputs does to a diagnosis: bias and spread of estimates, and causes that are none.

A model that is fed a noisy input answers to noise that the plant never saw. As much noise again is laid over the input,
and what that changes is what the noise there has changed already (simulation extrapolation; Cook and Stefanski, J. Am.
Stat. Assoc. 89, 1994).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals.analysis import ALPHA, ResidualAnalysis, analyse_residuals
from orchestration.discrepancy.selection.input_noise import (
    REPLICAS,
    noisier,
    noisy_inputs,
    not_followed,
    simulated,
    smoothed,
)
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.stepwise import Selection
from orchestration.identify.covariance import covariance

Array = NDArray[np.float64]
_BEYOND = 2.0  # times the most evidence that noise makes by itself in any replica, which an effect must come to
_PASSES = 4  # of smoothing, after which next to nothing is left of noise from sample to sample
_OWN = 0.1  # of the power of a residual, which is noise of the output itself at least
_TOLD = 0.002  # of the range, from which on noise of an input is told whatever it does
_MATTERS = 0.5  # standard errors of a bias, from which on it is


@dataclass(frozen=True)
class InputNoise:
    """Noise on measured inputs, and what it does to the base model's estimates.

    Attributes
    ----------
    deviation : dict of str to float
        By input, SI; empty where there is none.
    bias : ndarray, shape (p,)
        Of the searched coordinates.
    spread : ndarray, shape (p, p)
        Covariance that comes on top of that of the noise of the outputs.
    names : list of str
        Of the searched parameters.
    """

    deviation: dict[str, float]
    bias: Array
    spread: Array
    names: list[str]

    def spread_of(self, names: Sequence[str]) -> Array:
        """Standard deviation that comes on top for some coordinates; none for those of effects."""
        own = dict(zip(self.names, np.sqrt(np.diag(self.spread)), strict=True))
        return np.array([float(own.get(name, 0.0)) for name in names])


def nothing(base: FittedCandidate) -> InputNoise:
    """No noise on any input."""
    names = list(base.problem.names)
    return InputNoise({}, np.zeros(len(names)), np.zeros((len(names), len(names))), names)


def assess(search: Search, base: FittedCandidate) -> InputNoise:
    """Look for noise on inputs, and tell what it does.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The base model, fitted.
    """
    noise = noisy_inputs(search.base, search.data)
    noise = not_followed(search, base, noise) if noise else noise
    if not noise:
        return nothing(base)
    try:
        steps = np.array([_step(search, base, noise, seed) for seed in range(REPLICAS)])
    except UserError:
        return replace(nothing(base), deviation=noise)
    bias = steps.mean(axis=0)
    return replace(
        nothing(base),
        deviation=noise,
        bias=bias,
        spread=(steps - bias).T @ (steps - bias) / (REPLICAS - 1),
    )


def _step(search: Search, base: FittedCandidate, noise: Mapping[str, float], seed: int) -> Array:
    """By how much the estimates move with more noise on the inputs, to first order."""
    fit, truth = base.fit, simulated(search, base, search.data)
    told = {o: np.where(base.problem.present[o], truth[o], np.nan) for o in fit.noise}
    other = replace(search, data=replace(noisier(search.data, noise, seed), measured=told))
    problem = other.problem(base.candidate, base.problem.names, search.fixed)
    residual, jacobian = problem.evaluate(fit.q)
    pieces = [
        (n.whiten(residual[o], problem.present[o]), n.whiten(jacobian[o], problem.present[o]))
        for o, n in fit.noise.items()
    ]
    slopes = np.vstack([piece[1] for piece in pieces])
    known = covariance(slopes.T @ slopes, fit.prior_precision)
    return np.asarray(-known.matrix @ (slopes.T @ np.concatenate([piece[0] for piece in pieces])))


def defensible(
    selection: Selection, search: Search, noise: InputNoise
) -> tuple[Selection, list[Note]]:
    """Keep the effects for which there is more evidence than noise of the inputs makes by itself.

    The model without an effect is simulated as if it were true with the inputs freed of their noise, noise is laid over
    these, and the effect is fitted to that.

    Returns
    -------
    selection : Selection
    notes : list of Note
        What is not claimed.
    """
    if not noise.deviation or not selection.steps:
        return selection, []
    below, inputs = selection.base, tuple(noise.deviation)
    for k, step in enumerate(selection.steps):
        kept, names = (
            replace(selection, steps=selection.steps[:k]),
            [s.chosen.effect_name for s in selection.steps[k:]],
        )
        for seed in range(REPLICAS):
            by_noise = _gain(
                _replica(search, below, noise.deviation, seed), below, step.chosen, selection.tried
            )
            if search.budget.spent():  # what could not be held against noise is not claimed
                search.budget.leave(names)
                return kept, []
            if by_noise is None:
                reason = f"the model could not be simulated with other noise on {', '.join(inputs)}"
                return kept, [Note(NoteCode.NOT_SIMULATED, ", ".join(names), {"reason": reason})]
            if step.evidence < _BEYOND * by_noise:
                facts = {"inputs": inputs, "gain": by_noise}
                return kept, [Note(NoteCode.INPUT_NOISE_DOES_THE_SAME, ", ".join(names), facts)]
        below = step.chosen
    return selection, []


def excused(
    residuals: Mapping[str, ResidualAnalysis],
    selection: Selection,
    search: Search,
    noise: InputNoise,
) -> frozenset[tuple[str, type]]:
    """Kinds of structure, by output, that noise of the inputs puts into residuals by itself.

    Parameters
    ----------
    residuals : Mapping of str to ResidualAnalysis
        Of the best model.
    selection : Selection
    search : Search
    noise : InputNoise
    """
    asked = {(o, type(s)): _evidence(a)[type(s)] for o, a in residuals.items() for s in a.structure}
    if not noise.deviation or not asked:
        return frozenset()
    most: dict[tuple[str, type], float] = {}
    for seed in range(REPLICAS):
        replica = _replica(search, selection.base, noise.deviation, seed)
        try:
            analysed = analyse_residuals(replica.refit(selection.base), replica.data)
        except UserError:
            continue
        for output, analysis in analysed.items():
            for kind, evidence in _evidence(analysis).items():
                most[output, kind] = max(most.get((output, kind), 0.0), evidence)
    usual = -float(np.log(ALPHA))  # which is meant for records without such noise
    return frozenset(
        key
        for key, evidence in asked.items()
        if evidence < _BEYOND * max(most.get(key, 0.0), usual)
    )


def _evidence(analysis: ResidualAnalysis) -> dict[type, float]:
    """Minus the logarithm of the least p-value of every kind of test, none of it infinite."""
    found: dict[type, float] = {}
    for value in vars(analysis).values():
        for item in value if isinstance(value, list) else [value]:
            if isinstance(p := getattr(item, "p_value", None), float):
                found[type(item)] = max(found.get(type(item), 0.0), -float(np.log(max(p, 1e-300))))
    return found


def _replica(
    search: Search, base: FittedCandidate, noise: Mapping[str, float], seed: int
) -> Search:
    """Search over a record in which nothing is wrong but noise on inputs and outputs, together as large as there."""
    calm = {n: smoothed(search.data.inputs[n], s, _PASSES) for n, s in noise.items()}
    data = replace(search.data, inputs={**search.data.inputs, **calm})
    noisy = noisier(data, noise, seed)
    random, truth, told = (
        np.random.default_rng([seed, 25]),
        simulated(search, base, data),
        simulated(search, base, noisy),
    )
    measured = {}
    for output, model in base.fit.noise.items():
        by_inputs = np.var(told[output] - truth[output]) / np.var(base.fit.residual[output])
        own = np.sqrt(max(_OWN, 1.0 - float(by_inputs)))
        white = own * model.deviation * random.standard_normal(len(search.data.time))
        values = truth[output] + lfilter([1.0], [1.0, *-model.coefficients], white)
        measured[output] = np.where(base.problem.present[output], values, np.nan)
    return replace(
        search, data=replace(noisy, measured=measured), not_assessed={}, progress=lambda text: None
    )


def _gain(
    replica: Search, below: FittedCandidate, claimed: FittedCandidate, tried: int
) -> float | None:
    """Evidence for an effect in a record that does not have it, looked for where the record at hand has it.

    None where the model cannot be simulated with other noise: such a claim cannot be defended.
    """
    try:
        return replica.refit(claimed).delta_bic(replica.refit(below), tried)
    except FAILURES:
        return None


def remarks(noise: InputNoise, base: FittedCandidate, inputs: Mapping[str, Array]) -> list[Note]:
    """What is to be said of noise on inputs: its size, and the parameter that it biases most.

    Parameters
    ----------
    noise : InputNoise
    base : FittedCandidate
    inputs : Mapping of str to ndarray, shape (n,)
        SI.
    """
    if not noise.deviation:
        return []
    problem, fit = base.problem, base.fit
    errors = np.sqrt(fit.covariance.standard_errors**2 + np.diag(noise.spread))
    physical = [
        i
        for i, n in enumerate(noise.names)
        if not problem.declared[n].starts and np.isfinite(errors[i])
    ]
    if not physical:
        return []
    ranges = {n: float(np.ptp(inputs[n])) for n in noise.deviation}
    most = max(physical, key=lambda i: abs(noise.bias[i]) / errors[i])
    name = noise.names[most]
    off = (
        problem.scales[most].value(fit.q[most] + noise.bias[most]) / fit.values[name] - 1.0
        if fit.values[name]
        else 0.0
    )
    matters = abs(noise.bias[most]) > _MATTERS * errors[most]
    return [
        Note(
            NoteCode.INPUT_NOISE,
            n,
            {"share": s / ranges[n], "deviation": s, "parameter": name, "bias": float(off)},
        )
        for n, s in noise.deviation.items()
        if matters or s > _TOLD * ranges[n]
    ]
