"""Picture of a comparison with a reference: each signal in its tube, and around its worst place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import UserError
from orchestration.experiment.regression.comparison import Deviation, Regression
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_SIGNALS = 8  # more are too small to read
_NEIGHBOURHOOD = 0.04  # of the duration, on either side of the worst place


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
    for deviation, (whole, near) in zip(deviations, rows, strict=True):
        for panel in (panels[whole], panels[near]):
            _draw_signal(panel, deviation)
        pictures.label(panels[whole], deviation.signal, deviation.unit)
        _approach(panels[near], deviation)
    panels[rows[0][0]].legend(fontsize=8)
    for name in rows[-1]:
        panels[name].set_xlabel("time [s]")
    return figure


def _draw_signal(panel: Axes, deviation: Deviation) -> None:
    """Draw a signal, the reference with the tube, and the worst place if it is outside."""
    time = deviation.time
    panel.fill_between(
        time, deviation.lower, deviation.upper, color=pictures.MEASURED, alpha=0.4, label="allowed"
    )
    panel.plot(time, deviation.reference, color=pictures.MEASURED, label="reference")
    panel.plot(time, deviation.values, color=pictures.MODEL, label="result")
    if deviation.is_outside:
        k = deviation.worst
        panel.plot(time[k], deviation.values[k], "o", color=pictures.FITTED, fillstyle="none")


def _approach(panel: Axes, deviation: Deviation) -> None:
    """Limit a panel to the neighbourhood of the worst place."""
    time = deviation.time
    place = time[deviation.worst]
    half = max(_NEIGHBOURHOOD * np.ptp(time), np.finfo(float).eps * max(1.0, abs(place)))
    panel.set_xlim(place - half, place + half)
    near = np.abs(time - place) <= half
    drawn = np.concatenate(
        [curve[near] for curve in (deviation.values, deviation.lower, deviation.upper)]
    )
    drawn = drawn[np.isfinite(drawn)]
    if drawn.size and np.ptp(drawn) > 0.0:
        margin = 0.1 * np.ptp(drawn)
        panel.set_ylim(drawn.min() - margin, drawn.max() + margin)
