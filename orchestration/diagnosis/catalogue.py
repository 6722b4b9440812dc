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
from functools import cache, cached_property

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.effects import effect_name, unstack
from fmus.kit.symbolic import ComponentAlong, EffectForcing, Forcing, Points
from fmus.kit.titles import effect_title
from orchestration.diagnosis.courses import Courses
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.responses import Drives, Stepped, steps_along
from orchestration.diagnosis.runs import Course, Linearisation, Record, Setting
from orchestration.diagnosis.terms import NamedTerm, Released, Shape
from orchestration.fmu.model import catalogue
from orchestration.identify.fitting import Scale, scale_of

_STRENGTHS = (1.0, 10.0)  # of the declared size, where the response at null vanishes
_FACTORS = (0.3, 1.0, 3.0)  # of other positive parameters
_TIMES = (0.003, 0.02, 0.1, 0.5)  # of the length of a record, of a time constant
_SHORTEST = 0.1  # of a step of the record, of a time constant: a lag of a quarter is seen
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
    return usable_of(cls, catalogue(cls))


def usable_of(cls: type[Component], effects: Mapping[str, type[Effect]]) -> dict[str, type[Effect]]:
    """Return those of some effects by name that a free run can have; see `usable_effects`."""
    present = {effect_name(effect) for effect in unstack(cls)[1]}
    return {
        name: effect
        for name, effect in effects.items()
        if effect_name(effect) not in present
        and not (effect.is_random or effect.output or effect.layout.discretes)
        and not _declared(effect)[0].start
    }


def _declared(effect: type[Effect]) -> list[ParameterDeclaration]:
    """Return the real parameters of an effect without start states, its switch first."""
    own = [p for p in effect.layout.parameters if p.type == "real" and not p.starts]
    return sorted(own, key=lambda p: p.name != effect.neutral)


def named_terms(along: Courses) -> Iterator[Named]:
    """Yield named terms of all effects of a model, in several settings each."""
    if not along.model.effects:
        return
    responses_to = _by_runs(along) if along.model.clocks else _by_forcing(along)
    for name, effect in along.model.effects.items():
        declared = _declared(effect)
        for strengths in ((0.0,), _STRENGTHS):
            settings = list(_settings(declared, strengths, along.length))
            try:
                responses = responses_to(name, settings)
            except UserError:  # it cannot be laid over this model
                break
            seen = False
            for k, one in enumerate(settings):
                response = responses[:, :, k] / (one[declared[0].name] or 1.0)
                size = float(np.sqrt(np.mean((response / along.spread) ** 2)))
                if np.isfinite(size) and size * declared[0].nominal > _UNSEEN:
                    seen = True
                    term = _term(name, effect, one, 1.0 / size, along.step)
                    yield Named(term, response / size)
            if seen:
                break


def _by_forcing(along: Courses) -> Callable[[str, _Settings], Array]:
    """Return the function for responses (n, m, k) to an effect in k settings, by its additions."""
    components = _components(along)
    pairs = zip(along.pieces, along.parts, strict=True)
    steps = [steps_along(part, np.diff(piece.time)) for piece, part in pairs]

    @cache
    def forcings(name: str) -> list[EffectForcing]:
        return [EffectForcing(one, along.model.effects[name]) for one in components]

    def responses_to(name: str, settings: _Settings) -> Array:
        return _responses(along, steps, [one.of(settings) for one in forcings(name)])

    return responses_to


def _by_runs(along: Courses) -> Callable[[str, _Settings], Array]:
    """Return the function for responses (n, m, k) to an effect in k settings, by runs with it."""
    model = along.model
    pieces = [
        _Piece(model, piece, _without_effects(along.setting(piece)), course.states[0])
        for piece, course in zip(along.pieces, along.courses, strict=True)
    ]

    def responses_to(name: str, settings: _Settings) -> Array:
        effect = model.effects[name]
        switch = _declared(effect)[0].name
        columns = []
        for one in settings:
            term = _term(name, effect, one, 1.0, along.step)
            each = [piece.response(term, one[switch]) for piece in pieces]
            columns.append(np.concatenate(each))
        return np.dstack(columns)[:, along.measured]

    return responses_to


def _without_effects(setting: Setting) -> Setting:
    """Return a setting without terms of the catalogue, each pair of which would be compiled."""
    pairs = [(t, own) for t, own in setting.by_term() if not isinstance(t, NamedTerm)]
    values = np.concatenate([np.zeros(0), *(own for _, own in pairs)])
    return replace(setting, free=setting.free[:0], terms=tuple(t for t, _ in pairs), values=values)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A piece of a record, over which runs with an effect are compared to one without.

    Attributes
    ----------
    model : LawModel
    record : Record
    setting : Setting
    begin : ndarray, shape (nx + nz,)
        States and memories.
    """

    model: LawModel
    record: Record
    setting: Setting
    begin: Array

    def response(self, term: NamedTerm, strength: float) -> Array:
        """Return the change (n, ny) of the outputs by an effect, at no strength its slope."""
        plain = self.setting
        terms, values = (*plain.terms, term), np.append(plain.values, term.values(strength))
        run = self._run(replace(plain, terms=terms, values=values), sensitive=not strength)
        if run is None or self._base is None:
            return np.full((len(self.record.time), len(self.model.outputs)), np.nan)
        if strength:
            return run.outputs - self._base.outputs
        slopes = np.zeros_like(run.outputs)
        slopes[:, self.record.measured] = run.slopes[:, :, len(plain.values)]
        return slopes

    @cached_property
    def _base(self) -> Course | None:
        return self._run(self.setting)

    def _run(self, setting: Setting, *, sensitive: bool = False) -> Course | None:
        start = self.begin[: len(self.model.states)]
        return self.model.run(self.record, setting, start, sensitive=sensitive)


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
    name: str, effect: type[Effect], setting: Mapping[str, float], size: float, step: float
) -> NamedTerm:
    """Return the term of an effect, which starts from a setting.

    A time constant is not much shorter than a step of the record (s): a run has as many steps.
    """
    declared = _declared(effect)
    starts = tuple(setting[p.name] for p in declared[1:])
    others = (scale_of(p, v) for p, v in zip(declared[1:], starts, strict=True))
    scales = [Scale(False, size), *others]
    least = {"s": _SHORTEST * step}
    released = tuple(
        Released(p.name, p.unit, scale, max(p.min, least.get(p.unit, p.min)), p.max)
        for p, scale in zip(declared, scales, strict=True)
    )
    term = effect.term
    return NamedTerm(
        term.law,
        term.signal,
        Shape.LINEAR,
        constants=starts,
        effect=name,
        title=effect_title(effect),
        formula=term.shape,
        family=term.family or name,
        released=released,
    )


def _components(along: Courses) -> list[ComponentAlong]:
    """Return the component along each course, with inputs as the run takes them."""
    model = along.model
    components = []
    for piece, course in zip(along.pieces, along.courses, strict=True):
        pairs = zip(model.parameters, along.setting(piece).parameters, strict=True)
        values = {p.name: float(v) for p, v in pairs}
        states = course.states.T[: len(model.states)]
        begin = Points(piece.time[np.newaxis], piece.inputs.T, states)
        later = np.append(np.arange(1, len(piece.time)), len(piece.time) - 1)
        smooth = np.array(piece.smooth, dtype=bool)[:, np.newaxis]
        at_end = np.where(smooth, begin.inputs[:, later], begin.inputs)
        end = Points(begin.time[:, later], at_end, states[:, later])
        components.append(ComponentAlong(model.cls, values, begin, end))
    return components


def _responses(
    along: Courses, steps: Sequence[tuple[Array, Array]], forcings: Sequence[Forcing]
) -> Array:
    """Return the change (n, m, k) of the measured outputs of the model linearised along courses.

    By the steps of each course; see `steps_along`.
    """
    changes = []
    for part, step, forcing in zip(along.parts, steps, forcings, strict=True):
        # a state that is shown is an output without additions of its own
        of_states = ((0, 0), (0, len(along.measured) - forcing.shown.shape[1]), (0, 0))
        shown = np.pad(forcing.shown, of_states)[:, along.measured]
        additions = np.concatenate([0.5 * (forcing.begin + forcing.end), shown], axis=1)
        n, count, k = additions.shape
        values = additions.transpose(1, 2, 0).reshape(count * k, n)
        rows = np.zeros((3, count * k), dtype=int)
        rows[:2] = np.repeat(np.arange(count), k), np.arange(count * k)
        drives = Drives(values, np.ones((1, n)), rows)
        stepped, by_additions, at_once = _stepped(part, *step, count)
        at_rest = np.zeros((by_additions.shape[1], count * k))
        each = stepped.responses(at_rest, by_additions, at_once, drives)
        changes.append(each.reshape(n, -1, count, k).sum(axis=2))
    return np.concatenate(changes)


def _stepped(
    part: Linearisation, transitions: Array, driven: Array, count: int
) -> tuple[Stepped, Array, Array]:
    """Return the steps of a course, and what additions to its rates, then its outputs, do.

    To the states at the next sample, (n - 1, nx, count), and to the outputs (n, m, count) at once.
    """
    n, m, _ = part.outputs.shape
    nx = transitions.shape[1]
    by_states = part.outputs[:, :, part.outputs.shape[2] - nx :]
    by_outputs = np.zeros((n - 1, nx, m))
    if part.gains is not None:
        by_outputs = -transitions @ part.gains[:-1]
        transitions = transitions + by_outputs @ by_states[:-1]
    by_additions = np.concatenate([driven[:, :, : count - m], by_outputs], axis=2)
    at_once = np.zeros((n, m, count))
    at_once[:, :, count - m :] = np.eye(m)
    return Stepped(transitions, by_states, 1, smooth=False), by_additions, at_once
