"""The page about the laws of a model, and its sections, which the page of a diagnosis shows too."""

from __future__ import annotations

import re

from fmus.kit.titles import capitalised, in_words, variable_title
from orchestration.discrepancy.laws import Correction, Entry
from orchestration.discrepancy.report import html_elements
from orchestration.discrepancy.report.figures import COLOURS
from orchestration.discrepancy.report.laws import figures, wording
from orchestration.discrepancy.report.laws.law_report import (
    LawReport,
    describe_signal,
    is_confirmed,
    law_and_signal,
    shape_estimates,
    shape_formula,
)
from orchestration.discrepancy.report.sections import add_data, add_notes
from orchestration.discrepancy.report.wording import EXTENDED, REFITTED, format_interval
from orchestration.discrepancy.validation import parameter_estimates
from orchestration.reporting import format_percent
from orchestration.reporting.html import Bar, Markup, Page, elements, escaped, format_quantities

_CHIPS = {"confirmed": "named", "refuted": "cause", "not confirmed": "ambiguous", "not asked": ""}


def laws_page(law_report: LawReport, command: str) -> Page:
    """Make the page.

    Parameters
    ----------
    law_report : LawReport
    command : str
        That made it, to be repeated.

    Returns
    -------
    Page
    """
    result = law_report.result
    page = Page(_title(law_report), _verdict(law_report), _about(law_report))
    page.heading("What is wrong, and the law itself")
    corrected = [(each, each.best) for each in law_report.rounds if each.best is not None]
    for each, best in corrected:
        _add_curve(page, each, best)
        if best.errors[0]:
            _add_errors(page, each, best)
    page.heading("What to do next")
    page.items(wording.next_steps(law_report))
    add_notes(page, result, done=False)
    page.heading("How sure this is")
    for each, best in corrected:
        _add_corrections(page, each)
        _add_parameters(page, each, best)
    add_notes(page, result, done=True)
    page.heading("How it was found")
    for each in law_report.rounds:
        _add_law_map(page, each)
    records = [*result.records, *result.holdouts]
    add_data(page, records)
    page.reproduction([record.source for record in records], command)
    return page


def _title(law_report: LawReport) -> str:
    """Return which law depends on what, or that none lacks anything."""
    best = law_report.best
    if best is None:
        return wording.sentence(law_report)
    signal = describe_signal(best.entry.signal)
    may = "" if is_confirmed(best) else "may "
    verb = "depend" if may else "depends"
    law = capitalised(law_report.law_title(best))
    return f"{law} {may}{verb} on {signal} beyond what the model has."


def _about(law_report: LawReport) -> Markup:
    result = law_report.result
    return Markup(
        f"The laws of <code>{escaped(result.model.name)}</code> against"
        f" <code>{escaped(result.files)}</code>"
    )


def _verdict(law_report: LawReport) -> Markup:
    if law_report.best is None:
        chip = elements.chip("consistent", "nothing found")
    else:
        outcome = wording.unseen_data_outcome(law_report.best)
        chip = elements.chip(_CHIPS[outcome], outcome)
    return Markup(f"{chip} {format_quantities(wording.sentence(law_report))}")


def add_laws(page: Page, law_report: LawReport) -> None:
    """Add curve, map and corrections, and the same again beside each correction confirmed."""
    for each in law_report.rounds:
        if each.best is not None:
            _add_curve(page, each, each.best)
        _add_law_map(page, each)
        if each.best is not None:
            _add_corrections(page, each)


def _add_curve(page: Page, law_report: LawReport, best: Correction) -> None:
    """Add the curve of the best correction, with the law that it makes."""
    entry = best.entry
    law = law_report.law_title(best)
    page.subheading(f"{capitalised(law)} over {describe_signal(entry.signal)}{_beside(law_report)}")
    is_not_signal = bool(entry.signal.memory or law_and_signal(best.model.effect)[1].zero)
    x = "x" if is_not_signal else entry.signal.name
    page.parts.append(_equation(entry, shape_formula(best), x))
    relation = "plus 1 is what the law is multiplied with"
    if entry.kind == "add":
        relation = "is added to what the model says"
    dashed = ""
    if best.shape:
        dashed = (
            f" The dashed line is {wording.shape_name(best.shape)} as it was fitted, beside the"
            " straight line that is nearest, which the model's own parameters may make up."
        )
    page.chart(
        figures.plot_curve(law_report, best),
        f"What {law} lacks {relation}, with its 95 % band. The model's own parameters are"
        " fitted beside it, and what they can do may be in them as well as in the curve, such as a"
        f" straight part.{dashed}",
    )


def _add_law_map(page: Page, law_report: LawReport) -> None:
    """Add the map of every law over every signal, where there are several."""
    if law_report.found is None or len({entry.key for entry in law_report.found.entries}) < 2:
        return
    page.subheading(f"Which law over which signal{_beside(law_report)}")
    plot, omitted = figures.plot_law_map(law_report)
    chance = law_report.found.chance
    best_by_chance = f"would reach {chance:.3g}" if chance > 0.0 else "would explain nothing"
    page.chart(
        plot,
        "How much a curve there would explain, to first order: the fall of twice the logarithm of"
        " the likelihood, less the price of the curve. What is remembered is the best of its lags"
        f" and integrals. {omitted}Where nothing is hidden, the best of all {best_by_chance} in 19"
        f" records of 20.{wording.describe_smoothing(law_report)}",
    )


def _add_corrections(page: Page, law_report: LawReport) -> None:
    """Add a table of the corrections that were fitted."""
    page.subheading(f"Corrections that were fitted{_beside(law_report)}")
    largest = max(correction.gain for correction in law_report.corrections)
    page.table(
        ["law and signal", "fall of BIC", "looks like", "unseen data", "cannot be told from"],
        [_correction_row(law_report, each, largest) for each in law_report.corrections],
    )
    page.parts.append(
        elements.muted_paragraph(
            "Every correction is fitted in the model together with all parameters. The fall of BIC"
            " is less the price of looking at so many. Only the first one is held against unseen"
            " data."
        )
    )


def _equation(entry: Entry, formula: str, x: str) -> Markup:
    """Return a law as the model's own with a function of x, a curve where there is no formula."""
    function = re.sub(r"\bx\b", lambda _: x, formula) or f"f({x})"
    operation = f"+ {function}" if entry.kind == "add" else f"(1 + {function})"
    law = escaped(entry.law)
    return Markup(f'<p class="equation">{law} = {law}<sub>model</sub> {escaped(operation)}</p>')


def _correction_row(law_report: LawReport, correction: Correction, largest: float) -> list[str]:
    """Return the cells of a correction; its gain is drawn relative to the largest."""
    entry = correction.entry
    factor = ", as a factor" if entry.kind == "multiply" else ""
    shape = "a curve"
    if correction.shape:
        amounts = wording.describe_shape_parameters(law_report, correction)
        formula = f"{shape_formula(correction)} with {amounts}"
        shape = elements.two_lines(wording.shape_name(correction.shape), formula)
    outcome = wording.unseen_data_outcome(correction)
    indistinguishable = law_report.indistinguishable(correction)
    others = "<br>".join(map(escaped, indistinguishable))
    return [
        elements.named(
            f"{capitalised(law_report.law_title(correction))} over {describe_signal(entry.signal)}"
            f"{factor}",
            law_report.effect_name(correction),
            "",
        ),
        html_elements.number_above_bar(correction.gain, largest),
        shape,
        elements.chip(_CHIPS[outcome], outcome),
        Markup(f'<span class="two">{others}</span>') if indistinguishable else "",
    ]


def _add_errors(page: Page, law_report: LawReport, best: Correction) -> None:
    """Add how far off the model is without the correction and with it."""
    page.subheading(f"Error on data that no fit has seen{_beside(law_report)}")
    before, after = best.errors
    for output in before:
        bars = [
            Bar("without", COLOURS[REFITTED], before[output], format_percent(before[output])),
            Bar("with it", COLOURS[EXTENDED], after[output], format_percent(after[output])),
        ]
        page.parts.append(elements.bar_chart(capitalised(in_words(output)), bars))
    page.parts.append(
        elements.muted_paragraph(
            "Root mean square of measured minus simulated, in percent of that of the measurement"
            " about its mean; all parameters are fitted without it, and once more with it."
        )
    )


def _add_parameters(page: Page, law_report: LawReport, best: Correction) -> None:
    """Add the parameters with the correction and without it."""
    page.subheading(f"Parameters{_beside(law_report)}")
    own = shape_estimates(best)
    declared = best.model.problem.declared
    base_values = law_report.base_model.fit.values
    rows = []
    for name, e in {**own, **parameter_estimates(best.model)}.items():
        unit = wording.parameter_unit(law_report, best, e) if name in own else e.unit
        interval = format_interval(e.interval, "{:.4g}".format)
        rows.append(
            [
                elements.named(
                    capitalised(variable_title(declared[name])), name, declared[name].doc
                ),
                _format_value(e.value, unit),
                format_quantities(interval),
                _format_value(base_values[name], unit) if name in base_values else "",
            ]
        )
    page.table(["parameter", "with the correction", "95 % interval", "without"], rows)
    if not is_confirmed(best):
        page.parts.append(
            elements.muted_paragraph(
                "Unseen data do not confirm the correction: go on with those without it."
            )
        )


def _format_value(value: float, unit: str) -> Markup:
    return format_quantities(f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}")


def _beside(law_report: LawReport) -> str:
    """Return what the model has already, for a heading."""
    return f", beside {' and '.join(law_report.cause_titles)}" if law_report.causes else ""
