"""The picture of a diagnosis: the output whose error falls most, with its residuals."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

from fmus.kit.titles import capitalised
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.report import curves, wording
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDE = 92  # characters of a line of the title


@draw.register(Diagnosis)
def draw_diagnosis(diagnosis: Diagnosis) -> Figure:
    """Draw what was left out of the output whose error falls most, above the residuals."""
    before = diagnosis.errors(diagnosis.found.base)
    after = diagnosis.errors(diagnosis.final)

    def fall(course: curves.OutputCourse) -> float:
        return (before[course.output] or 0.0) - (after[course.output] or 0.0)

    course = max(curves.output_courses(diagnosis), key=fall)
    unseen = course.time >= course.unseen_from
    time, measured = course.time[unseen], course.measured[unseen]
    title = fill(capitalised(wording.headline(diagnosis)), _WIDE)
    figure, (above, below) = pictures.panels(2, title)
    above.plot(time, measured, color=pictures.MEASURED, lw=3, label="measured")
    for one in curves.simulations(diagnosis, course):
        error = "" if one.error is None else f": {wording.error_text(one.error)} error"
        values = one.values[unseen]
        above.plot(time, values, color=one.colour, lw=1.2, label=f"{one.label}{error}")
        below.plot(time, measured - values, color=one.colour, lw=1.0)
    pictures.label(above, course.output, course.unit)
    pictures.label(below, "residual", course.unit)
    above.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1
    )
    above.margins(x=0.0)
    return figure
