"""Results that are datasets of xarray with a picture of their own.

A notebook shows the picture, and ``plot()`` returns it. Operations of xarray keep the class, so
that a part of such a dataset has the picture too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray
from xarray.plot.accessor import DatasetPlotAccessor

from orchestration.reporting import pictures, saving
from orchestration.reporting.drawing import draw
from orchestration.reporting.notebook import bundle

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Plots(DatasetPlotAccessor):
    """Plots of a dataset: its own picture when called, those of xarray as methods."""

    __slots__ = ("_draw",)

    def __init__(self, data: xarray.Dataset, draw: Callable[[], Figure]):
        super().__init__(data)
        self._draw = draw

    def __call__(self, path: str | Path | None = None) -> Figure:  # type: ignore[override]
        """Draw the result, and write the picture if a path is given; see `Displayable.plot`."""
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

    def save(self, path: str | Path) -> Path:
        """Write the result to a file, from which `ppy.load` shows it again; see `Displayable`."""
        return saving.save(saving.kept(self), path)

    @property
    def plot(self) -> Plots:  # type: ignore[override]
        """Plots of the result: ``plot()`` draws its picture, ``plot.scatter`` is of xarray."""
        return Plots(self, self.draw)

    def _repr_html_(self) -> str:
        return str(self._repr_mimebundle_()["text/html"])

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        try:
            figure = self.draw()
        except Exception:  # a part of a result may lack variables that its picture needs
            figure = None
        return bundle(super()._repr_html_(), figure)
