"""Interpolation of each input, held or linear: its own course decides, and fits may overrule it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit, ndtr, ndtri

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import Amount, FittedCandidate, encompassing
from orchestration.discrepancy.data import Dataset, IntersampleCourse, classify_course
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.input_noise import (
    denoised,
    disturbances,
    noisy_inputs,
    simulated,
    unfollowed_noise,
)
from orchestration.discrepancy.selection.search import Search

# fall of BIC that overrules the course of an input: very strong evidence (Kass and Raftery 1995)
CLEAR = 10.0
# Half a sample of an unknown lag looks a little like the other choice. Then a record asks for
# another amount of it than all: more than twice as much, and more than three standard errors from
# it.
_OTHERWISE = 1.0 / 3.0
_SURELY = 9.0
_POSITIVE = 2.0  # fall of BIC that decides where both ways were fitted: positive evidence (ibid.)
_TINY = float(np.finfo(float).tiny)
_MATTERS = 1.0  # standard errors by which a parameter must depend on the choice, for a remark


class InterpolationBasis(StrEnum):
    """The evidence that a choice rests on."""

    GIVEN = "given"
    COURSE = "course"
    FIT = "fit"
    DEFAULT = "default"


@dataclass(frozen=True)
class Intersample:
    """The course that an input is taken to have between samples.

    Attributes
    ----------
    linear : bool
        Or held.
    basis : InterpolationBasis
        It was given, or told by the input's own course, by the fits, or by nothing.
    margin : float, optional
        Fall of BIC against the other choice, as the linearised model predicts it or as both fits
        have it; None where they were not held against each other.
    dependent_parameter : str
        Parameter that would surely be another with the other choice, where the fits do not tell;
        empty if none would.
    factor : float
        By which it would be another.
    shift : Mapping of str to float
        By how much coordinates of the model would be others, where both ways were fitted and
        neither is clear.
    contrary_course : IntersampleCourse, optional
        The input's own course, where something else was asked for.
    separation : float
        Distance of the simulations with either choice, in innovations; 0 where not assessed.
    inflation : float
        By which a fall of BIC between the choices is too large, as noise of the inputs is in it.
    """

    linear: bool
    basis: InterpolationBasis
    margin: float | None = None
    dependent_parameter: str = ""
    factor: float = 1.0
    shift: Mapping[str, float] = field(default_factory=dict)
    contrary_course: IntersampleCourse | None = None
    separation: float = 0.0
    inflation: float = 1.0

    @property
    def open(self) -> bool:
        """True if another model might ask for the other interpolation."""
        if self.basis is InterpolationBasis.GIVEN or (
            self.basis is InterpolationBasis.COURSE and not self.linear
        ):
            return False
        return self.separation**2 >= CLEAR


def by_course(cls: type[Component], data: Dataset) -> dict[str, Intersample]:
    """Choose by the own course of every input that moves; held where that does not tell."""
    real = {v.name for v in cls.layout.inputs if v.type == "real"}
    chosen = {}
    for name, values in data.inputs.items():
        runs = [values[run.samples] for run in data.runs]
        liveliest = max(runs, key=lambda part: np.count_nonzero(np.diff(part)))
        kind = classify_course(liveliest) if name in real else IntersampleCourse.STEPS
        if kind is not IntersampleCourse.STILL:
            basis = (
                InterpolationBasis.DEFAULT
                if kind is IntersampleCourse.UNCLEAR
                else InterpolationBasis.COURSE
            )
            chosen[name] = Intersample(kind is IntersampleCourse.SMOOTH, basis)
    return chosen


def given(cls: type[Component], data: Dataset) -> dict[str, Intersample]:
    """Choose as a dataset says for every input that moves; note where its course contradicts."""
    named = data.inputs if data.linear is True else data.linear or ()
    own_choices = by_course(cls, data)
    chosen = {}
    for name, values in data.inputs.items():
        if np.ptp(values) > 0.0:
            is_linear = name in named
            contrary = _contrary_course(own_choices.get(name), is_linear)
            chosen[name] = Intersample(
                is_linear, InterpolationBasis.GIVEN, contrary_course=contrary
            )
    return chosen


def _contrary_course(own: Intersample | None, is_linear: bool) -> IntersampleCourse | None:
    """Return the own course of an input, if it is known and contradicts what was asked for."""
    if own is None or own.basis is not InterpolationBasis.COURSE or own.linear is is_linear:
        return None
    return IntersampleCourse.SMOOTH if own.linear else IntersampleCourse.STEPS


def linear(chosen: dict[str, Intersample]) -> frozenset[str]:
    """Return the inputs that are linear between samples."""
    return frozenset(name for name, choice in chosen.items() if choice.linear)


def by_fit(
    search: Search, base: FittedCandidate, chosen: dict[str, Intersample]
) -> tuple[Search, FittedCandidate, dict[str, Intersample]]:
    """Overrule the course of inputs where the record asks for it.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The base model fitted with what was chosen.
    chosen : dict of str to Intersample
        By `by_course`.

    Returns
    -------
    search, base, chosen
        The same, or with what the record asks for.
    """
    if all(choice.basis is InterpolationBasis.GIVEN for choice in chosen.values()):
        return search, base, chosen
    quiet_search, quiet_base, noise = without_input_noise(search, base)
    fitted = _by_fit(quiet_search, quiet_base, chosen, noise)
    return fitted if quiet_search is search else retaken(search, base, chosen, fitted[2])


def without_input_noise(
    search: Search, base: FittedCandidate
) -> tuple[Search, FittedCandidate, dict[str, float]]:
    """Fit the base model to inputs that are freed of noise which the plant did not see.

    Straight lines take a share of such noise to the outputs that held values do not, so that BIC
    would compare noise, and not what the input does between samples.

    Returns
    -------
    search, base
        The same where there is no such noise.
    noise : dict of str to float
        Its standard deviation by input, SI.
    """
    noise = noisy_inputs(search.base, search.data)
    unfollowed = unfollowed_noise(search, base, noise) if noise else {}
    if not unfollowed:
        return search, base, {}
    quiet = replace(search, data=denoised(search.data, unfollowed))
    try:
        return quiet, quiet.refit(base), unfollowed
    except UserError:
        return search, base, {}


def retaken(
    search: Search,
    base: FittedCandidate,
    before: dict[str, Intersample],
    after: dict[str, Intersample],
) -> tuple[Search, FittedCandidate, dict[str, Intersample]]:
    """Fit the base model to inputs as measured by choices that were made without their noise."""
    others = linear(before) ^ linear(after)
    fitted = turned(search, base, others) if others else (search, base)
    return (search, base, before) if fitted is None else (*fitted, after)


def _by_fit(
    search: Search,
    base: FittedCandidate,
    chosen: dict[str, Intersample],
    noise: Mapping[str, float],
) -> tuple[Search, FittedCandidate, dict[str, Intersample]]:
    """Do so in inputs of which the noise does not count.

    Every input is assessed with a simulation and no fit; where the record asks for another choice,
    the base model is fitted once more with it, and the likelier one is taken.
    """
    names = [
        variable.name
        for variable in search.base.layout.inputs
        if variable.type == "real"
        and variable.name in chosen
        and chosen[variable.name].basis is not InterpolationBasis.GIVEN
    ]
    if not names:
        return search, base, chosen
    now = linear(chosen)
    try:
        others = [simulated(search, base, replace(search.data, linear=now ^ {n})) for n in names]
        in_outputs = disturbances(search, base, noise)
        amounts = dict(zip(names, encompassing(base, others, in_outputs), strict=True))
    except UserError:
        return search, base, chosen
    known = {
        name: replace(
            chosen[name],
            separation=_separation(base, other),
            inflation=amounts[name].inflation,
        )
        for name, other in zip(names, others, strict=True)
    }
    assessed = {n: _assessed(known.get(n, c), base, amounts.get(n)) for n, c in chosen.items()}
    asked = {name for name, amount in amounts.items() if _asks_for_other(amount)}
    search, base, turned_choices = _turned_if_likelier(search, base, assessed, asked)
    assessed |= turned_choices
    for name, choice in assessed.items():
        if choice.dependent_parameter:
            search, base, assessed[name] = _by_both_fits(search, base, name, choice)
    return search, base, assessed


def _turned_if_likelier(
    search: Search, base: FittedCandidate, chosen: Mapping[str, Intersample], names: Collection[str]
) -> tuple[Search, FittedCandidate, dict[str, Intersample]]:
    """Take some inputs the other way if the base model then clearly fits better.

    Returns
    -------
    search, base
    chosen : dict of str to Intersample
        Of these inputs, as far as they could be fitted both ways.
    """
    other = turned(search, base, names) if names else None
    if other is None:
        return search, base, {}
    margin = (base.fit.bic - other[1].fit.bic) / max(chosen[name].inflation for name in names)
    if margin < CLEAR:
        return search, base, {n: replace(chosen[n], margin=-margin) for n in names}
    choices = {
        name: replace(
            chosen[name],
            linear=not chosen[name].linear,
            basis=InterpolationBasis.FIT,
            margin=margin,
            dependent_parameter="",
            factor=1.0,
        )
        for name in names
    }
    return *other, choices


def _separation(base: FittedCandidate, other: Mapping[str, Array]) -> float:
    """Return the distance of a model from another simulation, in deviations of innovations."""
    squares = 0.0
    for output, noise in base.fit.noise.items():
        other_residual = base.problem.measured[output] - other[output]
        # between the two simulations, for both residuals are of the same measurements
        difference = other_residual[base.problem.present[output]] - base.fit.residual[output]
        power = float(np.mean((noise.deviation * base.fit.innovation[output]) ** 2))
        # without noise the power may be zero
        squares += float(difference @ difference) / max(power, _TINY)
    return float(np.sqrt(squares))


def turned(
    search: Search, base: FittedCandidate, names: Collection[str]
) -> tuple[Search, FittedCandidate] | None:
    """Fit the base model with the other interpolation of some inputs; None if that fails."""
    now = frozenset(search.data.inputs if search.data.linear is True else search.data.linear or ())
    other = replace(search, data=replace(search.data, linear=now ^ frozenset(names)))
    try:
        return other, other.refit(base)
    except UserError:
        return None


def _by_both_fits(
    search: Search, base: FittedCandidate, name: str, choice: Intersample
) -> tuple[Search, FittedCandidate, Intersample]:
    """Take the likelier interpolation of an input on which parameters depend, by fits of both."""
    other = turned(search, base, [name])
    if other is None:
        return search, base, choice
    margin = (other[1].fit.bic - base.fit.bic) / choice.inflation
    if margin < -_POSITIVE:
        margin = -margin
        choice = replace(choice, linear=not choice.linear, basis=InterpolationBasis.FIT)
        (search, base), other = other, (search, base)
    if margin >= CLEAR:
        clear = replace(choice, basis=_basis_by_fit(choice), margin=margin)
        return search, base, replace(clear, dependent_parameter="", factor=1.0)
    shift = dict(zip(base.problem.names, other[1].fit.q - base.fit.q, strict=True))
    dependent = _with_dependent_parameter(choice, base, shift)
    return search, base, replace(dependent, margin=margin, shift=shift)


def _basis_by_fit(choice: Intersample) -> InterpolationBasis:
    """Return the basis of a choice that the fits confirm."""
    if choice.basis is InterpolationBasis.DEFAULT:
        return InterpolationBasis.FIT
    return choice.basis


def _asks_for_other(amount: Amount) -> bool:
    """Return whether a record asks for the other choice, and for no more of it than there is."""
    if not np.isfinite(amount.standard_error) or amount.margin < CLEAR:
        return False
    return amount.excess < max(_OTHERWISE * amount.margin, _SURELY)


def _assessed(choice: Intersample, base: FittedCandidate, amount: Amount | None) -> Intersample:
    """Add to a choice that stands the margin by the fitted model, and a parameter it matters to."""
    if amount is None or not np.isfinite(amount.standard_error):
        return choice
    margin = -amount.margin
    if margin >= CLEAR:
        return replace(choice, basis=_basis_by_fit(choice), margin=margin)
    with_margin = replace(choice, margin=margin)
    # nothing but an output stage rests between steps
    if choice.basis is InterpolationBasis.COURSE and not choice.linear:
        return with_margin
    if margin <= -CLEAR:  # it asks for neither of the two
        return with_margin
    shift = dict(zip(base.problem.names, amount.shift, strict=True))
    return _with_dependent_parameter(with_margin, base, shift)


def _with_dependent_parameter(
    choice: Intersample, base: FittedCandidate, shift: Mapping[str, float]
) -> Intersample:
    """Add the parameter that would most significantly change with the other choice, if any.

    Parameters
    ----------
    choice : Intersample
    base : FittedCandidate
    shift : Mapping of str to float
        By how much its coordinates would be others.
    """
    problem = base.problem
    fit = base.fit
    significance: dict[str, float] = {}
    factors: dict[str, float] = {}
    for i, name in enumerate(problem.names):
        error = fit.covariance.standard_errors[i]
        if not problem.declared[name].starts and np.isfinite(error) and fit.values[name]:
            significance[name] = abs(shift[name] / error)
            shifted = problem.scales[i].value(fit.q[i] + shift[name])
            factors[name] = shifted / fit.values[name]
    most = max(significance, key=lambda name: significance[name], default="")
    if not most or significance[most] < _MATTERS:
        return replace(choice, dependent_parameter="", factor=1.0)
    return replace(choice, dependent_parameter=most, factor=factors[most])


def spread(chosen: Mapping[str, Intersample], model: FittedCandidate) -> Array:
    """Return the deviation of parameters (p,) that the choices add to that of the fit.

    Either choice has the weight of its BIC, and the interval holds 95 % of both together (Bayesian
    model averaging; Hoeting and others, Statistical Science 14, 1999).
    """
    errors = model.fit.covariance.standard_errors
    is_determined = np.isfinite(errors) & (errors > 0.0)
    deviation = np.zeros(len(errors))
    for choice in chosen.values():
        weight = float(expit(-(choice.margin or 0.0) / 2.0))
        for i in np.flatnonzero(is_determined):
            distance = choice.shift.get(model.problem.names[i], 0.0) / errors[i]
            wider = _half_width(abs(distance), weight) / _half_width(0.0, weight)
            more = errors[i] * np.sqrt(max(wider**2 - 1.0, 0.0))
            deviation[i] = np.hypot(deviation[i], more)
    return deviation


def _half_width(distance: float, weight: float) -> float:
    """Return half the width of the interval about 0 with 95 % of a mixture of two unit normals.

    Parameters
    ----------
    distance, weight : float
        Of the second of them; the first is about 0.
    """
    plain = float(ndtri(0.975))

    def outside(half: float) -> float:
        return float(
            (1.0 - weight) * 2.0 * ndtr(-half)
            + weight * (ndtr(distance - half) + ndtr(-half - distance))
        )

    return float(brentq(lambda half: outside(half) - 0.05, plain - 1e-3, plain + distance + 1e-3))


def remarks(chosen: dict[str, Intersample]) -> list[Note]:
    """Return notes on inputs that are not simply held, or on which a parameter depends."""
    notes = []
    for name, choice in chosen.items():
        facts = {
            "course": "linear" if choice.linear else "held",
            "basis": str(choice.basis),
            "margin": choice.margin or 0.0,
        }
        if choice.contrary_course is not None:
            contrary = {
                "course": facts["course"],
                "other": str(choice.contrary_course),
                "asked": choice.linear,
            }
            notes.append(Note(NoteCode.INTERSAMPLE_CONTRADICTED, name, contrary))
        elif choice.dependent_parameter:
            dependence = {"parameter": choice.dependent_parameter, "factor": choice.factor}
            notes.append(Note(NoteCode.INTERSAMPLE_OPEN, name, facts | dependence))
        elif choice.basis is not InterpolationBasis.GIVEN and (
            choice.linear or choice.basis is InterpolationBasis.FIT
        ):
            notes.append(Note(NoteCode.INTERSAMPLE, name, facts))
    return notes
