"""Pictures of the ageing of an actuator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orchestration.identify.ageing.result import HOUR, Ageing, Derating
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HOURS = "operation [h]"


@draw.register(Ageing)
def draw_ageing(found: Ageing) -> Figure:
    """Draw every quantity over the windows with its interval, and the forecast to its end.

    A life that may never end is drawn over twice the records.
    """
    title = f"ageing of {found.model}"
    figure, axes = pictures.panels(len(found.courses), title, _HOURS, shared=False)
    for axis, (name, course) in zip(axes, found.courses.items(), strict=True):
        spread = np.abs([course.low, course.high] - course.value)
        spread[~np.isfinite(spread)] = 0.0
        axis.errorbar(found.time / HOUR, course.value, spread, fmt=".", color=pictures.MODEL)
        pictures.label(axis, name, course.declared.unit)
        if name == found.of and found.forecast is not None:
            life = found.forecast.life
            end = life if np.isfinite(life) else 2.0 * found.time[-1]
            over = np.linspace(found.time[0], end, 400)
            expected = found.forecast.course(over)
            axis.plot(over / HOUR, expected, color=pictures.FITTED, label="expected course")
            axis.axhline(found.forecast.limit, ls="--", color=pictures.FITTED, label="end of life")
            axis.legend()
    return figure


def draw_derating(found: Derating) -> Figure:
    """Draw the change of the impedance, and the voltage limit that follows it."""
    figure, (change, limit) = pictures.panels(2, "derating", _HOURS)
    change.plot(found.time / HOUR, 100.0 * found.change, color=pictures.MODEL)
    limit.step(found.time / HOUR, found.limit, where="post", color=pictures.FITTED)
    pictures.label(change, "impedance change", "%")
    pictures.label(limit, "voltage limit", "V")
    return figure
