"""Between which values outputs are where parameters were chosen at random: quantiles over cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray
from numpy.typing import NDArray
from rich.table import Table

from fmus.kit.errors import UserError
from orchestration.reporting import pictures
from orchestration.reporting.console import plain_table
from orchestration.sweeps.sensitivity.numbers import complete, drawn

Array = NDArray[np.float64]
KIND = "draws"
_EVEN = (KIND, "latin-hypercube", "sobol")  # designs whose cases count alike
_USUAL = (0.05, 0.5, 0.95)
_AT_ONCE = 1_000_000  # values that are sorted at a time


def bands(found: xarray.Dataset, quantiles: Sequence[float] = _USUAL) -> xarray.Dataset:
    """Tell between which values every output is, over the cases of a sweep whose parameters were chosen at random.

    With the draws of a fit these are bands of what its record leaves open of the parameters. The noise of what would be
    measured is not in them.

    Parameters
    ----------
    found : xarray.Dataset
        Of `sweep` with ``kind="draws"``, ``"latin-hypercube"`` or ``"sobol"``.
    quantiles : sequence of float
        Between 0 and 1, rising.

    Returns
    -------
    xarray.Dataset
        For each trace, such as ``voltage``, its quantiles ``voltage_band`` over ``quantile`` and ``time``, and for each
        number those over ``quantile``, with their units.

    Raises
    ------
    UserError
        If it is no such sweep, or a case of it failed.

    Examples
    --------
    >>> import orchestration as ppy
    >>> from orchestration.rig.emulator.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> drawn = ppy.fit("clean.csv", "ppy_actuator", ["R1", "C"]).draws(100, seed=1)
    >>> found = ppy.sweep("ppy_actuator", drawn, {"current": 0.5}, stop=10.0, kind="draws", keep=["trace"])
    >>> band = ppy.bands(found)["voltage_band"].sel(time=10.0)
    >>> bool(band.sel(quantile=0.05) < band.sel(quantile=0.95))
    True
    """
    if found.attrs.get("design") not in _EVEN or "case" not in found.dims:
        raise UserError(
            f"bands are of a sweep of the designs {', '.join(_EVEN)}, not {found.attrs.get('design', 'none')}"
        )
    levels = np.asarray(quantiles, dtype=float)
    if (
        levels.ndim != 1
        or not levels.size
        or not ((levels >= 0) & (levels <= 1)).all()
        or (np.diff(levels) <= 0).any()
    ):
        raise UserError(f"quantiles {[*quantiles]}: between 0 and 1, and rising")
    complete(found, "bands")
    values: dict[str, object] = {}
    for name, value in found.items():
        about = {**value.attrs, "long_name": f"quantiles of {name} over cases"}
        if value.dims == ("case",):
            values[f"{name}_band"] = ("quantile", np.quantile(value.values, levels), about)
        elif value.dims == ("case", "time"):
            parts = [np.quantile(part, levels, axis=0) for part in _over_time(value)]
            values[f"{name}_band"] = (("quantile", "time"), np.hstack(parts), about)
    clock = {"time": found["time"]} if "time" in found.coords else {}
    about = {"model": found.attrs["model"], "design": found.attrs["design"]}
    return xarray.Dataset(values, {"quantile": levels, **clock}, about)


def _over_time(trace: xarray.DataArray) -> Iterator[Array]:
    """Traces of all cases, some points in time after others, so that not all of them are in memory."""
    step = max(1, _AT_ONCE // trace.sizes["case"])
    for at in range(0, trace.sizes["time"], step):
        yield trace.isel(time=slice(at, at + step)).values


def table(found: xarray.Dataset) -> Table:
    """Return bands as they are printed: traces where they are widest and at their end."""
    columns = [f"{100.0 * level:g} %" for level in found["quantile"].values]
    made = plain_table(None, "quantiles of", "at", *columns, "unit", right=["at", *columns])
    for name, band in found.items():
        output = str(name).removesuffix("_band")
        places = [("", band)]
        if "time" in band.dims:
            widest, end = int(np.argmax(np.ptp(band.values, axis=0))), found.sizes["time"] - 1
            places = [
                (f"{float(found['time'][at]):g} s", band.isel(time=at))
                for at in sorted({widest, end})
            ]
        for at, here in places:
            made.add_row(output, at, *(f"{value:.6g}" for value in here.values), band.units)
    return made


def draw(found: xarray.Dataset, path: Path) -> None:
    """Draw bands over time, and below each how far its quantiles are from the middle one.

    Raises
    ------
    UserError
        If there is no trace to draw, or the file cannot be written.
    """
    names = drawn([str(name) for name, band in found.items() if "time" in band.dims])
    if not names:
        raise UserError(f"--plot {path}: bands are drawn over time, which --keep trace keeps")
    figure, panels = pictures.panels(
        2 * len(names), f"{found.attrs['model']}: quantiles over cases"
    )
    levels = [f"{100.0 * level:g} %" for level in found["quantile"].values]
    for over, below, name in zip(panels[::2], panels[1::2], names, strict=True):
        band, unit = found[name].values, found[name].units
        middle = len(band) // 2
        for panel, values in ((over, band), (below, band - band[middle])):
            panel.fill_between(
                found["time"].values,
                values[0],
                values[-1],
                color=pictures.MODEL,
                alpha=0.25,
                lw=0.0,
                label=f"{levels[0]} to {levels[-1]}",
            )
            for level, line in zip(levels[1:-1], values[1:-1], strict=True):
                panel.plot(found["time"].values, line, color=pictures.MODEL, label=level)
        pictures.label(over, name.removesuffix("_band"), unit)
        pictures.label(below, f"from {levels[middle]}", unit)
    pictures.logarithmic(panels, found["time"].values)
    panels[0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, borderaxespad=0.1
    )
    pictures.save(figure, path)
