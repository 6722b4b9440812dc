"""The report of a diagnosis: one page that says what is wrong, shows it, and lets others check it."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.changes import Change
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import elements, figures, sections, typography, wording
from orchestration.discrepancy.report.changes import HEAD, page_rows
from orchestration.discrepancy.report.evidence_table import evidence
from orchestration.discrepancy.report.laws import sections as law_sections
from orchestration.discrepancy.report.laws.asked import Asked
from orchestration.discrepancy.report.laws.headline import typeset
from orchestration.records import Record
from orchestration.records.joined import base_name
from orchestration.reporting.page import Markup, Page, escaped


def page(
    result: Result, command: str, changes: Sequence[Change] = (), later: Result | None = None
) -> Page:
    """Make the page.

    Parameters
    ----------
    result : Result
    command : str
        That made it, to be repeated.
    changes : sequence of Change
        What was found in a later record.
    later : Result, optional
        Diagnosis of that one.

    Returns
    -------
    Page
    """
    diagnosis = result.diagnosis
    more = "".join(f'<span class="detail">{line}</span>' for line in typography.details(diagnosis))
    chip = elements.chip(diagnosis.verdict, diagnosis.verdict)
    verdict = Markup(f"{chip} {typeset(result)}{more}")
    made = Page(f"{result.model.name} against {result.files}", verdict, elements.STYLE)
    models, simulated = sections.shown_models(result)
    _summary(made, result)
    if later is not None:
        _comparison(made, changes, result, later)
    sections.gain(made, result, models, simulated)
    sections.curves(made, result, models, simulated)
    law_sections.laws(made, Asked(result, result.laws))
    evidence(made, result)
    sections.parameters(made, diagnosis)
    sections.residuals(made, result)
    if result.notes:
        made.heading("What could not be judged")
        made.items([wording.message(note) for note in result.notes])
    if result.experiment:
        made.heading("An experiment that would tell more")
        sentence = wording.experiment(result.experiment)
        made.text(
            f"{sentence} Save it as experiment.toml, and ppy run experiment.toml rehearses it."
        )
        made.code([result.experiment.toml(result.model.name, sentence)])
    read = [*result.records, *result.holdouts, *(later.records if later is not None else [])]
    data(made, read)
    reproduce(made, read, command)
    return made


def _summary(made: Page, result: Result) -> None:
    """What was fitted to, and what was held out."""
    diagnosis = result.diagnosis
    data, validation = diagnosis.estimation, diagnosis.validation
    if data.several or validation.data.several:
        made.parts.append(elements.aside(_runs(result)))
        return
    if validation.first == 0:
        fitted, judged = (int(sections.anywhere(part).sum()) for part in (data, validation.data))
        why = "is at rest in the end, so every third of the blocks it was divided into was held out"
        if not data.even:
            why = "is sampled unevenly, so every third sample was held out"
        made.parts.append(
            elements.aside(
                f"{' and '.join(diagnosis.residuals)}: {result.record.source.name} {why}: fitted to {fitted}, "
                f"judged on {judged}."
            )
        )
        return
    last = validation.data.time[validation.first :]
    where = "that follow" if result.holdout is None else f"of {result.holdout.source.name}"
    made.parts.append(
        elements.aside(
            f"{' and '.join(diagnosis.residuals)}: fitted to {_length(data.time)} of {result.record.source.name} "
            f"({len(data.time)} samples), judged on the {_length(last)} {where} ({len(last)} samples)."
        )
    )


def _runs(result: Result) -> str:
    """What of several records was fitted to, and what was held out."""
    diagnosis = result.diagnosis
    fitted, judged = diagnosis.estimation, diagnosis.validation.data
    names = [", ".join(run.label or result.files for run in data.runs) for data in (fitted, judged)]
    counts = int(fitted.within.sum()), int(diagnosis.validation.judged.sum())
    text = (
        f"{' and '.join(diagnosis.residuals)}: fitted to {names[0]} of {result.files} ({counts[0]} samples) with one "
        f"set of parameters, judged on {names[1]} ({counts[1]} samples). Every record starts on its own"
    )
    declared = diagnosis.final.problem.declared
    own = dict.fromkeys(
        base_name(n) for n in diagnosis.estimates if base_name(n) != n and not declared[n].starts
    )
    return f"{text}, and has {', '.join(own)} of its own." if own else f"{text}."


def _comparison(made: Page, changes: Sequence[Change], result: Result, later: Result) -> None:
    """What changed in a later record."""
    made.heading(f"What changed from {result.files} to {later.files}")
    made.text(wording.comparison(changes))
    made.table(HEAD, page_rows(changes))
    made.parts.append(
        elements.aside(
            "Claimed is what is surely another in the noise of both records, and about which ten stretches of each agree. "
            "Gain is the share of the squared error that letting go of this parameter alone in the later record takes off; "
            "what gains and is uncertain may stand in for an error of the model."
        )
    )
    chip = elements.chip(later.diagnosis.verdict, later.diagnosis.verdict)
    made.text(Markup(f"{escaped(later.files)} by itself: {chip} {typeset(later)}"))
    made.items(
        [wording.message(note) for note in later.notes if note.code not in wording.IN_HEADLINE]
    )


def data(made: Page, records: Sequence[Record]) -> None:
    """What was repaired in the files."""
    made.heading("The data")
    for record in records:
        repairs = [
            f"{'repaired' if r.changed_data else 'noted'}: {r.message}" for r in record.repairs
        ]
        run = f", run {record.label}" if record.label else ""
        made.text(
            f"{record.source.name}{run}: {'as follows.' if repairs else 'nothing had to be repaired.'}"
        )
        made.items(repairs)


def reproduce(made: Page, records: Sequence[Record], command: str) -> None:
    """The command, and what it was given."""
    made.heading("How to reproduce")
    made.code([command])
    which = {"ppy-rig": version("ppy-rig"), "Python": platform.python_version()}
    which |= {f"SHA-256 of {record.source.name}": _digest(record.source) for record in records}
    made.items(
        [Markup(f"{escaped(name)}: <code>{escaped(text)}</code>") for name, text in which.items()]
    )
    made.text("Nothing is drawn at random: the same files give the same page.")


def _length(time: NDArray[np.float64]) -> str:
    values, unit = figures.readable(time)
    return f"{values[-1] - values[0]:.4g} {unit}"


def _digest(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "cannot be read again"
