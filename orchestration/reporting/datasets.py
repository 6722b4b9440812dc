"""Datasets of xarray that are results: with a picture of their own, in a notebook and by ``plot``.

What xarray makes of such a dataset, such as a part of it, is one again.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray
from xarray.plot.accessor import DatasetPlotAccessor

from orchestration.reporting import pictures
from orchestration.reporting.drawing import draw
from orchestration.reporting.notebook import bundle

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Plots(DatasetPlotAccessor):
    """Pictures of a dataset: its own when it is called, and those of xarray by name."""

    __slots__ = ("_draw",)

    def __init__(self, data: xarray.Dataset, draw: Callable[[], Figure]):
        super().__init__(data)
        self._draw = draw

    def __call__(self, path: str | Path | None = None) -> Figure:  # type: ignore[override]
        """Draw the result, and write the picture where a path is given; see `Displayable.plot`."""
        return pictures.also_saved(self._draw(), path)


class ResultDataset(xarray.Dataset):
    """A dataset that has a picture of its own."""

    __slots__ = ()

    def draw(self) -> Figure:
        """Draw the result.

        Raises
        ------
        UserError
            If there is nothing to draw.
        """
        return draw(self)

    def to_frame(self) -> pandas.DataFrame:
        """Return the result as a table."""
        return self.to_dataframe()

    @property
    def plot(self) -> Plots:  # type: ignore[override]
        """Draw the result: ``plot()``, ``plot("file.png")``; ``plot.scatter`` is xarray's."""
        return Plots(self, self.draw)

    def _repr_html_(self) -> str:
        return str(self._repr_mimebundle_()["text/html"])

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        try:
            figure = self.draw()
        except Exception:  # what was calculated from a result may lack what its picture needs
            figure = None
        return bundle(super()._repr_html_(), figure)
