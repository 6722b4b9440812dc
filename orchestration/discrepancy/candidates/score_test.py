"""Score directions: how effects would move the residual, without any fit (Rao's score test).

At the fitted model an effect is evaluated at its neutral value, which gives the derivative by its
switch, and, because some do nothing until they are large, at a few other values, which give a
difference. Second parameters, such as time constants, are taken on a small grid. All effects
together are evaluated along one simulation of the model, to first order in what they do to its
states (`fmus.kit.symbolic.EffectForcing`); where the model or the effect samples, it is simulated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.effects import made_by
from fmus.kit.sensors import transport_delay
from fmus.kit.symbolic import ComponentAlong, EffectForcing, Points
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.candidates.linear_response import StepMatrices
from orchestration.identify.fitting import Problem, Scale, scale_of
from orchestration.records.runs import MeasuredRun

GRID = (0.2, 0.45, 1.0, 2.2, 5.0)  # times the default of a second parameter
COARSE = (0.2, 1.0, 5.0)  # of two of them
SWITCHED = (1.0, 4.0, 16.0)  # times the nominal value of a switch, where differences are taken
# Lengths of a delay: it shows a step of an input another sample later, which is no smooth function
# of it.
_DELAYS = 16
_CLOSE = 3.0  # from one time constant to the next, at most, where it is the only second parameter
_APART = 6.0  # where there are others
# of a change, in whatever unit: far beyond, a simulation ran away, and products overflow
_LARGEST = 1e15
_TRUST = 1.0 / 3.0, 3.0  # multiples of a difference that it still represents


@dataclass(frozen=True)
class ScoreDirection:
    """A setting of an effect, in which it changes the residual.

    Attributes
    ----------
    values : dict of str to float
        Its parameters, SI; the switch is where the derivative was taken, or where the difference
        ends.
    least, most : float
        How much of it there may be: bounds of the searched coordinate, or how far a difference can
        be trusted.
    """

    values: dict[str, float]
    least: float
    most: float


@dataclass(frozen=True, eq=False)  # products of them are kept by identity
class ScoreDirections:
    """Changes of the residual by an effect in k settings.

    Attributes
    ----------
    effect : type[Effect]
    settings : list of ScoreDirection
    gradient : dict of str to ndarray of float32, shape (m, k)
        Derivatives by the searched coordinate of the switch, or differences, of every output where
        it was measured.
    """

    effect: type[Effect]
    settings: list[ScoreDirection]
    gradient: dict[str, NDArray[np.float32]]

    def start_values(self, k: int, amount: float) -> dict[str, float]:
        """Return the parameters of the effect from which a fit starts, for an amount of one."""
        setting = self.settings[k]
        if setting.least > 0.0:
            return setting.values
        declared, scale = _switch(self.effect)
        value = scale.value(scale.position(float(declared.start)) + amount)
        limited = float(np.clip(value, declared.min, declared.max))
        return setting.values | {self.effect.neutral: limited}


def score_directions(
    model: FittedCandidate, effects: Iterable[type[Effect]], linear: Iterable[str]
) -> Iterator[tuple[type[Effect], ScoreDirections | None]]:
    """Evaluate how effects would move the residual of a fitted model, to first order.

    Parameters
    ----------
    model : FittedCandidate
    effects : iterable of type[Effect]
    linear : iterable of str
        Inputs that are interpolated between samples instead of held.

    Yields
    ------
    tuple of type[Effect] and ScoreDirections or None
        None of an effect that has to be simulated; see `simulated_directions`.
    """
    try:
        courses = _courses(model, frozenset(linear))
    except UserError:
        courses = []
    for effect in effects:
        directions = None
        if courses:
            try:
                directions = _first_order(model.problem, courses, effect)
            except UserError:
                directions = None
        yield effect, directions


@dataclass(frozen=True)
class _Course:
    """A run of a record as the fitted model simulates it."""

    run: MeasuredRun
    component: ComponentAlong
    matrices: StepMatrices
    shown: Array  # (n, outputs, states)
    rows: dict[str, int]  # outputs that are measured, by their place; states follow outputs


def _courses(model: FittedCandidate, linear: frozenset[str]) -> list[_Course]:
    """Linearise a fitted model along its simulation of every run."""
    problem = model.problem
    values = problem.start | problem.values(model.fit.q)
    ran = problem.model.run(problem.time, problem.inputs, values, problem.effort, problem.runs)
    courses = []
    for run in problem.runs:
        begin, end = points_of_run(
            model.candidate.cls, problem.time, problem.inputs, ran.signals, run, linear
        )
        component = ComponentAlong(model.candidate.cls, run.values(values), begin, end)
        courses.append(_linearised(run, component, list(problem.measured)))
    return courses


def _linearised(run: MeasuredRun, component: ComponentAlong, measured: Sequence[str]) -> _Course:
    """Linearise a component along its trajectory over one run."""
    at_begin = component.linearised(component.begin)
    at_end = component.linearised(component.end)
    steps = np.diff(component.begin.time[0])
    matrices = StepMatrices(at_begin.a, at_end.a, steps)
    layout = component.cls.layout
    states = np.eye(len(layout.states))
    itself = np.broadcast_to(states, (len(steps) + 1, *states.shape))
    names = [v.name for v in (*layout.outputs, *layout.states)]
    for output in measured:
        if output not in names:
            raise UserError(f"{output} is sampled: what an effect does to it is no linear response")
    rows = {o: names.index(o) for o in measured}
    return _Course(run, component, matrices, np.concatenate([at_begin.c, itself], axis=1), rows)


def points_of_run(
    cls: type[Component],
    time: Array,
    inputs: Mapping[str, Any],
    signals: Mapping[str, Array],
    run: MeasuredRun,
    linear: frozenset[str],
) -> tuple[Points, Points]:
    """Return the begin and the end of every step of a simulated run, on its own clock.

    Parameters
    ----------
    cls : type[Component]
    time : ndarray, shape (n,)
    inputs : Mapping of str to ndarray, shape (n,) or ()
        SI; those that are not given have their start value.
    signals : Mapping of str to ndarray, shape (n,)
        States and discrete states, SI.
    run : MeasuredRun
    linear : frozenset of str
        Inputs that are interpolated between samples instead of held.
    """
    layout = cls.layout
    at = run.samples
    count = len(time[at])

    def rows(group: Sequence[Any], values: Mapping[str, Any]) -> Array:
        full = [np.broadcast_to(values.get(v.name, v.start), len(time))[at] for v in group]
        return np.array(full, dtype=float).reshape(len(group), count)

    fed = rows(layout.inputs, inputs)
    begin = Points(
        time[at][np.newaxis] - run.ahead,
        fed,
        rows(layout.states, signals),
        # sampled when a step begins, and shown from the next sample on
        _following(rows(layout.discretes, signals)),
    )
    moves = np.array([v.name in linear for v in layout.inputs], dtype=bool)[:, np.newaxis]
    end = Points(
        _following(begin.time),
        np.where(moves, _following(fed), fed),
        _following(begin.states),
        begin.discretes,
    )
    return begin, end


def _following(values: Array) -> Array:
    """Return the values (k, n) of the sample after each one; of the last, its own."""
    return np.hstack([values[:, 1:], values[:, -1:]])


def _first_order(
    problem: Problem, courses: Sequence[_Course], effect: type[Effect]
) -> ScoreDirections:
    """Return the directions of one effect."""
    settings = _settings(effect, problem.time)
    if made_by(effect) is transport_delay:
        changes = [_delayed(course, effect, settings) for course in courses]
        settings = settings[1:]
    else:
        changes = [_changes(course, effect, settings) for course in courses]
    gradient: dict[str, Array] = {}
    for output, present in problem.present.items():
        whole = np.zeros((len(problem.time), len(settings)))
        for course, change in zip(courses, changes, strict=True):
            whole[course.run.samples] = change[output]
        gradient[output] = -whole[present]
    finite = np.all([(np.abs(g) < _LARGEST).all(axis=0) for g in gradient.values()], axis=0)
    seen = np.any([g.any(axis=0) for g in gradient.values()], axis=0)
    kept = np.flatnonzero(finite & seen)
    return ScoreDirections(
        effect,
        [settings[k] for k in kept],
        {o: g[:, kept].astype(np.float32) for o, g in gradient.items()},
    )


def _changes(
    course: _Course, effect: type[Effect], settings: Sequence[ScoreDirection]
) -> dict[str, Array]:
    """Return the changes (n, k) of measured outputs in k settings, by searched coordinates."""
    declared, scale = _switch(effect)
    forcing = EffectForcing(course.component, effect).of([one.values for one in settings])
    acts = forcing.begin.any() or forcing.end.any()
    moved = course.matrices.response(forcing.begin, forcing.end) if acts else None
    slope = scale.slope(scale.position(float(declared.start)))
    size = np.array([1.0 if one.least > 0.0 else slope for one in settings])
    changes = {}
    for output, row in course.rows.items():
        change = np.zeros((len(forcing.begin), len(settings)))
        if moved is not None:
            change += np.einsum("ns,nsk->nk", course.shown[:, row], moved)
        if row < forcing.shown.shape[1]:
            change += forcing.shown[:, row]
        changes[output] = change * size
    return changes


def _delayed(
    course: _Course, effect: type[Effect], settings: Sequence[ScoreDirection]
) -> dict[str, Array]:
    """Return the changes (n, k) of measured outputs by delays of one of them."""
    time = course.component.begin.time[0]
    lengths = np.array([one.values[effect.neutral] for one in settings if one.least > 0.0])
    changes = {o: np.zeros((len(time), len(lengths))) for o in course.rows}
    output = effect.output
    if output in course.rows:
        begin, end = course.component.outputs(course.rows[output])
        for k, length in enumerate(lengths):
            then = np.maximum(time - length, time[0])
            i = np.minimum(np.searchsorted(time, then, "right") - 1, len(time) - 2)
            share = (then - time[i]) / (time[i + 1] - time[i])
            changes[output][:, k] = begin[i] + share * (end[i] - begin[i]) - begin
    return changes


def _settings(effect: type[Effect], time: Array) -> list[ScoreDirection]:
    """Return the settings of an effect: its derivative, and differences, on the grid."""
    declared, scale = _switch(effect)
    neutral = float(declared.start)
    here = scale.position(neutral)
    low = scale.position(float(declared.min)) - here
    high = scale.position(float(declared.max)) - here
    fixed = {p.name: float(p.start) for p in effect.layout.parameters if p.type != "string"}
    own = own_parameters(effect)
    settings = []
    for second in _grid(own[1:], effect.declared, time):
        values = {name: fixed[name] for name in own} | second
        settings.append(ScoreDirection(values | {effect.neutral: neutral}, low, high))
        settings += [
            ScoreDirection(values | {effect.neutral: value}, *_TRUST)
            for value in _trials(effect, declared, time)
        ]
    return settings


def _switch(effect: type[Effect]) -> tuple[Any, Scale]:
    """Return the declaration of an effect's switch, and the scale in which it is searched."""
    declared: Any = effect.declared[effect.neutral]
    return declared, scale_of(declared, float(declared.start))


def simulated_directions(problem: Problem, effect: type[Effect]) -> ScoreDirections:
    """Simulate how an effect would move the residual.

    Parameters
    ----------
    problem : Problem
        Of the model with the effect, its start being the fitted base; searched is what the effect
        brings.
    effect : type[Effect]

    Raises
    ------
    UserError
        If it cannot be simulated, whatever its second parameters.
    """
    settings: list[ScoreDirection] = []
    columns: list[dict[str, Array]] = []
    failure = None
    for setting in _settings(effect, problem.time):
        try:
            column = _simulated(problem, effect, setting)
        except UserError as error:  # with such a shape it cannot be simulated, with another perhaps
            failure = error
            continue
        if any(values.any() for values in column.values()):
            settings.append(setting)
            columns.append(column)
    problem.forget_simulation()
    if failure is not None and not settings:
        raise failure
    gradient = {
        o: np.column_stack([np.empty((int(p.sum()), 0)), *(c[o] for c in columns)]).astype(
            np.float32
        )
        for o, p in problem.present.items()
    }
    return ScoreDirections(effect, settings, gradient)


def _simulated(problem: Problem, effect: type[Effect], setting: ScoreDirection) -> dict[str, Array]:
    """Return the derivative by the switch, or the difference that a value of it makes."""
    neutral = {effect.neutral: float(_switch(effect)[0].start)}
    second = problem.start | setting.values | neutral
    base, slopes = problem.evaluate(problem.position(second))
    if setting.least <= 0.0:
        column = problem.names.index(effect.neutral)
        return {output: slope[:, column] for output, slope in slopes.items()}
    moved, _ = problem.evaluate(problem.position(problem.start | setting.values))
    return {output: moved[output] - base[output] for output in base}


def _trials(effect: type[Effect], switch: Any, time: Array) -> list[float]:
    """Return values of a switch at which a difference is taken, within its range."""
    if made_by(effect) is transport_delay:
        step = float(np.median(np.diff(time)))
        most = switch.max
        samples = np.unique(
            np.round(np.expm1(np.linspace(0.0, np.log1p(most / step - 0.5), _DELAYS)))
        )
        return [float(k + 0.5) * step for k in samples if (k + 0.5) * step <= most] or [most]
    if switch.start > switch.min:  # it goes both ways and is seen at its neutral value
        return []
    values = [switch.start + factor * switch.nominal for factor in SWITCHED]
    if _is_time(switch):
        values = _times(time, _APART)
    return sorted({float(min(value, switch.max)) for value in values})


def _grid(names: Sequence[str], declared: Mapping[str, Any], time: Array) -> list[dict[str, float]]:
    """Return points of the second parameters.

    A time lies between the step of the record and its length, whatever its default; others are at
    some multiples of theirs.
    """
    alone = len(names) < 2
    choices = []
    for name in names:
        p = declared[name]
        values = [p.start * factor for factor in (GRID if alone else COARSE)]
        if _is_time(p):
            values = _times(time, _CLOSE if alone else _APART)
        choices.append(sorted({float(np.clip(value, p.min, p.max)) for value in values}))
    return [dict(zip(names, point, strict=True)) for point in product(*choices)]


def _is_time(declared: Any) -> bool:
    """Return whether a parameter is a time, such as the constant of a lag."""
    return bool(declared.unit == "s")


def _times(time: Array, ratio: float) -> list[float]:
    """Return times between two samples and a tenth of a record, so many times apart at most.

    What remembers for longer is hardly told from a drift.
    """
    shortest = 2.0 * float(np.median(np.diff(time)))
    longest = max(float(time[-1] - time[0]) / 10.0, shortest)
    count = int(np.ceil(np.log(longest / shortest) / np.log(ratio))) + 1
    return [float(value) for value in np.geomspace(shortest, longest, count)]
