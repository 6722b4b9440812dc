"""Picture of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.master.result import Run
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_PANELS = 16  # more in one picture are not looked at


@draw.register(Run)
def draw_run(run: Run) -> Figure:
    """Draw the signals over time, one panel each; of many only the first.

    Raises
    ------
    UserError
        If the run has no points or no signals.
    """
    if not (run.time.size and run.signals):
        raise UserError("the run has no points or no signals, so there is nothing to draw")
    shown = list(run.signals.items())[:_MOST_PANELS]
    figure, axes = pictures.panels(len(shown), run.extent)
    for axis, (name, values) in zip(axes, shown, strict=True):
        axis.plot(run.time, values, color=pictures.MODEL)
        pictures.fit_values(axis)
        pictures.label(axis, name, run.units[name])
    return figure
