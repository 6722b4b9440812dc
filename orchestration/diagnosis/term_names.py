"""Terms of a fit in the units of the model: names, parameters with intervals, and texts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Component, Effect
from fmus.kit.arrays import Array
from fmus.kit.curves import in_brackets, per
from fmus.kit.effects import made_by, made_with, unstack
from fmus.kit.law_terms import LawTerm, law_term_effect
from fmus.kit.symbolic import list_laws
from fmus.kit.titles import in_words, law_title, within_sentence
from fmus.kit.units import measure_alike
from orchestration.diagnosis.fitting import (
    Fit,
    final_curvature,
    prior_deviations,
    with_free_starts,
)
from orchestration.diagnosis.terms import (
    FORMS,
    MEMORIES,
    DelayTerm,
    Memory,
    NamedTerm,
    SensorTerm,
    Shape,
    Term,
)
from orchestration.identify.uncertainty import Estimate

_UNDETERMINED = 0.7  # of its prior deviation, from which on a coordinate is not determined
_INTERVAL = 1.96  # deviations of 95 %


@dataclass(frozen=True)
class TermParameter:
    """A parameter of a term, as a fit has it and as a component declares it.

    Attributes
    ----------
    name : str
    factor : float
        By which a searched value is multiplied; of a logarithm, its exponential.
    logarithmic : bool
    unit : str
    """

    name: str
    factor: float
    logarithmic: bool
    unit: str


def stems(cls: type[Component], terms: Sequence[Term]) -> dict[str, Term]:
    """Return terms by names that can stand in a component: ``friction_of_velocity``.

    Parameters
    ----------
    cls : type[Component]
        Whose laws they are added to; terms that were added to it before have names already.
    terms : sequence of Term
    """
    taken = {term.stem for effect in unstack(cls)[1] for term in _law_terms(effect)}
    named: dict[str, Term] = {}
    for term in terms:
        if isinstance(term, NamedTerm):
            named[_identifier(term.effect)] = term
            continue
        if isinstance(term, DelayTerm):
            named[_identifier(term.name)] = term
            continue
        remembered = "" if term.memory is Memory.NONE else f"_{term.memory.name.lower()}"
        stem = f"{term.law}_of_{term.signal}{remembered}" if term.signal else f"{term.law}_offset"
        number = 1 + sum(
            name.rpartition("_no_")[0] == stem or name == stem for name in (*taken, *named)
        )
        named[stem if number == 1 else f"{stem}_no_{number}"] = term
    return named


def _law_terms(effect: type[Effect]) -> list[LawTerm]:
    """Return the term that an effect adds to a law, if a diagnosis has found it."""
    if made_by(effect) is not law_term_effect:
        return []
    return [made_with(effect)["term"]]


def _identifier(effect: str) -> str:
    """Return the name of an effect as an identifier."""
    return effect.replace("(", "_of_").replace(", ", "_of_").rstrip(")")


def term_parameters(cls: type[Component], stem: str, term: Term) -> list[TermParameter]:
    """Return the parameters of a term in the order of its values in a fit."""
    if isinstance(term, NamedTerm):
        return [
            TermParameter(
                one.name,
                1.0 if one.scale.logarithmic else one.scale.size,
                one.scale.logarithmic,
                one.unit,
            )
            for one in term.released
        ]
    if isinstance(term, DelayTerm):
        return [TermParameter(f"{term.law}_delay", term.size, False, "s")]
    unit = unit_of(cls, term.law)
    if term.factor:
        below = unit_of(cls, term.factor)
        unit = "1" if unit == below else per(unit, below)
    signal = seen_unit(cls, term)
    power = FORMS[term.shape].power
    scale = term.size / term.scale**power
    amount = [f"{stem}_at_{k}" for k in range(len(term.places))] or [stem]
    result = [TermParameter(name, scale, False, per(unit, signal, power)) for name in amount]
    for name in MEMORIES[term.memory].constants:
        is_signal = name == "way"
        constant_unit = {"way": signal, "rate": per(signal, "s"), "ratio": "1"}.get(name, "s")
        factor = term.scale if is_signal or name == "rate" else 1.0
        result.append(TermParameter(f"{stem}_{name}", factor, True, constant_unit))
    if term.shape.has_width:
        result.append(TermParameter(f"{stem}_width", term.scale, True, signal))
    return result


def unit_of(cls: type[Component], name: str) -> str:
    """Return the SI unit of an input, a state, a law, or the time; 1 if it is not known."""
    layout = cls.layout
    variables = (*layout.inputs, *layout.states, *layout.discretes)
    declared = {v.name: v.unit for v in variables} | {"time": "s"}
    return declared.get(name) or {law.name: law.unit for law in list_laws(cls)}.get(name) or "1"


def seen_unit(cls: type[Component], term: Term) -> str:
    """Return the SI unit of the signal of a term as its shape has it: that of its memory."""
    unit, of_memory = unit_of(cls, term.signal), MEMORIES[term.memory].unit
    if unit == "1":
        return "s" if term.memory.counts else unit
    return of_memory.format(in_brackets(unit)) or unit


def estimates(fitted: Fit, terms: Mapping[str, Term]) -> dict[str, Estimate]:
    """Return the parameters of a fit with intervals, those of its terms and start states too.

    Parameters
    ----------
    fitted : Fit
    terms : Mapping of str to Term
        Its terms, by name.
    """
    problem = fitted.problem
    deviation = deviations(fitted)
    result = {}
    # values of one parameter together
    for k in sorted(range(len(problem.free)), key=lambda k: problem.free[k]):
        i, scale = problem.free[k], problem.scales[k]
        declared = problem.model.parameters[i]
        place = fitted.point.q[k] % 1.0 if k in problem.phases else fitted.point.q[k]
        ends = interval_of(place, deviation[k], problem.deviation[k])
        result[problem.names[k]] = Estimate(
            scale.value(place),
            float(problem.nominal[i]),
            (scale.value(ends[0]), scale.value(ends[1])),
            declared.unit,
        )
    places, priors = _places(fitted), prior_deviations(fitted)
    for stem, term in terms.items():
        at = places[term]
        parameters = term_parameters(problem.model.cls, stem, term)
        values = zip(fitted.values_of(term), deviation[at:], priors[at:], strict=False)
        for k, (parameter, (value, wide, prior)) in enumerate(
            zip(parameters, values, strict=False)
        ):
            ends = interval_of(float(value), float(wide), float(prior))
            # without the term its amounts are zero, and its other values nothing
            nominal = 0.0 if k < term.coefficients else np.nan
            result[parameter.name] = _estimate(parameter, float(value), nominal, ends)
    own = len(problem.free) + len(fitted.point.values)
    return result | _start_states(fitted, deviation[own:])


def covariance_of(fitted: Fit) -> Array:
    """Return the covariance of the searched coordinates, in the order of the curvature.

    Start states are free in it, in deviations of `with_free_starts`.
    """
    curvature = final_curvature(replace(fitted, problem=with_free_starts(fitted.problem)))
    size = np.sqrt(np.diag(curvature))
    covariance = np.linalg.pinv(curvature / np.outer(size, size), hermitian=True)
    return np.asarray(covariance / np.outer(size, size))


def deviations(fitted: Fit) -> Array:
    """Return standard deviations of the searched coordinates, in the order of the curvature.

    Those of the values of a curve are about its mean, as its law has a level of its own.
    """
    covariance = covariance_of(fitted)
    variance = np.diag(covariance).copy()
    for term, at in _places(fitted).items():
        if term.shape is Shape.CURVE:
            own = slice(at, at + term.coefficients)
            about_mean = np.eye(term.coefficients) - 1.0 / term.coefficients
            variance[own] = np.diag(about_mean @ covariance[own, own] @ about_mean)
    return np.sqrt(variance)


def _places(fitted: Fit) -> dict[Term, int]:
    """Return the place of the first value of each term among the searched coordinates."""
    at = len(fitted.problem.free)
    places = {}
    for term in fitted.terms:
        places[term] = at
        at += term.coefficients + len(term.start)
    return places


def interval_of(value: float, deviation: float, prior: float) -> tuple[float, float]:
    """Return the ends of an interval of 95 %; infinite where a record says less than the prior."""
    if deviation > _UNDETERMINED * prior:
        return -np.inf, np.inf
    return value - _INTERVAL * deviation, value + _INTERVAL * deviation


def _estimate(
    parameter: TermParameter, value: float, nominal: float, ends: tuple[float, float]
) -> Estimate:
    """Return a value of a term in the unit of its parameter."""
    three = (ends[0], value, ends[1])
    low, middle, high = np.exp(three) if parameter.logarithmic else three
    scaled = [float(parameter.factor * end) for end in (low, middle, high)]
    return Estimate(scaled[1], nominal, (scaled[0], scaled[2]), parameter.unit)


def _start_states(fitted: Fit, deviation: Array) -> dict[str, Estimate]:
    """Return the start states; with several records the record stands behind an @."""
    problem = with_free_starts(fitted.problem)
    model = problem.model
    nx = len(model.states)
    result = {}
    for r, (record, start) in enumerate(zip(problem.records, fitted.point.starts, strict=True)):
        suffix = f"@{record.label}" if len(problem.records) > 1 else ""
        for i in np.flatnonzero(~problem.known_starts):
            wide = float(deviation[r * nx + i] * problem.starts[r].deviation[i])
            name = model.parameters[model.start_positions[i]].name
            value, unit = float(start[i]), model.states[i].unit
            ends = (value - _INTERVAL * wide, value + _INTERVAL * wide)
            nominal = float(problem.nominal[model.start_positions[i]])
            result[f"{name}{suffix}"] = Estimate(value, nominal, ends, unit)
    return result


def shape_text(term: Term) -> str:
    """Return the function of a term as a formula."""
    if isinstance(term, NamedTerm):
        return term.formula
    if isinstance(term, DelayTerm):
        return "x(t - d)"
    text = FORMS[term.shape].text
    if term.middle:
        text = re.sub(r"\bx\b", f"(x - {term.middle:.3g})", text)
    return f"{text} {term.factor}" if term.factor else text


def memory_text(term: Term) -> str:
    """Return the memory of a term as one word; empty if it has none."""
    return "" if term.memory is Memory.NONE else term.memory.name.lower()


def sentence(cls: type[Component], term: Term, value: float | None = None) -> str:
    """Return a term for people: ``friction over velocity``.

    In proportion to its law it is a factor: ``friction times a function of velocity``. Of what an
    FMU without equations gets, it is in words of its ports: ``torque that depends on omega``.

    Parameters
    ----------
    cls : type[Component]
    term : Term
    value : float, optional
        The first of its fitted values, whose sign tells the direction of what an FMU gets.
    """
    if isinstance(term, NamedTerm):
        return within_sentence(term.title)
    law = _title(cls, term.law)
    if isinstance(term, SensorTerm):
        fault = {"offset": "an offset", "gain": "another gain"}.get(term.fault, f"a {term.fault}")
        return f"{fault} of the sensor of {law}"
    if not term.signal:
        return f"an offset of {law}"
    if term.signal == "time" and term.shape is Shape.STEP:
        return f"{law} changes at {term.width * term.scale:.4g} s"
    seen = seen_title(cls, term)
    if term.law in fed_laws(cls):
        if seen == law and term.shape is Shape.LINEAR and not term.middle:
            return f"another gain of {law}"
        return f"{law} {_of_port(cls, term, seen, value)}"
    if not term.factor:
        return f"{law} over {'itself' if seen == law else seen}"
    if term.factor == term.law:
        return f"{law} times a function of {seen}"
    return f"{law} over {seen}, in proportion to {_title(cls, term.factor)}"


def _title(cls: type[Component], name: str) -> str:
    """Return the title of a law or a signal within a sentence; a name keeps its case."""
    title = law_title(cls, name)
    return title if title == in_words(name) else within_sentence(title)


def seen_title(cls: type[Component], term: Term) -> str:
    """Return what the shape of a term sees of its signal, for people; of an FMU by its port."""
    signal = "time" if term.signal == "time" else _title(cls, term.signal)
    if term.law in fed_laws(cls):
        signal = signal.removeprefix("simulated ")
    return MEMORIES[term.memory].text.format(signal)


def fed_laws(cls: type[Component]) -> frozenset[str]:
    """Return the laws of what an FMU without equations gets of its inputs; else none."""
    found: frozenset[str] = getattr(cls, "fed", frozenset())
    return found


_NATURES = {  # of what acts against or along a signal: its size, and its name where that is a speed
    Shape.DRY: ("of one size", "dry friction"),
    Shape.LINEAR: ("in proportion to it", "viscous friction"),
    Shape.ODD_SQUARE: ("with its square", "drag"),
}
_SPEEDS = ("m/s", "rad/s")


def _of_port(cls: type[Component], term: Term, seen: str, value: float | None) -> str:
    """Return how what an FMU gets depends on a signal: ``that opposes omega, of one size``."""
    known = _NATURES.get(term.shape)
    if known is None or not value or term.middle or term.memory is not Memory.NONE or term.factor:
        return f"that depends on {seen}"
    size, friction = known
    if value > 0.0:
        return f"that goes with {seen}, {size}"
    unit = unit_of(cls, term.signal)
    is_speed = any(measure_alike(unit, speed) for speed in _SPEEDS)
    return f"that opposes {seen}, {size}" + (f": {friction}" if is_speed else "")
