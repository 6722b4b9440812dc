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
    """Functions that analyse a sweep, make a table of it, and list omissions of its picture."""

    analyse: Callable[[xarray.Dataset], SweepResult]
    table: Callable[[xarray.Dataset], Table]
    omissions: Callable[[xarray.Dataset], list[str]]


_BY_DESIGN = {
    indices.SOBOL_INDICES: Analysis(indices.sensitivity, indices.table, indices.omissions),
    bands.BANDS: Analysis(bands.bands, bands.table, bands.omissions),
    tornado.TORNADO: Analysis(tornado.tornado, tornado.table, tornado.omissions),
}


def analysis_of(design: str) -> Analysis | None:
    """Return the analysis of a design; None for a design without one."""
    return _BY_DESIGN.get(design)


def check_picture(design: str, keep: Sequence[str]) -> None:
    """Raise if a sweep will not keep the values of its picture, before it is run.

    Parameters
    ----------
    design : str
    keep : sequence of str
        Reductions, and ``trace``.

    Raises
    ------
    UserError
        If bands have no traces, or another design has no numbers.
    """
    if design == bands.BANDS and TRACE not in keep:
        raise bands.no_traces()
    if design != bands.BANDS and not {*keep} - {TRACE}:
        raise no_numbers()


def merge_analysis(data: xarray.Dataset, analysis: xarray.Dataset) -> xarray.Dataset:
    """Return one dataset of the cases of a sweep and their analysis.

    Raises
    ------
    UserError
        If one name stands for different variables in the two.
    """
    names = {*data.variables} & {*analysis.variables}
    conflicts = {str(name) for name in names if not data[name].identical(analysis[name])}
    if conflicts:
        raise UserError(
            f"{data.attrs['model']}: {', '.join(sorted(conflicts))} is also a name of the analysis;"
            " write cases and analysis to different files"
        )
    return data.merge(analysis, combine_attrs="no_conflicts")
