"""The report on a model's laws: one page that says what they lack, shows the curve, and lets others check it."""

from __future__ import annotations

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.report import elements, typography
from orchestration.discrepancy.report.figures import COLOURS, EXTENDED, REFITTED
from orchestration.discrepancy.report.laws import figures, wording
from orchestration.discrepancy.report.laws.asked import Asked, named, shape_estimates, verdict
from orchestration.discrepancy.report.page import data, reproduce
from orchestration.discrepancy.report.wording import message
from orchestration.discrepancy.validation.estimates import estimates
from orchestration.identify.estimate import Estimate
from orchestration.reporting.page import Markup, Page, escaped

_CHIPS = {"confirmed": "named", "refuted": "cause", "not confirmed": "ambiguous", "not asked": ""}


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
    chip = elements.chip(_CHIPS.get(said, "consistent"), said if best else "nothing found")
    text = Markup(f"{chip} {typography.pretty(wording.sentence(asked))}")
    made = Page(f"The laws of {result.model.name} against {result.files}", text, elements.STYLE)
    if best is not None:
        _curve(made, asked, best)
    if asked.found is not None and asked.found.entries:
        _map(made, asked)
    if best is not None:
        _corrections(made, asked)
        if best.errors[0]:
            _errors(made, best)
        _parameters(made, asked, best)
    made.heading("What to do next")
    made.items(wording.next_steps(asked))
    if result.notes:
        made.heading("What could not be judged")
        made.items([message(note) for note in result.notes])
    read = [*result.records, *result.holdouts]
    data(made, read)
    reproduce(made, read, command)
    return made


def _curve(made: Page, asked: Asked, best: Correction) -> None:
    """What the law lacks, large."""
    entry = best.entry
    made.heading(f"{entry.law} over {named(entry.signal)}")
    how = "is added to what the model says" if entry.kind == "add" else "plus 1 is what the law is multiplied with"
    like = ""
    if best.shape:
        like = (
            f" The dashed line is {wording.shape_name(best.shape)} as it was fitted, beside the straight line that is "
            "nearest, which the model's own parameters may make up."
        )
    made.plot(
        figures.curve(asked, best),
        f"What {entry.law} lacks {how}, with its 95 % band. The model's own parameters are fitted beside it, and what "
        f"they can do may be in them as well as in the curve, such as a straight part.{like}",
    )


def _map(made: Page, asked: Asked) -> None:
    """Every law over every signal."""
    made.heading("Which law over which signal")
    plot, left = figures.law_map(asked)
    chance = asked.found.chance if asked.found else 0.0
    most = f"would reach {chance:.3g}" if chance > 0.0 else "would explain nothing"
    by_chance = f"Where nothing is hidden, the best of all {most} in 19 records of 20."
    made.plot(
        plot,
        "How much a curve there would explain, to first order: the fall of twice the logarithm of the likelihood, less "
        f"the price of the curve. What is remembered is the best of its lags and integrals. {left}{by_chance}",
    )


def _corrections(made: Page, asked: Asked) -> None:
    """What was fitted."""
    made.heading("Corrections that were fitted")
    most = max(one.gain for one in asked.corrections)
    rows = []
    for one in asked.corrections:
        said, alike = wording.said_of(one), asked.alike(one)
        factor = "as a factor" if one.entry.kind == "multiply" else ""
        rows.append([
            elements.two(f"{one.entry.law} over {named(one.entry.signal)}", factor),
            elements.bar(one.gain, most),
            elements.two(wording.shape_name(one.shape), _formula(asked, one)) if one.shape else "a curve",
            elements.chip(_CHIPS[said], said),
            Markup(f'<span class="two">{"<br>".join(map(escaped, alike))}</span>') if alike else "",
        ])  # fmt: skip
    made.table(["law and signal", "fall of BIC", "looks like", "unseen data", "cannot be told from"], rows)
    made.parts.append(elements.aside(
        "Every correction is fitted in the model together with all parameters. The fall of BIC is less the price of "
        "looking at so many. Only the first one is held against unseen data."
    ))  # fmt: skip


def _formula(asked: Asked, one: Correction) -> str:
    return f"{wording.formula(one.shape)} with {wording.amounts(asked, one)}" if one.shape else ""


def _errors(made: Page, best: Correction) -> None:
    """How far off the model is without and with it."""
    made.heading("Error on data that no fit has seen")
    before, after = best.errors
    for output in before:
        sizes = (("without", COLOURS[REFITTED], before[output]), ("with it", COLOURS[EXTENDED], after[output]))
        made.parts.append(
            elements.bars(output, [(name, colour, size, wording.percent(size)) for name, colour, size in sizes])
        )
    made.parts.append(elements.aside(
        "Root mean square of measured minus simulated, in percent of that of the measurement about its mean; all "
        "parameters are fitted without it, and once more with it."
    ))  # fmt: skip


def _parameters(made: Page, asked: Asked, best: Correction) -> None:
    """Values beside each other: without the correction, and with it."""
    made.heading("Parameters")
    own, declared = shape_estimates(best), best.model.problem.declared
    base, rows = asked.result.diagnosis.selection.best.fit.values, []
    for name, e in {**own, **estimates(best.model)}.items():
        unit = wording.unit_text(asked, best, e) if name in own else e.unit
        without = _value(base[name], unit) if name in base else ""
        rows.append([elements.two(name, declared[name].doc), _value(e.value, unit), _interval(e), without])
    made.table(["parameter", "with the correction", "95 % interval", "without"], rows)
    if not verdict(best):
        made.parts.append(elements.aside("Unseen data do not confirm the correction: go on with those without it."))


def _value(value: float, unit: str) -> Markup:
    return typography.pretty(f"{value:.4g}" + ("" if unit == "1" else f" {unit}"))


def _interval(e: Estimate) -> Markup:
    return typography.pretty(" … ".join(f"{end:.4g}" for end in e.interval))
