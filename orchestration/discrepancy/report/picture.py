"""A diagnosis as one static picture: measurement, simulations before and after, and residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import units
from fmus.kit.units import unit_of_differences
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.report.figures import COLOURS, in_display_unit
from orchestration.discrepancy.report.wording import EXTENDED, REFITTED, answer
from orchestration.discrepancy.validation import simulated_outputs
from orchestration.fmu import Model
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_diagnosis(diagnosis: Diagnosis, model: Model) -> Figure:
    """Draw the output that gained most, over the validation data.

    Parameters
    ----------
    diagnosis : Diagnosis
    model : Model
        For units.

    Returns
    -------
    matplotlib.figure.Figure
    """
    output = max(diagnosis.before, key=lambda o: diagnosis.before[o] - diagnosis.after[o])
    signal = model.outputs[output]
    difference = unit_of_differences(signal)
    validation = diagnosis.validation
    part = slice(validation.first, None)
    time = validation.data.time[part]
    measured = validation.data.measured[output][part]
    figure, (above, below) = pictures.panels(2, answer(diagnosis).first)
    above.plot(
        time, in_display_unit(measured, signal), color=pictures.MEASURED, lw=3, label="measured"
    )
    for name, fitted, errors in _models(diagnosis):
        simulated = simulated_outputs(validation, fitted)[output][part]
        within_runs = np.where(validation.data.within[part], simulated, np.nan)
        label = f"{name}: {100.0 * errors[output]:.1f} % error"
        above.plot(
            time, in_display_unit(within_runs, signal), color=COLOURS[name], lw=1.2, label=label
        )
        residual = units.convert(measured - within_runs, signal.unit, difference)
        below.plot(time, residual, color=COLOURS[name], lw=1)
    above.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1
    )
    pictures.label(above, output, signal.display)
    pictures.label(below, "residual", difference)
    above.margins(x=0.0)
    return figure


def _models(diagnosis: Diagnosis) -> list[tuple[str, FittedCandidate, dict[str, float]]]:
    """Return label, model and errors by output of the models that are drawn."""
    selection = diagnosis.selection
    refitted = (REFITTED, selection.base, diagnosis.before)
    if not selection.steps:
        return [refitted]
    return [refitted, (EXTENDED, selection.best, diagnosis.after)]
