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
from orchestration.diagnosis.comparison import (
    WEIGHTS,
    Judged,
    are_same,
    common_of,
    compare,
    inexact,
)
from orchestration.diagnosis.delays import recorded
from orchestration.diagnosis.fitting import (
    Point,
    Problem,
    fit,
    fit_base,
    mean_squares,
    nominal_point,
)
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import Reading, ReadingKind, readings_by_run, readings_of
from orchestration.diagnosis.runs import Course, Record, step_of
from orchestration.diagnosis.subject import LeftOut, Subject, divided_as_read, thinned

_OF_A_KIND = 2  # readings of a kind that are fitted
_KEPT = 2  # readings on top of which laws are searched
_STEPS = 5
_ROUNDS = 3  # of estimates of a shift and of the parameters by turns
_WEIGHT = 10.0  # of squared errors in spreads: within a third, as a first fit of the model
_LATEST = 5  # share of what is fitted, by which a column is late at most
_DELAYS = 1.6  # ratio of delays that are tried
_PACES = np.linspace(-0.1, 0.1, 81)  # of a clock: shares by which it is fast
_PERIODS = 4.0  # of a cut-off that is tried, in the record at least
_CUTOFFS = 16  # that are tried
_DIFFERENCE = 1e-2  # of the spread of a column, for the derivative by its offset
_NEAREST = 3  # points of a reading at which the model is run
_BESIDE = 2  # shifts that are tried, within which two are the same place
_LONGEST = 0.7  # of a step of the screen, in prior deviations
_MOST = 600  # samples of a screen
# Of a signal that is smoother, or comes between samples, any model predicts the next sample.
_OF_SLOPES = (ReadingKind.RATE, ReadingKind.INTEGRAL)
_OF_RUNS = (*_OF_SLOPES, ReadingKind.PACE)
_FOLLOWS = 0.5  # of the spread, up to which a model follows a record
_AHEAD = 3.0  # of an output, from which on a reading is fitted whatever others leave
_RIDGE = 1e-12  # of columns of length 1, in which the prior's may be lost beside large slopes
_AS_READ = Reading(ReadingKind.SIGN, ())  # of no column: the file as it was read


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
        moved = [replace(t, misfit=_misfit(t.problem, t.point)) for t in _nearest(trials)]
        best = min(moved, key=lambda t: t.misfit, default=None)
        if best is not None and reading.is_sized and reading.kind is not ReadingKind.LATE:
            return _shifted(best) or best
        return best

    def readings_by_run(self) -> Iterator[Reading]:
        """Yield the readings of outputs that tell a part of their signal, by the first run."""
        problem = self.subject.problem
        runs = next((run for run in self._runs if run is not None), None)
        if runs is not None:
            yield from readings_by_run(problem.model, problem.records, runs[0].outputs)

    def _shifts(self, reading: Reading) -> list[float]:
        """Return the shifts of a reading that are tried."""
        time = self.subject.problem.records[0].time
        if reading.kind is ReadingKind.PACE:
            return [share for share in _PACES.tolist() if share]
        if reading.kind is ReadingKind.FILTERED:
            step = step_of(time)
            return np.geomspace(
                _PERIODS / float(time[-1] - time[0]), 0.25 / step, _CUTOFFS
            ).tolist()
        if reading.kind is not ReadingKind.LATE:
            return [reading.shift]
        most = max(1, len(time) // _LATEST)
        if reading.moves_inputs(self.subject.problem.model):
            count = int(np.log(most) / np.log(_DELAYS)) + 2
            samples = np.unique(np.geomspace(1.0, most, count).astype(int))
            # an early input is a late output where there is one of each
            record = self.subject.problem.records[0]
            is_early = (
                record.measured.sum() > 1 or np.count_nonzero(np.ptp(record.inputs, axis=0)) > 1
            )
        else:
            samples = np.arange(1, most + 1)
            is_early = True
        step = step_of(time)
        signs = (1.0, -1.0) if is_early else (1.0,)
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
        pairs = zip(problem.records, known.records, strict=True)
        if any((one.measured != other.measured).any() for one, other in pairs):
            return  # nothing is left of an output that is so late
        starts = zip(problem.starts, known.starts, strict=True)
        # outputs that come later start a little elsewhere, which is a part of the step
        is_same = not reading.moves_inputs(problem.model) and (
            reading.is_fitted or all(np.array_equal(a.mean, b.mean) for a, b in starts)
        )
        points = self._points(known if is_same else problem)
        for point, as_read in zip(points, self._runs, strict=True):
            runs = as_read if is_same else _runs(problem, point)
            if is_same and runs is not None:
                runs = [recorded(c, r) for c, r in zip(runs, problem.records, strict=True)]
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
    readings = _candidates(screen, subject)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        as_read, *first = pool.map(screen.best, [_AS_READ, *readings])
        chosen = _best_of_each_kind([trial for trial in first if trial is not None])
        plain, *refined = pool.map(_refined, [as_read, *chosen])
        hopeful = [t for t in refined if t is not None and _is_hopeful(t, plain)]
        read = pool.map(lambda t: _fitted(_read_again(subject, t)), hopeful)
        judged = [(s, s.judge(s.base)) for s in read if s is not None]
    return _gaining([(s, j) for s, j in judged if j is not None], base)


def _candidates(screen: _Screen, subject: Subject) -> list[Reading]:
    """Return the readings of a file that are tried."""
    model = subject.problem.model
    readings = [*readings_of(model, subject.problem.records), *screen.readings_by_run()]
    if model.begins_as_declared:  # each size of an input is a run of its own
        readings = [r for r in readings if not (r.is_sized and r.moves_inputs(model))]
        # of one output it is the delay of its sensor
        readings = [r for r in readings if r.kind is not ReadingKind.LATE or len(r.columns) > 1]
    if subject.observer is not None:
        readings = [r for r in readings if r.kind not in _OF_RUNS]
    left = _logarithms(screen.subject.problem, subject.base.point)
    # an integral has small slow noise, and fits by that alone an output that the model follows
    pairs = zip(model.outputs, left, strict=True)
    followed = {variable.name for variable, size in pairs if size < 2.0 * np.log(_FOLLOWS)}
    return [r for r in readings if r.kind not in _OF_SLOPES or followed.isdisjoint(r.columns)]


def _is_hopeful(trial: _Trial, as_read: _Trial | None) -> bool:
    """Return whether a reading is fitted on, beside the file as it was read after as many steps.

    If it gains more than its words cost, or much in one output, which a fit may have given up.
    """
    if as_read is None:
        return True
    ahead = _logarithms(as_read.problem, as_read.point) - _logarithms(trial.problem, trial.point)
    gain = _implausibility(as_read) - _implausibility(trial)
    return bool(gain > WEIGHTS.misread or np.nanmax(ahead) > _AHEAD)


def _thin(subject: Subject) -> Subject:
    """Return a subject of fewer samples, if the model sees no difference."""
    problem = subject.problem
    most = _MOST // len(problem.records)
    q = subject.base.point.q  # by a wrong unit the nominal model may not move at all
    records = tuple(thinned(problem, r, q, most) for r in problem.records)
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


def _runs(problem: Problem, point: Point) -> list[Course] | None:
    """Return the free runs over all records; None if one leaves its bounds."""
    runs = []
    for record, start in zip(problem.records, point.starts, strict=True):
        course = problem.run(record, point, (), start, True)
        if course is None:
            return None
        runs.append(course)
    return runs


def _columns(problem: Problem, point: Point, runs: Sequence[Course]) -> tuple[Array, Array]:
    """Return errors (m,), and slopes (m, k) by all that is fitted, in prior deviations, whitened.

    Both are in a third of the spread of each output, for all samples one after the other.
    """
    slopes = problem.slopes(point.q) * problem.deviation
    p, nx = len(slopes), len(problem.model.states)
    root = np.sqrt(_WEIGHT) / problem.spread
    targets, blocks = [], []
    for r, course in enumerate(runs):
        outputs, by_all = course.outputs, course.slopes
        measured = problem.records[r].measured
        places = problem.columns(problem.records[r].group)
        of_measured = np.zeros((*by_all.shape[:2], p + nx * len(runs)))
        of_measured[:, :, places] = by_all[:, :, : len(places)] * slopes[places]
        starts = by_all[:, :, len(places) :] * problem.starts[r].deviation
        of_measured[:, :, p + r * nx : p + (r + 1) * nx] = starts
        block = np.zeros((*outputs.shape, of_measured.shape[2]))
        block[:, measured] = of_measured
        blocks.append((block * root[:, None]).reshape(outputs.size, block.shape[2]))
        targets.append(((problem.records[r].outputs - outputs) * root).ravel())
    return np.concatenate(targets), np.concatenate(blocks)


def _stepped(problem: Problem, point: Point, runs: Sequence[Course]) -> tuple[Point, float]:
    """Return the point a Gauss-Newton step away, and the misfit that is expected there."""
    target, others = _columns(problem, point, runs)
    known = np.isfinite(target)
    own = others[known]
    if not np.isfinite(own).all():
        return point, np.inf
    sizes = np.sqrt(1.0 + np.sum(own**2, axis=0))
    own = own / sizes
    products = own.T @ own + np.diag(1.0 / sizes**2 + _RIDGE)
    least = np.linalg.solve(products, own.T @ target[known]) / sizes
    step = np.clip(least, -_LONGEST, _LONGEST)
    left = (target - others @ step).reshape(-1, len(problem.spread)) / np.sqrt(_WEIGHT)
    p, nx = len(point.q), len(problem.model.states)
    moves = step[p:].reshape(len(runs), nx)
    starts = zip(point.starts, moves, problem.starts, strict=True)
    there = Point(
        np.clip(point.q + step[:p] * problem.deviation, *problem.bounds),
        point.values,
        tuple(x + move * prior.deviation for x, move, prior in starts),
    )
    return there, float(np.nanmean(_logarithm(left)))


def _misfit(problem: Problem, point: Point) -> float:
    """Return the mean over the outputs of the logarithm of the mean square error."""
    return float(np.nanmean(_logarithms(problem, point)))


def _logarithms(problem: Problem, point: Point) -> Array:
    """Return the logarithm of the mean square error of each output (ny,)."""
    errors = problem.errors(point)
    if errors is None:
        return np.full(len(problem.spread), np.inf)
    return _logarithm(np.concatenate(errors))


def _logarithm(errors: Array) -> Array:
    """Return the logarithm of the mean square of each column of errors (n, ny)."""
    return np.log(np.maximum(mean_squares(errors), 1e-12))


def _best_of_each_kind(trials: Sequence[_Trial]) -> Iterator[_Trial]:
    """Yield the best of each kind, of inputs and of outputs, each with other columns."""
    taken: dict[object, int] = {}
    for trial in sorted(trials, key=_implausibility):
        kind = trial.reading.kind, trial.reading.is_command
        source = trial.reading.source
        if taken.get(kind, 0) < _OF_A_KIND and source not in taken:
            taken[kind] = taken.get(kind, 0) + 1
            taken[source] = 1
            yield trial


def _nearest(trials: Sequence[_Trial]) -> list[_Trial]:
    """Return the nearest trials of a reading, of which shifts are apart where there are many."""
    shifts = np.unique([trial.reading.shift for trial in trials])
    taken: list[_Trial] = []
    for trial in sorted(trials, key=lambda t: t.misfit):
        places = np.searchsorted(shifts, [t.reading.shift for t in (trial, *taken)])
        is_beside = len(shifts) > 1 and (np.abs(places[1:] - places[0]) <= _BESIDE).any()
        if not is_beside:
            taken.append(trial)
    return taken[:_NEAREST]


def _implausibility(trial: _Trial) -> float:
    """Return the misfit of a trial and the distance of its parameters from nominal, nats.

    By a model with a gain of its own one unit fits as well as another.
    """
    problem = trial.problem
    distance = (trial.point.q - problem.mean) / problem.deviation
    samples = sum(int(np.isfinite(r.outputs).sum()) for r in problem.records)
    return 0.5 * (samples * trial.misfit + WEIGHTS.nominal * float(distance @ distance))


def _refined(trial: _Trial | None) -> _Trial | None:
    """Fit a reading for a few steps, its shift and the parameters by turns."""
    if trial is None:
        return None
    weights = [np.full(len(trial.problem.spread), _WEIGHT) for _ in trial.problem.records]
    starts = [trial.point]
    for _ in range(_ROUNDS if trial.reading.is_sized else 1):
        found = fit(trial.problem, (), starts, weights, _STEPS)
        if found is None:
            return None
        trial = replace(trial, point=found.point, misfit=_misfit(trial.problem, found.point))
        shifted = _shifted(trial) if trial.reading.is_sized else None
        if shifted is None:
            return trial
        trial, starts = shifted, [shifted.point]
    return trial


def _shifted(trial: _Trial) -> _Trial | None:
    """Return a trial with the values of its reading that are best; None if none is better.

    With the parameters as they are; of an input that acts late, whose dead time they have made up
    for, also a step further.
    """
    change = _best_change(trial)
    moved = None if change is None else _moved(trial, change)
    if moved is None:
        return None
    points = [trial.point]
    runs = _runs(moved.problem, trial.point) if trial.reading.is_command else None
    if runs is not None:
        points.append(_stepped(moved.problem, trial.point, runs)[0])
    tried = [replace(moved, point=p, misfit=_misfit(moved.problem, p)) for p in points]
    best = min(tried, key=lambda t: t.misfit)
    return best if best.misfit < trial.misfit else None


def _best_change(trial: _Trial) -> Array | None:
    """Return the change of the values of a reading that is best, the parameters being free too.

    By differences. None if there is none, or a run leaves its bounds.
    """
    problem = trial.problem
    steps = np.diag(_differences(trial))
    ahead = [_moved(trial, step) for step in steps]
    errors = [None if there is None else there.problem.errors(trial.point) for there in ahead]
    runs = _runs(problem, trial.point)
    tried = [np.concatenate(error).ravel() for error in errors if error is not None]
    if runs is None or len(tried) < len(steps):
        return None
    target, others = _columns(problem, trial.point, runs)
    columns = np.sqrt(_WEIGHT) * np.column_stack(tried) - target[:, np.newaxis]
    known = np.isfinite(target) & np.isfinite(columns).all(axis=1)
    own = np.linalg.lstsq(np.hstack([columns, others])[known], -target[known])[0][: len(steps)]
    if trial.reading.kind is ReadingKind.LATE and not trial.reading.is_command:
        own = np.round(own)
    return own @ steps if own.any() else None


def _differences(trial: _Trial) -> Array:
    """Return differences of the values of a reading by which derivatives are taken.

    A whole sample of a delay.
    """
    reading, record = trial.reading, trial.problem.records[0]
    step = step_of(record.time)
    if reading.kind is ReadingKind.LATE:
        return np.array([step])
    if reading.kind is ReadingKind.PACE:
        return np.array([step / float(record.time[-1] - record.time[0])])
    if reading.kind is ReadingKind.FILTERED:
        return np.array([_DIFFERENCE * reading.shift])
    model = trial.problem.model
    names = [v.name for v in (*model.inputs, *model.outputs)]
    columns = np.hstack([record.inputs, record.outputs])
    spreads = np.nanstd(columns[:, [names.index(name) for name in reading.columns]], axis=0)
    return np.asarray(_DIFFERENCE * spreads)


def _moved(trial: _Trial, by: Array) -> _Trial | None:
    """Return a trial with values of its reading larger by so much; None of those out of reason."""
    reading = trial.reading.with_values(trial.reading.values + by)
    time = trial.problem.records[0].time
    largest = {ReadingKind.LATE: (time[-1] - time[0]) / _LATEST, ReadingKind.PACE: _PACES[-1]}
    if abs(reading.shift) > largest.get(reading.kind, np.inf):
        return None
    return replace(_read(trial.subject, reading), point=trial.point)


def _fitted(trial: _Trial) -> Subject | None:
    """Fit the model to what the file means by a reading.

    Inputs go between samples as fits best: of a file that is misread that was no choice.
    """
    here = trial.problem.records[0].smooth
    ways = dict.fromkeys([here, tuple(not one for one in here)])
    if not trial.problem.model.is_dynamic:
        ways = {here: None}
    fits = [one for smooth in ways if (one := _fitted_as(trial, smooth)) is not None]
    return min(fits, key=lambda one: one.base.misfit, default=None)


def _fitted_as(trial: _Trial, smooth: tuple[bool, ...]) -> Subject | None:
    """Fit the model to what the file means, with inputs that are held or go in straight lines.

    The shift of a reading is fitted by all samples, in turns with the parameters.
    """
    subject = trial.subject
    model = subject.problem.model
    records = tuple(model.simulated(replace(r, smooth=smooth)) for r in subject.problem.records)
    others = [model.simulated(replace(o.record, smooth=smooth)) for o in subject.left_out]
    own = [replace(o, record=r) for o, r in zip(subject.left_out, others, strict=True)]
    subject = replace(
        subject, problem=replace(subject.problem, records=records), left_out=tuple(own)
    )
    trial = replace(_read(subject, trial.reading), point=trial.point)
    best: Subject | None = None
    for _ in range(_ROUNDS if trial.reading.is_sized else 1):
        fitted = fit_base(trial.problem, trial.point.q)
        if fitted is None or (best is not None and fitted.misfit >= best.base.misfit):
            return best
        best = Subject(trial.problem, trial.left_out, fitted, trial.reading)
        there = replace(trial, point=fitted.point, misfit=_misfit(trial.problem, fitted.point))
        shifted = _shifted(there) if trial.reading.is_sized else None
        if shifted is None:
            return best
        trial = shifted
    return best


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
        None if no free run by any leaves less than half of the spread.
    """
    plain = [r for r in readings_of(model, records) if not r.is_sized]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        subjects = list(pool.map(subject_as, plain))
    pairs = zip(subjects, plain, strict=True)
    fits = [(s.base.misfit, r) for s, r in pairs if s is not None and s.observer is None]
    misfit, reading = min(fits, key=lambda entry: entry[0], default=(np.inf, None))
    return reading if misfit < _FOLLOWS else None
