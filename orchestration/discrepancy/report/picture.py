"""A diagnosis as one picture: what was measured, what the model made of it before and after, and what either leaves."""

from __future__ import annotations

from pathlib import Path

from fmus.kit import units
from fmus.kit.units import unit_of_differences
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.report.figures import COLOURS, EXTENDED, REFITTED
from orchestration.discrepancy.report.wording import sentence
from orchestration.fmu.model import Model
from orchestration.reporting import pictures


def draw(found: Diagnosis, model: Model, path: Path) -> None:
    """Draw the output that gained most, over the data that no fit has seen.

    Parameters
    ----------
    found : Diagnosis
    model : Model
        For units.
    path : Path

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    output = max(found.before, key=lambda o: found.before[o] - found.after[o])
    signal, part = model.outputs[output], slice(found.unseen.first, None)
    difference = unit_of_differences(signal)
    data = found.unseen.data
    time, measured = data.time[part], data.measured[output][part]
    figure, (over, rest) = pictures.panels(2, sentence(found))
    over.plot(
        time, units.convert(measured, signal.unit, signal.display), color=pictures.MEASURED, lw=3, label="measured"
    )
    runs = [(REFITTED, found.selection.base, found.before)]
    runs += [(EXTENDED, found.selection.best, found.after)] if found.selection.steps else []
    for name, model_fitted, errors in runs:
        simulated = found.unseen.simulated(model_fitted)[output][part]
        label = f"{name}: {100.0 * errors[output]:.1f} % error"
        over.plot(time, units.convert(simulated, signal.unit, signal.display), color=COLOURS[name], lw=1.2, label=label)
        left = units.convert(measured - simulated, signal.unit, difference)
        rest.plot(time, left, color=COLOURS[name], lw=1)
    over.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1)
    pictures.label(over, output, signal.display)
    pictures.label(rest, "residual", difference)
    over.margins(x=0.0)
    pictures.save(figure, path)
