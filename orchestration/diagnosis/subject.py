"""A model with its records, of which some samples are fitted and others left out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from fmus.kit.arrays import Array, Indices, Mask, single_threaded
from orchestration.diagnosis.comparison import WEIGHTS, Judged, common_of, compare, words
from orchestration.diagnosis.fitting import (
    Fit,
    Point,
    Problem,
    StartPrior,
    effective_samples,
    fit,
    fit_base,
    fit_from_pieces,
    fit_start,
    joined_by,
    variance_of,
    weights_of,
)
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.local_values import COMMON, LocalValues
from orchestration.diagnosis.observer import Observer, Place, growth_of, observer_of, slowest_decay
from orchestration.diagnosis.prediction import Prediction, predict
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.recording import evenly, with_quiet_inputs, without_outliers
from orchestration.diagnosis.remainder import with_gaps
from orchestration.diagnosis.runs import Record, Setting
from orchestration.diagnosis.terms import Shape, Term
from orchestration.records.quality import noise_of

_PART = 2.0 / 3.0  # of a single record that is fitted
_START = 0.1  # of a record: what nothing drives after it is a free response
_TURNS = 8  # of a free response: a block of each is left out
_BEGINNING = 6  # a held-out record gives its start states in the first part of so many
_STRETCHES = 10  # of it, each of which gives local values in its first part: a start alone is short
_BLOCKS = 8  # of what is left out, by turns for the choice and for the figure
_FIRST = 6  # samples that show where a state starts
_DECLARED = 0.1  # deviation of a start state that is declared, in its nominal value
_KNOWN = 1e-6  # the same of one that is known, as a share
_WELL = 20.0 / 0.05**2  # weight of the beginning: twenty samples within a twentieth of the spread
_MOST = 2400  # samples of a record, among which terms are searched; more are thinned
_ALL = 5 * _MOST  # by which a conclusion is drawn: ten minutes at 20 Hz
_LONGEST = 2  # times as many of all records that cannot be thinned: their beginnings decide
_RUN_ALONE = 10  # times as many of one that is held out: nothing is fitted to it
_SHORTEST = _MOST // 2  # of one of many, to which it is cut at most
_STILL = 0.01  # standard deviations, by which an input moves at most that drives nothing
_DECAY = 1.0  # e-folds over a record, by which each mode decays of a model that forgets errors
_ROUNDS = 3  # of observers and fits by turns
_MOST_OBSERVED = 32  # states of an observer: each sample takes as long as the cube of their number
_ASTRAY = 0.5  # misfit in spreads, from which on a fit may be near a frequency that is not there
_UNSEEN = 0.002  # of the spread, by which a run over fewer samples may differ
_COARSE = 0.01  # the same, of a record of which the end would be lost
_IN_NOISE = 0.1  # of the noise of an output, by which it may differ at most: ten nats of thousands
_RESOLVED = 2e-4  # of the spread, by which it may differ where there is no noise


def _no_subject() -> None:
    """Return what there is instead of a subject of other samples, where there is none."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Samples that no fit sees.

    Attributes
    ----------
    record : Record
    first : int
        From where the errors count.
        Zero of a record that was fitted in part all along.
    of : int or None
        The fitted record whose run goes on here; None for one that starts anew.
    """

    record: Record
    first: int
    of: int | None

    @property
    def is_between(self) -> bool:
        """True if fitted samples are before and after those that are left out."""
        return self.of is not None and not self.first


@dataclass(frozen=True, eq=False)
class Subject:
    """A model, the problem of fitting it, and what is left out.

    Attributes
    ----------
    problem : Problem
    left_out : tuple of LeftOut
    base : Fit
        Without terms.
    reading : Reading or None
        Of the file, if it means other values than those that were read.
    observer : Observer or None
        By which all errors are those of predictions; None if they are those of free runs.
    otherwise : callable
        Returns the subject whose inputs go the other way between samples, if that may be; else
        None.
    complete : callable
        Returns the subject of all samples, if these are more; else None.
    fewer : Subject or None
        Of thinned records, if these are all samples.
    """

    problem: Problem
    left_out: tuple[LeftOut, ...]
    base: Fit
    reading: Reading | None = None
    observer: Observer | None = None
    otherwise: Callable[[], Subject | None] = _no_subject
    complete: Callable[[], Subject | None] = _no_subject
    fewer: Subject | None = None

    def judge(self, fitted: Fit) -> Judged | None:
        """Run a fit over what is left out.

        None if it runs away there, or if it has more to fit than the record can tell.
        """
        if fitted.terms and self.samples <= self.rank + fitted.freedom:
            return None
        choosing, beyond, measuring = [], [], []
        for one in self.left_out:
            predicted = self._prediction(fitted, one)
            if predicted is None:
                return None
            predicted.errors[self._begins(one)[one.first :]] = np.nan
            blocks = np.array_split(np.arange(len(predicted.errors)), _BLOCKS)
            by_turns = np.concatenate(blocks[::2])
            choosing.append(predicted.errors[by_turns])
            beyond.append(predicted.beyond_uncertainty(by_turns))
            # or samples of two blocks would be neighbours
            measuring.append(with_gaps([predicted.errors[block] for block in blocks[1::2]]))
        model = self.problem.model
        read = () if self.reading is None else (self.reading,)
        prior = sum(words_of(model, part) for part in (*read, *fitted.terms))
        chosen_by, likely_by, unseen = map(np.concatenate, (choosing, beyond, measuring))
        return Judged(fitted, chosen_by, likely_by, unseen, prior, self.reading)

    @cached_property
    def samples(self) -> int:
        """Measured values that are fitted."""
        return sum(int(np.isfinite(r.outputs).sum()) for r in self.problem.records)

    @cached_property
    def rank(self) -> int:
        """Directions of parameters and start states of which the record says more than the prior.

        Eigenvalues of the information matrix of the fit without terms, in prior deviations.
        """
        curvature = self.base.curvature
        own = self.problem.deviation
        widths = np.append(own, np.ones(len(curvature) - len(own)))
        with_prior = np.linalg.eigvalsh(curvature * np.outer(widths, widths))
        return int(np.sum(with_prior - 1.0 > 1.0))

    @cached_property
    def sizes(self) -> Array:
        """RMS (ny,) of each output about its mean where nothing was fitted, in spreads.

        NaN of an output that was not measured there or does not move.
        """
        unseen = np.concatenate([one.record.outputs[one.first :] for one in self.left_out])
        size = np.full(unseen.shape[1], np.nan)
        for j, values in enumerate(unseen.T):
            measured = values[np.isfinite(values)]
            if measured.size and np.ptp(measured) > 0.0:
                size[j] = measured.std() / self.problem.spread[j]
        return size

    @property
    def beginnings(self) -> list[float]:
        """Times until which each record is fitted, or left out and followed on, s."""
        ends = [float(record.time[-1]) for record in self.problem.records]
        for one in self.left_out:
            if one.of is not None:
                ends[one.of] = float(one.record.time[-1])
        return ends

    def errors(self, fitted: Fit, one: LeftOut) -> Array | None:
        """Return the errors (m, ny) of a fit on samples that are left out, in spreads."""
        predicted = self._prediction(fitted, one)
        return None if predicted is None else predicted.errors

    def _prediction(self, fitted: Fit, one: LeftOut) -> Prediction | None:
        """Return the prediction of what is left out by a fit; None if it runs away there.

        A change at an instant is one of the fitted record: another was made before it or after it,
        as its beginning says.
        """
        if one.of is not None:
            start, prior = fitted.point.starts[one.of], self.problem.starts[one.of]
            whole = predict(fitted, one.record, start, prior, one.of)
            return whole and whole.part(one.first)
        begins = self._begins(one)
        tried = [self._begun(variant, one.record, begins) for variant in _before_and_after(fitted)]
        known = [whole for whole in tried if whole is not None]
        if not known:
            return None
        nearest = min(known, key=lambda whole: float(np.nansum(whole.errors[begins] ** 2)))
        return nearest.part(one.first)

    def _begins(self, one: LeftOut) -> Mask:
        """Return the samples (n,) by which start and local values are known of what is left out."""
        count = len(one.record.time)
        known = np.zeros(count, dtype=bool)
        if one.of is None:
            known[: _beginning(one.record)] = True
        if one.of is None and self.problem.local.each:
            for stretch in np.array_split(np.arange(count), _STRETCHES):
                known[stretch[: len(stretch) // _BEGINNING]] = True
        return known

    def _begun(self, fitted: Fit, record: Record, begins: Mask) -> Prediction | None:
        """Return the prediction of a record whose start some samples (n,) give."""
        joined = joined_by(fitted, record)
        problem, point = joined.problem, joined.point
        last = int(np.flatnonzero(begins)[-1]) + 1
        outputs = np.where(begins[:, np.newaxis], record.outputs, np.nan)
        beginning = replace(record, outputs=outputs).part(0, last)
        prior = start_prior(problem, beginning)
        weight = np.full(len(problem.spread), _WELL / int(begins.sum()))
        local = len(point.q) - len(fitted.point.q)
        begun = fit_start(problem, point, fitted.terms, beginning, prior, weight, local=local)
        if begun is None:
            return None
        return predict(replace(joined, point=begun[0]), record, begun[1], prior, beginning)


def _before_and_after(fitted: Fit) -> list[Fit]:
    """Return a fit as it is before its changes at an instant, and after them."""
    if not any(term.shape is Shape.STEP for term in fitted.terms):
        return [fitted]
    terms = [replace(t, shape=Shape.CONSTANT) if t.shape is Shape.STEP else t for t in fitted.terms]
    variants = []
    for share in (0.0, 1.0):
        values = [
            share * fitted.values_of(t)[:1] if t.shape is Shape.STEP else fitted.values_of(t)
            for t in fitted.terms
        ]
        point = replace(fitted.point, values=np.concatenate(values))
        variants.append(replace(fitted, terms=tuple(terms), point=point))
    return variants


def words_of(model: LawModel, part: Reading | Term) -> float:
    """Return the prior of a part of a model, nats."""
    if isinstance(part, Reading):
        return WEIGHTS.shifted if part.is_sized else WEIGHTS.misread
    return words(model, part, depends(model, part))


def depends(model: LawModel, term: Term) -> bool:
    """Return whether a law depends on the signals of a term already, or is one of them."""
    own = {"", term.law} | model.reads(term.law)
    return term.signal in own and term.factor in own


def _beginning(record: Record) -> int:
    """Return the number of samples that give the start states of a held-out record."""
    count = len(record.time)
    return min(max(20, count // _BEGINNING), count // 2)


def start_prior(problem: Problem, record: Record) -> StartPrior:
    """Return what is known of the start states: nominal, or read off an output that is the state.

    A state that nominally starts somewhere starts near it if the model has inputs, unless the
    problem begins anywhere; without inputs its start is all that moves. One that is held starts
    there.
    """
    model = problem.model
    nominal = model.nominal_states
    mean = problem.nominal[list(model.start_positions)]
    near = _DECLARED if len(model.inputs) and not problem.begins_anywhere else 1.0
    known = problem.known_starts
    deviation = np.where(known, _KNOWN, near) * nominal
    for i, j in model.measured_states.items():
        first = record.outputs[:_FIRST, j]
        if np.isfinite(first).any() and not known[i]:
            mean[i] = first[np.isfinite(first)][0]
            deviation[i] = nominal[i]  # the sensor may have an offset
    return StartPrior(mean, deviation)


def thinned(
    problem: Problem, record: Record, q: Array, most: int = _MOST, unseen: Array | float = _UNSEEN
) -> Record:
    """Return a record of fewer samples, if the model at `q` (p,) sees no difference.

    Samples at which an input jumps stay. Inputs that are held are averaged over the samples that
    fall between.

    Parameters
    ----------
    problem : Problem
    record : Record
    q : ndarray, shape (p,)
    most : int
        Samples that are enough.
    unseen : float or ndarray, shape (ny,)
        Root mean square of what each measured output may differ by, in spreads.
    """
    if record.gain is not None:  # of the steps between its samples
        return record
    model = problem.model
    setting = _setting(problem, q, record)
    start = start_prior(problem, record).mean
    whole = model.run(record, setting, start)
    step = int(np.ceil(len(record.time) / most))
    while step > 1 and whole is not None:
        kept = _kept(record, step)
        part = model.simulated(_thinned_to(record, kept))
        course = model.run(part, setting, start)
        if course is not None:
            gap = (whole.outputs[kept] - course.outputs) / problem.spread
            if (np.sqrt(np.mean(gap**2, axis=0)) < unseen)[record.measured].all():
                return part
        step //= 2
    return record


def _shortened(problem: Problem, record: Record, q: Array, most: int, longest: int) -> Record:
    """Return a record of enough samples: thinned, more coarsely if that leaves too many, or cut."""
    part = thinned(problem, record, q, most, _unseen(problem, record))
    if len(part.time) > longest:
        part = thinned(problem, record, q, longest, _COARSE)
    return part.part(0, longest)


def _unseen(problem: Problem, record: Record) -> Array:
    """Return differences of the outputs (ny,) that are none in their noise, in spreads.

    A law would gain by larger ones, which are the same at every run.
    """
    noise = np.array([noise_of(column) for column in record.outputs.T])
    return np.clip(_IN_NOISE * noise / problem.spread, _RESOLVED, _UNSEEN)


def _setting(problem: Problem, q: Array, record: Record) -> Setting:
    """Return the model without terms at searched coordinates of its parameters, over a record."""
    return problem.setting(Point(q, np.zeros(0), ()), (), record.group)


def _kept(record: Record, step: int) -> Indices:
    """Return the positions of every so many samples, and of those at which an input jumps.

    One that moves all the time has no jumps. A straight line between samples needs the sample
    before a jump, too.
    """
    kept = record.jumps.copy()
    if any(record.smooth):
        kept[:-1] |= record.jumps[1:]
    kept[::step] = True
    return np.flatnonzero(kept)


def _thinned_to(record: Record, kept: Indices) -> Record:
    """Return some samples of a record; inputs that are held are averaged up to the next."""
    counts = np.diff(kept, append=len(record.time))
    averages = np.add.reduceat(record.inputs, kept, axis=0) / counts[:, np.newaxis]
    # of a straight line an average up to the next would be half a step late
    inputs = np.where(record.smooth, record.inputs[kept], averages)
    return replace(
        record,
        time=record.time[kept],
        inputs=np.ascontiguousarray(inputs),
        outputs=record.outputs[kept],
    )


@single_threaded
def subject_of(
    model: LawModel,
    records: Sequence[Record],
    held_out: Sequence[Record] = (),
    hold: Collection[str] = (),
    values: Mapping[str, float] | None = None,
    interpolate: bool | None = None,
    *,
    local: LocalValues = COMMON,
) -> Subject | None:
    """Divide records into fitted samples and others, and fit the model without terms.

    Parameters
    ----------
    model : LawModel
    records : sequence of Record
        Without `held_out`, the last third of each is left out.
    held_out : sequence of Record
    hold : collection of str
        Parameters that keep their values.
    values : Mapping of str to float, optional
        Nominal values of parameters, SI.
    interpolate : bool, optional
        Whether inputs go in straight lines between samples, or are held; by default what fits
        clearly better. With what the model lacks it may be seen that they go otherwise.
    local : LocalValues, optional
        Values that the records do not share.

    Returns
    -------
    Subject or None
        None if the model runs away over the records.
    """
    # of what is fitted alone, or a fit would depend on what is left out
    fitted = records if held_out else [r.part(0, int(_PART * len(r.time))) for r in records]
    problem = Problem(model, (), _spread(fitted), (), frozenset(hold), values, local=local)
    ways = [False] if interpolate is None else [interpolate]
    if interpolate is None and len(model.inputs) and model.is_dynamic:
        ways = [False, True]
    read = [
        _as_recorded(
            problem, _inputs_go(model, records, smooth), _inputs_go(model, held_out, smooth)
        )
        for smooth in ways
    ]
    first, second = [*(one for one in read if one is not None), None, None][:2]
    if first is None:
        return None
    if second is None:
        return _as_read(first, False)
    if likelihood_gain(second.subject, first.subject) > WEIGHTS.least:
        first, second = second, first
    return replace(_as_read(first, True), otherwise=partial(_as_read, second, False))


def _as_read(recorded: _Recorded, turns: bool) -> Subject:
    """Return a subject of records as the model clearly follows them better.

    Without noise of their clock, which is that of every slope and goes first, and of inputs. If it
    `turns`, inputs go otherwise between samples, where that was decided by runs from a wrong start.
    """
    subject = _begun(_as_fitted(recorded))
    best = replace(recorded, subject=subject)
    bare, q = replace(subject.problem, records=(), starts=()), subject.base.point.q
    ways = [evenly, with_quiet_inputs, _curved]
    if turns and bare.begins_anywhere:
        ways.insert(0, _turned)
    for clean in ways:
        own = [clean(bare.model, record) for record in best.records]
        if own == best.records:
            continue
        others = [clean(bare.model, record) for record in best.held_out]
        one = _as_recorded(bare, own, others, q)
        if one is not None and likelihood_gain(one.subject, best.subject) > WEIGHTS.least:
            best = one
    few = _without_outliers(best.subject)
    return replace(few, complete=partial(_of_all_samples, best, few))


def _of_all_samples(recorded: _Recorded, few: Subject) -> Subject | None:
    """Return a subject of all samples of its records, unless it has them already."""
    bare, q = replace(few.problem, records=(), starts=()), few.base.point.q
    problem, left_out = _divided(bare, recorded.records, recorded.held_out, q, _ALL)
    counts = [[len(r.time) for r in one.records] for one in (problem, few.problem)]
    if few.observer is not None or counts[0] == counts[1]:
        return None
    base = fit_base(problem, q)
    if base is None:
        return None
    return _without_outliers(Subject(problem, left_out, base, few.reading, fewer=few))


def read_again(whole: Subject, few: Subject) -> Subject | None:
    """Return a subject of all samples in the reading of one of few; None if the model runs away."""
    assert few.reading is not None
    problem, left_out = divided_as_read(whole, few.reading)
    model, smooth = problem.model, few.problem.records[0].smooth
    records = tuple(model.simulated(replace(record, smooth=smooth)) for record in problem.records)
    others = [model.simulated(replace(o.record, smooth=smooth)) for o in left_out]
    left_out = tuple(replace(o, record=r) for o, r in zip(left_out, others, strict=True))
    problem = replace(problem, records=records)
    base = fit_base(problem, few.base.point.q)
    return None if base is None else Subject(problem, left_out, base, few.reading, fewer=few)


def _without_outliers(subject: Subject) -> Subject:
    """Return a subject without single values far from what its model leaves around them."""
    problem, base = subject.problem, subject.base
    if subject.observer is not None:
        return subject
    pairs = zip(problem.records, base.errors, strict=True)
    records = tuple(without_outliers(problem.model, r, e) for r, e in pairs)
    left_out = []
    for one in subject.left_out:
        errors = np.full(one.record.outputs.shape, np.nan)
        unseen = subject.errors(base, one)
        if unseen is not None:
            errors[one.first :] = unseen
        left_out.append(replace(one, record=without_outliers(problem.model, one.record, errors)))
    if records == problem.records and left_out == list(subject.left_out):
        return subject
    problem = replace(problem, records=records)
    refitted = fit_base(problem, base.point.q)
    if refitted is None:
        return subject
    return replace(subject, problem=problem, left_out=tuple(left_out), base=refitted)


@dataclass(frozen=True, eq=False)
class _Recorded:
    """Records as they are read, with the subject that they make."""

    records: list[Record]
    held_out: list[Record]
    subject: Subject


def _inputs_go(model: LawModel, records: Sequence[Record], smooth: bool) -> list[Record]:
    """Return records with inputs that go in straight lines between samples, or are held."""
    read = [replace(r, smooth=(smooth,) * r.inputs.shape[1]) for r in records]
    return [model.simulated(record) for record in read]


def _turned(model: LawModel, record: Record) -> Record:
    """Return a record with inputs in straight lines where they were held, or the reverse."""
    return model.simulated(replace(record, smooth=tuple(not one for one in record.smooth)))


def _curved(model: LawModel, record: Record) -> Record:
    """Return a record with inputs in cubics where they went in straight lines."""
    return model.simulated(replace(record, curved=True)) if any(record.smooth) else record


def _as_recorded(
    problem: Problem, records: list[Record], held_out: list[Record], q: Array | None = None
) -> _Recorded | None:
    """Return the subject of a problem without records yet; None if the model runs away."""
    subject = _fitted(*_divided(problem, records, held_out, q))
    return None if subject is None else _Recorded(records, held_out, subject)


def _fitted(problem: Problem, left_out: tuple[LeftOut, ...]) -> Subject | None:
    """Fit a model without terms: by free runs, or as the least observer predicts if it is unstable.

    None if it runs away in either way.
    """
    base = fit_base(problem)
    if growth_of(_place(problem, left_out, base)) <= -np.log(_UNSEEN):
        return None if base is None else Subject(problem, left_out, base)
    subject = _observed(problem, left_out, None)
    return subject and predicted(subject)


def nearer(subject: Subject) -> Subject:
    """Return a subject with a fit that starts along pieces, if that from nominal is far astray."""
    base = subject.base
    is_astray = subject.observer is None and base.misfit > _ASTRAY
    return replace(subject, base=fit_from_pieces(base)) if is_astray else subject


def predicted(subject: Subject, fitted: Fit | None = None) -> Subject | None:
    """Return a subject of which all errors are those of the predictions of an observer.

    The observer and the fit by which it is chosen are made by turns, of thinned records.

    Parameters
    ----------
    subject : Subject
    fitted : Fit, optional
        With terms, by which the observer is chosen; by default the one without.

    Returns
    -------
    Subject or None
        None if the model runs away, forgets all errors of its states, or has too many of them.
    """
    model = subject.problem.model
    if model.begins_as_declared or any(o.is_between for o in subject.left_out):
        return None
    if len(model.states) > _MOST_OBSERVED:
        return None
    subject = subject.fewer or subject
    at = subject.base if fitted is None else fitted
    if growth_of(_place(subject.problem, subject.left_out, at)) < -_DECAY:
        return None
    for _ in range(_ROUNDS):
        one = _observed(subject.problem, subject.left_out, at)
        again = None if one is None else _refitted(one, at.terms, at.point)
        if one is None or again is None:
            return None
        subject, at = one, again
    return subject


def longest_time_constant(subject: Subject) -> float:
    """Return the time in which the slowest mode of the base falls by e, s; see `slowest_decay`."""
    return slowest_decay(_place(subject.problem, subject.left_out, subject.base))


def _refitted(subject: Subject, terms: Sequence[Term], point: Point) -> Fit | None:
    """Return the fit of terms to other records than those of a point, or that without terms."""
    if not terms:
        return subject.base
    return fit(subject.problem, terms, [point], weights_of(subject.base.errors))


def _observed(
    problem: Problem, left_out: tuple[LeftOut, ...], fitted: Fit | None
) -> Subject | None:
    """Return a subject as an observer predicts it that is chosen by a fit, or at nominal."""
    place = _place(problem, left_out, fitted)
    observer = observer_of(place)
    if observer is None:
        return None
    pairs = zip(place.records, observer.gains, strict=True)
    wholes = [replace(record, gain=gain) for record, gain in pairs]
    count = len(problem.records)
    own = [w.part(0, len(r.time)) for w, r in zip(wholes[:count], problem.records, strict=True)]
    others = wholes[:count] if left_out[0].of is not None else wholes[count:]
    starts = tuple(_anywhere(problem, record) for record in own)
    changed = replace(problem, records=tuple(own), starts=starts)
    q = place.point.q
    changed = replace(changed, substeps=_substeps(changed, own, q))
    base = fit_base(changed, q)
    if base is None:
        return None
    unseen = tuple(replace(o, record=w) for o, w in zip(left_out, others, strict=True))
    return Subject(changed, unseen, base, observer=observer)


def _place(problem: Problem, left_out: Sequence[LeftOut], fitted: Fit | None) -> Place:
    """Return a fit over all records, fitted ones first; without a fit the nominal model."""
    unseen = [one.record for one in left_out]
    # what is left out of a record goes on from what is fitted of it
    wholes, others = (problem.records, unseen) if left_out[0].of is None else (unseen, [])
    counts = (*(len(r.time) for r in problem.records), *(0 for _ in others))
    starts = tuple(_anywhere(problem, record) for record in (*problem.records, *others))
    nominal = Point(problem.mean, np.zeros(0), ())
    place = Place(problem, nominal, (), (*wholes, *others), counts, starts)
    if fitted is None:
        return place
    known = zip(starts, fitted.point.starts, strict=False)
    reached = [replace(start, mean=mean) for start, mean in known]
    starts = (*reached, *starts[len(reached) :])
    return replace(place, point=fitted.point, terms=fitted.terms, starts=starts)


def _anywhere(problem: Problem, record: Record) -> StartPrior:
    """Return the start states of a record for an observer, which finds where a run starts."""
    return start_prior(replace(problem, begins_anywhere=True), record)


def _as_fitted(recorded: _Recorded) -> Subject:
    """Divide records by the steps that the fitted model needs: the nominal one may be unstable."""
    subject = recorded.subject
    if subject.observer is not None:
        return subject
    problem, base = subject.problem, subject.base
    bare = replace(problem, records=(), starts=())
    parts = _divided(bare, recorded.records, recorded.held_out, base.point.q)
    if _steps(parts[0]) == _steps(problem):
        return subject
    refitted = fit_base(parts[0], base.point.q)
    return subject if refitted is None else Subject(*parts, refitted)


def _begun(subject: Subject) -> Subject:
    """Return a subject whose runs begin where the records say, if they clearly do elsewhere.

    A record that begins while the plant moves misses no law; to a search that may not begin there,
    it would miss any that moves a state at first.
    """
    problem = subject.problem
    model = problem.model
    at_rest = len(model.inputs) and subject.observer is None
    if problem.known_starts.all() or not at_rest:
        return subject
    free = replace(problem, begins_anywhere=True)
    free = replace(free, starts=tuple(start_prior(free, r) for r in free.records))
    fitted = fit_base(free, subject.base.point.q)
    if fitted is None:
        return subject
    other = replace(subject, problem=free, base=fitted)
    ours, declared = (one.judge(one.base) for one in (other, subject))
    if ours is None or declared is None:
        return subject
    gain = compare(ours, declared, common_of([ours, declared]))
    columns = 0.5 * float((~problem.known_starts).sum()) * len(problem.records)
    columns *= float(np.log(max(sum(n.sum() for n in ours.effective), 3.0)))
    return other if min(gain.fitted - columns, gain.left_out) > WEIGHTS.least else subject


def _steps(problem: Problem) -> list[int]:
    """Return the steps of a run over each record."""
    return [problem.substeps * len(record.time) for record in problem.records]


def _spread(records: Sequence[Record]) -> Array:
    """Return the standard deviations (ny,) of the outputs; 1 of one that stands still."""
    spread = np.mean([np.nanstd(r.outputs, axis=0) for r in records], axis=0)
    return np.where(spread > 0.0, spread, 1.0)


def divided_as_read(subject: Subject, reading: Reading) -> tuple[Problem, tuple[LeftOut, ...]]:
    """Return the problem of a subject and what is left out, of what the file means by a reading."""
    problem = subject.problem
    model = problem.model
    records = tuple(reading.apply(model, r) for r in problem.records)
    left_out = tuple(replace(o, record=reading.apply(model, o.record)) for o in subject.left_out)
    starts = tuple(start_prior(problem, r) for r in records)
    # as that of the file as it was read, of which these may be a part, or errors would differ by it
    spread = problem.spread * _spread(records) / _spread(problem.records)
    if reading.is_fed_by_output(model):
        spread = spread / WEIGHTS.fed
    changed = replace(problem, records=records, spread=spread, starts=starts)
    if reading.kind is ReadingKind.CLOCK:
        changed = replace(changed, substeps=_substeps(changed, records, changed.mean))
    return changed, left_out


def likelihood_gain(one: Subject, other: Subject) -> float:
    """Return the gain in log likelihood of a reading of records over another, nats.

    Of the samples that both kept: the noise of others differs by more than most gains. That of each
    output counts: one in which a law is missing hides no other. It has as many samples as are
    independent in the fit that leaves more structure there.
    """
    pairs = zip(one.problem.records, other.problem.records, strict=True)
    shared = [_shared(first.time, second.time) for first, second in pairs]
    errors = [
        [e[kept[k]] for e, kept in zip(subject.base.errors, shared, strict=True)]
        for k, subject in enumerate((one, other))
    ]
    counts = [[[effective_samples(c) for c in e.T] for e in both] for both in errors]
    samples = np.min(np.sum(counts, axis=1), axis=0)
    shares = np.log(variance_of(errors[1]) / variance_of(errors[0]))
    return float(0.5 * np.nansum(samples * shares))


def _shared(one: Array, other: Array) -> tuple[Indices, Indices]:
    """Return the positions in two clocks of samples of which each is the nearest of the other."""
    nearest = _nearest(other, one)
    kept = np.flatnonzero(_nearest(one, other)[nearest] == np.arange(len(one)))
    return kept, nearest[kept]


def _nearest(clock: Array, time: Array) -> Indices:
    """Return the positions in a clock of the samples that are nearest to instants."""
    return np.searchsorted(0.5 * (clock[1:] + clock[:-1]), time)


def _divided(
    problem: Problem,
    records: Sequence[Record],
    held_out: Sequence[Record],
    q: Array | None = None,
    enough: int = _MOST,
) -> tuple[Problem, tuple[LeftOut, ...]]:
    """Return the problem over what is fitted, and what is left out, by runs at `q` or nominal.

    Records of more than enough samples are thinned.
    """
    most = enough if len(records) == 1 else enough // 2
    place = problem.mean if q is None else q
    resolved = replace(problem, substeps=_substeps(problem, records, place))
    longest = max(_LONGEST * enough // max(len(records), 1), _SHORTEST)
    fitted = [_shortened(resolved, record, place, most, longest) for record in records]
    if held_out:
        others = [_shortened(resolved, r, place, enough, _RUN_ALONE * longest) for r in held_out]
        left_out = [LeftOut(record, _beginning(record), None) for record in others]
    else:
        parts = [_parts(record, i) for i, record in enumerate(fitted)]
        fitted, left_out = [seen for seen, _ in parts], [unseen for _, unseen in parts]
    starts = tuple(start_prior(resolved, record) for record in fitted)
    return replace(resolved, records=tuple(fitted), starts=starts), tuple(left_out)


def _parts(record: Record, position: int) -> tuple[Record, LeftOut]:
    """Return the fitted part of a record, and the third that is left out.

    That is the last one, unless no input moves after the beginning. A free response is over by
    then, or has only come to its slowest part: of it blocks in between are left out.
    """
    count = len(record.time)
    driven = record.inputs[int(_START * count) :]
    if (np.ptp(driven, axis=0) > _STILL * record.inputs.std(axis=0)).any():
        cut = int(_PART * count)
        return record.part(0, cut), LeftOut(record, cut, position)
    is_seen = (np.arange(count) * 3 * _TURNS // count % 3 != 1)[:, np.newaxis]
    seen = np.where(is_seen, record.outputs, np.nan)
    unseen = np.where(is_seen, np.nan, record.outputs)
    return replace(record, outputs=seen), LeftOut(replace(record, outputs=unseen), 0, position)


def _substeps(problem: Problem, records: Sequence[Record], q: Array) -> int:
    """Return steps between two samples for the fastest rate of the model at `q`."""
    model = problem.model
    counts = [1]
    for record in records:
        setting = _setting(problem, q, record)
        for substeps in (1, 8, 60):
            course = model.run(
                record, replace(setting, substeps=substeps), start_prior(problem, record).mean
            )
            if course is not None:
                counts.append(model.substeps(record, setting, course))
                break
    return max(counts)
