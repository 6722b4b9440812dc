"""From measured records to the diagnosis of a component: the one way through the kernel."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, cast

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.registry import Excitation
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import Judged
from orchestration.diagnosis.conclude import Conclusion, Pairs, conclude, is_lost
from orchestration.diagnosis.design import Design, design_experiment
from orchestration.diagnosis.equivalence import equivalent_pairs
from orchestration.diagnosis.extension import extended_component
from orchestration.diagnosis.fitting import by_least_squares
from orchestration.diagnosis.joints import pieced
from orchestration.diagnosis.law_model import MOST_TICKS, LawModel
from orchestration.diagnosis.local_values import COMMON, LocalValues
from orchestration.diagnosis.misreadings import misreadings, reading_that_runs
from orchestration.diagnosis.observer import Observer
from orchestration.diagnosis.options import Deadline, Options
from orchestration.diagnosis.pieces import Note, pieces_of, recorded_inputs
from orchestration.diagnosis.readings import TIME, Reading
from orchestration.diagnosis.remainder import (
    Remainder,
    drifts,
    leaves_more,
    remainders,
    undersampled,
)
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.search import Found, search
from orchestration.diagnosis.subject import Subject, longest_time_constant, predicted, subject_of
from orchestration.diagnosis.term_names import deviations, estimates, stems
from orchestration.diagnosis.terms import Term
from orchestration.experiment.design import DiscriminatingExperiment, menu
from orchestration.fmu import Model
from orchestration.identify.uncertainty import Estimate, is_significantly_different
from orchestration.records import Record as MeasuredRecord
from orchestration.records import record_labels
from orchestration.reporting import option

_Answer = tuple[Found, Conclusion]
Verdict = Literal["consistent", "recalibrate", "cause", "ambiguous", "unexplained"]

_WHOLE = 0.9  # of a record, from which on it counts as used
_UNTOLD = 3.0  # times the longest record, from which on a time constant is like an endless one
_HELD_OUT = "in what was held out, "  # begins what is said of these records


@dataclass(frozen=True)
class Rung:
    """A step of the ladder: so many parts of the best model, with their error on unseen samples.

    Attributes
    ----------
    parts : tuple of Reading or Term
        Empty for the model without terms on the file as it was read.
    error : float or None
        Root mean square on samples by which nothing was chosen; see `Diagnosis.error`.
    """

    parts: tuple[Reading | Term, ...]
    error: float | None

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms among its parts."""
        return tuple(part for part in self.parts if isinstance(part, Term))


@dataclass(frozen=True)
class Diagnosis:
    """The diagnosis of a component over records.

    Attributes
    ----------
    model : Model
    records, holdouts : tuple of MeasuredRecord
    pieces : tuple of Record
        The records as they were used: cut at gaps of their time, and where states jump.
    found : Found
        All fits, with their subject.
    conclusion : Conclusion
    notes : tuple of (str, str, str)
        Code, subject and sentence of a remark on the data.
    experiment : DiscriminatingExperiment or None
        That tells the causes of a group apart, or best guesses.
    """

    model: Model
    records: tuple[MeasuredRecord, ...]
    holdouts: tuple[MeasuredRecord, ...]
    pieces: tuple[Record, ...]
    found: Found
    conclusion: Conclusion
    notes: tuple[Note, ...] = ()
    experiment: DiscriminatingExperiment | None = None

    @property
    def subject(self) -> Subject:
        """The compiled model with its records, as they were fitted by the final model."""
        return self.found.subject_of(self.reading)

    @property
    def cls(self) -> type[Component]:
        """The component that was diagnosed; the one made around an FMU without equations."""
        return self.found.subject.problem.model.cls

    @property
    def has_equations(self) -> bool:
        """True if the model is a component, and no FMU whose equations are unknown."""
        return self.model.cls is not None

    @property
    def observer(self) -> Observer | None:
        """The observer by whose predictions models are judged; None if free runs judge them."""
        return self.found.subject.observer

    @property
    def is_interrupted(self) -> bool:
        """True if Ctrl-C ended the search."""
        return _INTERRUPTED in self.notes

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict, by the conclusion and by what is left."""
        if self.conclusion.verdict != "consistent":
            return cast("Verdict", self.conclusion.verdict)
        is_changed = bool(self.changed) or self.begins_elsewhere
        return "recalibrate" if is_changed else "consistent"

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The group of causes, the most probable first; best guesses where nothing is explained."""
        return () if self.conclusion.verdict == "consistent" else self.conclusion.causes

    @property
    def is_named(self) -> bool:
        """True if the verdict names a cause, or a group of them."""
        return self.conclusion.is_named

    @property
    def final(self) -> Judged:
        """The model that all figures after the diagnosis are of: with the first cause if named."""
        return self.conclusion.causes[0].judged if self.is_named else self.found.base

    @property
    def reading(self) -> Reading | None:
        """The reading of the files by the final model; None if it is as they were read."""
        return self.final.reading

    @cached_property
    def terms(self) -> dict[str, Term]:
        """Terms of the final model in the order in which they explain, by name."""
        if not self.is_named:
            return {}
        return stems(self.cls, self.causes[0].terms)

    @cached_property
    def component(self) -> type[Component]:
        """The final model as a component, with fitted values as defaults."""
        reading = self.reading if self.has_equations else None
        made = extended_component(self.final.fit, self.terms, reading)
        files = ", ".join(dict.fromkeys(record.source.name for record in self.records))
        read = "" if self.reading is None else f", in which {self.reading.sentence}"
        made.remark = f"Fitted to {ascii(files)[1:-1]}{read}\n{made.remark}".strip()
        return made

    @cached_property
    def remainders(self) -> tuple[Remainder, ...]:
        """Errors that the final model leaves in each measured output."""
        return remainders(self.final, self.found.subject_of(self.reading).sizes)

    @cached_property
    def parameters(self) -> dict[str, Estimate]:
        """Parameters of the final model, those of its terms among them, by name."""
        return estimates(self.final.fit, self.terms)

    @property
    def begins_elsewhere(self) -> bool:
        """True if the records begin at other start states than the model declares.

        A model that may begin anywhere declares none.
        """
        problem = self.found.subject.problem
        return problem.begins_anywhere and not problem.model.cls.begins_anywhere

    @cached_property
    def changed(self) -> tuple[str, ...]:
        """Parameters of the model that differ from nominal, significantly and noticeably.

        What the record does not determine is not among them, though it was fitted; nor is the phase
        of a clock, as a record begins at any instant of a period.
        """
        fitted = self.final.fit
        problem = fitted.problem
        changes = fitted.point.q - problem.mean
        errors = deviations(fitted)[: len(changes)]
        return tuple(
            name
            for name, change, error in zip(problem.names, changes, errors, strict=True)
            if is_significantly_different(change, error)
            and name not in problem.model.shifts
            and np.isfinite(self.parameters[name].interval[1])
        )

    @cached_property
    def ladder(self) -> tuple[Rung, ...]:
        """Errors of the model without terms, and with one more of the first cause at a time."""
        rungs = [Rung((), self.error(self.found.base))]
        parts = self.causes[0].parts if self.causes else ()
        for count in range(1, len(parts) + 1):
            sources = {part.source for part in parts[:count]}
            same = [one for one in self.found.fits if {p.source for p in one.parts} == sources]
            if count == len(parts):
                same = [self.causes[0].judged]
            if same:
                best = min(same, key=lambda one: float(np.nanmean(one.choosing**2)))
                rungs.append(Rung(parts[:count], self.error(best)))
        return tuple(rungs)

    @cached_property
    def errors_before(self) -> dict[str, float | None]:
        """Errors of the model without terms, by output; see `errors`."""
        return self.errors(self.found.base)

    @cached_property
    def errors_after(self) -> dict[str, float | None]:
        """Errors of the final model, by output; see `errors`."""
        return self.errors(self.final)

    def errors(self, judged: Judged) -> dict[str, float | None]:
        """Return RMS errors where nothing was chosen, over `Subject.sizes`, by output."""
        result = {}
        sizes = self.found.subject_of(judged.reading).sizes
        for j, output in enumerate(self.subject.problem.model.outputs):
            error = judged.measuring[:, j]
            error = error[np.isfinite(error)]
            share = float(np.sqrt(np.mean(error**2)) / sizes[j]) if error.size else np.nan
            result[output.name] = share if np.isfinite(share) else None
        return result

    def error(self, judged: Judged) -> float | None:
        """Return the root mean square of `errors` over the outputs."""
        known = [value for value in self.errors(judged).values() if value is not None]
        return float(np.sqrt(np.mean(np.square(known)))) if known else None


def diagnose(
    records: Sequence[MeasuredRecord],
    model: Model,
    holdouts: Sequence[MeasuredRecord] = (),
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
    law_model: LawModel | None = None,
) -> Diagnosis:
    """Diagnose a component over records.

    Parameters
    ----------
    records : sequence of MeasuredRecord
        Each has start states of its own; one with gaps in its time is cut there.
    model : Model
        With equations, unless `law_model` has them.
    holdouts : sequence of MeasuredRecord
        By one half of which models are compared, and by the other measured; without any, the last
        third of every record.
    options : Options, optional
    progress : callable
        Called with a text about each step of the work.
    law_model : LawModel, optional
        By default the model, compiled.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UserError
        If the model, the records or the options cannot be used.
    """
    options = options or Options()
    law_model = law_model or _law_model(model, options)
    labels = record_labels([*records, *holdouts])
    count = len(records)
    fitted, notes = pieces_of(records, law_model, options.given, labels=labels[:count])
    unseen, others = pieces_of(holdouts, law_model, options.given, _HELD_OUT, labels[count:])
    unseen = [replace(one, group=count) for one in unseen]
    local = LocalValues(tuple(labels[:count]), options.own_of_each(law_model))
    _check_clocks(law_model, [*fitted, *unseen], options.given)
    data = _Data(model, law_model, _names(records), fitted, unseen, options, local)
    progress("fitting the model as it is")
    deadline = Deadline(options.time)
    with warnings.catch_warnings():
        # an output that was not recorded has no mean
        warnings.simplefilter("ignore", RuntimeWarning)
        (found, conclusion), data, more = _decide(data, progress, deadline)
    notes += [*others, *more, *_remarks(found, data)]
    if conclusion.verdict == "consistent":
        notes += _short(model, found.subject)
    if deadline.interrupted:
        notes.append(_INTERRUPTED)
    elif not deadline.was_met:
        notes.append(_time_note(options))
    design = _designed(found, conclusion, records, options)
    return Diagnosis(
        model,
        tuple(records),
        tuple(holdouts),
        tuple(data.records),
        found,
        conclusion,
        (*notes, *design.notes),
        design.experiment,
    )


def is_followed(records: Sequence[MeasuredRecord], model: Model, options: Options) -> bool:
    """Return whether free runs of a model stay with records, with fitted parameters.

    Raises
    ------
    UserError
        If the model, the records or the options cannot be used.
    """
    law_model = _law_model(model, options)
    pieces, _ = pieces_of(records, law_model, options.given)
    data = _Data(model, law_model, _names(records), pieces, [], options, COMMON)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        subject = data.subject()
        if subject is None or subject.observer is not None:
            return False
        judged = subject.judge(subject.base)
        return judged is not None and not drifts(judged)


@dataclass(frozen=True, eq=False)
class _Data:
    """A model with its records, as they are fitted and as they are left out."""

    model: Model
    law_model: LawModel
    files: str
    records: list[Record]
    unseen: list[Record]
    options: Options
    local: LocalValues

    def subject(self, reading: Reading | None = None) -> Subject | None:
        """Return the subject of the files as they were read, or in another reading."""
        options = self.options
        hold = options.held_of(self.law_model)
        own, others = self.records, self.unseen
        if reading is not None:
            own = [reading.apply(self.law_model, record) for record in own]
            others = [reading.apply(self.law_model, record) for record in others]
        known = hold, options.given, options.interpolate
        return subject_of(self.law_model, own, others, *known, local=self.local)


def _decide(
    data: _Data, progress: Callable[[str], None], deadline: Deadline
) -> tuple[_Answer, _Data, list[Note]]:
    """Return the answer of a search, the data by which it was found, and notes on them.

    A record that was put together is its pieces, of which the model leaves noise alone: nothing is
    searched there.

    Raises
    ------
    UserError
        If the records say nothing of the model, or it cannot follow them.
    """
    subject = data.subject()
    if subject is not None and not subject.rank:
        subject = predicted(subject) or subject
    parts = None
    if subject is not None:
        _check_count(data, subject)
    # behind a joint a clock would tick at other instants
    if subject is not None and not len(subject.problem.phases):
        parts = pieced(
            subject,
            data.records,
            lambda own, local: replace(data, records=own, local=local).subject(),
        )
    notes = []
    options = data.options
    if parts is not None:
        subject, notes = parts.subject, [parts.note]
        data = replace(data, records=list(parts.records))
        options = replace(options, laws=False, effects=())
    answer = None if subject is None else _answer(subject, options, progress, deadline)
    if subject is None or answer is None or subject.observer is not None:
        read = reading_that_runs(data.law_model, data.records, data.subject)
        if answer is None or read is not None:
            raise UserError(_refusal(data, read))
    _check_rank(data, answer)
    return answer, data, notes


def _designed(
    found: Found, conclusion: Conclusion, records: Sequence[MeasuredRecord], options: Options
) -> Design:
    """Design an experiment as long as the longest record.

    Inputs with a given value keep it, and inputs that are held that about which they were recorded.
    """
    record = max(records, key=lambda record: float(np.ptp(record.time)))
    law_model = found.subject.problem.model
    inputs = recorded_inputs(record, law_model, options.given)
    given = {name: (value, value) for name, value in options.given.items() if name in inputs}
    rig = options.excitation or Excitation({}, np.inf)
    values = menu.operating_values(law_model.recorded, inputs)
    held = {name: (values[name], values[name]) for name in options.hold if name in values}
    rig = replace(rig, ranges={**rig.ranges, **held, **given})
    try:
        return design_experiment(found, conclusion, inputs, record.time, rig)
    except UserError as error:
        return Design(reason=f"no experiment could be designed: {error}")


def _answer(
    subject: Subject, options: Options, progress: Callable[[str], None], deadline: Deadline
) -> _Answer | None:
    """Search for terms, unless parameters alone are to be fitted; None if the model runs away.

    If states of the model keep errors, the errors are those of predictions where free runs leave a
    large slow error, with a cause or without.
    """

    def answer_of(one: Subject) -> _Answer | None:
        if options.recalibrates:
            one = one.complete() or one
            base = one.judge(by_least_squares(one.base))
            found = None if base is None else Found(one, base)
        else:
            ways = progress, deadline.is_over, options.is_candidate
            with deadline.ended_by_ctrl_c():
                found = search(one, *ways, thorough=options.thorough)
        return None if found is None else (found, _concluded(found))

    begun = subject.judge(subject.base)
    is_adrift = subject.observer is None and (begun is None or drifts(begun))
    one = predicted(subject) if is_adrift else None
    first = answer_of(one) if one is not None and _is_trusted(one) else None
    is_silent = first is not None and first[1].verdict == "consistent"
    if is_silent and not _follows_otherwise(subject, begun):
        return first
    plain = answer_of(subject)
    if plain is None or options.recalibrates or not _is_open(plain):
        return plain
    ranked = plain[0].compared()
    if not drifts(ranked[0].judged if ranked else plain[0].base):
        return plain
    if subject.observer is not None:
        return _predicted_answer(plain, plain, answer_of)
    one = one or predicted(subject)
    if one is None or (plain[1].is_named and not _is_trusted(one)):
        return plain
    first = first or answer_of(one)
    if first is None:
        return plain
    return _predicted_answer(plain, first, answer_of)


def _concluded(found: Found) -> Conclusion:
    """Return the conclusion, in which one model in several parametrisations is one cause."""
    conclusion = conclude(found)
    equivalent: Pairs = frozenset()
    while conclusion.verdict in ("ambiguous", "unexplained"):
        further = equivalent_pairs(conclusion.causes, found.base.choosing)
        if not further:
            return conclusion
        equivalent = frozenset((*equivalent, *further))
        conclusion = conclude(found, equivalent)
    return conclusion


def _follows_otherwise(subject: Subject, begun: Judged | None) -> bool:
    """Return whether free runs follow the file in a plain reading: predictions follow any."""
    if begun is None:
        return False
    plain = [one for one in misreadings(subject, begun) if one.reading and not one.reading.is_sized]
    judged = [one.judge(one.base) for one in plain]
    return any(one is not None and not drifts(one) for one in judged)


def _predicted_answer(
    plain: _Answer, first: _Answer, answer_of: Callable[[Subject], _Answer | None]
) -> _Answer:
    """Return the answer by predictions where free runs explain nothing.

    `plain` is by free runs, unless the model is unstable; `first` is by the observer that was
    chosen by the fit without terms.
    """
    is_trusted = _is_trusted(first[0].subject)
    if first[1].verdict == "consistent" or (is_trusted and first[1].verdict != "unexplained"):
        return first if is_trusted else plain
    found = (first if is_trusted else plain)[0]
    ranked = found.compared()
    one = predicted(found.subject, ranked[0].judged.fit if ranked else found.base.fit)
    last = answer_of(one) if one is not None and _is_trusted(one) else None
    return last or plain


def _is_open(answer: _Answer) -> bool:
    """Return whether no cause is found, or one that leaves more than noise."""
    conclusion = answer[1]
    if not conclusion.is_named:
        return conclusion.verdict == "unexplained"
    return leaves_more(conclusion.causes[0].judged)


def _is_trusted(subject: Subject) -> bool:
    """Return whether predictions are those of the model rather than of disturbances."""
    return subject.observer is not None and subject.observer.is_small


def _remarks(found: Found, data: _Data) -> Iterator[Note]:
    """Yield notes on how the records were used and the model was judged."""
    subject = found.subject
    yield from _cut_off(subject, data.records)
    yield from _free_response(subject)
    yield from _predictions(data.model, subject)
    yield from _denoised(subject)
    yield from _in_cubics(subject)
    yield from _unrelated(found)
    yield from _coarse(found)


def _short(model: Model, subject: Subject) -> Iterator[Note]:
    """Yield the note on records that are short beside the slowest mode of a model."""
    records = (*subject.problem.records, *(one.record for one in subject.left_out))
    length = max(float(np.ptp(record.time)) for record in records)
    slowest = longest_time_constant(subject)
    if slowest > _UNTOLD * length:
        text = (
            f"{model.name} takes {slowest:.3g} s to settle by two thirds, and the longest record"
            f" lasts {length:.3g} s: what it does later is not tested; record a longer run"
        )
        yield "short", model.name, text


def _coarse(found: Found) -> Iterator[Note]:
    """Yield the note on outputs of which what is left may be noise as well as a law."""
    names = " and ".join(undersampled(found.base))
    text = (
        f"{names}: sampled too coarsely: from sample to sample the model moves by about as much as"
        " it leaves, so that noise cannot be distinguished from what it lacks; record more samples"
        " a second"
    )
    if names:
        yield "coarse", names, text


def _predictions(model: Model, subject: Subject) -> Iterator[Note]:
    """Yield the note on errors that are those of predictions."""
    if subject.observer is None:
        return
    text = (
        f"{model.name} keeps or lets grow what its states miss, so that a free run drifts: errors"
        f" are those of predictions by an observer, which corrects the states by the measured"
        f" outputs and has a memory of {subject.observer.memory:.2g} s"
    )
    yield "predictions", model.name, text


def _free_response(subject: Subject) -> Iterator[Note]:
    """Yield notes on records of which blocks in between are left out."""
    text = (
        "no input moves after the beginning: the model is judged by how outputs settle, on blocks"
        " in between that no fit has seen"
    )
    for one in subject.left_out:
        if one.is_between:
            yield "free_response", one.record.label, text


def _in_cubics(subject: Subject) -> Iterator[Note]:
    """Yield the note on inputs that go in curves between samples."""
    record = subject.problem.records[0]
    if not record.curved:
        return
    pairs = zip(subject.problem.model.inputs, record.smooth, strict=True)
    names = " and ".join(v.name for v, is_smooth in pairs if is_smooth)
    text = (
        f"{names}: taken to go in cubics between samples, by which the model follows the record"
        " better than in straight lines; a simulation has to read it so, or at more samples"
    )
    yield "curved", names, text


def _unrelated(found: Found) -> Iterator[Note]:
    """Yield the note on outputs of which no fit predicts more than their means."""
    problem = found.subject.problem
    measured = problem.records[0].measured
    if not all(is_lost(one, found.subject_of(one.reading)) for one in (found.base, *found.fits)):
        return
    pairs = zip(problem.model.outputs, measured, strict=True)
    names = " and ".join(output.name for output, is_measured in pairs if is_measured)
    text = (
        f"no model that was tried predicts {names} much better than a mean: see whether inputs and"
        " outputs are of one run, and of this plant"
    )
    yield "unrelated", names, text


_INTERRUPTED: Note = ("interrupted", "", "Ctrl-C was pressed: this is the best answer so far")


def _time_note(options: Options) -> Note:
    """Return the note on a search that ended by its time."""
    text = (
        f"time is up after {options.time:g} s of processor time: this is the best answer so far;"
        f" {option('time', f'{4.0 * (options.time or 0.0):g}s')} continues"
    )
    return "time", "", text


def _refusal(data: _Data, read: Reading | None) -> str:
    """Return why a model cannot be fitted, with the reading of the files by which it can."""
    where = f"{data.model.name}: a free run over {data.files} leaves all bounds"
    if read is not None:
        return f"{where}, and follows it if {read.sentence}: {read.correction}"
    return (
        f"{where}, and so do predictions by an observer: the model is unstable there, or lacks an"
        " input"
    )


def _check_count(data: _Data, subject: Subject) -> None:
    """Raise an error unless the records leave samples to judge the model by."""
    samples, rank = subject.samples, subject.rank
    if samples <= rank:
        raise UserError(
            f"{data.model.name}: {data.files}: {samples} measured values are fitted, by"
            f" {rank} parameters and start states that they determine, and none is over to judge"
            f" the model by; add samples or hold parameters ({option('hold')})"
        )


def _check_rank(data: _Data, answer: _Answer) -> None:
    """Raise an error if the records say nothing of the model in any way to read them."""
    found, conclusion = answer
    subject = found.subject
    is_misread = any(cause.reading is not None for cause in conclusion.causes)
    known = int(subject.problem.known_starts.sum()) * len(subject.base.point.starts)
    if not subject.rank and len(subject.base.curvature) > known and not is_misread:
        raise UserError(
            f"{data.model.name}: {data.files}: its {subject.samples} measured values say"
            " nothing of any parameter or start state; record a run in which the outputs move"
        )


def _law_model(model: Model, options: Options) -> LawModel:
    """Compile a model with equations.

    Raises
    ------
    UserError
        If it has none, or not an effect that is wanted.
    """
    if model.cls is None:
        raise UserError(f"{model.without_equations}, so that there are no laws to search")
    return LawModel(model.cls, options.effects_of(model.cls))


def _check_clocks(model: LawModel, records: Sequence[Record], given: Mapping[str, float]) -> None:
    """Raise an error if a clock ticks too often between two samples of a record."""
    parameters = np.array([float(given.get(p.name, p.start)) for p in model.parameters])
    for record in records:
        ticks = model.ticks_in_step(record, parameters)
        if ticks > MOST_TICKS:
            raise UserError(
                f"{model.cls.name}: {ticks:.0f} sample instants fall between two samples of"
                f" {record.label}, and {MOST_TICKS:.0f} are allowed; record more samples"
            )


def _cut_off(subject: Subject, records: Sequence[Record]) -> Iterator[Note]:
    """Yield notes on records of which the beginning alone is used."""
    for used, record in zip(subject.beginnings, records, strict=True):
        length = float(record.time[-1])
        # what is thinned ends up to a step earlier
        if used < _WHOLE * length:
            text = f"of {record.label} the first {used:.6g} s of {length:.6g} s are used"
            yield "beginning", record.label, text


def _names(records: Sequence[MeasuredRecord]) -> str:
    return ", ".join(dict.fromkeys(record.source.name for record in records))


def _denoised(subject: Subject) -> Iterator[Note]:
    """Yield notes on columns that are read without their noise."""
    outputs = {output.name for output in subject.problem.model.outputs}
    records = [*subject.problem.records, *(one.record for one in subject.left_out)]
    counts = Counter(name for record in records for name in record.denoised)
    for name, count in counts.items():
        if name == TIME:
            text = "has noise, which adds to every slope: its steps are taken to be even"
        elif name in outputs:
            text = f"has single values far from those beside them, which are left out: {count}"
        else:
            text = "has noise, which passes through the model: it is smoothed between its jumps"
        yield "denoised", name, f"{name} {text}"
