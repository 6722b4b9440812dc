"""A diagnosis as one picture: what was measured, what the model made of it before and after, and what either leaves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import units
from fmus.kit.units import unit_of_differences
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.report.figures import COLOURS, EXTENDED, REFITTED
from orchestration.discrepancy.report.wording import sentence
from orchestration.discrepancy.validation.prediction import predict
from orchestration.fmu.model import Model
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(diagnosis: Diagnosis, model: Model, path: Path | None = None) -> Figure:
    """Draw the output that gained most, over the validation data.

    Parameters
    ----------
    diagnosis : Diagnosis
    model : Model
        For units.
    path : Path, optional
        Picture to write.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    output = max(diagnosis.before, key=lambda o: diagnosis.before[o] - diagnosis.after[o])
    signal, part = model.outputs[output], slice(diagnosis.validation.first, None)
    within = diagnosis.validation.data.within[part]
    difference = unit_of_differences(signal)
    data = diagnosis.validation.data
    time, measured = data.time[part], data.measured[output][part]
    figure, (over, below) = pictures.panels(2, sentence(diagnosis))
    over.plot(
        time,
        units.convert(measured, signal.unit, signal.display),
        color=pictures.MEASURED,
        lw=3,
        label="measured",
    )
    runs = [(REFITTED, diagnosis.selection.base, diagnosis.before)]
    runs += (
        [(EXTENDED, diagnosis.selection.best, diagnosis.after)] if diagnosis.selection.steps else []
    )
    for name, fitted, errors in runs:
        simulated = predict(diagnosis.validation, fitted).simulated[output][part]
        simulated = np.where(within, simulated, np.nan)  # nothing between one record and the next
        label = f"{name}: {100.0 * errors[output]:.1f} % error"
        over.plot(
            time,
            units.convert(simulated, signal.unit, signal.display),
            color=COLOURS[name],
            lw=1.2,
            label=label,
        )
        residual = units.convert(measured - simulated, signal.unit, difference)
        below.plot(time, residual, color=COLOURS[name], lw=1)
    over.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1
    )
    pictures.label(over, output, signal.display)
    pictures.label(below, "residual", difference)
    over.margins(x=0.0)
    if path is not None:
        pictures.save(figure, path)
    return figure
