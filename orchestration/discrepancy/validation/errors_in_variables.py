"""Errors in variables: bias and spread of estimates, and false causes, from noise on inputs.

A model that is fed a noisy input answers to noise that the plant never saw. As much noise again is
added to the input: the change that it makes is that which the noise there has made already
(simulation extrapolation; Cook and Stefanski, J. Am. Stat. Assoc. 89, 1994).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals import ALPHA, ResidualAnalysis, analyse_residuals
from orchestration.discrepancy.selection import (
    FAILURES,
    REPLICAS,
    Search,
    Selection,
    denoised,
    noisy_inputs,
    simulated,
    unfollowed_noise,
    with_more_noise,
)
from orchestration.identify import autoregression
from orchestration.identify.uncertainty import parameter_covariance

# times the most evidence that noise makes by itself in any replica, which an effect must reach
_BEYOND = 2.0
_OWN = 0.1  # of the power of a residual, which is noise of the output itself at least
_NOTED = 0.002  # of the range, from which on noise of an input is noted whatever it does
_MATTERS = 0.5  # standard errors of a bias, from which on it is


@dataclass(frozen=True)
class InputNoise:
    """Noise on measured inputs, with the bias and spread that it gives the base model's estimates.

    Attributes
    ----------
    deviation : dict of str to float
        By input, SI; empty where there is none.
    bias : ndarray, shape (p,)
        Of the searched coordinates.
    spread : ndarray, shape (p, p)
        Covariance beside that from the noise of the outputs.
    names : list of str
        Of the searched parameters.
    """

    deviation: dict[str, float]
    bias: Array
    spread: Array
    names: list[str]

    def spread_of(self, names: Sequence[str]) -> Array:
        """Return the deviation beside that of the fit by coordinate; 0 for those of effects.

        The bias is among it: the estimates are those of the fit, which has it.
        """
        deviations = np.hypot(np.sqrt(np.diag(self.spread)), self.bias)
        own = dict(zip(self.names, deviations, strict=True))
        return np.array([float(own.get(name, 0.0)) for name in names])


def no_input_noise(base: FittedCandidate) -> InputNoise:
    """Return that there is no noise on any input."""
    names = list(base.problem.names)
    return InputNoise({}, np.zeros(len(names)), np.zeros((len(names), len(names))), names)


def estimate_input_noise(search: Search, base: FittedCandidate) -> InputNoise:
    """Estimate noise on inputs, and the bias and spread that it gives to estimates.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The base model, fitted.
    """
    noise = noisy_inputs(search.base, search.data)
    if noise:
        noise = unfollowed_noise(search, base, noise)
    if not noise:
        return no_input_noise(base)
    try:
        steps = np.array([_step(search, base, noise, seed) for seed in range(REPLICAS)])
    except UserError:
        return replace(no_input_noise(base), deviation=noise)
    bias = steps.mean(axis=0)
    spread = (steps - bias).T @ (steps - bias) / (REPLICAS - 1)
    return replace(no_input_noise(base), deviation=noise, bias=bias, spread=spread)


def _step(search: Search, base: FittedCandidate, noise: Mapping[str, float], seed: int) -> Array:
    """Return by how much more noise on the inputs moves the estimates (p,), to first order."""
    fit = base.fit
    truth = simulated(search, base, search.data)
    measured = {o: np.where(base.problem.present[o], truth[o], np.nan) for o in fit.noise}
    data = replace(with_more_noise(search.data, noise, seed), measured=measured)
    problem = replace(search, data=data).problem(base.candidate, base.problem.names, search.fixed)
    residual, jacobian = problem.evaluate(fit.q)
    present = problem.present
    errors = np.concatenate([n.whiten(residual[o], present[o]) for o, n in fit.noise.items()])
    slopes = np.vstack([n.whiten(jacobian[o], present[o]) for o, n in fit.noise.items()])
    covariance = parameter_covariance(slopes.T @ slopes, fit.prior_precision)
    return np.asarray(-covariance.matrix @ (slopes.T @ errors))


def drop_indefensible(
    selection: Selection, search: Search, noise: InputNoise
) -> tuple[Selection, list[Note]]:
    """Keep the effects for which there is more evidence than noise of the inputs makes by itself.

    The model without an effect is simulated as if it were true with the inputs freed of their
    noise, noise is added to these, and the effect is fitted to that.

    Returns
    -------
    selection : Selection
    notes : list of Note
        On what is not claimed.
    """
    if not noise.deviation or not selection.steps:
        return selection, []
    inputs = tuple(noise.deviation)
    below = selection.base
    for k, step in enumerate(selection.steps):
        kept = replace(selection, steps=selection.steps[:k])
        names = [s.chosen.effect_name for s in selection.steps[k:]]
        for seed in range(REPLICAS):
            replica = _replica(search, below, noise.deviation, seed)
            by_noise = _evidence_in_replica(replica, below, step.chosen, selection.tried)
            if by_noise is None:
                reason = f"the model could not be simulated with other noise on {', '.join(inputs)}"
                return kept, [Note(NoteCode.NOT_SIMULATED, ", ".join(names), {"reason": reason})]
            if step.evidence < _BEYOND * by_noise:
                facts = {"inputs": inputs, "gain": by_noise}
                return kept, [Note(NoteCode.INPUT_NOISE_DOES_THE_SAME, ", ".join(names), facts)]
        below = step.chosen
    return selection, []


def structure_of_input_noise(
    residuals: Mapping[str, ResidualAnalysis],
    selection: Selection,
    search: Search,
    noise: InputNoise,
) -> frozenset[tuple[str, type]]:
    """Return the kinds of structure in residuals that noise of the inputs may make by itself.

    The base model is fitted to replicas, records in which nothing is wrong but noise: what shows
    there about as clearly as in the record at hand says nothing of the model.

    Parameters
    ----------
    residuals : Mapping of str to ResidualAnalysis
        Of the best model.
    selection : Selection
    search : Search
    noise : InputNoise

    Returns
    -------
    frozenset of tuple
        Output and type of the test.
    """
    shown = {
        (output, type(test)): _evidence_by_test(analysis)[type(test)]
        for output, analysis in residuals.items()
        for test in analysis.structure
    }
    if not noise.deviation or not shown:
        return frozenset()
    by_noise = _most_evidence_in_replicas(selection.base, search, noise)
    usual = -float(np.log(ALPHA))  # which is meant for records without such noise
    return frozenset(
        test
        for test, evidence in shown.items()
        if evidence < _BEYOND * max(by_noise.get(test, 0.0), usual)
    )


def _most_evidence_in_replicas(
    base: FittedCandidate, search: Search, noise: InputNoise
) -> dict[tuple[str, type], float]:
    """Return the most evidence for structure in any replica, by output and type of the test."""
    most: dict[tuple[str, type], float] = {}
    for seed in range(REPLICAS):
        replica = _replica(search, base, noise.deviation, seed)
        try:
            analysed = analyse_residuals(replica.refit(base), replica.data)
        except UserError:
            continue
        for output, analysis in analysed.items():
            for kind, evidence in _evidence_by_test(analysis).items():
                most[output, kind] = max(most.get((output, kind), 0.0), evidence)
    return most


def _evidence_by_test(analysis: ResidualAnalysis) -> dict[type, float]:
    """Return minus the logarithm of the least p-value of every kind of test, never infinite."""
    most: dict[type, float] = {}
    for value in vars(analysis).values():
        for item in value if isinstance(value, list) else [value]:
            p_value = getattr(item, "p_value", None)
            if isinstance(p_value, float):
                evidence = -float(np.log(max(p_value, 1e-300)))
                most[type(item)] = max(most.get(type(item), 0.0), evidence)
    return most


def _replica(
    search: Search, base: FittedCandidate, noise: Mapping[str, float], seed: int
) -> Search:
    """Return a search over a record in which nothing is wrong but noise on inputs and outputs.

    Together they make a residual as large as that of the record at hand.
    """
    data = denoised(search.data, noise)
    noisy = with_more_noise(data, noise, seed)
    random = np.random.default_rng([seed, 25])
    truth = simulated(search, base, data)
    disturbed = simulated(search, base, noisy)
    measured = {}
    for output, model in base.fit.noise.items():
        whole = float(np.var(base.fit.residual[output]))
        by_inputs = float(np.var(disturbed[output] - truth[output]))
        own = np.sqrt(max(_OWN, 1.0 - by_inputs / whole if whole else 0.0))
        white = own * model.deviation * random.standard_normal(len(search.data.time))
        values = truth[output] + autoregression([1.0, *-model.coefficients], white)
        measured[output] = np.where(base.problem.present[output], values, np.nan)
    return replace(
        search, data=replace(noisy, measured=measured), not_assessed={}, progress=lambda text: None
    )


def _evidence_in_replica(
    replica: Search, below: FittedCandidate, claimed: FittedCandidate, tried: int
) -> float | None:
    """Return the evidence for a claimed effect in a record that does not have it.

    Parameters
    ----------
    replica : Search
        Over a record in which nothing is wrong but noise.
    below, claimed : FittedCandidate
        The model without the effect, and with it.
    tried : int
        Effects that were tried.

    Returns
    -------
    float or None
        Fall of BIC; None where the model cannot be simulated with other noise, so that the claim
        cannot be defended.
    """
    try:
        return replica.refit(claimed).delta_bic(replica.refit(below), tried)
    except FAILURES:
        return None


def input_noise_notes(
    noise: InputNoise, base: FittedCandidate, inputs: Mapping[str, Array]
) -> list[Note]:
    """Return notes on noise on inputs: its size, and the parameter that it biases most.

    Parameters
    ----------
    noise : InputNoise
    base : FittedCandidate
    inputs : Mapping of str to ndarray, shape (n,)
        SI.
    """
    if not noise.deviation:
        return []
    problem = base.problem
    errors = np.sqrt(base.fit.covariance.standard_errors**2 + np.diag(noise.spread))
    physical = [
        i
        for i, n in enumerate(noise.names)
        if not problem.declared[n].starts and np.isfinite(errors[i])
    ]
    if not physical:
        return []
    most = max(physical, key=lambda i: abs(noise.bias[i]) / errors[i])
    matters = abs(noise.bias[most]) > _MATTERS * errors[most]
    name = noise.names[most]
    bias = 0.0
    if base.fit.values[name]:
        biased = problem.scales[most].value(base.fit.q[most] + noise.bias[most])
        bias = float(biased / base.fit.values[name] - 1.0)
    notes = []
    for n, deviation in noise.deviation.items():
        spread = float(np.ptp(inputs[n]))
        if matters or deviation > _NOTED * spread:
            share = deviation / spread
            facts = {"share": share, "deviation": deviation, "parameter": name, "bias": bias}
            notes.append(Note(NoteCode.INPUT_NOISE, n, facts))
    return notes
