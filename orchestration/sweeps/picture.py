"""Picture of a sweep or its analysis, chosen by the dimensions of the dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kit import UserError, quoting
from orchestration.reporting import draw
from orchestration.sweeps.curves import draw_curves
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.sensitivity import indices, one_at_a_time, prediction_bands

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(SweepResult)
def draw_sweep(data: SweepResult) -> Figure:
    """Draw a sweep as numbers over parameters, or its analysis as indices, tornado or bands.

    Raises
    ------
    UserError
        If there is nothing to draw, or the dataset is only a part of a sweep.
    """
    dimensions = {str(name) for name in data.dims}
    parameters = {*quoting.words(str(data.attrs.get("over", "")))}
    if {"parameter", "index"} <= dimensions:
        return indices.draw(data)
    if {"parameter", "end"} <= dimensions:
        return one_at_a_time.draw(data)
    if "quantile" in dimensions:
        return prediction_bands.draw(data)
    if parameters and ("case" in dimensions or parameters <= dimensions):
        return draw_curves(data)
    raise UserError("a part of a sweep has no picture; draw the whole sweep")
