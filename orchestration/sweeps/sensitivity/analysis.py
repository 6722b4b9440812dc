"""Analysis of a sweep by its design: Sobol indices, bands or a tornado plot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import xarray
from rich.table import Table

from fmus.kit import UserError
from orchestration.sweeps.curves import no_numbers
from orchestration.sweeps.reductions import TRACE
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.sensitivity import indices
from orchestration.sweeps.sensitivity import one_at_a_time as tornado
from orchestration.sweeps.sensitivity import prediction_bands as bands


class Analysis(NamedTuple):
    """The functions that analyse a swept dataset, print it, and say what its picture leaves out."""

    analyse: Callable[[xarray.Dataset], SweepResult]
    table: Callable[[xarray.Dataset], Table]
    left_out: Callable[[xarray.Dataset], list[str]]


_BY_DESIGN = {
    indices.SOBOL_INDICES: Analysis(indices.sensitivity, indices.table, indices.left_out),
    bands.BANDS: Analysis(bands.bands, bands.table, bands.left_out),
    tornado.TORNADO: Analysis(tornado.tornado, tornado.table, tornado.left_out),
}


def analysis_of(design: str) -> Analysis | None:
    """Return the analysis of a design; None for a design whose cases are the result."""
    return _BY_DESIGN.get(design)


def check_picture(design: str, keep: Sequence[str]) -> None:
    """Refuse a picture of values that a sweep will not keep, before it is run.

    Parameters
    ----------
    design : str
    keep : sequence of str
        Reductions, and ``trace``.

    Raises
    ------
    UserError
    """
    if design == bands.BANDS and TRACE not in keep:
        raise bands.no_traces()
    if design != bands.BANDS and not {*keep} - {TRACE}:
        raise no_numbers()


def merge_analysis(data: xarray.Dataset, analysed: xarray.Dataset) -> xarray.Dataset:
    """Merge cases and their analysis into one dataset.

    Raises
    ------
    UserError
        If the model and the analysis have a name in common.
    """
    shared = {*data.variables} & {*analysed.variables}
    both = {str(name) for name in shared if not data[name].identical(analysed[name])}
    if both:
        raise UserError(
            f"{data.attrs['model']}: {', '.join(sorted(both))} is a name of the analysis, too; keep"
            " them apart"
        )
    return data.merge(analysed, combine_attrs="no_conflicts")
