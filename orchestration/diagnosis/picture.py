"""The picture of a diagnosis: every measured output with its residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.report import curves
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(Diagnosis)
def draw_diagnosis(diagnosis: Diagnosis) -> Figure:
    """Draw every measured output, with the model without and with terms, above the residuals."""
    courses = curves.output_courses(diagnosis)
    figure, axes = pictures.panels(2 * len(courses), f"{diagnosis.model.name}: {diagnosis.verdict}")
    for k, course in enumerate(courses):
        over, below = axes[2 * k], axes[2 * k + 1]
        over.plot(course.time, course.measured, color=pictures.MEASURED, lw=3, label="measured")
        for name, values, colour in curves.simulations(diagnosis, course):
            over.plot(course.time, values, color=colour, label=name)
            below.plot(course.time, course.measured - values, color=colour)
        pictures.label(over, course.output, course.unit)
        pictures.label(below, "measured - simulated", course.unit)
        over.legend(loc="upper right", ncols=3, frameon=False)
    return figure
