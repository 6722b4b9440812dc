"""The result of a sweep, or of its analysis: a dataset with a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.reporting import ResultDataset

if TYPE_CHECKING:
    import pandas


class SweepResult(ResultDataset):
    """The cases of a sweep, or what an analysis makes of them; a dataset of xarray.

    A notebook shows its picture beside its variables; ``plot()`` draws it, and
    ``plot("file.png")`` writes it as well.
    """

    __slots__ = ()

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each case; of a sweep that kept traces alone, over time."""
        numbers = [name for name, value in self.items() if "time" not in value.dims]
        return (self[numbers] if numbers else self).to_dataframe().reset_index()
