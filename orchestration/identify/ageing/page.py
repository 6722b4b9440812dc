"""The page of the ageing of an actuator."""

from __future__ import annotations

from orchestration.identify.ageing.picture import draw_derating
from orchestration.identify.ageing.result import HOUR, Ageing
from orchestration.reporting import draw, make_page
from orchestration.reporting.html import Markup, Page, escaped


@make_page.register(Ageing)
def ageing_page(found: Ageing, command: str = "") -> Page:
    """Make the page.

    Parameters
    ----------
    found : Ageing
    command : str
        That made it.
    """
    derating = found.derating
    summary = "" if derating is None else derating.summary()
    about = f"Ageing of <code>{escaped(found.model)}</code>"
    page = Page(found.headline(), summary, Markup(about))
    page.heading("Its circuit, window by window")
    page.figure(
        draw(found),
        "Estimates of each window with their 95 % intervals. The line is the expected course of"
        f" {found.of}, dashed its value at the end of the life.",
    )
    if derating is not None:
        page.heading("The derating, as it would have acted")
        page.figure(
            draw_derating(derating),
            "The degradation estimator over the same records, and the limit that it would have"
            " set.",
        )
    page.items([*found.notes])
    with page.folded("All windows"):
        rows = [
            [
                label,
                f"{at / HOUR:.4g}",
                *(" (".join(course.at(k)) + ")" for course in found.courses.values()),
            ]
            for k, (label, at) in enumerate(zip(found.labels, found.time, strict=True))
        ]
        page.table(["record", "hours", *found.courses], rows)
    page.reproduction([*found.sources], command)
    return page
