"""Sections of the page of a diagnosis, each added below what is there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array, Mask
from fmus.kit.titles import (
    capitalised,
    effect_title,
    in_words,
    law_title,
    variable_title,
    within_sentence,
)
from fmus.kit.units import unit_of_differences, write_prefixed
from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.note import Action, Note, notes_by_action
from orchestration.discrepancy.pipeline import Result, file_names
from orchestration.discrepancy.report import figures, html_elements, wording
from orchestration.discrepancy.report.effect_picture import effect_chart
from orchestration.discrepancy.report.figures import Parts, ShownModel, SimulatedModel
from orchestration.discrepancy.report.html_elements import AxisScale, format_estimate
from orchestration.discrepancy.report.tables import (
    TriedEffect,
    error_table,
    least_squares_table,
    tried_effects,
)
from orchestration.discrepancy.report.wording import EXTENDED, NOMINAL, REFITTED, meanings_of
from orchestration.discrepancy.residuals import (
    OperatingRegion,
    ResidualAnalysis,
    ResidualTest,
    residual_tests,
)
from orchestration.discrepancy.validation import simulated_outputs
from orchestration.identify import changes, rms
from orchestration.identify.changes import Change
from orchestration.identify.uncertainty import Estimate
from orchestration.records import Record
from orchestration.records.runs import base_name, shown_name
from orchestration.reporting import format_percent
from orchestration.reporting.html import Bar, Markup, Page, elements, escaped

_DRAWN = 3  # effects of which there is a picture
_EVIDENCE_HEAD = ["effect", "fall of BIC", "p-value", "verdict"]
_LISTED = 5  # lines, jumps, and what a residual correlates with


def simulated_models(result: Result) -> list[SimulatedModel]:
    """Return the models that are shown, and their outputs over the validation data.

    Outputs of the FMUs are taken where these were run. A nominal model that cannot be simulated is
    left out.
    """
    validation = result.diagnosis.validation
    models = _simulate_each(
        _models(result.diagnosis), lambda model: simulated_outputs(validation, model)
    )
    if not result.gain:
        return models
    of_fmus = {REFITTED: result.gain.base, EXTENDED: result.gain.extended}
    return [replace(shown, simulated=of_fmus.get(shown.label, shown.simulated)) for shown in models]


def _models(diagnosis: Diagnosis) -> list[ShownModel]:
    selection = diagnosis.selection
    nominal = replace(selection.base, fit=replace(selection.base.fit, values={}))
    models = [ShownModel(NOMINAL, nominal), ShownModel(REFITTED, selection.base)]
    if selection.steps:
        models.append(ShownModel(EXTENDED, selection.best))
    return models


def _simulate_each(
    models: Sequence[ShownModel], simulate: Callable[[FittedCandidate], Mapping[str, Array]]
) -> list[SimulatedModel]:
    """Simulate every model; the nominal one is left out where it cannot be."""
    simulated = []
    for shown in models:
        try:
            simulated.append(SimulatedModel(shown.label, shown.model, simulate(shown.model)))
        except UserError:
            if shown.label != NOMINAL:
                raise
    return simulated


def _without_unmeasured(data: Dataset) -> Dataset:
    """Return data without the outputs of which nothing was measured."""
    measured = {output: y for output, y in data.measured.items() if np.isfinite(y).any()}
    return replace(data, measured=measured)


def measured_anywhere(data: Dataset) -> Mask:
    """Return the samples at which anything was measured, a mask of shape (n,)."""
    return np.any([np.isfinite(y) for y in data.measured.values()], axis=0)


def add_errors(page: Page, result: Result, models: Sequence[SimulatedModel]) -> None:
    """Add how far off every model is on data that no fit has seen."""
    diagnosis = result.diagnosis
    page.subheading(f"Error on {wording.UNSEEN}")
    cls = diagnosis.selection.base.candidate.cls
    for output in _without_unmeasured(diagnosis.validation.data).measured:
        bars = [_error_bar(result, shown, output) for shown in models]
        page.parts.append(elements.bar_chart(capitalised(law_title(cls, output)), bars))
    page.parts.append(elements.muted_paragraph(_explanation_of_errors(result)))
    head, rows = error_table(diagnosis)
    page.table(head, rows)
    page.parts.append(
        elements.muted_paragraph(
            "The same errors, and those on the part of the record that was fitted."
        )
    )


def _error_bar(result: Result, shown: SimulatedModel, output: str) -> Bar:
    """Return the error of a model in an output as a bar, in percent and in its unit."""
    validation = result.diagnosis.validation
    values = shown.simulated[output]
    errors = (validation.data.measured[output] - values)[validation.judged]
    share = validation.nrmse({**validation.data.measured, output: values})[output]
    size = write_prefixed(rms(errors), result.model.outputs[output].unit)
    percent = format_percent(share)
    text = f"{percent} · {size}" if np.isfinite(share) else size
    return Bar(shown.label, shown.colour, share, text)


def _explanation_of_errors(result: Result) -> str:
    selection = result.diagnosis.selection
    text = (
        "Root mean square of measured minus simulated, in percent of the standard deviation of the"
        f" measurement, and in its unit. {NOMINAL.capitalize()}: the model as it came;"
        f" {REFITTED}: all of them, without an effect"
    )
    if selection.steps:
        effects = selection.best.candidate.effects
        titles = " and ".join(within_sentence(effect_title(effect)) for effect in effects)
        text += f"; {EXTENDED}: with {titles} as well"
    if result.gain:
        return f"{text}. Simulated by the exported FMU and that of the base model."
    return f"{text}."


def add_curves(page: Page, result: Result, models: Sequence[SimulatedModel]) -> None:
    """Add measured and simulated outputs over time, of what was held out and what was fitted to."""
    validation = result.diagnosis.validation
    if result.holdout is not None or validation.data.several:
        _add_curves_of_records(page, result, models)
        return
    page.subheading("The record and the model")
    data = _without_unmeasured(validation.data)
    if validation.first > 0:
        parts = Parts(validation.first, "fitted", "held out")
        page.chart(*figures.plot_over_time(result.model, data, models, parts))
        _add_closer(page, result, models, validation.first)
        return
    page.parts.append(elements.muted_paragraph("Only samples that were held out are shown."))
    mask = measured_anywhere(validation.data)
    masked = [shown.where(mask) for shown in models]
    page.chart(*figures.plot_over_time(result.model, data.where(mask), masked))


def _add_closer(page: Page, result: Result, models: Sequence[SimulatedModel], first: int) -> None:
    """Add the beginning of what is judged once more, closer."""
    data = _without_unmeasured(result.diagnosis.validation.data)
    closer = figures.plot_closer(result.model, data, models, first)
    if closer is not None:
        page.chart(*closer)


def _add_curves_of_records(page: Page, result: Result, models: Sequence[SimulatedModel]) -> None:
    """Add the curves of the records held out, and then of those fitted to."""
    validation = result.diagnosis.validation
    estimation = result.diagnosis.estimation
    several = bool(estimation.several or validation.data.several)
    page.subheading("The records held out" if several else "The record held out")
    page.parts.append(elements.muted_paragraph(file_names(result.holdouts or result.records)))
    held_out = _without_unmeasured(validation.data)
    parts = None
    if not validation.data.several:
        parts = Parts(validation.first, "start fitted", "judged")
    page.chart(*figures.plot_over_time(result.model, held_out, models, parts))
    _add_closer(page, result, models, validation.first)

    page.subheading("The records fitted to" if several else "The record fitted to")
    page.parts.append(elements.muted_paragraph(result.files))
    fitted = _without_unmeasured(estimation)
    over_fitted = _simulate_each(models, lambda model: _simulate(model, fitted))
    page.chart(*figures.plot_over_time(result.model, fitted, over_fitted))


def _simulate(model: FittedCandidate, data: Dataset) -> dict[str, Array]:
    """Return the outputs of a free run of a model over data, SI."""
    ran = model.problem.model.run(data.time, data.inputs, model.parameters, runs=data.runs)
    return {output: ran.signals[output] for output in data.measured}


def add_causes(page: Page, diagnosis: Diagnosis) -> None:
    """Add what every effect that was named does, and which parameters differ."""
    lines = html_elements.verdict_details(diagnosis)
    if lines:
        page.items(lines)


def add_effects(page: Page, diagnosis: Diagnosis) -> None:
    """Add a picture of every effect that was named: its law with it and without it."""
    charts = [effect_chart(diagnosis, step.chosen) for step in diagnosis.selection.steps[:_DRAWN]]
    drawn = [chart for chart in charts if chart is not None]
    if not drawn:
        return
    page.heading("The effect itself" if len(drawn) == 1 else "The effects themselves")
    for chart in drawn:
        page.chart(*chart)


def add_evidence(page: Page, result: Result) -> None:
    """Add what speaks for every effect that was tried: those named first, refuted ideas folded."""
    diagnosis = result.diagnosis
    page.subheading("Evidence: what was tried")
    tried = tried_effects(diagnosis)
    cls = diagnosis.selection.base.candidate.cls
    rejected = [row for row in tried if row.verdict == "rejected"]
    named = [row for row in tried if row.verdict != "rejected"]
    if named:
        page.table(_EVIDENCE_HEAD, _evidence_rows(cls, named))
    if rejected:
        with page.folded(f"{len(rejected)} ideas that the record refutes or does not need"):
            page.table(_EVIDENCE_HEAD, _evidence_rows(cls, rejected))
    if tried:
        page.parts.append(
            elements.muted_paragraph(
                "BIC weighs how likely a model makes the record against the number of its"
                f" parameters. Its fall is less the price of looking at {diagnosis.selection.tried}"
                " effects, and p-values are corrected for that. Every candidate refits all"
                " parameters and the colour of the noise."
            )
        )
    fitted = {row.candidate.effect_name for row in tried}
    others = [effect for effect in result.effects if label(effect) not in fitted]
    if not others:
        return
    if tried:
        reason = "Less promising, and so not fitted"
    elif diagnosis.selection.tried:
        reason = "Looked at; none was promising enough to be fitted"
    else:
        reason = "Not tried"
    titles = ", ".join(within_sentence(effect_title(effect)) for effect in others)
    page.text(f"{reason}: {titles}.")


def _evidence_rows(cls: type[Component], tried: Sequence[TriedEffect]) -> list[list[str]]:
    largest = max(row.gain for row in tried)
    return [
        [
            elements.named(
                effect_title(row.candidate.effect),
                row.candidate.effect_name,
                html_elements.effect_summary(cls, row.candidate.effect),
            ),
            html_elements.number_above_bar(row.gain, largest),
            html_elements.format_probability(row.p_value),
            elements.two_lines(elements.chip(row.verdict, row.verdict), row.reason),
        ]
        for row in tried
    ]


def add_parameters(page: Page, diagnosis: Diagnosis) -> None:
    """Add the parameters with intervals, beside their nominal values."""
    best = diagnosis.selection.best
    declared = diagnosis.final.problem.declared
    owners = {name: effect for effect in best.candidate.effects for name in effect.declared}
    estimates: dict[str, Estimate] = {}
    starts: dict[str, Estimate] = {}
    for name, e in diagnosis.estimates.items():
        group = starts if declared[name].starts else estimates
        group[name] = e
    scale = AxisScale.covering([e for name, e in estimates.items() if name not in owners])
    rows = [_parameter_row(diagnosis, name, owners.get(name), scale) for name in estimates]
    page.subheading("Parameters")
    page.table(["parameter", "value (95 %)", "nominal", scale.header], rows)
    if diagnosis.changed:
        page.parts.append(
            elements.muted_paragraph(
                "Marked are those that surely and noticeably differ from nominal."
            )
        )
    if starts:
        texts = "; ".join(_start_text(name, e, declared) for name, e in starts.items())
        page.text(Markup(f"Where the states start: {texts}."))


def _parameter_row(
    diagnosis: Diagnosis, name: str, owner: type[Effect] | None, scale: AxisScale
) -> list[str]:
    """Return the cells of a parameter: its meaning, its value, nominal, and its interval drawn.

    Parameters
    ----------
    diagnosis : Diagnosis
    name : str
    owner : type[Effect] or None
        Effect that it belongs to; None for a parameter of the model.
    scale : AxisScale
    """
    e = diagnosis.estimates[name]
    declared = diagnosis.final.problem.declared[name]
    differs = name in diagnosis.changed
    formatted = format_estimate(e, declared)
    interval = ""
    text = declared.doc
    if owner:
        title = within_sentence(effect_title(owner))
        remark = f"without {title}" if e.nominal == declared.start else ""
        text = "; ".join([text, *meanings_of(diagnosis, owner, name)])
    else:
        remark = html_elements.format_change(e)
        interval = scale.draw_interval(e, differs)
        if differs:
            remark = elements.chip("differs", remark)
    return [
        elements.named(
            capitalised(wording.parameter_title(diagnosis, name)), shown_name(name), text
        ),
        elements.two_lines(formatted.value, formatted.interval),
        elements.two_lines(formatted.nominal, remark),
        interval,
    ]


def _start_text(name: str, e: Estimate, declared: Mapping[str, Any]) -> str:
    """Return the state that a parameter is the start value of, with the run, and its estimate."""
    state = shown_name(name.replace(base_name(name), declared[name].starts, 1))
    formatted = format_estimate(e, declared[name])
    return f"{escaped(in_words(state))} {formatted.value} ({formatted.interval})"


def add_residuals(page: Page, result: Result) -> None:
    """Add what the best model leaves unexplained of every output."""
    diagnosis = result.diagnosis
    page.subheading("What is left")
    for output, analysis in diagnosis.residuals.items():
        page.text(Markup(f"<b>{escaped(capitalised(in_words(output)))}</b>"))
        page.items(_residual_findings(result, output, analysis))
        if diagnosis.estimation.even:
            _add_residual_figures(page, result, output, analysis)
        else:
            page.text("Sampling is uneven, so there is no spectrum and no autocorrelation to show.")


def _residual_findings(result: Result, output: str, analysis: ResidualAnalysis) -> list[str]:
    """Return what the tests say of a residual, a sentence each."""
    signal = result.model.outputs[output]
    texts: list[str] = [
        f"Once the colour of the noise is taken off: {analysis.whiteness.summary()}."
    ]
    for line in analysis.lines[:_LISTED]:
        size = write_prefixed(line.amplitude, signal.unit)
        texts.append(f"A line at {line.frequency:.4g} Hz with an amplitude of {size}.")
    for jump in analysis.level_shifts[:_LISTED]:
        size = write_prefixed(jump.size, signal.unit)
        texts.append(f"A jump of {size} at {jump.time:.6g} s.")
    for kind, items in (("lines", analysis.lines), ("jumps", analysis.level_shifts)):
        if len(items) > _LISTED:
            texts.append(f"{len(items) - _LISTED} more {kind}.")
    listed = [test for test in reversed(residual_tests()) if test.is_listed]
    results: list[ResidualTest | OperatingRegion] = [*analysis.tests, *analysis.regions]
    significant = [item for item in results if item.significant]
    for of in (*listed, OperatingRegion):
        of_kind = [item for item in significant if type(item) is of]
        texts += [f"{capitalised(item.describe(output))}." for item in of_kind[:_LISTED]]
    return texts


def _add_residual_figures(
    page: Page, result: Result, output: str, analysis: ResidualAnalysis
) -> None:
    """Add spectrum and autocorrelation of a residual that is sampled evenly."""
    diagnosis = result.diagnosis
    signal = result.model.outputs[output]
    unit = unit_of_differences(signal)
    models = [shown for shown in _models(diagnosis) if shown.label != NOMINAL]
    residuals = figures.shown_residuals(models, output, signal.unit, unit)
    step = float(np.median(np.diff(diagnosis.estimation.time)))
    lines = [line.frequency for line in analysis.lines[:_LISTED]]
    best = diagnosis.selection.best
    spectra = figures.plot_spectra(residuals, step, unit, lines)
    correlations = figures.plot_autocorrelations(
        residuals, best.problem.present[output], best.fit.noise[output]
    )
    page.parts.append('<div class="pair">')
    page.chart(spectra, "Spectrum of measured minus simulated, where the model was fitted.")
    page.chart(correlations, "Autocorrelation, once the colour of the noise is taken off.")
    page.parts.append("</div>")


def add_changes(page: Page, found: Sequence[Change]) -> None:
    """Add a table of what changed in a later record, with intervals."""
    page.text(changes.describe_changes(found))
    page.table(changes.CHANGE_HEAD, [_change_row(change) for change in found])
    page.parts.append(
        elements.muted_paragraph(
            "Claimed is what is surely another in the noise of both records, and about which ten"
            " stretches of each agree. Gain is the share of the squared error that letting go of"
            " this parameter alone in the later record takes off; what gains and is uncertain may"
            " stand in for an error of the model."
        )
    )


def _change_row(change: Change) -> list[str]:
    verdict = changes.change_verdict(change)
    return [
        elements.named(
            capitalised(variable_title(change.declaration)),
            change.name,
            change.effect or change.declaration.doc,
        ),
        _changed_value(change, change.before, change.before_interval),
        _changed_value(change, change.after, change.after_interval),
        changes.format_gain(change),
        elements.chip("differs", verdict) if change.changed else verdict,
    ]


def _changed_value(change: Change, value: float, interval: tuple[float, float]) -> Markup:
    declared = change.declaration
    formatted = format_estimate(Estimate(value, value, interval, declared.unit), declared)
    return elements.two_lines(formatted.value, formatted.interval)


def add_notes(page: Page, result: Result, done: bool) -> None:
    """Add notes, grouped by what to do.

    Parameters
    ----------
    page : Page
    result : Result
    done : bool
        Whether those are added about which nothing has to be done; else the others are.
    """
    titles = {label(effect): within_sentence(effect_title(effect)) for effect in result.effects}
    for action, notes in notes_by_action(result.notes).items():
        if (action is Action.NONE) is done:
            page.subheading(action)
            page.items([_note_line(note, titles) for note in notes])


def _note_line(note: Note, titles: Mapping[str, str]) -> str:
    """Return a note, which calls an effect by its title, with the identifier behind."""
    if note.subject not in titles:
        return capitalised(wording.message(note))
    said = capitalised(wording.message(replace(note, subject=titles[note.subject])))
    return Markup(f"{escaped(said)} <code>{escaped(note.subject)}</code>")


def add_least_squares(page: Page, diagnosis: Diagnosis) -> None:
    """Add the errors of plain least squares, where they are not those after the refit."""
    head, rows = least_squares_table(diagnosis)
    if not rows:
        return
    page.subheading("Where the search began")
    page.text(
        "Plain least squares brings the free run of the model without effects as near to the record"
        " as its parameters can, from several starts, whatever the noise is. From there the"
        " parameters were refitted to what is likeliest in the noise that is left, which errors of"
        " the free run alone do not show."
    )
    page.table(head, rows)


def add_data(page: Page, records: Sequence[Record]) -> None:
    """Add what was repaired in the files."""
    page.subheading("The data")
    for record in records:
        repairs = [
            f"{'repaired' if r.changed_data else 'noted'}: {r.message}" for r in record.repairs
        ]
        run = f", run {record.label}" if record.label else ""
        outcome = "as follows." if repairs else "nothing had to be repaired."
        page.text(f"{record.source.name}{run}: {outcome}")
        page.items(repairs)
