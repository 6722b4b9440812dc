"""The report on a model's laws: one page that says what they lack, shows the curve, and lets others check it."""

from __future__ import annotations

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.report import elements, typography
from orchestration.discrepancy.report.figures import COLOURS, EXTENDED, REFITTED
from orchestration.discrepancy.report.laws import sections, wording
from orchestration.discrepancy.report.laws.asked import Asked, shape_estimates, verdict
from orchestration.discrepancy.report.page import data, reproduce
from orchestration.discrepancy.report.wording import message
from orchestration.discrepancy.validation.estimates import estimates
from orchestration.identify.estimate import Estimate
from orchestration.reporting.page import Markup, Page


def page(asked: Asked, command: str) -> Page:
    """Make the page.

    Parameters
    ----------
    asked : Asked
    command : str
        That made it, to be repeated.

    Returns
    -------
    Page
    """
    result, best = asked.result, asked.best
    said = wording.said_of(best) if best else "consistent"
    chip = elements.chip(sections.CHIPS.get(said, "consistent"), said if best else "nothing found")
    text = Markup(f"{chip} {typography.pretty(wording.sentence(asked))}")
    made = Page(f"The laws of {result.model.name} against {result.files}", text, elements.STYLE)
    sections.laws(made, asked)
    for each in asked.rounds:
        if each.best is not None:
            if each.best.errors[0]:
                _errors(made, each, each.best)
            _parameters(made, each, each.best)
    made.heading("What to do next")
    made.items(wording.next_steps(asked))
    if result.notes:
        made.heading("What could not be judged")
        made.items([message(note) for note in result.notes])
    read = [*result.records, *result.holdouts]
    data(made, read)
    reproduce(made, read, command)
    return made


def _errors(made: Page, asked: Asked, best: Correction) -> None:
    """How far off the model is without and with it."""
    made.heading(f"Error on data that no fit has seen{sections.beside(asked)}")
    before, after = best.errors
    for output in before:
        sizes = (
            ("without", COLOURS[REFITTED], before[output]),
            ("with it", COLOURS[EXTENDED], after[output]),
        )
        made.parts.append(
            elements.bars(
                output,
                [(name, colour, size, wording.percent(size)) for name, colour, size in sizes],
            )
        )
    made.parts.append(
        elements.aside(
            "Root mean square of measured minus simulated, in percent of that of the measurement about its mean; all "
            "parameters are fitted without it, and once more with it."
        )
    )


def _parameters(made: Page, asked: Asked, best: Correction) -> None:
    """Values beside each other: without the correction, and with it."""
    made.heading(f"Parameters{sections.beside(asked)}")
    own, declared = shape_estimates(best), best.model.problem.declared
    base, rows = asked.base.fit.values, []
    for name, e in {**own, **estimates(best.model)}.items():
        unit = wording.unit_text(asked, best, e) if name in own else e.unit
        without = _value(base[name], unit) if name in base else ""
        rows.append(
            [elements.two(name, declared[name].doc), _value(e.value, unit), _interval(e), without]
        )
    made.table(["parameter", "with the correction", "95 % interval", "without"], rows)
    if not verdict(best):
        made.parts.append(
            elements.aside(
                "Unseen data do not confirm the correction: go on with those without it."
            )
        )


def _value(value: float, unit: str) -> Markup:
    return typography.pretty(f"{value:.4g}" + ("" if unit == "1" else f" {unit}"))


def _interval(e: Estimate) -> Markup:
    return typography.pretty(" … ".join(f"{end:.4g}" for end in e.interval))
