"""Result of a sweep or its analysis: a dataset with a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.reporting import ResultDataset

if TYPE_CHECKING:
    import pandas


class SweepResult(ResultDataset):
    """The cases of a sweep, or an analysis of them; a dataset of xarray.

    A notebook shows its picture and its variables; ``plot()`` draws the picture, and
    ``plot("file.png")`` also writes it.
    """

    __slots__ = ()

    def to_frame(self) -> pandas.DataFrame:
        """Return a DataFrame with a row per case; per case and time if only traces were kept."""
        numbers = [name for name, value in self.items() if "time" not in value.dims]
        return (self[numbers] if numbers else self).to_dataframe().reset_index()
