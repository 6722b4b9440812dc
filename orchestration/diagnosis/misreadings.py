"""Readings of a file that make a model of it: a screen of all, and fits of the few that gain.

A reading is judged by the free run that the model makes of it, as terms are. First all of them
are run at the nominal parameters and at those that were fitted to the file as it was read. Then the
best of each kind are fitted, and those that gain beside the file as it was read are kept.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.comparison import Judged, are_same, common_of, compare, inexact
from orchestration.diagnosis.fitting import (
    Point,
    Problem,
    fit,
    fit_base,
    mean_squares,
    nominal_point,
)
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import Reading, ReadingKind, readings_of
from orchestration.diagnosis.responses import Projection
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.subject import LeftOut, Subject, divided_as_read, thinned

_OF_A_KIND = 2  # readings of a kind that are fitted
_KEPT = 2  # readings on top of which laws are searched
_STEPS = 3
_ROUNDS = 3  # of estimates of a shift and of the parameters by turns
_WEIGHT = 10.0  # of squared errors in spreads: within a third, as a first fit of the model
_LATEST = 8  # share of a record, by which a column is late at most
_DELAYS = 1.6  # ratio of delays that are tried
_DIFFERENCE = 1e-2  # of the spread of a column, for the derivative by its offset
_NEAREST = 2  # points of a reading at which the model is run
_LONGEST = 0.7  # of a step of the screen, in prior deviations
_MOST = 600  # samples of a screen
_FOLLOWS = 0.5  # of the spread, up to which a model follows a record
_HOPELESS = 1.0  # misfit above that of the file as it was read, of a reading of as many steps


Run = tuple[Array, Array]  # outputs (n, ny) of a record; slopes (n, m, p + nx) of measured ones


@dataclass(frozen=True, eq=False)
class _Trial:
    """A reading of a subject at a point, with its misfit: the mean logarithm of the errors."""

    subject: Subject
    reading: Reading
    problem: Problem
    left_out: tuple[LeftOut, ...]
    point: Point
    misfit: float


class _Screen:
    """Readings of a subject at two points: the nominal one, and that which was fitted to the file.

    From each goes a Gauss-Newton step, which is shortened as in a fit; the misfit is that of the
    run there.
    """

    def __init__(self, subject: Subject):
        self.subject = subject
        self._runs = [_runs(subject.problem, point) for point in self._points(subject.problem)]

    def best(self, reading: Reading) -> _Trial | None:
        """Return a reading with the shift that is best, from the better point."""
        trials = [t for shift in self._shifts(reading) for t in self._trials(reading, shift)]
        nearest = sorted(trials, key=lambda t: t.misfit)[:_NEAREST]
        moved = [replace(t, misfit=_misfit(t.problem, t.point)) for t in nearest]
        best = min(moved, key=lambda t: t.misfit, default=None)
        if best is not None and reading.kind is ReadingKind.OFFSET:
            return _shifted(best) or best
        return best

    def _shifts(self, reading: Reading) -> list[float]:
        """Return the shifts of a reading that are tried."""
        if reading.kind is not ReadingKind.LATE:
            return [reading.shift]
        time = self.subject.problem.records[0].time
        most = max(1, len(time) // _LATEST)
        count = int(np.log(most) / np.log(_DELAYS)) + 2
        samples = np.unique(np.geomspace(1.0, most, count).astype(int))
        step = float(np.median(np.diff(time)))
        # an early input of a model with one output is a late output
        signs = (1.0, -1.0) if self.subject.problem.records[0].measured.sum() > 1 else (1.0,)
        return [float(sign * k * step) for k in samples for sign in signs]

    def _points(self, problem: Problem) -> list[Point]:
        """Return both points with the start states that a problem expects."""
        starts = tuple(prior.mean for prior in problem.starts)
        both = nominal_point(problem), self.subject.base.point
        return [replace(point, starts=starts) for point in both]

    def _trials(self, reading: Reading, shift: float) -> Iterator[_Trial]:
        """Yield a reading a step from each point at which the model runs, with what is expected."""
        trial = _read(self.subject, replace(reading, shift=shift))
        problem, known = trial.problem, self.subject.problem
        is_same = not reading.moves_inputs(problem.model) and all(
            np.array_equal(one.mean, other.mean)
            for one, other in zip(problem.starts, known.starts, strict=True)
        )
        for point, as_read in zip(self._points(problem), self._runs, strict=True):
            runs = as_read if is_same else _runs(problem, point)
            if runs is not None:
                there, misfit = _stepped(problem, point, runs)
                yield replace(trial, point=there, misfit=misfit)


def misreadings(subject: Subject, base: Judged) -> list[Subject]:
    """Return a subject for each reading that gains beside the file as it was read, the best first.

    Parameters
    ----------
    subject : Subject
        Of the file as it was read.
    base : Judged
        Its fit without terms.
    """
    screen = _Screen(_thin(subject))
    readings = readings_of(subject.problem.model, subject.problem.records)
    as_read = _misfit(subject.problem, subject.base.point)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        first = [t for t in pool.map(screen.best, readings) if t is not None]
        refined = pool.map(_refined, list(_best_of_each_kind(first)))
        hopeful = [t for t in refined if t is not None and t.misfit < as_read + _hope(t, subject)]
        read = pool.map(lambda t: _fitted(_read_again(subject, t)), hopeful)
        judged = [(s, s.judge(s.base)) for s in read if s is not None]
    return _gaining([(s, j) for s, j in judged if j is not None], base)


def _hope(trial: _Trial, subject: Subject) -> float:
    """Return the misfit above that of the file as it was read, up to which a reading is fitted on.

    By another clock a run may take many more steps; the less it may then be behind.
    """
    return _HOPELESS * subject.problem.substeps / max(trial.problem.substeps, 1)


def _thin(subject: Subject) -> Subject:
    """Return a subject of fewer samples, if the model sees no difference."""
    problem = subject.problem
    most = _MOST // len(problem.records)
    records = tuple(thinned(problem, r, problem.mean, most) for r in problem.records)
    return replace(subject, problem=replace(problem, records=records), left_out=())


def _read_again(subject: Subject, trial: _Trial) -> _Trial:
    """Return a trial of all samples of a subject."""
    return replace(_read(subject, trial.reading), point=trial.point, misfit=trial.misfit)


def _gaining(read: Sequence[tuple[Subject, Judged]], base: Judged) -> list[Subject]:
    """Return the readings that gain; of those that a model cannot tell apart the plainest."""
    if not read:
        return []
    common = common_of([base, *(judged for _, judged in read)])
    compared = [(s, j, compare(j, base, common)) for s, j in read]
    part = inexact([c for *_, c in compared], common.structure)
    scored = [(s, j, c.score(part)) for s, j, c in compared if not c.is_worse]
    gaining = sorted((entry for entry in scored if entry[2] > 0.0), key=lambda entry: -entry[2])
    kept: list[tuple[Subject, Judged]] = []
    for one, judged, _ in gaining:
        same = next((k for k, (_, other) in enumerate(kept) if are_same(judged, other)), None)
        if same is None:
            kept.append((one, judged))
        else:
            kept[same] = (_joined(kept[same][0], one), kept[same][1])
    return [one for one, _ in kept[:_KEPT]]


def _joined(one: Subject, other: Subject) -> Subject:
    """Return the subject of the plainer of two readings, of an input, which names the other."""
    (plain, reading), (_, instead) = sorted(
        ((s, s.reading) for s in (one, other) if s.reading is not None),
        key=lambda pair: not pair[1].moves_inputs(one.problem.model),
    )
    others = (*reading.instead, replace(instead, instead=()), *instead.instead)
    return replace(plain, reading=replace(reading, instead=others))


def _read(subject: Subject, reading: Reading) -> _Trial:
    problem, left_out = divided_as_read(subject, reading)
    return _Trial(subject, reading, problem, left_out, nominal_point(problem), np.inf)


def _runs(problem: Problem, point: Point) -> list[Run] | None:
    """Return the free runs over all records; None if one leaves its bounds."""
    runs = []
    for record, start in zip(problem.records, point.starts, strict=True):
        course = problem.run(record, point, (), start, True)
        if course is None:
            return None
        runs.append((course.outputs, course.slopes))
    return runs


def _columns(problem: Problem, point: Point, runs: Sequence[Run]) -> tuple[Array, Array]:
    """Return errors (m,), and slopes (m, k) by all that is fitted, in prior deviations, whitened.

    Both are in a third of the spread of each output, for all samples one after the other.
    """
    slopes = problem.slopes(point.q) * problem.deviation
    p, nx = len(slopes), len(problem.model.states)
    root = np.sqrt(_WEIGHT) / problem.spread
    targets, blocks = [], []
    for r, (outputs, by_all) in enumerate(runs):
        measured = problem.records[r].measured
        places = problem.columns(problem.records[r].group)
        of_measured = np.zeros((*by_all.shape[:2], p + nx * len(runs)))
        of_measured[:, :, places] = by_all[:, :, : len(places)] * slopes[places]
        starts = by_all[:, :, len(places) :] * problem.starts[r].deviation
        of_measured[:, :, p + r * nx : p + (r + 1) * nx] = starts
        block = np.zeros((*outputs.shape, of_measured.shape[2]))
        block[:, measured] = of_measured
        blocks.append((block * root[:, None]).reshape(-1, block.shape[2]))
        targets.append(((problem.records[r].outputs - outputs) * root).ravel())
    return np.concatenate(targets), np.concatenate(blocks)


def _stepped(problem: Problem, point: Point, runs: Sequence[Run]) -> tuple[Point, float]:
    """Return the point a Gauss-Newton step away, and the misfit that is expected there."""
    target, others = _columns(problem, point, runs)
    known = np.isfinite(target)
    nothing = np.zeros((int(known.sum()), 0))
    projection = Projection(target[known], nothing, others[known])
    step = np.clip(projection.shift(np.zeros(0, dtype=int), np.zeros(0)), -_LONGEST, _LONGEST)
    left = (target - others @ step).reshape(-1, len(problem.spread)) / np.sqrt(_WEIGHT)
    p, nx = len(point.q), len(problem.model.states)
    moves = step[p:].reshape(len(runs), nx)
    starts = zip(point.starts, moves, problem.starts, strict=True)
    there = Point(
        np.clip(point.q + step[:p] * problem.deviation, *problem.bounds),
        point.values,
        tuple(x + move * prior.deviation for x, move, prior in starts),
    )
    return there, _logarithm(left)


def _misfit(problem: Problem, point: Point) -> float:
    """Return the mean over the outputs of the logarithm of the mean square error."""
    errors = _errors(problem, point)
    if errors is None:
        return float("inf")
    return _logarithm(np.concatenate(errors))


def _logarithm(errors: Array) -> float:
    """Return the mean over the outputs of the logarithm of the mean square of errors (n, ny)."""
    squares = mean_squares(errors)
    return float(np.nanmean(np.log(np.maximum(squares, 1e-12))))


def _errors(problem: Problem, point: Point) -> list[Array] | None:
    """Return the errors (n, ny) of each record in spreads."""
    errors = []
    for record, start in zip(problem.records, point.starts, strict=True):
        course = problem.run(record, point, (), start, False)
        if course is None:
            return None
        errors.append((record.outputs - course.outputs) / problem.spread)
    return errors


def _best_of_each_kind(trials: Sequence[_Trial]) -> Iterator[_Trial]:
    """Yield the best of each kind, each with other columns."""
    taken: dict[object, int] = {}
    for trial in sorted(trials, key=lambda t: t.misfit):
        kind, source = trial.reading.kind, trial.reading.source
        if taken.get(kind, 0) < _OF_A_KIND and source not in taken:
            taken[kind] = taken.get(kind, 0) + 1
            taken[source] = 1
            yield trial


def _refined(trial: _Trial) -> _Trial | None:
    """Fit a reading for a few steps, its shift and the parameters by turns."""
    weights = [np.full(len(trial.problem.spread), _WEIGHT) for _ in trial.problem.records]
    starts = [trial.point]
    for _ in range(_ROUNDS if trial.reading.is_fitted else 1):
        found = fit(trial.problem, (), starts, weights, _STEPS)
        if found is None:
            return None
        trial = replace(trial, point=found.point, misfit=_misfit(trial.problem, found.point))
        shifted = _shifted(trial) if trial.reading.is_fitted else None
        if shifted is None:
            return trial
        trial, starts = shifted, [shifted.point]
    return trial


def _shifted(trial: _Trial) -> _Trial | None:
    """Return a trial with the shift that is best, parameters and starts being free; else None."""
    problem, reading = trial.problem, trial.reading
    step = _difference(trial)
    there = _moved(trial, step)
    runs = _runs(problem, trial.point)
    ahead = None if there is None else _errors(there.problem, trial.point)
    if runs is None or ahead is None:
        return None
    target, others = _columns(problem, trial.point, runs)
    column = np.sqrt(_WEIGHT) * np.concatenate(ahead).ravel() - target
    known = np.isfinite(target) & np.isfinite(column)
    projection = Projection(target[known], column[known, None], others[known])
    size = float(projection.norms[0])
    steps = -float(projection.moments[0]) / size if size > 0.0 else 0.0
    if reading.kind is ReadingKind.LATE:
        steps = float(np.round(steps))
    if not steps:
        return None
    moved = _moved(trial, steps * step)
    if moved is None:
        return None
    misfit = _misfit(moved.problem, trial.point)
    return replace(moved, misfit=misfit) if misfit < trial.misfit else None


def _difference(trial: _Trial) -> float:
    """Return the difference of a shift by which derivatives are taken: of a delay one sample."""
    record = trial.problem.records[0]
    if trial.reading.kind is ReadingKind.LATE:
        return float(np.median(np.diff(record.time)))
    model = trial.problem.model
    names = [v.name for v in (*model.inputs, *model.outputs)]
    columns = np.hstack([record.inputs, record.outputs])
    return _DIFFERENCE * float(np.nanstd(columns[:, names.index(trial.reading.columns[0])]))


def _moved(trial: _Trial, by: float) -> _Trial | None:
    """Return a trial at its point with a shift larger by so much; None of a delay too long."""
    shift = trial.reading.shift + by
    time = trial.problem.records[0].time
    if trial.reading.kind is ReadingKind.LATE and abs(shift) > (time[-1] - time[0]) / _LATEST:
        return None
    moved = _read(trial.subject, replace(trial.reading, shift=shift))
    return replace(moved, point=trial.point)


def _fitted(trial: _Trial) -> Subject | None:
    """Fit the model to what the file means by a reading.

    Inputs go between samples as fits best: of a file that is misread that was no choice.
    """
    here = trial.problem.records[0].smooth
    ways = dict.fromkeys([here, tuple(not one for one in here)])
    if not trial.problem.model.states:
        ways = {here: None}
    fits = [one for smooth in ways if (one := _fitted_as(trial, smooth)) is not None]
    return min(fits, key=lambda one: one.base.misfit, default=None)


def _fitted_as(trial: _Trial, smooth: tuple[bool, ...]) -> Subject | None:
    """Fit the model to what the file means, with inputs that are held or go in straight lines."""
    problem = trial.problem
    records = tuple(replace(r, smooth=smooth) for r in problem.records)
    left_out = tuple(replace(o, record=replace(o.record, smooth=smooth)) for o in trial.left_out)
    problem = replace(problem, records=records)
    fitted = fit_base(problem, trial.point.q)
    return None if fitted is None else Subject(problem, left_out, fitted, trial.reading)


def reading_that_runs(
    model: LawModel, records: Sequence[Record], subject_as: Callable[[Reading], Subject | None]
) -> Reading | None:
    """Return the reading by which a model fits best that leaves its bounds over the files as read.

    Parameters
    ----------
    model : LawModel
    records : sequence of Record
    subject_as : callable
        Makes the subject of a reading.

    Returns
    -------
    Reading or None
        None if the model runs by none, or leaves more than half of the spread.
    """
    plain = [r for r in readings_of(model, records) if not r.is_fitted]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        subjects = list(pool.map(subject_as, plain))
    fits = [(s.base.misfit, r) for s, r in zip(subjects, plain, strict=True) if s is not None]
    misfit, reading = min(fits, key=lambda entry: entry[0], default=(np.inf, None))
    return reading if misfit < _FOLLOWS else None
