"""The page of a diagnosis: the answer, the model beside the record, the terms, and what is left."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from itertools import islice

import numpy as np

from fmus.kit.titles import capitalised, in_words
from fmus.kit.units import format_value
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.law_map import LawEntry, LawMap
from orchestration.diagnosis.report import curves, terminal, tried_sets, wording
from orchestration.diagnosis.term_names import sentence, shape_text, unit_of
from orchestration.identify.changes import CHANGE_HEAD, Change, change_rows, describe_changes
from orchestration.records import Record
from orchestration.reporting import flag, make_page, pictures
from orchestration.reporting.html import (
    Bar,
    Boundary,
    Markup,
    Page,
    Panel,
    Trace,
    elements,
    escaped,
    format_quantities,
    heat_map,
    stacked,
)

_HEIGHT, _RESIDUAL_HEIGHT, _CURVE_HEIGHT = 190, 110, 190  # pixels
_SETS = 12  # that are listed
_MARKS = 150  # samples that are marked below a curve
_LARGEST_MAP = 16  # laws, and signals
_LEAST_GAIN = 1.0  # nats, that are shown on the map
_SET_HEAD = ("Terms", "Gain on fitted samples [nat]", "On unseen ones", "Score", "Error")


@make_page.register(Changed)
def changed_page(changed: Changed, command: str = "") -> Page:
    """Make the page of a diagnosis with what changed in a later record; see `diagnosis_page`."""
    return diagnosis_page(changed.before, command, changed)


@make_page.register(LawMap)
def laws_page(law_map: LawMap, command: str = "") -> Page:
    """Make the page of a diagnosis with the map of its laws; see `diagnosis_page`."""
    return diagnosis_page(law_map.diagnosis, command, law_map=law_map)


@make_page.register(Diagnosis)
def diagnosis_page(
    diagnosis: Diagnosis,
    command: str = "",
    changed: Changed | None = None,
    law_map: LawMap | None = None,
) -> Page:
    """Make the page of a diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
    command : str
        That made it; unless given, one that makes the same.
    changed : Changed, optional
        What changed in a later record.
    law_map : LawMap, optional
        What each law gains over each signal.
    """
    later = [] if changed is None else [*changed.later.records]
    used = (*diagnosis.records, *diagnosis.holdouts, *later)
    sources = list(dict.fromkeys(record.source for record in used))
    files = ", ".join(source.name for source in sources)
    about = (
        f"Diagnosis of <code>{escaped(diagnosis.model.name)}</code> on"
        f" <code>{escaped(files)}</code>"
    )
    step = format_quantities(capitalised(wording.next_step(diagnosis)))
    page = Page(
        capitalised(wording.headline(diagnosis)),
        Markup(f"{verdict_text(diagnosis)} <b>Next:</b> {step}"),
        Markup(about),
    )
    if diagnosis.causes:
        _add_causes(page, diagnosis)
    if changed is not None:
        _add_changes(page, changed)
    _add_experiment(page, diagnosis)
    _add_courses(page, diagnosis)
    if law_map is not None and law_map.entries:
        _add_law_map(page, law_map)
    _add_figures(page, diagnosis)
    page.reproduction(sources, command or _command(diagnosis, later))
    return page


def part_page(label: str, diagnosis: Diagnosis) -> Page:
    """Make the page of a part of a system, whose page it is on; it is no model by itself."""
    title = f"{capitalised(label)}: {wording.headline(diagnosis)}"
    page = Page(title, verdict_text(diagnosis))
    if diagnosis.causes:
        _add_causes(page, diagnosis)
    _add_courses(page, diagnosis)
    _add_figures(page, diagnosis)
    return page


def verdict_text(diagnosis: Diagnosis) -> Markup:
    """Return the verdict with what supports it."""
    chip = elements.chip(diagnosis.verdict, diagnosis.verdict)
    return Markup(f"{chip} {format_quantities(wording.support(diagnosis))}")


def _add_courses(page: Page, diagnosis: Diagnosis) -> None:
    """Add charts of the outputs, and of what the terms add."""
    page.heading("The model beside the record")
    for course in curves.output_courses(diagnosis):
        _add_course(page, diagnosis, course)
    terms = curves.term_curves(diagnosis.final.fit, diagnosis.terms)
    if terms:
        page.heading("What the terms add")
        for curve in terms.values():
            _add_curve(page, diagnosis, curve)


def _add_figures(page: Page, diagnosis: Diagnosis) -> None:
    """Add what is left, the parameters, and the sets that were fitted."""
    page.heading("What is left")
    head = [capitalised(title) for title in terminal.REMAINDER_HEAD]
    page.table(head, terminal.remainder_rows(diagnosis))
    page.text(wording.error_meaning(diagnosis))
    if diagnosis.notes:
        page.items([message for _, _, message in diagnosis.notes])
    page.heading("How sure this is")
    _add_parameters(page, diagnosis)
    page.heading("How it was found")
    _add_sets(page, diagnosis)


def _add_causes(page: Page, diagnosis: Diagnosis) -> None:
    """Add the group of causes, and the error by the number of terms."""
    page.heading("What is wrong" if diagnosis.is_named else "Best guesses")
    head, rows = terminal.filled(terminal.GROUP_HEAD, terminal.group_rows(diagnosis))
    cells = [[format_quantities(cell) for cell in row] for row in rows]
    page.table([capitalised(title) for title in head], cells)
    for line in wording.alias_lines(diagnosis):
        page.text(line)
    bars = []
    for rung, (model, error) in zip(diagnosis.ladder, terminal.ladder_rows(diagnosis), strict=True):
        length = np.nan if rung.error is None else rung.error
        colour = pictures.FITTED if rung.parts else pictures.MODEL
        bars.append(Bar(capitalised(model), colour, length, error))
    page.parts.append(elements.bar_chart("Error on unseen samples, part by part", bars))


def _add_changes(page: Page, changed: Changed) -> None:
    """Add what changed in a later record, and the diagnosis of that record by itself."""
    before, after = wording.files(changed.before), wording.files(changed.later)
    page.heading(f"What changed from {before} to {after}")
    page.text(describe_changes(changed.changes))
    head = [capitalised(title) for title in CHANGE_HEAD]
    page.table(head, [_change_row(one) for one in changed.changes])
    page.parts.append(elements.muted_paragraph(wording.CHANGES_MEANING))
    verdict = changed.later.verdict
    chip = elements.chip(verdict, verdict)
    told = format_quantities(wording.by_itself(changed))
    page.text(Markup(f"{escaped(after)} by itself: {chip} {told}"))
    if changed.later.notes:
        page.items([message for _, _, message in changed.later.notes])


def _change_row(change: Change) -> list[str]:
    """Return a row of the table of changes, with intervals."""
    name, before, after, *rest, verdict = change_rows([change])[0]
    ends = [
        wording.ends(interval, lambda value: format_value(value, change.declaration, 4))
        for interval in (change.before_interval, change.after_interval)
    ]
    cells = [
        elements.two_lines(format_quantities(value), format_quantities(end))
        for value, end in zip((before, after), ends, strict=True)
    ]
    return [name, *cells, *rest, elements.chip("differs", verdict) if change.changed else verdict]


def _add_experiment(page: Page, diagnosis: Diagnosis) -> None:
    """Add the experiment that tells the causes apart, if there is one."""
    experiment = diagnosis.experiment
    if experiment is None:
        return
    page.subheading("An experiment that would tell more")
    page.text(
        f"{experiment.sentence} Save it as experiment.toml, and ppy run experiment.toml rehearses"
        " it."
    )
    page.code([experiment.toml(diagnosis.model.name, experiment.sentence)])


def _add_course(page: Page, diagnosis: Diagnosis, course: curves.OutputCourse) -> None:
    """Add a chart of an output above its residuals."""
    bracket = "" if course.unit == "1" else f" [{course.unit}]"
    is_corrected = diagnosis.reading is not None and not np.isfinite(course.before).any()
    measured = "measured, corrected" if is_corrected else "measured"
    above = [Trace(measured, course.time, course.measured, pictures.MEASURED, 3.5)]
    below = []
    for one in curves.simulations(diagnosis, course):
        above.append(Trace(one.label, course.time, one.values, one.colour))
        below.append(Trace(one.label, course.time, course.measured - one.values, one.colour))
    title = capitalised(in_words(course.output))
    boundary = None
    if course.unseen_from > course.time[0]:
        is_own = diagnosis.subject.left_out[0].of is None
        before = "its start states are fitted" if is_own else "fitted"
        boundary = Boundary(course.unseen_from, before, "unseen")
    panels = [
        Panel(f"{title}{bracket}", _HEIGHT, above),
        Panel(f"measured − simulated{bracket}", _RESIDUAL_HEIGHT, below),
    ]
    caption = f"{title} of record {course.record}, and what the models leave of it."
    if diagnosis.reading is not None:
        caption = f"{caption} In the file {diagnosis.reading.sentence}."
    page.chart(stacked(panels, "time [s]", boundary=boundary), caption)


def _add_curve(page: Page, diagnosis: Diagnosis, curve: curves.TermCurve) -> None:
    """Add a chart of a term over its signal, with the values that the record reached."""
    cls = diagnosis.subject.problem.model.cls
    term = curve.term
    unit = "1" if term.factor else unit_of(cls, term.law)
    added = f"part of {in_words(term.factor)}" if term.factor else f"added to {in_words(term.law)}"
    places = np.quantile(curve.samples, np.linspace(0.0, 1.0, _MARKS))
    places = places[(places >= curve.signal[0]) & (places <= curve.signal[-1])]
    floor = np.full(places.shape, float(curve.addition.min()))
    traces = [
        Trace("fitted", curve.signal, curve.addition, pictures.FITTED, 2.0),
        Trace("samples of the record", places, floor, pictures.MEASURED, dots=True),
    ]
    panel = Panel(f"{added}{'' if unit == '1' else f' [{unit}]'}", _CURVE_HEIGHT, traces)
    signal_unit = unit_of(cls, term.signal)
    across = in_words(term.signal) + ("" if signal_unit == "1" else f" [{signal_unit}]")
    caption = (
        f"{capitalised(sentence(cls, term))}: {shape_text(term)}, where x is the signal below."
    )
    page.chart(stacked([panel], across), format_quantities(caption))


def _add_law_map(page: Page, law_map: LawMap) -> None:
    """Add what each law gains over each signal, as a map."""
    page.heading("Which law over which signal")
    best = {one.term.cause: one for one in law_map.entries if one.gain >= _LEAST_GAIN}
    if not best:
        page.text("No law gains by a term of any signal, to first order.")
        return
    laws = list(dict.fromkeys(law for law, _ in best))
    signals = list(dict.fromkeys(signal for _, signal in best))
    rows, columns = laws[:_LARGEST_MAP], signals[:_LARGEST_MAP]
    gains = np.full((len(rows), len(columns)), np.nan)
    texts = [["" for _ in columns] for _ in rows]
    for i, law in enumerate(rows):
        for k, signal in enumerate(columns):
            entry = best.get((law, signal))
            if entry is not None:
                gains[i, k] = entry.gain
                texts[i][k] = _entry_text(law_map.diagnosis, entry)
    omitted = len(laws) - len(rows) + len(signals) - len(columns)
    more = f" {omitted} laws and signals that gain less are not shown." if omitted else ""
    chart = heat_map(rows, columns, gains, texts, "gain [nat]")
    empty = f" A cell is empty where less than {_LEAST_GAIN:g} is gained."
    page.chart(chart, f"{wording.LAW_MAP_MEANING}{empty}{more}")


def _entry_text(diagnosis: Diagnosis, entry: LawEntry) -> str:
    """Return an entry of the map for people."""
    cls = diagnosis.subject.problem.model.cls
    return f"{sentence(cls, entry.term)}, {shape_text(entry.term)}: {entry.gain:.1f}"


def _add_parameters(page: Page, diagnosis: Diagnosis) -> None:
    """Add the parameters with their intervals."""
    head = [capitalised(title) for title in terminal.PARAMETER_HEAD]
    rows = [
        [name, *(format_quantities(cell) for cell in figures)]
        for name, *figures in terminal.parameter_rows(diagnosis)
    ]
    page.table(head, rows)
    if diagnosis.changed:
        page.text("* differs from nominal, significantly and noticeably.")


def _add_sets(page: Page, diagnosis: Diagnosis) -> None:
    """Add the sets of terms that were fitted, the best first."""
    fits = diagnosis.found.compared()
    page.text(
        f"{len(fits)} fits of sets of terms in {wording.runs(diagnosis)} were compared with the"
        " model without terms."
    )
    rows = []
    for one in islice(tried_sets(diagnosis), _SETS):
        figures = [f"{value:.1f}" for value in (one.fitted, one.left_out, one.score)]
        rows.append((format_quantities(one.parts), *figures, wording.error_text(one.error)))
    with page.folded(f"The best {len(rows)}"):
        page.table(_SET_HEAD, rows)


def _command(diagnosis: Diagnosis, later: Sequence[Record]) -> str:
    """Return a command that makes the same diagnosis."""
    words = ["ppy", "diagnose", *(str(record.source) for record in diagnosis.records)]
    for record in diagnosis.holdouts:
        words += [flag("holdout"), str(record.source)]
    for record in later:
        words += [flag("compare"), str(record.source)]
    words += [flag("model"), diagnosis.model.name]
    return shlex.join(words)
