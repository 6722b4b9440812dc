"""Outputs as they are recorded: late, by another clock, or without their sign.

A late output moves nothing else, so that it needs no state: outputs and their derivatives are read
a delay earlier, between samples of the model, and the derivative by the delay is the slope there,
with its sign changed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.declare import Declaration
from orchestration.diagnosis.runs import Course, Linearisation, Record, Setting
from orchestration.diagnosis.terms import DelayTerm


class _Model(Protocol):
    """A model that runs without delays."""

    outputs: tuple[Declaration, ...]

    def run(
        self, record: Record, setting: Setting, start: Array, *, sensitive: bool
    ) -> Course | None: ...

    def linearise(self, record: Record, setting: Setting, course: Course) -> Linearisation: ...


class _Delay(NamedTuple):
    """A delay of an output: its place among values and outputs, its size and its value, s."""

    place: int
    output: int
    size: float
    seconds: float

    @property
    def slope(self) -> float:
        """By the value of its term: none where that would be a delay into the future."""
        return self.size if self.seconds > 0.0 else 0.0


def has_delays(setting: Setting) -> bool:
    """Return whether an output is late."""
    return any(isinstance(term, DelayTerm) for term in setting.terms)


def run_late(
    model: _Model, record: Record, setting: Setting, start: Array, *, sensitive: bool
) -> Course | None:
    """Run freely with late outputs; see `LawModel.run`."""
    plain, delays = _divided(model, setting)
    course = model.run(record, plain, start, sensitive=sensitive)
    if course is None or not sensitive:
        return None if course is None else replace(course, outputs=_late(course, record, delays))
    slopes = course.slopes.copy()
    shown = np.flatnonzero(record.measured).tolist()
    by_delay = np.zeros((*slopes.shape[:2], len(delays)))
    for k, delay in enumerate(delays):
        if delay.output in shown:
            own = shown.index(delay.output)
            slopes[:, own], _ = earlier(course.slopes[:, own], record.time, delay.seconds)
            rate = earlier(course.outputs[:, delay.output], record.time, delay.seconds)[1]
            by_delay[:, own, k] = -delay.slope * rate
    slopes = _inserted(slopes, by_delay, delays, len(setting.free))
    return replace(course, outputs=_late(course, record, delays), slopes=slopes)


def linearise_late(
    model: _Model, record: Record, setting: Setting, course: Course
) -> Linearisation:
    """Linearise along a course of `run_late`; outputs follow the states at once there."""
    plain, delays = _divided(model, setting)
    part = model.linearise(record, plain, course)
    by_delay = np.zeros((*part.outputs.shape[:2], len(delays)))
    for k, delay in enumerate(delays):
        rate = np.gradient(course.outputs[:, delay.output], record.time)
        by_delay[:, delay.output, k] = -delay.slope * rate

    def inserted(array: Array, columns: Array) -> Array:
        return _inserted(array, columns, delays, len(setting.free))

    def unmoved(array: Array) -> Array:
        return inserted(array, np.zeros((*array.shape[:2], len(delays))))

    return replace(
        part,
        rates=unmoved(part.rates),
        outputs=inserted(part.outputs, by_delay),
        steps=None if part.steps is None else unmoved(part.steps),
    )


def recorded(course: Course, record: Record) -> Course:
    """Return a course with outputs as they are recorded: by another clock, or without a sign."""
    if record.pace:
        there = record.time / (1.0 + record.pace)
        own = course.outputs, course.slopes
        outputs, slopes = (_at(a, record.time, there)[0] if len(a) else a for a in own)
        course = replace(course, outputs=outputs, slopes=slopes)
    if record.folds is None:
        return course
    moved = course.outputs - record.folds
    is_folded = np.isfinite(moved)
    signs = np.where(is_folded, np.where(moved < 0.0, -1.0, 1.0), 1.0)
    slopes = course.slopes
    if len(slopes):
        slopes = slopes * signs[:, record.measured, np.newaxis]
    outputs = np.where(is_folded, np.abs(moved), course.outputs)
    return replace(course, outputs=outputs, slopes=slopes, signs=signs)


def linearise_recorded(course: Course, part: Linearisation) -> Linearisation:
    """Return derivatives along a course with the signs that its outputs lost."""
    if course.signs is None:
        return part
    signs = course.signs[:, :, np.newaxis]
    outputs, by_laws = part.outputs * signs, part.outputs_by_laws * signs
    return replace(part, outputs=outputs, outputs_by_laws=by_laws)


def earlier(values: Array, time: Array, delay: float) -> tuple[Array, Array]:
    """Return values (n, ...) a delay earlier, linear between samples, and their slopes there.

    Before the first sample they are as there.
    """
    return _at(values, time, time - max(delay, 0.0))


def _at(values: Array, time: Array, instants: Array) -> tuple[Array, Array]:
    """Return values (n, ...) at other instants (n,), and their slopes there."""
    place = np.clip(np.searchsorted(time, instants, side="right") - 1, 0, len(time) - 2)
    step = time[place + 1] - time[place]
    share = np.clip((instants - time[place]) / step, 0.0, 1.0)
    extra = (1,) * (values.ndim - 1)
    change = values[place + 1] - values[place]
    inside = np.where(instants >= time[0], 1.0 / step, 0.0).reshape(-1, *extra)
    return values[place] + share.reshape(-1, *extra) * change, inside * change


def _late(course: Course, record: Record, delays: list[_Delay]) -> Array:
    outputs = course.outputs.copy()
    for delay in delays:
        own = course.outputs[:, delay.output]
        outputs[:, delay.output], _ = earlier(own, record.time, delay.seconds)
    return outputs


def _divided(model: _Model, setting: Setting) -> tuple[Setting, list[_Delay]]:
    """Return a setting without delays, and these."""
    names = [output.name for output in model.outputs]
    terms, values, delays = [], [np.zeros(0)], []
    place = 0
    for term, own in setting.by_term():
        if isinstance(term, DelayTerm):
            seconds = float(term.size * own[0])
            delays.append(_Delay(place, names.index(term.law), term.size, seconds))
        else:
            terms.append(term)
            values.append(own)
        place += len(own)
    return replace(setting, terms=tuple(terms), values=np.concatenate(values)), delays


def _inserted(array: Array, columns: Array, delays: list[_Delay], first: int) -> Array:
    """Return derivatives (n, m, k) with those by the delays at their places among the values."""
    for k, delay in enumerate(delays):
        array = np.insert(array, first + delay.place, columns[:, :, k], axis=2)
    return array
