"""Comparison with a reference as rows of a table, and as a page."""

from __future__ import annotations

from pathlib import Path

from orchestration.experiment.regression.comparison import Deviation, Regression
from orchestration.experiment.regression.picture import shown
from orchestration.reporting import draw, make_page
from orchestration.reporting.html import Page

COLUMNS = ("signal", "worst difference", "at", "outside", "verdict")


def rows(regression: Regression) -> list[tuple[str, ...]]:
    """Return a row of texts for each signal, with the columns `COLUMNS`."""
    return [_row(one) for one in regression.deviations]


def _row(one: Deviation) -> tuple[str, ...]:
    if one.fault:
        return (one.signal, "", "", "", one.fault)
    return (
        one.signal,
        one.shown_difference,
        f"{one.time[one.worst]:.6g} s",
        f"{one.outside} of {one.compared}",
        "differs" if one.message else "as allowed",
    )


def verdict(regression: Regression) -> str:
    """Return the verdict in a sentence."""
    refused = len(regression.refused)
    count = len(regression.deviations)
    named = f"{regression.result} and {regression.reference}"
    return f"{named}: {refused or 'none'} of {count} signals differ"


@make_page.register(Regression)
def regression_page(regression: Regression, command: str = "") -> Page:
    """Make the page of a comparison: verdict, figures, and pictures of the worst places."""
    page = Page("Comparison with a reference", verdict(regression))
    page.items([f"{one.signal} {one.message}" for one in regression.refused])
    if shown(regression):
        page.figure(draw(regression), "Left the whole, right the worst place of each signal.")
    page.heading("Signals")
    page.table(COLUMNS, rows(regression))
    if regression.new:
        page.text(f"Not in the reference, and not compared: {', '.join(regression.new)}.")
    files = [Path(name) for name in (regression.result, regression.reference)]
    page.reproduction([file for file in files if file.is_file()], command)
    return page
