"""The result of a sweep, or of its analysis: a dataset with a picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import xarray

from fmus.kit import UserError
from orchestration.reporting import ResultDataset

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class SweepResult(ResultDataset):
    """The cases of a sweep, or what an analysis makes of them; a dataset of xarray.

    A notebook shows its picture beside its variables; ``plot()`` draws it, and
    ``plot("file.png")`` writes it as well.
    """

    __slots__ = ()

    def draw(self) -> Figure:
        """Draw numbers over parameters; indices, a tornado or bands of what was analysed.

        Raises
        ------
        UserError
            If there is nothing to draw, or it is a part of a sweep only.
        """
        return _drawing(self)(self)

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each case; of a sweep that kept traces alone, over time."""
        numbers = [name for name, value in self.items() if "time" not in value.dims]
        return (self[numbers] if numbers else self).to_dataframe().reset_index()


def _drawing(data: xarray.Dataset) -> Callable[[xarray.Dataset], Figure]:
    """Return what draws a dataset, by its dimensions."""
    from orchestration.sweeps import picture
    from orchestration.sweeps.sensitivity import indices, one_at_a_time, prediction_bands

    dimensions = {str(name) for name in data.dims}
    swept = {*str(data.attrs.get("over", "")).split()}
    if {"parameter", "index"} <= dimensions:
        return indices.draw
    if {"parameter", "end"} <= dimensions:
        return one_at_a_time.draw
    if "quantile" in dimensions:
        return prediction_bands.draw
    if swept and ("case" in dimensions or swept <= dimensions):
        return picture.draw
    raise UserError("this is a part of a sweep, of which there is no picture; draw the whole")
