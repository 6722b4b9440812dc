"""A fitted set of terms as a component, from which an FMU is built."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from fmus.kit import Component, Effect, stack
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.effects import effect_name, unstack
from fmus.kit.inputs import input_delay
from fmus.kit.law_terms import LawTerm, law_term_effect
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import transport_delay
from orchestration.diagnosis.courses import courses_of_fit
from orchestration.diagnosis.fitting import Fit
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.runs import step_of
from orchestration.diagnosis.term_names import (
    seen_unit,
    sentence,
    shape_text,
    stems,
    term_parameters,
)
from orchestration.diagnosis.terms import FORMS, DelayTerm, NamedTerm, Shape, Term

_ADDITIONS = 4  # place of the additions to laws among the arguments of a model's functions


def extended_component(
    fitted: Fit, terms: Mapping[str, Term] | None = None, reading: Reading | None = None
) -> type[Component]:
    """Return a model with the terms of a fit, and fitted values as defaults.

    Start states are those of the first record.

    Parameters
    ----------
    fitted : Fit
    terms : Mapping of str to Term, optional
        Its terms by name; by default named in their order.
    reading : Reading, optional
        Of the files that it was fitted to. The model has the dead time of an input, so that it
        takes the values as they were recorded.

    Notes
    -----
    Play and Dahl elements follow their signal at the samples of the record, as they do in the free
    runs of the fit; in a run over other steps they differ by what happens between two samples.
    """
    model = fitted.problem.model
    named = stems(model.cls, fitted.terms) if terms is None else dict(terms)
    effects: list[type[Effect]] = []
    of_inputs = []
    values = _own_values(fitted)
    if reading is not None and reading.dead_time:  # next to the command
        (column,) = reading.columns
        sampling = _sampling(fitted, reading.dead_time)
        effects.append(input_delay(model.cls, column, sampling=sampling))
        values[effects[0].neutral] = reading.dead_time
        of_inputs.append(f"Added to {column}: {effect_name(effects[0])}")
    for stem, term in named.items():
        if isinstance(term, NamedTerm):
            effects.append(model.effects[term.effect])
        elif isinstance(term, DelayTerm):
            effects.append(_delay(fitted, term))
        else:
            effects.append(law_term_effect(model.cls, term.law, law_term(fitted, stem, term)))
        values |= _term_values(fitted, stem, term)
    made = stack(model.cls, *effects, name=f"{model.cls.name}_{'extended' if named else 'fitted'}")
    declared = {p.name: p for p in made.layout.parameters}
    defaults = {n: _allowed(v, declared[n]) for n, v in values.items() if v != declared[n].start}
    made = stack(made, name=made.name, defaults=defaults)
    remarks = [
        f"Added to {term.law or 'it'}: {shape_text(term)}, {sentence(model.cls, term)}"
        for term in named.values()
    ]
    made.remark = "\n".join([*of_inputs, *remarks])
    return made


def _delay(fitted: Fit, term: DelayTerm) -> type[Effect]:
    """Return the effect of measurement that a delay is."""
    seconds = max(float(term.size * fitted.values_of(term)[0]), 0.0)
    return transport_delay(fitted.problem.model.cls, term.law, _sampling(fitted, seconds))


def _sampling(fitted: Fit, delay: float) -> Sampling:
    """Return the sampling of the first record, with a register that holds a delay, s."""
    time = fitted.problem.records[0].time
    return Sampling(step_of(time), float(np.ptp(time))).holding(delay)


def _own_values(fitted: Fit) -> dict[str, float]:
    """Return the parameters and the start states of a fit."""
    problem = fitted.problem
    model = problem.model
    fitted_values = problem.parameters(fitted.point.q)
    values = {p.name: v for p, v in zip(model.parameters, fitted_values, strict=True)}
    for i, position in enumerate(model.start_positions):
        values[model.parameters[position].name] = fitted.point.starts[0][i]
    return {name: float(value) for name, value in values.items()}


def _term_values(fitted: Fit, stem: str, term: Term) -> dict[str, float]:
    """Return the parameters of a term, SI."""
    values = {stem: 1.0} if term.places else {}
    if isinstance(term, NamedTerm):
        pairs = zip(term.released, fitted.values_of(term), strict=True)
        return {one.name: one.value(value) for one, value in pairs}
    parameters = term_parameters(fitted.problem.model.cls, stem, term)
    for one, value in zip(parameters, fitted.values_of(term), strict=True):
        values[one.name] = float(one.factor * (np.exp(value) if one.logarithmic else value))
    return values


def _allowed(value: float, declared: ParameterDeclaration) -> float:
    """Clip a value to its range, which a start state may have left by its noise."""
    return min(max(value, declared.min), declared.max)


def law_term(fitted: Fit, stem: str, term: Term) -> LawTerm:
    """Return a term in SI units, as its effect declares it.

    Parameters
    ----------
    fitted : Fit
    stem : str
        Name of the parameter that switches it.
    term : Term
        One of its terms.
    """
    problem = fitted.problem
    model = problem.model
    step = min(step_of(record.time) for record in problem.records)
    amount = term_parameters(model.cls, stem, term)[0]
    return LawTerm(
        term.law,
        term.signal,
        term.shape.name.lower(),
        term.memory.name.lower(),
        stem,
        amount.unit,
        seen_unit(model.cls, term),
        FORMS[term.shape].power,
        float(term.size),
        float(term.scale),
        0.0 if term.shape is Shape.CURVE else float(term.middle),
        term.factor,
        term.knots,
        step / problem.substeps if term.memory.is_sampled else 0.0,
        _is_held(model, term.law),
        len(unstack(model.cls)[1]),
        _range(fitted, term) if term.places else (),
    )


def _range(fitted: Fit, term: Term) -> tuple[float, ...]:
    """Return the ends of the range that a curve has knots in, or saw in the records of its fit."""
    along = courses_of_fit(fitted)
    seen = [*term.knots, *([] if along is None else along.seen_by(term))]
    return float(min(seen)), float(max(seen))


def _is_held(model: LawModel, law: str) -> bool:
    """Return whether a sampled memory in a law is held between samples, as in the free run.

    An output is computed before the sample instant at the end of a step; a memory that it shows
    follows its signal there.
    """
    outputs = next(f for f in model.perturbed.functions() if f.name() == "output_slopes_of")
    by_laws = ca.DM(outputs.jac_sparsity(0, _ADDITIONS), 1.0).full()
    return not by_laws[:, model.laws.index(law)].any()
