"""The picture of a diagnosis: the output whose error falls most, with its residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import UserError
from fmus.kit.titles import capitalised
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.report import added_to_law, curve_view, curves, wording
from orchestration.diagnosis.term_names import sentence
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(Diagnosis)
def draw_diagnosis(diagnosis: Diagnosis) -> Figure:
    """Draw what was left out of the output whose error falls most, above the residuals."""
    before = diagnosis.errors_before
    after = diagnosis.errors_after

    def fall(course: curves.OutputCourse) -> float:
        return (before[course.output] or 0.0) - (after[course.output] or 0.0)

    course = max(curves.output_courses(diagnosis), key=fall)
    unseen = course.time >= course.unseen_from
    time, measured = course.time[unseen], course.measured[unseen]
    title = capitalised(wording.headline(diagnosis))
    figure, (above, below) = pictures.panels(2, title)
    above.plot(time, measured, color=pictures.MEASURED, lw=3, label="measured")
    for one in curves.simulations(diagnosis, course):
        colour = pictures.FITTED if one.is_final else pictures.MODEL
        error = "" if one.error is None else f": {wording.error_text(one.error)} error"
        values = one.values[unseen]
        above.plot(time, values, color=colour, lw=1.2, label=f"{one.label}{error}")
        below.plot(time, measured - values, color=colour, lw=1.0)
    pictures.label(above, course.output, course.unit)
    pictures.label(below, "residual", course.unit)
    pictures.legend_above(above, 3)
    above.margins(x=0.0)
    return figure


@draw.register(LawMap)
def draw_curve(law_map: LawMap) -> Figure:
    """Draw what the leading term of the first cause adds to its law, over its signal.

    Raises
    ------
    UserError
        If no law is found to lack a function of a signal.
    """
    diagnosis = law_map.diagnosis
    curve = next(iter(curves.term_curves(diagnosis.final.fit, diagnosis.terms).values()), None)
    if curve is None:
        raise UserError("no law is found to lack anything, so there is no curve to draw")
    shown = curve_view(diagnosis, curve)
    title = capitalised(sentence(diagnosis.cls, curve.term))
    figure, (axis,) = pictures.panels(1, title, shown.signal, height=3.0)
    axis.plot(curve.signal, curve.addition, color=pictures.FITTED)
    samples = np.array(shown.samples, dtype=float)
    floor = np.full(samples.shape, curve.addition.min())
    axis.plot(samples, floor, "|", color=pictures.MEASURED, label="samples of the record")
    pictures.label(axis, *added_to_law(diagnosis, curve.term))
    axis.legend(frameon=False)
    return figure
