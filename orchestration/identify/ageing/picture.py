"""Picture of the ageing of an actuator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orchestration.identify.ageing.result import HOUR, Ageing
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(Ageing)
def draw_ageing(found: Ageing) -> Figure:
    """Draw every quantity over the windows with its interval, and the forecast."""
    title = f"ageing of {found.model}"
    figure, axes = pictures.panels(len(found.courses), title, "operation [h]")
    for axis, (name, course) in zip(axes, found.courses.items(), strict=True):
        below, above = course.value - course.low, course.high - course.value
        spread = np.where(np.isfinite([below, above]), [below, above], 0.0)
        axis.errorbar(found.time / HOUR, course.value, spread, fmt=".", color=pictures.MODEL)
        pictures.label(axis, name, course.declared.unit)
        if name == found.of and found.forecast is not None:
            expected = found.forecast.course(found.time)
            axis.plot(found.time / HOUR, expected, color=pictures.FITTED)
    return figure
