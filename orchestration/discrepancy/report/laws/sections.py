"""Sections on what a model's laws lack, for the page of a look at them and for that of a diagnosis."""

from __future__ import annotations

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.report import elements
from orchestration.discrepancy.report.laws import figures, wording
from orchestration.discrepancy.report.laws.asked import Asked, named, signal_of
from orchestration.discrepancy.report.laws.mathml import equation
from orchestration.reporting.page import Markup, Page, escaped

CHIPS = {"confirmed": "named", "refuted": "cause", "not confirmed": "ambiguous", "not asked": ""}


def laws(made: Page, asked: Asked) -> None:
    """What the laws lack: the curve of the best correction, the map, and all that were fitted; and so on beside it."""
    for each in asked.rounds:
        if each.best is not None:
            curve(made, each, each.best)
        if each.found is not None and len({entry.what for entry in each.found.entries}) > 1:
            law_map(made, each)
        if each.best is not None:
            corrections(made, each)


def curve(made: Page, asked: Asked, best: Correction) -> None:
    """What the law lacks, large."""
    entry = best.entry
    made.heading(f"{entry.law} over {named(entry.signal)}{beside(asked)}")
    how = (
        "is added to what the model says"
        if entry.kind == "add"
        else "plus 1 is what the law is multiplied with"
    )
    like = ""
    if best.shape:
        like = (
            f" The dashed line is {wording.shape_name(best.shape)} as it was fitted, beside the straight line that is "
            "nearest, which the model's own parameters may make up."
        )
    made.parts.append(
        equation(
            entry.law,
            entry.signal.name,
            entry.kind,
            wording.formula(best),
            bool(entry.signal.memory or signal_of(best.model.effect)[1].zero),
        )
    )
    made.plot(
        figures.curve(asked, best),
        f"What {entry.law} lacks {how}, with its 95 % band. The model's own parameters are fitted beside it, and what "
        f"they can do may be in them as well as in the curve, such as a straight part.{like}",
    )


def law_map(made: Page, asked: Asked) -> None:
    """Every law over every signal."""
    made.heading(f"Which law over which signal{beside(asked)}")
    plot, left = figures.law_map(asked)
    chance = asked.found.chance if asked.found else 0.0
    most = f"would reach {chance:.3g}" if chance > 0.0 else "would explain nothing"
    by_chance = f"Where nothing is hidden, the best of all {most} in 19 records of 20."
    made.plot(
        plot,
        "How much a curve there would explain, to first order: the fall of twice the logarithm of the likelihood, less "
        f"the price of the curve. What is remembered is the best of its lags and integrals. {left}{by_chance}"
        f"{wording.smoothed(asked)}",
    )


def corrections(made: Page, asked: Asked) -> None:
    """What was fitted."""
    made.heading(f"Corrections that were fitted{beside(asked)}")
    most = max(one.gain for one in asked.corrections)
    rows = []
    for one in asked.corrections:
        said, alike = wording.said_of(one), asked.alike(one)
        factor = ", as a factor" if one.entry.kind == "multiply" else ""
        rows.append(
            [
                elements.two(
                    f"{one.entry.law} over {named(one.entry.signal)}", asked.effect(one) + factor
                ),
                elements.bar(one.gain, most),
                elements.two(wording.shape_name(one.shape), _formula(asked, one))
                if one.shape
                else "a curve",
                elements.chip(CHIPS[said], said),
                Markup(f'<span class="two">{"<br>".join(map(escaped, alike))}</span>')
                if alike
                else "",
            ]
        )
    made.table(
        ["law and signal", "fall of BIC", "looks like", "unseen data", "cannot be told from"], rows
    )
    made.parts.append(
        elements.aside(
            "Every correction is fitted in the model together with all parameters. The fall of BIC is less the price of "
            "looking at so many. Only the first one is held against unseen data."
        )
    )


def beside(asked: Asked) -> str:
    """What the model has already, for a heading."""
    return f", beside {' and '.join(asked.causes)}" if asked.causes else ""


def _formula(asked: Asked, one: Correction) -> str:
    return f"{wording.formula(one)} with {wording.amounts(asked, one)}" if one.shape else ""
