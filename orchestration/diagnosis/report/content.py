"""The content of a diagnosis that terminal and page show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from fmus.kit import Component, quoting
from fmus.kit.arrays import Array, Indices
from fmus.kit.titles import capitalised, in_words, law_title
from fmus.kit.units import format_value
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.remainder import TESTS
from orchestration.diagnosis.report import curves, wording
from orchestration.diagnosis.report.tried import tried_sets
from orchestration.diagnosis.term_names import (
    memory_text,
    seen_title,
    seen_unit,
    sentence,
    shape_text,
    term_parameters,
    unit_of,
)
from orchestration.diagnosis.terms import Term
from orchestration.diagnosis.view import (
    Answer,
    ChangesView,
    CourseView,
    CurveView,
    DiagnosisView,
    LawRow,
    Line,
    Numbers,
    Proposal,
)
from orchestration.identify.changes import Change, change_rows, describe_changes
from orchestration.records import Record
from orchestration.reporting import flag, pictures
from orchestration.reporting.html import extremes, facts_about

_SETS = 12  # that are listed
_BINS = 800  # of a course, of which every line keeps its lowest and its highest point
_MARKS = 150  # samples that are marked below a curve
_DIGITS = 6  # of a number that is drawn


def answer_of(diagnosis: Diagnosis, written: Mapping[str, str] | None = None) -> Answer:
    """Return the answer of a diagnosis in words and tables.

    Parameters
    ----------
    diagnosis : Diagnosis
    written : Mapping of str to str, optional
        Files that are written with it, by option; see `wording.next_step`.
    """
    return Answer(
        model=diagnosis.model.name,
        verdict=diagnosis.verdict,
        headline=wording.headline(diagnosis),
        support=wording.support(diagnosis),
        next_step=wording.next_step(diagnosis, written),
        is_named=diagnosis.is_named,
        notes=_messages(diagnosis),
        causes=tuple(_group_rows(diagnosis)),
        aliases=tuple(wording.alias_lines(diagnosis)),
        ladder=tuple(_ladder_rows(diagnosis)) if diagnosis.causes else (),
        left=tuple(_remainder_rows(diagnosis)),
        error_meaning=wording.error_meaning(diagnosis),
        parameters=tuple(_parameter_rows(diagnosis)),
    )


def view_of(
    shown: Diagnosis | Changed | LawMap,
    command: str = "",
    written: Mapping[str, str] | None = None,
) -> DiagnosisView:
    """Return a diagnosis as a page shows it.

    Parameters
    ----------
    shown : Diagnosis, Changed or LawMap
        With what changed in a later record, or with the map of its laws.
    command : str
        That made it; unless given, one that makes the same.
    written : Mapping of str to str, optional
        Files that are written with it, by option; see `wording.next_step`.
    """
    changed = shown if isinstance(shown, Changed) else None
    law_map = shown if isinstance(shown, LawMap) else None
    if isinstance(shown, Diagnosis):
        diagnosis = shown
    else:
        diagnosis = shown.before if isinstance(shown, Changed) else shown.diagnosis
    later = [] if changed is None else [*changed.later.records]
    used = (*diagnosis.records, *diagnosis.holdouts, *later)
    sources = list(dict.fromkeys(record.source for record in used))
    terms = curves.term_curves(diagnosis.final.fit, diagnosis.terms).values()
    return DiagnosisView(
        answer=answer_of(diagnosis, written),
        files=tuple(source.name for source in sources),
        facts=facts_about(sources),
        command=command or _command(diagnosis, later),
        errors=tuple(rung.error for rung in diagnosis.ladder),
        courses=tuple(_course(diagnosis, one) for one in curves.output_courses(diagnosis)),
        curves=tuple(curve_view(diagnosis, one) for one in terms),
        compared=(
            f"{len(diagnosis.found.compared())} fits of sets of terms in"
            f" {wording.runs(diagnosis)} were compared with the model without terms."
        ),
        sets=tuple(_set_rows(diagnosis)),
        experiment=_proposal(diagnosis),
        changes=None if changed is None else changes_view(changed),
        laws=None if law_map is None else tuple(law_rows(law_map)),
    )


def _command(diagnosis: Diagnosis, later: Sequence[Record]) -> str:
    """Return a command that makes the same diagnosis."""
    words: list[str | Path] = ["ppy", "diagnose"]
    words += [record.source for record in diagnosis.records]
    for record in diagnosis.holdouts:
        words += [flag("holdout"), record.source]
    for record in later:
        words += [flag("compare"), record.source]
    words += [flag("model"), diagnosis.model.name]
    return quoting.shell(words)


def law_rows(law_map: LawMap) -> Iterator[LawRow]:
    """Yield a row for each law over a signal, the largest gain first."""
    cls = law_map.diagnosis.cls
    for entry in law_map.entries:
        term = entry.term
        yield LawRow(
            law=term.law,
            signal=term.signal,
            text=sentence(cls, term),
            shape=shape_text(term),
            memory=memory_text(term),
            gain=entry.gain,
        )


def changes_view(changed: Changed) -> ChangesView:
    """Return what changed in a later record; of several in time, a row of each for each value."""
    names = [wording.files(one.later) for one in changed.in_time]
    if len(set(names)) < len(names):
        names = [str(one.later.records[0].source) for one in changed.in_time]
    texts = [describe_changes(one.changes) for one in changed.in_time]
    rows = [
        (change, [f"{cells[0]}, {name}", *cells[1:]])
        for name, one in zip(names, changed.in_time, strict=True)
        for change, cells in zip(one.changes, change_rows(one.changes), strict=True)
    ]
    if changed.earlier:
        texts = [f"{name}: {text}" for name, text in zip(names, texts, strict=True)]
        order = [change.name for change in changed.changes]
        order += [change.name for change, _ in rows]
        rows.sort(key=lambda row: order.index(row[0].name))
    else:
        rows = [*zip(changed.changes, change_rows(changed.changes), strict=True)]
    return ChangesView(
        before=wording.files(changed.before),
        after=names[-1],
        text="\n".join(texts),
        rows=tuple(tuple(cells) for _, cells in rows),
        intervals=tuple(_intervals(change) for change, _ in rows),
        verdict=changed.later.verdict,
        by_itself=wording.answer(changed.later),
        notes=_messages(changed.later),
    )


def _messages(diagnosis: Diagnosis) -> tuple[str, ...]:
    return tuple(dict.fromkeys(message for _, _, message in diagnosis.notes))


def _intervals(change: Change) -> tuple[str, ...]:
    """Return the intervals of a value before and after."""
    return tuple(
        wording.ends(interval, lambda value: format_value(value, change.declaration, 4))
        for interval in (change.before_interval, change.after_interval)
    )


def _proposal(diagnosis: Diagnosis) -> Proposal | None:
    experiment = diagnosis.experiment
    if experiment is None:
        return None
    text = experiment.sentence
    return Proposal(sentence=text, toml=experiment.toml(diagnosis.model.name, text))


def _group_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for each cause of the group."""
    for cause in diagnosis.causes:
        first, *others = cause.parts
        term = first if isinstance(first, Term) else None
        yield (
            wording.percent(cause.probability),
            wording.cause_text(diagnosis, cause),
            wording.error_text(diagnosis.error(cause.judged)),
            shape_text(term) if term else "",
            memory_text(term) if term else "",
            "; ".join(wording.part_text(diagnosis, part) for part in others),
        )


def _ladder_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for the model with fitted parameters, and for each part that is added."""
    for rung in diagnosis.ladder:
        added = [f"+ {wording.part_text(diagnosis, part)}" for part in rung.parts[-1:]]
        (model,) = added or ["parameters fitted"]
        yield model, wording.error_text(rung.error)


def _remainder_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for each output."""
    for one in diagnosis.remainders:
        yield (
            one.output,
            wording.error_text(one.share),
            wording.noise_widths(one),
            one.pace,
            *(f"{one.tests[name]:.2f}" for name in TESTS),
        )


def _parameter_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for each parameter; those that differ from nominal are marked."""
    of_terms = {
        parameter.name
        for stem, term in diagnosis.terms.items()
        for parameter in term_parameters(diagnosis.cls, stem, term)
    }
    places = _places(diagnosis.cls, diagnosis.terms)
    for name, estimate in diagnosis.parameters.items():
        label = name + places.get(name, "")
        yield (
            f"{label} *" if name in diagnosis.changed else label,
            wording.quantity(diagnosis, name, estimate.value),
            wording.interval(diagnosis, name, estimate),
            "" if name in of_terms else wording.quantity(diagnosis, name, estimate.nominal),
        )


def _places(cls: type[Component], terms: Mapping[str, Term]) -> dict[str, str]:
    """Return the value that a curve sees at each knot, by the name of its parameter."""
    seen = {
        stem: pictures.with_unit(seen_title(cls, term), seen_unit(cls, term))
        for stem, term in terms.items()
    }
    return {
        f"{stem}_at_{k}": f" ({seen[stem]} = {x:.3g})"
        for stem, term in terms.items()
        for k, x in enumerate(term.knots)
    }


def _set_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for each of the sets of terms that were fitted, the best first."""
    for one in islice(tried_sets(diagnosis), _SETS):
        figures = [f"{value:.1f}" for value in (one.fitted, one.left_out, one.score)]
        yield (one.parts, *figures, wording.error_text(one.error))


def _course(diagnosis: Diagnosis, course: curves.OutputCourse) -> CourseView:
    """Return an output beside the models."""
    shown = curves.simulations(diagnosis, course)
    lines = [course.measured, *(one.values for one in shown)]
    kept = _extremes([*lines, *(course.measured - one.values for one in shown)])
    time, *lines = (line[kept] for line in (course.time, *lines))
    title = capitalised(in_words(course.output))
    caption = f"{title} of record {course.record}, and what the models leave of it."
    if diagnosis.reading is not None:
        caption = f"{caption} In the file {diagnosis.reading.sentence}."
    is_corrected = diagnosis.reading is not None and not np.isfinite(course.before).any()
    is_own = diagnosis.subject.left_out[0].of is None
    return CourseView(
        output=title,
        unit=course.unit,
        caption=caption,
        measured_as="measured, corrected" if is_corrected else "measured",
        time=_numbers(time),
        measured=_numbers(lines[0]),
        simulated=tuple(
            Line(label=one.label, is_final=one.is_final, values=_numbers(values))
            for one, values in zip(shown, lines[1:], strict=True)
        ),
        unseen_from=course.unseen_from if course.unseen_from > course.time[0] else None,
        before="its start states are fitted" if is_own else "fitted",
    )


def _extremes(lines: Sequence[Array]) -> Indices:
    """Return indices of samples: all, or those where a line has an end of a stretch's range."""
    n = len(lines[0])
    if n <= 2 * _BINS * len(lines):
        return np.arange(n)
    kept = [extremes(line, 2 * _BINS) for line in lines]
    return np.unique(np.concatenate([[0, n - 1], *kept]))


def _numbers(values: Array) -> Numbers:
    """Return numbers as they are drawn; what is not finite is a gap."""
    return tuple(float(f"{v:.{_DIGITS}g}") if np.isfinite(v) else None for v in values.tolist())


def added_to_law(diagnosis: Diagnosis, term: Term) -> tuple[str, str]:
    """Return what the curve of a term shows, and its unit."""
    title = law_title(diagnosis.cls, term.factor or term.law)
    if term.factor:
        return f"part of {title}", "1"
    return f"added to {title}", unit_of(diagnosis.cls, term.law)


def curve_view(diagnosis: Diagnosis, curve: curves.TermCurve) -> CurveView:
    """Return what a term adds over its signal."""
    cls = diagnosis.cls
    term = curve.term
    places = np.quantile(curve.samples, np.linspace(0.0, 1.0, _MARKS))
    places = places[(places >= curve.signal[0]) & (places <= curve.signal[-1])]
    return CurveView(
        added=pictures.with_unit(*added_to_law(diagnosis, term)),
        signal=pictures.with_unit(seen_title(cls, term), seen_unit(cls, term)),
        caption=(
            f"{capitalised(sentence(cls, term))}: {shape_text(term)}, where x is the signal below."
        ),
        x=_numbers(curve.signal),
        y=_numbers(curve.addition),
        samples=_numbers(places),
    )
