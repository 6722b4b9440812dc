"""The page of a protocol: a table, a chart for each check, and lines to sign."""

from __future__ import annotations

import numpy as np

from orchestration.plugins.commission.protocol import (
    FAILED,
    NOT_APPLICABLE,
    NOT_CONFIRMED,
    PASS,
    Line,
    Protocol,
)
from orchestration.reporting import make_page
from orchestration.reporting.html import Markup, Page, Panel, Trace, elements, escaped, stacked

# colours of chips
_CHIPS = {PASS: "consistent", FAILED: "wrong", NOT_CONFIRMED: "ambiguous", NOT_APPLICABLE: ""}
# attribute of a row, its colour and the width of its line
COURSES = (
    ("commanded", "#b98a2f", 5.0),
    ("applied", "#0b6aa2", 3.0),
    ("read_back", "#155c2e", 1.2),
)
_HEIGHT = 90  # of a panel, pixels
_SIGNATURE = "_" * 24


@make_page.register(Protocol)
def protocol_page(protocol: Protocol, command: str = "") -> Page:
    """Make the page of a protocol."""
    page = Page(
        f"Commissioning of {protocol.facts['backend']}: {protocol.conclusion}",
        f"{protocol.summary}.",
        f"{protocol.facts['date']}, ppy-rig {protocol.facts['ppy-rig']}",
    )
    page.table(
        ("check", "verdict", "what was measured", "what was done", "what must hold"),
        [
            (
                line.title,
                elements.chip(_CHIPS[line.verdict], line.verdict),
                _wrapped(line.finding.measured),
                _wrapped(line.action),
                _wrapped(line.requirement),
            )
            for line in protocol.lines
        ],
    )
    page.heading("Signature")
    page.text("The wiring, the emergency stop and what is not confirmed above were seen by")
    page.items([f"{field}: {_SIGNATURE}" for field in ("Name", "Date", "Signature")])
    page.heading("What was served")
    page.table(("of", "is"), [(name, _wrapped(text)) for name, text in protocol.facts.items()])
    page.heading("Inputs during each check")
    for line in filter(lambda one: one.rows, protocol.lines):
        page.subheading(line.title)
        page.chart(_chart(line, protocol), f"{line.verdict}: {line.finding.measured}")
    with page.folded("Lines of the server"):
        page.code(protocol.log)
    if command:
        page.heading("Command")
        page.code([command])
    return page


def _wrapped(text: str) -> Markup:
    """Return a text that may take several lines of a cell."""
    return Markup(f'<span class="two">{escaped(text)}</span>')


def _chart(line: Line, protocol: Protocol) -> Markup:
    """Return a chart with a panel for each input."""
    begun = line.rows[0].time
    panels = [
        Panel(f"{name} ({unit})", _HEIGHT, traces_of(line, name))
        for name, unit in protocol.units.items()
    ]
    marks = [(time - begun, text) for time, text in line.finding.marks]
    return stacked(panels, "time (s)", marks=marks)


def traces_of(line: Line, name: str) -> list[Trace]:
    """Return what was commanded, applied and read back of an input, over the time of a check.

    Parameters
    ----------
    line : Line
        With rows.
    name : str

    Returns
    -------
    list of Trace
    """
    times = np.array([row.time for row in line.rows]) - line.rows[0].time
    traces = []
    for course, colour, width in COURSES:
        values = [getattr(row, course).get(name) for row in line.rows]
        label = course.replace("_", " ")
        traces.append(Trace(label, times, np.array(values, float), colour, width, stepped=True))
    return traces
