"""Picture of a comparison with a reference: each signal in its tube, and around its worst place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.experiment.regression.comparison import Deviation, Regression
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_SIGNALS = 8  # more are too small to read
_AROUND = 5  # samples on either side of the worst place, at least


def shown(regression: Regression) -> list[Deviation]:
    """Return the deviations that the picture shows, those that are refused first."""
    comparable = [one for one in regression.deviations if not one.fault]
    return sorted(comparable, key=lambda one: not one.message)[:_MOST_SIGNALS]


@draw.register(Regression)
def draw_regression(regression: Regression) -> Figure:
    """Draw signals with their tubes: the whole on the left, the worst place on the right.

    Raises
    ------
    UserError
        If no signal could be compared.
    """
    deviations = shown(regression)
    if not deviations:
        raise UserError(f"{regression.result}: no signal was compared, so there is no picture")
    rows = [(one.signal, f"{one.signal} at its worst") for one in deviations]
    figure, panels = pictures.mosaic(rows, f"{regression.result} and {regression.reference}")
    for one, (whole, near) in zip(deviations, rows, strict=True):
        _draw_signal(panels[whole], one, slice(None))
        around = max(_AROUND, one.time.size // 25)
        _draw_signal(panels[near], one, slice(max(0, one.worst - around), one.worst + around + 1))
        pictures.label(panels[whole], one.signal, one.unit)
    panels[rows[0][0]].legend(fontsize=8)
    for name in rows[-1]:
        panels[name].set_xlabel("time [s]")
    return figure


def _draw_signal(panel: Axes, one: Deviation, samples: slice) -> None:
    """Draw samples of a signal, the reference in its tube, and the worst place if it is outside."""
    time = one.time[samples]
    tube = (one.lower[samples], one.upper[samples])
    panel.fill_between(time, *tube, color=pictures.MEASURED, alpha=0.4, label="allowed")
    panel.plot(time, one.reference[samples], color=pictures.MEASURED, label="reference")
    panel.plot(time, one.values[samples], color=pictures.MODEL, label="result")
    if one.outside:
        place = one.time[one.worst], one.values[one.worst]
        panel.plot(*place, "o", color=pictures.FITTED, fillstyle="none")
