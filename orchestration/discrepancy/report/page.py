"""The page of a diagnosis: it says what is wrong, shows it, and lets others check it."""

from __future__ import annotations

from collections.abc import Sequence

from fmus.kit.arrays import Array
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import figures, sections, wording
from orchestration.identify.changes import Change
from orchestration.records.runs import base_name
from orchestration.reporting.html import Markup, Page, elements, escaped


def diagnosis_page(
    result: Result, command: str, changes: Sequence[Change] = (), later: Result | None = None
) -> Page:
    """Make the page.

    Parameters
    ----------
    result : Result
    command : str
        That made it, to be repeated.
    changes : sequence of Change
        Differences between the record and a later one.
    later : Result, optional
        Diagnosis of the later record.

    Returns
    -------
    Page
    """
    diagnosis = result.diagnosis
    answer = wording.headline(result)
    page = Page(
        elements.format_quantities(answer.first),
        _verdict(result, answer.support),
        _about(result),
    )
    models = sections.simulated_models(result)
    page.heading("What is wrong")
    sections.add_causes(page, diagnosis)
    sections.add_errors(page, result, models)
    if later is not None:
        _add_comparison(page, changes, result, later)
    sections.add_effects(page, diagnosis)
    page.heading("What to do next")
    page.items(wording.next_steps(result))
    sections.add_notes(page, result, done=False)
    _add_experiment(page, result)
    page.heading("How sure this is")
    page.parts.append(elements.muted_paragraph(_division_of_data(result)))
    sections.add_curves(page, result, models)
    sections.add_evidence(page, result)
    sections.add_parameters(page, diagnosis)
    sections.add_residuals(page, result)
    sections.add_notes(page, result, done=True)
    page.heading("How it was found")
    sections.add_least_squares(page, diagnosis)
    records = [*result.records, *result.holdouts]
    if later is not None:
        records += later.records
    sections.add_data(page, records)
    page.reproduction([record.source for record in records], command)
    return page


def _about(result: Result) -> Markup:
    """Return which model was held against which record, by their names for tools."""
    return Markup(
        f"Diagnosis of <code>{escaped(result.model.name)}</code> against"
        f" <code>{escaped(result.files)}</code>"
    )


def _verdict(result: Result, support: Sequence[str]) -> Markup:
    """Return the verdict, what supports it, and the first thing to do next."""
    verdict = result.diagnosis.verdict
    chip = elements.chip(verdict, verdict)
    first_step = escaped(wording.next_steps(result)[0])
    return Markup(
        f"{chip} {elements.format_quantities(' '.join(support))}<br><b>Next:</b> {first_step}"
    )


def _division_of_data(result: Result) -> str:
    """Return to which data the model was fitted, and on which it was judged."""
    diagnosis = result.diagnosis
    estimation = diagnosis.estimation
    validation = diagnosis.validation
    if estimation.several or validation.data.several:
        return _division_of_records(result)
    outputs = " and ".join(diagnosis.residuals)
    name = result.record.source.name
    if validation.first == 0:
        fitted = int(sections.measured_anywhere(estimation).sum())
        judged = int(sections.measured_anywhere(validation.data).sum())
        reason = "is sampled unevenly, so every third sample was held out"
        if estimation.even:
            reason = (
                "is at rest in the end, so every third of the blocks it was divided into was held"
                " out"
            )
        return f"{outputs}: {name} {reason}: fitted to {fitted}, judged on {judged}."
    judged_time = validation.data.time[validation.first :]
    place = "that follow" if result.holdout is None else f"of {result.holdout.source.name}"
    return (
        f"{outputs}: fitted to {_format_duration(estimation.time)} of {name}"
        f" ({len(estimation.time)} samples), judged on the {_format_duration(judged_time)} {place}"
        f" ({len(judged_time)} samples)."
    )


def _division_of_records(result: Result) -> str:
    """Return to which of several records the model was fitted, and on which it was judged."""
    diagnosis = result.diagnosis
    estimation = diagnosis.estimation
    validation = diagnosis.validation
    fitted = ", ".join(run.label or result.files for run in estimation.runs)
    judged = ", ".join(run.label or result.files for run in validation.data.runs)
    text = (
        f"{' and '.join(diagnosis.residuals)}: fitted to {fitted} of {result.files}"
        f" ({int(estimation.within.sum())} samples) with one set of parameters, judged on {judged}"
        f" ({int(validation.judged.sum())} samples). Every record starts on its own"
    )
    declared = diagnosis.final.problem.declared
    own = dict.fromkeys(
        base_name(name)
        for name in diagnosis.estimates
        if base_name(name) != name and not declared[name].starts
    )
    return f"{text}, and has {', '.join(own)} of its own." if own else f"{text}."


def _format_duration(time: Array) -> str:
    values, unit = figures.readable_time(time)
    return f"{values[-1] - values[0]:.4g} {unit}"


def _add_comparison(page: Page, changes: Sequence[Change], result: Result, later: Result) -> None:
    """Add what changed in a later record, and the diagnosis of that record by itself."""
    page.subheading(f"What changed from {result.files} to {later.files}")
    sections.add_changes(page, changes)
    chip = elements.chip(later.diagnosis.verdict, later.diagnosis.verdict)
    told = elements.format_quantities(str(wording.headline(later)))
    page.text(Markup(f"{escaped(later.files)} by itself: {chip} {told}"))
    page.items(
        [wording.message(note) for note in later.notes if note.code not in wording.IN_HEADLINE]
    )


def _add_experiment(page: Page, result: Result) -> None:
    """Add an experiment that would tell more, if one was designed."""
    if not result.experiment:
        return
    page.subheading("An experiment that would tell more")
    sentence = result.experiment.sentence
    page.text(f"{sentence} Save it as experiment.toml, and ppy run experiment.toml rehearses it.")
    page.code([result.experiment.toml(result.model.name, sentence)])
