"""Changes from records to a later one of the same specimen: of parameters, and of causes."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import single_threaded
from orchestration.diagnosis.comparison import Judged
from orchestration.diagnosis.engine import Diagnosis, diagnose
from orchestration.diagnosis.extension import extended_component
from orchestration.diagnosis.fitting import by_least_squares, vague, with_free_starts
from orchestration.diagnosis.joint import (
    Difference,
    Joint,
    Selected,
    Selection,
    start_values,
    strengths,
)
from orchestration.diagnosis.local_values import LocalValues
from orchestration.diagnosis.options import Deadline, Options
from orchestration.diagnosis.search import Found
from orchestration.diagnosis.subject import Subject, predicted, subject_of
from orchestration.diagnosis.term_names import TermParameter, interval_of, stems, term_parameters
from orchestration.diagnosis.terms import Term
from orchestration.identify.changes import Change
from orchestration.records import Record as MeasuredRecord
from orchestration.records import record_labels
from orchestration.reporting import option


@dataclass(frozen=True)
class Changed:
    """Changes from the records of a diagnosis to a later one.

    Attributes
    ----------
    before, later : Diagnosis
        Of the records, and of the later record by itself.
    changes : tuple of Change
        Of every parameter and every cause of which the records say something; those that surely
        changed first, by their gain.
    earlier : tuple of Changed
        The same of records in between, in time.
    """

    before: Diagnosis
    later: Diagnosis
    changes: tuple[Change, ...]
    earlier: tuple[Changed, ...] = ()

    @property
    def in_time(self) -> tuple[Changed, ...]:
        """Changes to every later record, in time."""
        return (*self.earlier, self)


def changes_in_time(
    before: Diagnosis,
    records: Sequence[MeasuredRecord],
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Changed:
    """Find what differs in each of several later records, in time; see `find_changes`.

    Returns
    -------
    Changed
        Of the last record, with those of the others.
    """
    *earlier, last = [find_changes(before, record, options, progress) for record in records]
    return replace(last, earlier=tuple(earlier))


def find_changes(
    before: Diagnosis,
    after: MeasuredRecord,
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Changed:
    """Find what differs in a later record of the same specimen.

    Parameters
    ----------
    before : Diagnosis
    after : MeasuredRecord
    options : Options, optional
        That the diagnosis was made with.
    progress : callable
        Called with a text about each step of the work.

    Returns
    -------
    Changed

    Raises
    ------
    UserError
        If the later record cannot be used.
    """
    options = options or Options()
    smooth = any(before.subject.problem.records[0].smooth)
    progress(f"diagnosing {after.source.name}")
    try:
        alone = replace(options, interpolate=smooth)
        later = diagnose([after], before.model, (), alone, progress)
    except UserError as error:
        raise UserError(f"{option('compare', after.source.name)}: {error}") from error
    return changes_between(before, later, options, progress)


def changes_between(
    before: Diagnosis,
    later: Diagnosis,
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Changed:
    """Find what differs between the records of two diagnoses of one model; see `find_changes`."""
    options = options or Options()
    _check_outputs(before, later)
    deadline = Deadline(options.time)
    progress("fitting all records together")
    with warnings.catch_warnings():
        # an output that was not recorded has no mean
        warnings.simplefilter("ignore", RuntimeWarning)
        subject = _joined(before, later, options)
    explaining = None
    if subject is not None:
        explaining = _explaining(subject, before, later, deadline.is_over)
    if explaining is None:
        names = [one.records[0].source.name for one in (before, later)]
        raise UserError(f"{before.model.name}: a run over {' and '.join(names)} leaves all bounds")
    joint, common, separate, every = explaining
    progress(f"{len(every)} values that may have changed")
    selected = Selection(joint, common, separate, every, deadline.is_over).select()
    return Changed(before, later, _changes(selected))


def _check_outputs(before: Diagnosis, later: Diagnosis) -> None:
    """Raise an error unless the later record has the outputs of those from before."""

    def measured(diagnosis: Diagnosis) -> set[str]:
        problem = diagnosis.subject.problem
        columns = np.any([record.measured for record in problem.records], axis=0)
        return {problem.model.outputs[j].name for j in np.flatnonzero(columns)}

    missing = sorted(measured(before) - measured(later))
    if missing:
        name = option("compare", later.records[0].source.name)
        raise UserError(f"{name}: it lacks an output of the record before, {', '.join(missing)}")


def _joined(before: Diagnosis, later: Diagnosis, options: Options) -> Subject | None:
    """Return the model over all records, each as the diagnosis of it reads it."""
    model = before.subject.problem.model
    records = []
    for diagnosis, first in ((before, 0), (later, len(before.records))):
        own = diagnosis.pieces
        if diagnosis.reading is not None:
            own = tuple(diagnosis.reading.apply(model, record) for record in own)
        several = len(diagnosis.records) > 1  # of one, pieces may be of two specimens
        records += [replace(r, group=first + r.group * several) for r in own]
    groups = tuple(record_labels([*before.records, *later.records]))
    local = LocalValues(groups, options.own_of_each(model))
    hold = options.held_of(model)
    smooth = any(before.subject.problem.records[0].smooth)
    subject = subject_of(model, records, (), hold, options.given, smooth, local=local)
    if subject is None:
        return None
    if options.recalibrates:  # by all samples, as each by itself
        subject = subject.complete() or subject
        base, problem = by_least_squares(subject.base), vague(subject.problem)
    else:
        base, problem = subject.base, with_free_starts(subject.problem)
    subject = replace(subject, problem=problem, base=replace(base, problem=problem))
    if before.observer is None:
        return subject
    return predicted(subject) or subject


@single_threaded
def _explaining(
    subject: Subject, before: Diagnosis, later: Diagnosis, is_over: Callable[[], bool]
) -> tuple[Joint, Judged, Judged, tuple[Difference, ...]] | None:
    """Return the model that explains all records best, with the causes of either, of both or none.

    None if it leaves its bounds in all these ways.

    Returns
    -------
    joint : Joint
    common, separate : Judged
        Without values that differ, and with all of them.
    every : tuple of Difference
        Those that differ there.
    """
    tried = list(_fitted_jointly(subject, before, later, is_over))
    if not tried:
        return None
    base = subject.judge(subject.base)
    scores = {}
    if base is not None:
        found = Found(subject, base, tuple(separate for _, _, separate, _ in tried))
        ranked = [one for one in found.compared() if not one.comparison.is_worse]
        scores = {id(one.judged): one.score for one in ranked}
    return max(tried, key=lambda one: scores.get(id(one[2]), -np.inf))


def _fitted_jointly(
    subject: Subject, before: Diagnosis, later: Diagnosis, is_over: Callable[[], bool]
) -> Iterator[tuple[Joint, Judged, Judged, tuple[Difference, ...]]]:
    """Yield fits over all records, with the causes of none, of either and of both."""
    ours, theirs = tuple(before.terms.values()), tuple(later.terms.values())
    own = {term.source for term in ours}
    both = (*ours, *(term for term in theirs if term.source not in own))
    fits = before.final.fit, later.final.fit
    for terms in dict.fromkeys(((), ours, theirs, both)):
        joint = Joint(subject, terms)
        start = start_values(joint, *fits)
        common = joint.fit((), [start])
        every = tuple(joint.all_differences(list(fits)))
        here = [] if common is None else [start, joint.values(common.fit, ())]
        separate = joint.fit(every, here) if here else None
        if common is not None and separate is not None:
            yield joint, common, separate, every
        if is_over():
            break


def _changes(selected: Selected) -> tuple[Change, ...]:
    """Return every value as it is before and after, those that surely changed first."""
    joint = selected.joint
    cls = joint.subject.problem.model.cls
    made = extended_component(selected.common.fit, stems(cls, joint.terms))
    declared = {p.name: p for p in made.layout.parameters}
    others = [one for one in selected.all if one not in selected.chosen]
    changes = []
    for one in (*selected.chosen, *others):
        is_sure = one in selected.sure
        (before, its_interval), (after, later_interval) = _both(selected, one)
        name = one if isinstance(one, str) else _strength(joint, one).name
        changes.append(
            Change(
                name,
                before,
                after,
                its_interval,
                later_interval,
                is_sure,
                one in selected.doubtful,
                selected.gains.get(one),
                declared[name],
                "" if isinstance(one, str) else one.name,
                None if isinstance(one, str) else 0.0,
                selected.bounds[one],
                one in selected.stayed,
            )
        )
    return tuple(sorted(changes, key=lambda change: not change.changed))


def _both(selected: Selected, one: Difference) -> list[tuple[float, tuple[float, float]]]:
    """Return a value with its interval, before and after.

    One that surely changed is as it is beside the others that did; else as if all had.
    """
    fitted, differences = selected.separate.fit, selected.all
    if one in selected.sure:
        fitted, differences = selected.best.fit, selected.chosen
    values, covariance = strengths(selected.joint, fitted, differences, one)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    pairs = zip(values, spread, strict=True)
    return [_value(selected.joint, one, float(v), float(wide)) for v, wide in pairs]


def _value(
    joint: Joint, one: Difference, value: float, deviation: float
) -> tuple[float, tuple[float, float]]:
    """Return a value with its interval of 95 %, SI."""
    if isinstance(one, str):
        problem = joint.subject.problem
        place = joint.place(one)
        low, high = interval_of(value, deviation, problem.deviation[place])
        scale = problem.scales[place]
        return scale.value(value), (scale.value(low), scale.value(high))
    factor = _strength(joint, one).factor
    low, high = interval_of(value, deviation, np.inf)
    return factor * value, (factor * low, factor * high)


def _strength(joint: Joint, term: Term) -> TermParameter:
    """Return the first parameter of a term, which says how strong it is."""
    cls = joint.subject.problem.model.cls
    stem = next(stem for stem, other in stems(cls, joint.terms).items() if other == term)
    return term_parameters(cls, stem, term)[0]
