"""The page of a diagnosis: the answer, the model beside the record, the terms, and what is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.titles import capitalised
from orchestration.diagnosis import view
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.report import terminal, view_of, wording
from orchestration.identify.changes import CHANGE_HEAD
from orchestration.reporting import make_page, pictures
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
_LARGEST_MAP = 16  # laws, and signals
_LEAST_GAIN = 1.0  # nats, that are shown on the map
_SET_HEAD = ("Terms", "Gain on fitted samples [nat]", "On unseen ones", "Score", "Error")


@make_page.register(Changed)
@make_page.register(LawMap)
@make_page.register(Diagnosis)
def diagnosis_page(shown: Diagnosis | Changed | LawMap, command: str = "") -> Page:
    """Make the page of a diagnosis; see `view_of`."""
    return view_page(view_of(shown, command))


@make_page.register(view.DiagnosisView)
def view_page(shown: view.DiagnosisView, command: str = "") -> Page:
    """Make the page of a diagnosis from what is shown of it.

    Parameters
    ----------
    shown : DiagnosisView
    command : str
        In place of the one that made it.
    """
    answer = shown.answer
    about = (
        f"Diagnosis of <code>{escaped(answer.model)}</code> on"
        f" <code>{escaped(', '.join(shown.files))}</code>"
    )
    step = format_quantities(capitalised(answer.next_step))
    page = Page(
        capitalised(answer.headline),
        Markup(f"{_verdict(answer)} <b>Next:</b> {step}"),
        Markup(about),
    )
    _add_causes(page, shown)
    if shown.changes is not None:
        _add_changes(page, shown.changes)
    _add_experiment(page, shown)
    _add_courses(page, shown)
    if shown.laws:
        _add_laws(page, shown.laws)
    _add_figures(page, shown)
    page.made_by(command or shown.command, shown.facts)
    return page


def part_page(label: str, shown: view.DiagnosisView) -> Page:
    """Make the page of a part of a system, whose page it is on; it is no model by itself."""
    title = f"{capitalised(label)}: {shown.answer.headline}"
    page = Page(title, _verdict(shown.answer))
    _add_causes(page, shown)
    _add_courses(page, shown)
    _add_figures(page, shown)
    return page


def _verdict(answer: view.Answer) -> Markup:
    """Return the verdict with what supports it."""
    chip = elements.chip(answer.verdict, answer.verdict)
    return Markup(f"{chip} {format_quantities(answer.support)}")


def _add_courses(page: Page, shown: view.DiagnosisView) -> None:
    """Add charts of the outputs, and of what the terms add."""
    page.heading("The model beside the record")
    for course in shown.courses:
        _add_course(page, course)
    if shown.curves:
        page.heading("What the terms add")
        for curve in shown.curves:
            _add_curve(page, curve)


def _add_figures(page: Page, shown: view.DiagnosisView) -> None:
    """Add what is left, the parameters, and the sets that were fitted."""
    answer = shown.answer
    page.heading("What is left")
    page.table(_capitals(view.REMAINDER_HEAD), answer.left)
    page.text(answer.error_meaning)
    if answer.notes:
        page.items(answer.notes)
    page.heading("How sure this is")
    rows = [[name, *map(format_quantities, figures)] for name, *figures in answer.parameters]
    page.table(_capitals(view.PARAMETER_HEAD), rows)
    if any(name.endswith(" *") for name, *_ in answer.parameters):
        page.text("* differs from nominal, significantly and noticeably.")
    page.heading("How it was found")
    page.text(shown.compared)
    with page.folded(f"The best {len(shown.sets)}"):
        page.table(_SET_HEAD, [(format_quantities(terms), *rest) for terms, *rest in shown.sets])


def _add_causes(page: Page, shown: view.DiagnosisView) -> None:
    """Add the group of causes, if there is one, and the error by the number of terms."""
    answer = shown.answer
    if not answer.causes:
        return
    page.heading("What is wrong" if answer.is_named else "Best guesses")
    head, rows = terminal.filled(view.GROUP_HEAD, answer.causes)
    page.table(_capitals(head), [[format_quantities(cell) for cell in row] for row in rows])
    for line in answer.aliases:
        page.text(line)
    bars = []
    for k, ((model, text), error) in enumerate(zip(answer.ladder, shown.errors, strict=True)):
        colour = pictures.FITTED if k else pictures.MODEL
        bars.append(Bar(capitalised(model), colour, np.nan if error is None else error, text))
    page.parts.append(elements.bar_chart("Error on unseen samples, part by part", bars))


def _add_changes(page: Page, changes: view.ChangesView) -> None:
    """Add what changed in a later record, and the diagnosis of that record by itself."""
    page.heading(f"What changed from {changes.before} to {changes.after}")
    for line in changes.text.splitlines():
        page.text(line)
    rows = []
    for (name, before, after, *rest, verdict), ends in zip(
        changes.rows, changes.intervals, strict=True
    ):
        cells = [
            elements.two_lines(format_quantities(value), format_quantities(end))
            for value, end in zip((before, after), ends, strict=True)
        ]
        last = elements.chip("differs", verdict) if verdict == "changed" else verdict
        rows.append([name, *cells, *rest, last])
    page.table(_capitals(CHANGE_HEAD), rows)
    page.parts.append(elements.muted_paragraph(wording.CHANGES_MEANING))
    chip = elements.chip(changes.verdict, changes.verdict)
    told = format_quantities(changes.by_itself)
    page.text(Markup(f"{escaped(changes.after)} by itself: {chip} {told}"))
    if changes.notes:
        page.items(changes.notes)


def _add_experiment(page: Page, shown: view.DiagnosisView) -> None:
    """Add the experiment that tells the causes apart, if there is one."""
    experiment = shown.experiment
    if experiment is None:
        return
    page.subheading("An experiment that would tell more")
    page.text(
        f"{experiment.sentence} Save it as experiment.toml, and ppy run experiment.toml rehearses"
        " it."
    )
    page.code([experiment.toml])


def _add_course(page: Page, course: view.CourseView) -> None:
    """Add a chart of an output above its residuals."""
    time, measured = _array(course.time), _array(course.measured)
    above = [Trace(course.measured_as, time, measured, pictures.MEASURED, 3.5)]
    below = []
    for one in course.simulated:
        values = _array(one.values)
        colour = pictures.FITTED if one.is_final else pictures.MODEL
        above.append(Trace(one.label, time, values, colour))
        below.append(Trace(one.label, time, measured - values, colour))
    boundary = None
    if course.unseen_from is not None:
        boundary = Boundary(course.unseen_from, course.before, "unseen")
    panels = [
        Panel(pictures.with_unit(course.output, course.unit), _HEIGHT, above),
        Panel(pictures.with_unit("measured − simulated", course.unit), _RESIDUAL_HEIGHT, below),
    ]
    page.chart(stacked(panels, "time [s]", boundary=boundary), course.caption)


def _add_curve(page: Page, curve: view.CurveView) -> None:
    """Add a chart of a term over its signal, with the values that the record reached."""
    values, samples = _array(curve.y), _array(curve.samples)
    floor = np.full(samples.shape, values.min())
    traces = [
        Trace("fitted", _array(curve.x), values, pictures.FITTED, 2.0),
        Trace("samples of the record", samples, floor, pictures.MEASURED, dots=True),
    ]
    panel = Panel(curve.added, _CURVE_HEIGHT, traces)
    page.chart(stacked([panel], curve.signal), format_quantities(curve.caption))


def _add_laws(page: Page, entries: Sequence[view.LawRow]) -> None:
    """Add what each law gains over each signal, as a map."""
    page.heading("Which law over which signal")
    best = {(one.law, one.signal): one for one in entries if one.gain >= _LEAST_GAIN}
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
                texts[i][k] = f"{entry.text}, {entry.shape}: {entry.gain:.1f}"
    omitted = len(laws) - len(rows) + len(signals) - len(columns)
    more = f" {omitted} laws and signals that gain less are not shown." if omitted else ""
    chart = heat_map(rows, columns, gains, texts, "gain [nat]")
    empty = f" A cell is empty where less than {_LEAST_GAIN:g} is gained."
    page.chart(chart, f"{wording.LAW_MAP_MEANING}{empty}{more}")


def _capitals(titles: Sequence[str]) -> list[str]:
    return [capitalised(title) for title in titles]


def _array(values: view.Numbers) -> Array:
    """Return numbers to draw; None is a gap."""
    return np.array(values, dtype=float)
