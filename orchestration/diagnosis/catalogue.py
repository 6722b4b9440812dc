"""Effects of a component's catalogue as named terms, with the outputs' responses to them.

What an effect of any size adds to rates and outputs is computed along a course of the model without
it, its own states included; the outputs' response is that of the model linearised there. Nothing is
compiled for this. If the model has discrete states, through which an effect may act, the response
is that of runs with it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.effects import effect_name, unstack
from fmus.kit.symbolic import ComponentAlong, EffectForcing, Forcing, Points
from orchestration.diagnosis.law_model import Course, LawModel, Linearisation, Record, Setting
from orchestration.diagnosis.responses import steps_along
from orchestration.diagnosis.terms import NamedTerm, Released, Shape
from orchestration.fmu.model import catalogue
from orchestration.identify.fitting import Scale, scale_of

_STRENGTHS = (1.0, 10.0)  # of the declared size, where the response at null vanishes
_FACTORS = (0.3, 1.0, 3.0)  # of other positive parameters
_TIMES = (0.003, 0.02, 0.1, 0.5)  # of the length of a record, of a time constant
_MOST = 16  # settings of an effect
_Settings = Sequence[Mapping[str, float]]  # values of an effect's parameters
_UNSEEN = 1e-9  # of the spread, below which a response is none


@dataclass(frozen=True, eq=False)
class Named:
    """A named term with the response (n, ny) of the outputs to its coefficient, SI."""

    term: NamedTerm
    response: Array


def usable_effects(cls: type[Component]) -> dict[str, type[Effect]]:
    """Return the effects of a component's catalogue that a free run can have, by name.

    Without those that it has already, of random numbers, of discrete states, and of a switch that
    is not neutral at zero.
    """
    present = {effect_name(effect) for effect in unstack(cls)[1]}
    return {
        name: effect
        for name, effect in catalogue(cls).items()
        if effect_name(effect) not in present
        and not (effect.is_random or effect.output or effect.layout.discretes)
        and not _declared(effect)[0].start
    }


def _declared(effect: type[Effect]) -> list[ParameterDeclaration]:
    """Return the real parameters of an effect without start states, its switch first."""
    own = [p for p in effect.layout.parameters if p.type == "real" and not p.starts]
    return sorted(own, key=lambda p: p.name != effect.neutral)


def named_terms(
    model: LawModel,
    setting: Setting,
    records: Sequence[Record],
    courses: Sequence[Course],
    parts: Sequence[Linearisation],
    spread: Array,
) -> Iterator[Named]:
    """Yield named terms of all effects of a model, in several settings each.

    Parameters
    ----------
    model : LawModel
    setting : Setting
        Of the courses.
    records : sequence of Record
    courses : sequence of Course
        Of the model over the records.
    parts : sequence of Linearisation
        Along the courses.
    spread : ndarray, shape (ny,)
        Of the outputs.
    """
    if not model.effects:
        return
    responses_to = (
        _by_runs(model, setting, records, courses)
        if model.clocks
        else _by_forcing(model, setting, records, courses, parts)
    )
    length = max(float(record.time[-1] - record.time[0]) for record in records)
    for name, effect in model.effects.items():
        declared = _declared(effect)
        for strengths in ((0.0,), _STRENGTHS):
            settings = list(_settings(declared, strengths, length))
            try:
                responses = responses_to(name, settings)
            except UserError:  # it acts through a discrete state of its own
                break
            seen = False
            for k, one in enumerate(settings):
                response = responses[:, :, k] / (one[declared[0].name] or 1.0)
                size = float(np.sqrt(np.mean((response / spread) ** 2)))
                if np.isfinite(size) and size * declared[0].nominal > _UNSEEN:
                    seen = True
                    yield Named(_term(name, effect, declared, one, 1.0 / size), response / size)
            if seen:
                break


def _by_forcing(
    model: LawModel,
    setting: Setting,
    records: Sequence[Record],
    courses: Sequence[Course],
    parts: Sequence[Linearisation],
) -> Callable[[str, _Settings], Array]:
    """Return the function for responses (n, ny, k) to an effect in k settings, by its additions."""
    values = {p.name: float(v) for p, v in zip(model.parameters, setting.parameters, strict=True)}
    along = [
        _along(model, values, record, course)
        for record, course in zip(records, courses, strict=True)
    ]

    @cache
    def forcings(name: str) -> list[EffectForcing]:
        return [EffectForcing(one, model.effects[name]) for one in along]

    def responses_to(name: str, settings: _Settings) -> Array:
        runs = zip(records, parts, forcings(name), strict=True)
        return np.concatenate([_response(r, part, one.of(settings)) for r, part, one in runs])

    return responses_to


def _by_runs(
    model: LawModel, setting: Setting, records: Sequence[Record], courses: Sequence[Course]
) -> Callable[[str, _Settings], Array]:
    """Return the function for responses (n, ny, k) to an effect in k settings, by runs with it.

    Without other effects of the catalogue, or each pair of them would be compiled.
    """
    pairs = [(t, own) for t, own in setting.by_term() if not isinstance(t, NamedTerm)]
    terms = tuple(t for t, _ in pairs)
    values = np.concatenate([np.zeros(0), *(own for _, own in pairs)])
    plain = replace(setting, free=setting.free[:0], terms=terms, values=values)
    starts = [course.states[0][: len(model.states)] for course in courses]
    bases = [model.run(r, plain, x) for r, x in zip(records, starts, strict=True)]

    def response(
        record: Record, start: Array, base: Course | None, term: NamedTerm, strength: float
    ) -> Array:
        own = term.values(strength)
        changed = replace(plain, terms=(*terms, term), values=np.append(values, own))
        run = model.run(record, changed, start, sensitive=not strength)
        if run is None or base is None:
            return np.full((len(record.time), len(model.outputs)), np.nan)
        return run.outputs - base.outputs if strength else run.slopes[:, :, len(values)]

    def responses_to(name: str, settings: _Settings) -> Array:
        effect = model.effects[name]
        declared = _declared(effect)
        columns = []
        for one in settings:
            term = _term(name, effect, declared, one, 1.0)
            strength = one[declared[0].name]
            parts = zip(records, starts, bases, strict=True)
            columns.append(np.concatenate([response(*part, term, strength) for part in parts]))
        return np.dstack(columns)

    return responses_to


def _settings(
    declared: Sequence[ParameterDeclaration], strengths: Sequence[float], length: float
) -> Iterator[Mapping[str, float]]:
    """Yield values of an effect's parameters, within their ranges."""
    switch, *others = declared
    grids = [np.clip([s * switch.nominal for s in strengths], switch.min, switch.max)]
    for one in others:
        values = [float(one.start)]
        if one.unit == "s":
            values = [share * length for share in _TIMES]
        elif one.min >= 0.0 and one.start > 0.0 and len(others) < 3:
            values = [factor * float(one.start) for factor in _FACTORS]
        grids.append(np.unique(np.clip(values, one.min, one.max)))
    for chosen in itertools.islice(itertools.product(*grids), _MOST):
        yield {p.name: float(value) for p, value in zip(declared, chosen, strict=True)}


def _term(
    name: str,
    effect: type[Effect],
    declared: Sequence[ParameterDeclaration],
    setting: Mapping[str, float],
    size: float,
) -> NamedTerm:
    """Return the term of an effect, which starts from a setting."""
    others = declared[1:]
    starts = tuple(setting[p.name] for p in others)
    scales = [Scale(False, size), *(scale_of(p, v) for p, v in zip(others, starts, strict=True))]
    released = tuple(
        Released(p.name, p.unit, scale, p.min, p.max)
        for p, scale in zip(declared, scales, strict=True)
    )
    term = effect.term
    return NamedTerm(
        term.law,
        term.signal,
        Shape.LINEAR,
        constants=starts,
        effect=name,
        title=effect.title,
        formula=term.shape,
        family=term.family or name,
        released=released,
    )


def _along(
    model: LawModel, values: Mapping[str, float], record: Record, course: Course
) -> ComponentAlong:
    """Return the component along a course, with inputs as the run takes them."""
    time, inputs = record.time[np.newaxis], record.inputs.T
    states = course.states.T[: len(model.states)]
    none = np.zeros((0, len(record.time)))
    begin = Points(time, inputs, states, none)
    later = np.append(np.arange(1, len(record.time)), len(record.time) - 1)
    smooth = np.array(record.smooth, dtype=bool)[:, np.newaxis]
    at_end = np.where(smooth, inputs[:, later], inputs)
    end = Points(time[:, later], at_end, states[:, later], none)
    return ComponentAlong(model.cls, values, begin, end)


def _response(record: Record, part: Linearisation, forcing: Forcing) -> Array:
    """Return the change (n, ny, k) of the outputs of a model that is linearised along a course."""
    n, own, k = forcing.begin.shape
    nx = part.rates.shape[1]
    transitions, driven = steps_along(part, np.diff(record.time))
    between = driven[:, :, :own] @ (0.5 * (forcing.begin + forcing.end))[:-1]
    states = np.zeros((n, nx, k))
    for j, transition in enumerate(transitions):
        states[j + 1] = transition @ states[j] + between[j]
    return np.asarray(forcing.shown + part.outputs[:, :, part.outputs.shape[2] - nx :] @ states)
