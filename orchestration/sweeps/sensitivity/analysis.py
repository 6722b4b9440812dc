"""What a sweep comes to besides its cases, by what it was made for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import xarray
from rich.table import Table

from fmus.kit.errors import UserError
from orchestration.sweeps.reductions import TRACE
from orchestration.sweeps.sensitivity import bands, indices, tornado


class Analysis(NamedTuple):
    """How a swept dataset is analysed, and the result printed and drawn."""

    analyse: Callable[[xarray.Dataset], xarray.Dataset]
    table: Callable[[xarray.Dataset], Table]
    draw: Callable[[xarray.Dataset, Path], None]


_BY_DESIGN = {
    indices.KIND: Analysis(indices.sensitivity, indices.table, indices.draw),
    bands.KIND: Analysis(bands.bands, bands.table, bands.draw),
    tornado.KIND: Analysis(tornado.tornado, tornado.table, tornado.draw),
}


def analysis_of(design: str) -> Analysis | None:
    """Return what a sweep of a design is made for; None for its cases themselves."""
    return _BY_DESIGN.get(design)


def check_picture(path: Path, design: str, keep: Sequence[str]) -> None:
    """Refuse a picture of what a sweep does not keep, before it is run.

    Parameters
    ----------
    path : Path
    design : str
    keep : sequence of str
        Reductions, and ``trace``.

    Raises
    ------
    UserError
    """
    if design == bands.KIND and TRACE not in keep:
        raise UserError(f"--plot {path}: bands are drawn over time, which --keep trace keeps")
    if design != bands.KIND and not {*keep} - {TRACE}:
        raise UserError(
            f"--plot {path}: numbers are drawn over parameters, such as --keep last; there are none"
        )


def together(data: xarray.Dataset, analysed: xarray.Dataset) -> xarray.Dataset:
    """Put cases and what they come to into one dataset.

    Raises
    ------
    UserError
        If something of the model is called as a part of the analysis is.
    """
    shared = {*data.variables} & {*analysed.variables}
    both = {str(name) for name in shared if not data[name].identical(analysed[name])}
    if both:
        raise UserError(
            f"{data.attrs['model']}: {', '.join(sorted(both))} is a name of the analysis, too; keep them apart"
        )
    return data.merge(analysed, combine_attrs="no_conflicts")
