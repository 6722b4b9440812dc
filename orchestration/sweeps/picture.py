"""Picture of a sweep, or of its analysis: the one that its dimensions call for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.reporting import draw
from orchestration.sweeps.curves import draw_curves
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.sensitivity import indices, one_at_a_time, prediction_bands

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(SweepResult)
def draw_sweep(data: SweepResult) -> Figure:
    """Draw numbers over parameters; indices, a tornado or bands of what was analysed.

    Raises
    ------
    UserError
        If there is nothing to draw, or it is a part of a sweep only.
    """
    dimensions = {str(name) for name in data.dims}
    swept = {*str(data.attrs.get("over", "")).split()}
    if {"parameter", "index"} <= dimensions:
        return indices.draw(data)
    if {"parameter", "end"} <= dimensions:
        return one_at_a_time.draw(data)
    if "quantile" in dimensions:
        return prediction_bands.draw(data)
    if swept and ("case" in dimensions or swept <= dimensions):
        return draw_curves(data)
    raise UserError("this is a part of a sweep, of which there is no picture; draw the whole")
