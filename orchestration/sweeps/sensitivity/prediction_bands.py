"""Prediction bands: quantiles of outputs over cases with random parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from rich.table import Table

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.experiment import results
from orchestration.reporting import option, pictures, plain_table
from orchestration.sweeps.curves import describe_omission, names_to_draw
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.sensitivity.numbers import require_complete

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BANDS = "draws"
_EVEN = (BANDS, "latin-hypercube", "sobol")  # designs whose cases have equal weights
_QUANTILES = (0.05, 0.5, 0.95)
_AT_ONCE = 1_000_000  # most values that are sorted at a time


def bands(found: xarray.Dataset, quantiles: Sequence[float] = _QUANTILES) -> SweepResult:
    """Return quantiles of every output over the cases of a sweep with random parameters.

    With the draws of a fit they show the uncertainty of outputs due to that of parameters, without
    the noise of measurements.

    Parameters
    ----------
    found : xarray.Dataset
        Result of `sweep` with ``kind="draws"``, ``"latin-hypercube"`` or ``"sobol"``.
    quantiles : sequence of float
        Between 0 and 1, in rising order.

    Returns
    -------
    SweepResult
        Quantiles of each trace, such as ``voltage_band`` of ``voltage``, over ``quantile`` and
        ``time``, and those of each number over ``quantile``, in the units of the sweep.

    Raises
    ------
    UserError
        If it is not such a sweep, or one of its cases failed.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> drawn = ppy.fit("clean.csv", "ppy_actuator", ["R1", "C"]).draws(100, seed=1)
    >>> found = ppy.sweep(
    ...     "ppy_actuator", drawn, {"current": 0.5}, stop=10.0, kind="draws", keep=["trace"]
    ... )
    >>> band = ppy.bands(found)["voltage_band"].sel(time=10.0)
    >>> bool(band.sel(quantile=0.05) < band.sel(quantile=0.95))
    True
    """
    if found.attrs.get("design") not in _EVEN or "case" not in found.dims:
        raise UserError(
            f"bands need a sweep of the designs {', '.join(_EVEN)}, not"
            f" {found.attrs.get('design', 'none')}"
        )
    levels = _checked_levels(quantiles)
    require_complete(found, "bands")
    values: dict[str, object] = {}
    for name, value in found.items():
        about = {**value.attrs, "long_name": f"quantiles of {name} over cases"}
        if value.dims == ("case",):
            values[f"{name}_band"] = ("quantile", np.quantile(value.values, levels), about)
        elif value.dims == ("case", "time"):
            parts = [np.quantile(part, levels, axis=0) for part in _over_time(value)]
            values[f"{name}_band"] = (("quantile", "time"), np.hstack(parts), about)
    coordinates: dict[str, object] = {"quantile": levels}
    if "time" in found.coords:
        coordinates["time"] = found["time"]
    attributes = {"model": found.attrs["model"], "design": found.attrs["design"]}
    return SweepResult(values, coordinates, attributes)


def _checked_levels(quantiles: Sequence[float]) -> Array:
    """Return quantiles as an array; raise if they are not between 0 and 1 in rising order."""
    levels = np.asarray(quantiles, dtype=float)
    is_row = levels.ndim == 1 and levels.size
    is_inside = ((levels >= 0) & (levels <= 1)).all()
    if not is_row or not is_inside or (np.diff(levels) <= 0).any():
        raise UserError(f"quantiles {[*quantiles]} (allowed: between 0 and 1, in rising order)")
    return levels


def _over_time(trace: xarray.DataArray) -> Iterator[Array]:
    """Yield the traces of all cases in intervals of time that fit into memory."""
    step = max(1, _AT_ONCE // trace.sizes["case"])
    for first in range(0, trace.sizes["time"], step):
        yield trace.isel(time=slice(first, first + step)).values


def table(found: xarray.Dataset) -> Table:
    """Return a table of bands; those of traces at their widest point and at their end."""
    columns = [f"{100.0 * level:g} %" for level in found["quantile"].values]
    result = plain_table(None, "quantiles of", "at", *columns, "unit", right=["at", *columns])
    for name, band in found.items():
        output = str(name).removesuffix("_band")
        for instant, quantiles in _at_instants(band):
            values, unit = results.displayed(quantiles)
            result.add_row(output, instant, *(f"{value:.6g}" for value in values), unit)
    return result


def _at_instants(band: xarray.DataArray) -> list[tuple[str, xarray.DataArray]]:
    """Return the quantiles of a trace where they are widest and at its end, with these instants."""
    if "time" not in band.dims:
        return [("", band)]
    widest = int(np.argmax(np.ptp(band.values, axis=0)))
    instants = sorted({widest, band.sizes["time"] - 1})
    return [(f"{float(band['time'][k]):g} s", band.isel(time=k)) for k in instants]


def draw(found: xarray.Dataset) -> Figure:
    """Draw bands over time, and below each band its quantiles minus the middle one.

    Raises
    ------
    UserError
        If there is no trace to draw.
    """
    names = names_to_draw(_traces(found))
    if not names:
        raise no_traces()
    title = f"{found.attrs['model']}: quantiles over cases"
    figure, panels = pictures.panels(2 * len(names), title)
    levels = [f"{100.0 * level:g} %" for level in found["quantile"].values]
    time = found["time"].values
    for over, below, name in zip(panels[::2], panels[1::2], names, strict=True):
        band, unit = results.displayed(found[name])
        middle = len(band) // 2
        _draw_band(over, time, band, levels)
        _draw_band(below, time, band - band[middle], levels)
        pictures.label(over, name.removesuffix("_band"), unit)
        pictures.label(below, f"from {levels[middle]}", unit)
    pictures.logarithmic(panels, time)
    pictures.legend_above(panels[0], 4)
    return figure


def no_traces() -> UserError:
    """Return the error for a picture of bands of a sweep that kept no trace."""
    return UserError(
        f"no picture: bands are drawn over time, which {option('keep', ['trace'])} keeps"
    )


def omissions(found: xarray.Dataset) -> list[str]:
    """Return a line on bands that the picture does not show, if there are any."""
    return describe_omission(_traces(found))


def _traces(found: xarray.Dataset) -> list[str]:
    return [str(name) for name, band in found.items() if "time" in band.dims]


def _draw_band(panel: Any, time: Array, band: Array, levels: Sequence[str]) -> None:
    """Draw quantiles of one output, shape (q, n), over time, shape (n,)."""
    panel.fill_between(
        time,
        band[0],
        band[-1],
        color=pictures.MODEL,
        alpha=0.25,
        lw=0.0,
        label=f"{levels[0]} to {levels[-1]}",
    )
    for level, line in zip(levels[1:-1], band[1:-1], strict=True):
        panel.plot(time, line, color=pictures.MODEL, label=level)
