"""Estimates of parameters after a fit: intervals, changes, and reservations about them.

A fit is surer of its parameters than a model deserves that has not quite the form of the truth.
What such a model does not explain is no noise: it comes back wherever the record does the same. So
another record would pull the parameters about as far as single stretches of this one do
(`clustered_covariance`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from fmus.kit import Component, Effect
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals import ResidualAnalysis
from orchestration.discrepancy.selection import Selection
from orchestration.identify.fitting import error_scales, weighted_slopes
from orchestration.identify.uncertainty import (
    NOTICEABLE,
    SIGNIFICANT,
    Estimate,
    clustered_covariance,
    parameter_covariance,
)
from orchestration.records.runs import base_name

# times nominal: no specimen is like that, but a wrong unit or a wrong column is
_IMPLAUSIBLE = 30.0
_STRETCHES = 12  # of a record, that may pull parameters each its own way
# Standard errors in searched coordinates, most of which are logarithms. Above the first, which is
# near that of the prior, a value may be half or twice as large: the record hardly determines it.
# Below the second, with all others known, it would be known to a tenth: then it is determined
# together with others (Belsley, Kuh, Welsch: Regression Diagnostics, chapter 3).
_OPEN = 0.6
_KNOWN = 0.1
_AT_END = 1e-6  # in searched coordinates
_UNMOVED = 1e-6
# Fall of the deviance that a residual may hide from all tests for structure. These look at some two
# hundred lags and regions, whose sum of squares scatters by twenty where there is nothing; five
# times that is seen.
_UNSEEN = 100.0
_POINTS = 8  # at which a law is evaluated to tell what a parameter does to it
_ROUNDING = 1e-6  # of the slope there
_WRONG = 3.0  # times its noise, from which on an error is one that a refit should have lowered


def parameter_estimates(
    model: FittedCandidate, extra_deviation: ArrayLike = 0.0
) -> dict[str, Estimate]:
    """Return the searched parameters with their 95 % intervals.

    Parameters
    ----------
    model : FittedCandidate
    extra_deviation : float or ndarray, shape (p,)
        Standard deviation of the searched coordinates beside that of the fit.

    Returns
    -------
    dict of str to Estimate
        By name, SI.
    """
    problem = model.problem
    errors = np.hypot(model.fit.covariance.standard_errors, extra_deviation)
    return {
        name: Estimate(
            model.fit.values[name], problem.start[name], interval, problem.declared[name].unit
        )
        for name, interval in problem.intervals(model.fit.q, errors).items()
    }


def significantly_changed(
    model: FittedCandidate, parameters: Sequence[str], extra_deviation: ArrayLike = 0.0
) -> list[str]:
    """Return the physical parameters that surely and noticeably differ from nominal.

    Parameters
    ----------
    model : FittedCandidate
    parameters : sequence of str
        Those that are looked at.
    extra_deviation : float or ndarray, shape (p,)
        As in `parameter_estimates`.

    Returns
    -------
    list of str
        The surest first.

    Notes
    -----
    A change is measured by its ratio and by its difference, and the surer of the two does not
    count: far above a nominal value that is as good as zero the logarithm has any length. Where the
    nominal value is within a standard error of zero, its ratio says nothing, and a change is
    noticeable by what it does to the outputs.
    """
    problem = model.problem
    q = model.fit.q
    ratios = np.abs(q - problem.position(problem.start))
    errors = np.hypot(model.fit.covariance.standard_errors, extra_deviation)
    t_statistics = {}
    for i, name in enumerate(problem.names):
        if name not in parameters or problem.declared[name].starts:
            continue
        slope = problem.scales[i].slope(q[i])
        nominal = problem.start[name]
        difference = abs(model.fit.values[name] - nominal) / slope if slope else np.inf
        change = min(ratios[i], difference)
        is_near_zero = abs(nominal) <= slope * errors[i]
        noticed = _moves(model, i, difference) if is_near_zero else change
        if noticed > NOTICEABLE and change > SIGNIFICANT * errors[i]:
            # of a record without noise there is no error
            t_statistics[name] = change / errors[i] if errors[i] else np.inf
    return sorted(t_statistics, key=lambda name: -t_statistics[name])


def _moves(model: FittedCandidate, i: int, change: float) -> float:
    """Return the most that a change of a searched coordinate moves an output, over its spread."""
    problem = model.problem
    _, jacobian = problem.evaluate(model.fit.q)
    moves = []
    for output, slopes in jacobian.items():
        spread = float(np.std(problem.measured[output][problem.present[output]]))
        if spread > 0.0:
            moves.append(change * float(np.sqrt(np.mean(slopes[:, i] ** 2))) / spread)
    return max(moves, default=0.0)


def straight_parts(
    effects: Iterable[type[Effect]], cls: type[Component], parameters: Iterable[str]
) -> dict[str, tuple[str, ...]]:
    """Return the parameters that are slopes of a law to which an effect adds a curve.

    How much of the straight part of a curve is the effect's and how much the law's is a matter of
    how the shape is written, such as ``a |x|`` for what is rough in one direction only.

    Parameters
    ----------
    effects : iterable of type[Effect]
    cls : type[Component]
        The model without them.
    parameters : iterable of str
        Those that are looked at.

    Returns
    -------
    dict of str to tuple of str
        By the label of the effect.
    """
    if cls.engine is not None:  # it has no laws of its own
        return {}
    names = list(parameters)
    slopes = {}
    for effect in effects:
        term = effect.term
        if term.law and term.signal and not effect.layout.states:
            found = tuple(n for n in names if _is_slope(cls, term.law, term.signal, n))
            if found:
                slopes[label(effect)] = found
    return slopes


def _is_slope(cls: type[Component], law: str, signal: str, parameter: str) -> bool:
    """Return whether a parameter changes a law in proportion to a signal, whatever else moves."""
    random = np.random.default_rng(0)
    component = cls()
    for variable in (*cls.layout.states, *cls.layout.inputs):
        setattr(component, variable.name, variable.nominal * random.standard_normal(_POINTS))
    value = getattr(component, parameter)
    try:
        with np.errstate(all="ignore"):
            x = _value(component, signal)
            before = _value(component, law)
            setattr(component, parameter, value + (value or 1.0))
            shares = (_value(component, law) - before) / x
    except (ArithmeticError, AttributeError, TypeError, ValueError):
        return False  # it is no number that is computed of signals
    return bool(shares.any() and np.allclose(shares, shares[0], rtol=_ROUNDING, atol=0.0))


def _value(component: Component, name: str) -> Array:
    """Return the values (n,) of a signal or a law."""
    value = getattr(component, name)
    computed = np.asarray(value() if callable(value) else value, dtype=float)
    return np.broadcast_to(computed, _POINTS)


def implausible(values: Mapping[str, Estimate], parameters: Sequence[str]) -> dict[str, float]:
    """Return the estimates that are so far from nominal that no specimen can have them.

    An estimate counts if it has the sign of the nominal value and its whole interval lies beyond
    `_IMPLAUSIBLE` times that value, or below as small a part of it.

    Parameters
    ----------
    values : Mapping of str to Estimate
        Of one run or of all.
    parameters : sequence of str
        Physical parameters, whose estimates are looked at.

    Returns
    -------
    dict of str to float
        Ratio to nominal, by name.
    """
    ratios = {}
    for name, estimate in values.items():
        if base_name(name) not in parameters or not estimate.nominal:
            continue
        ratio = estimate.value / estimate.nominal
        low, high = sorted(end / estimate.nominal for end in estimate.interval)
        is_beyond = low >= _IMPLAUSIBLE or high <= 1.0 / _IMPLAUSIBLE
        if ratio > 0.0 and is_beyond:
            ratios[name] = ratio
    return ratios


def undetermined_effects(
    model: FittedCandidate, values: Mapping[str, Estimate]
) -> list[type[Effect]]:
    """Return the effects of a model that may do nothing, as far as their strength is known.

    Parameters
    ----------
    model : FittedCandidate
    values : Mapping of str to Estimate
        Of its searched parameters.

    Returns
    -------
    list of type[Effect]
        Those whose 95 % interval holds the neutral value, the least sure first.
    """
    undetermined = {}
    for effect in model.candidate.effects:
        strength = values.get(effect.neutral)
        if strength is None:
            continue
        neutral = neutral_value(effect)
        low, high = strength.interval
        if low <= neutral <= high:
            undetermined[effect] = abs(strength.value - neutral) / ((high - low) or 1.0)
    return sorted(undetermined, key=lambda effect: undetermined[effect])


def neutral_value(effect: type[Effect]) -> float:
    """Return the strength at which an effect does nothing, SI."""
    declared: Any = effect.declared[effect.neutral]
    return float(declared.start)


def by_likelihood_ratio(strength: Estimate, neutral: float, ratio: float) -> Estimate:
    """Return an estimate with the interval that a likelihood ratio against neutral implies.

    Where a strength and other parameters do nearly the same, its standard error is large although
    nothing is as likely without it. The test-based interval has the standard error with which the
    test statistic of Wald would be the likelihood ratio (Miettinen, Am. J. Epidemiol. 103, 1976).

    Parameters
    ----------
    strength : Estimate
    neutral : float
        Value at which the effect does nothing, SI.
    ratio : float
        Twice the logarithm of the likelihood ratio of the models with and without the effect.
    """
    half = float(ndtri(0.975)) * abs(strength.value - neutral) / math.sqrt(ratio)
    return replace(strength, interval=(strength.value - half, strength.value + half))


def misfit_spread(model: FittedCandidate) -> Array:
    """Return the deviation of the searched coordinates that the structure of a residual makes.

    Parameters
    ----------
    model : FittedCandidate
        That leaves structure.

    Returns
    -------
    ndarray, shape (p,)
        Standard deviation beside that of the fit.
    """
    problem = model.problem
    errors, slopes = problem.evaluate(model.fit.q)
    scales = error_scales(problem)
    jacobian = weighted_slopes(slopes, scales, np.empty((0, len(model.fit.q))))
    residual = np.concatenate([errors[o] / scales[o] for o in errors])
    samples = np.concatenate([np.flatnonzero(problem.present[o]) for o in errors])
    stretches = samples * _STRETCHES // (int(samples.max()) + 1)
    assumed = parameter_covariance(jacobian.T @ jacobian, model.fit.prior_precision)
    covariance = clustered_covariance(assumed, jacobian, residual, stretches)
    beyond = np.diag(covariance.matrix) - np.diag(model.fit.covariance.matrix)
    return np.asarray(np.sqrt(np.maximum(beyond, 0.0)))


def shape_spread(model: FittedCandidate, selection: Selection, structured: bool) -> Array:
    """Return the deviation of the searched coordinates that the form of the effects leaves open.

    No effect has quite the form of the truth. With another shape of the same cause a parameter is
    elsewhere, and a part of that other shape may be in the truth: as large a part as would not be
    seen (`_UNSEEN`). To first order a part moves parameters in proportion, and its evidence goes
    with its square.

    Parameters
    ----------
    model : FittedCandidate
    selection : Selection
        Its effects, with other shapes and alternatives as they were fitted.
    structured : bool
        Whether the residual shows that the form is another; then any part may be in it.

    Returns
    -------
    ndarray, shape (p,)
        Such that an interval of 95 % ends where parameters would be with that part.
    """
    names = model.problem.names
    shared = set(selection.base.problem.names)  # what other effects call alike may be another thing
    farthest = np.zeros(len(names))
    for step in selection.steps:
        chosen = dict(zip(step.chosen.problem.names, step.chosen.fit.q, strict=True))
        for other in (*step.shapes, *step.alternatives):
            lost = max(step.gain - step.gains.get(other.effect_name, step.gain), 0.0)
            part = 1.0 if structured else math.sqrt(_UNSEEN / (_UNSEEN + lost))
            there = dict(zip(other.problem.names, other.fit.q, strict=True))
            both = shared & there.keys() & chosen.keys()
            moved = [there[name] - chosen[name] if name in both else 0.0 for name in names]
            farthest = np.maximum(farthest, part * np.abs(moved))
    return farthest / float(ndtri(0.975))


def deviation_beside_fit(
    model: FittedCandidate,
    known: Iterable[Array],
    selection: Selection,
    residuals: Mapping[str, ResidualAnalysis],
) -> Array:
    """Return the deviation of the searched coordinates from all that the fit cannot know of.

    Parameters
    ----------
    model : FittedCandidate
    known : iterable of ndarray, shape (p,)
        Deviations for what is known of inputs.
    selection : Selection
        Where it names nothing, a model that leaves structure is what is wrong, and there is nothing
        to be sure of.
    residuals : Mapping of str to ResidualAnalysis

    Returns
    -------
    ndarray, shape (p,)
        Standard deviation beside that of the fit.
    """
    structured = any(analysis.structure for analysis in residuals.values())
    deviations = [*known, shape_spread(model, selection, structured)]
    if selection.steps and structured:
        deviations.append(misfit_spread(model))
    return np.asarray(np.linalg.norm(deviations, axis=0))


def identifiability_notes(model: FittedCandidate, physical: Sequence[str]) -> list[Note]:
    """Return notes on parameters that the record does not determine, and on fits that failed.

    Parameters
    ----------
    model : FittedCandidate
        The best one, fitted to all that was measured.
    physical : sequence of str
        Parameters of the base model that were searched, without starts of states.
    """
    problem = model.problem
    fit = model.fit
    at = {name: i for i, name in enumerate(problem.names) if name in physical}
    low, high = problem.bounds()
    ends = [n for n, i in at.items() if min(fit.q[i] - low[i], high[i] - fit.q[i]) < _AT_END]
    errors = fit.covariance.standard_errors
    loose = [n for n, i in at.items() if errors[i] > _OPEN and n not in ends]
    together, unknown = _determined_together(model, at, loose)
    by_code = {
        NoteCode.UNDETERMINED: unknown,
        NoteCode.DETERMINED_TOGETHER: together,
        NoteCode.AT_BOUND: ends,
    }
    notes = [Note(code, "", {"names": tuple(names)}) for code, names in by_code.items() if names]
    if not fit.converged:
        notes.append(Note(NoteCode.NOT_CONVERGED))
    moved = np.abs(fit.q - problem.position(problem.start))[list(at.values())]
    if at and moved.max() < _UNMOVED and _errors_beyond_noise(model):
        notes.append(Note(NoteCode.NOT_MOVED))
    return notes


def _determined_together(
    model: FittedCandidate, at: Mapping[str, int], loose: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Divide loose parameters into those that would be known if all others were, and the others.

    Parameters
    ----------
    model : FittedCandidate
    at : Mapping of str to int
        Places of parameters in the searched coordinates.
    loose : sequence of str
        Parameters with large standard errors.
    """
    information = np.diag(model.fit.information)
    errors_alone = np.divide(
        1.0,
        np.sqrt(information),
        out=np.full(len(information), np.inf),
        where=information > 0.0,
    )
    together = [n for n in loose if errors_alone[at[n]] < _KNOWN]
    unknown = [n for n in loose if n not in together]
    if len(together) == 1:  # with starts of states or with an effect
        return [], unknown + together
    return together, unknown


def _errors_beyond_noise(model: FittedCandidate) -> bool:
    """Return True if errors are far beyond what is not explained from sample to sample."""
    fit = model.fit
    return any(np.std(e) > _WRONG * fit.noise[o].deviation for o, e in fit.residual.items())
