"""The page of the ageing of an actuator."""

from __future__ import annotations

import numpy as np

from fmus.kit.units import printed
from orchestration.identify.ageing.result import HOUR, Ageing, Course
from orchestration.reporting import make_page, pictures
from orchestration.reporting.html import Markup, Page, Panel, Trace, escaped, stacked

_HEIGHT = 150  # pixels
_HOURS = "operation [h]"
_POINTS = 400  # of an expected course


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
    panels = [_panel(found, name, course) for name, course in found.courses.items()]
    page.chart(
        stacked(panels, _HOURS),
        "Estimates of each window with their 95 % intervals. The line is the expected course of"
        f" {found.of}, dashed its value at the end of the life.",
    )
    if derating is not None:
        page.heading("The derating, as it would have acted")
        limit = Trace(
            "voltage limit", derating.time / HOUR, derating.limit, pictures.FITTED, stepped=True
        )
        change = Trace("change", derating.time / HOUR, 100.0 * derating.change, pictures.MODEL)
        page.chart(
            stacked(
                [
                    Panel("impedance change [%]", _HEIGHT, [change]),
                    Panel("voltage limit [V]", _HEIGHT, [limit]),
                ],
                _HOURS,
            ),
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


def _panel(found: Ageing, name: str, course: Course) -> Panel:
    """Draw a quantity over the windows; of the one that ends the life also its forecast."""
    at = found.time / HOUR
    low, high = (np.where(np.isfinite(end), end, np.nan) for end in (course.low, course.high))
    traces = [
        Trace("95 %", at, high, pictures.MEASURED, low=low, makes_room=False),
        Trace("estimate", at, course.value, pictures.MODEL),
    ]
    if name == found.of and found.forecast is not None:
        one = found.forecast
        end = one.life if np.isfinite(one.life) else 2.0 * found.time[-1]
        over = np.linspace(found.time[0], min(end, 3.0 * found.time[-1]), _POINTS)
        limit = np.full(2, one.limit)
        traces += [
            Trace("expected course", over / HOUR, one.course(over), pictures.FITTED),
            Trace("end of the life", over[[0, -1]] / HOUR, limit, pictures.FITTED, dashed=True),
        ]
    return Panel(f"{name} [{printed(course.declared.unit)}]", _HEIGHT, traces)
