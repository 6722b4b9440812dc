"""Tornado plot: effects of one parameter at a time, at both ends of its range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from rich.table import Table

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.experiment import results
from orchestration.reporting import option, pictures, plain_table
from orchestration.sweeps.curves import describe_omission, names_to_draw
from orchestration.sweeps.ranges import Range
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.sensitivity.numbers import (
    numbers,
    parameters_of,
    require_complete,
    require_design,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TORNADO = "tornado"
ENDS = ("from", "to")
_WORDS = {"from": "low end of the range", "to": "high end"}


def one_at_a_time(ranges: Sequence[Range], starts: Mapping[str, float]) -> Array:
    """Return cases: all parameters at their start values, then one at a time at both its ends.

    Parameters
    ----------
    ranges : sequence of Range
        Ranges of p parameters.
    starts : Mapping of str to float
        Start value by parameter, in the units of the ranges.

    Returns
    -------
    ndarray, shape (2 p + 1, p)

    Raises
    ------
    UserError
        If a start value is not in its range.
    """
    start = np.array([starts[one.name] for one in ranges])
    cases = np.tile(start, (2 * len(ranges) + 1, 1))
    for k, one in enumerate(ranges):
        low, high = one.values
        if not low <= start[k] <= high:
            raise UserError(
                f"{option('over', {one.name: f'{low:g}..{high:g}'})}: its start value"
                f" {start[k]:g} {one.unit} is not in this range; set another with"
                f" {option('settings', {one.name: '...'})}, or widen the range"
            )
        cases[2 * k + 1, k] = low
        cases[2 * k + 2, k] = high
    return cases


def tornado(found: xarray.Dataset) -> SweepResult:
    """Return the effect of each parameter alone on every number of a sweep of ``tornado``.

    Parameters
    ----------
    found : xarray.Dataset
        Result of `sweep` with ``kind="tornado"``, also if it was read from a file.

    Returns
    -------
    SweepResult
        Each number of the sweep, such as ``voltage_last_tornado``, over ``parameter`` and ``end``
        (``from``, ``to``) of its range, with the others at their start values; and
        ``voltage_last_start`` with all at their start values. ``ends`` has the ranges. NaN where a
        case failed.

    Raises
    ------
    UserError
        If it is not such a sweep, or the case with all parameters at their start values failed.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> over = {"R1": "0.3..0.7", "C": "2..10"}
    >>> found = ppy.sweep("ppy_actuator", over, {"current": 0.5}, stop=10.0, kind="tornado")
    >>> effects = ppy.tornado(found)["voltage_last_tornado"]
    >>> bool(effects.sel(parameter="C", end="from") > effects.sel(parameter="C", end="to"))
    True
    """
    require_design(found, TORNADO)
    parameters = parameters_of(found)
    if found.sizes["case"] != 2 * len(parameters) + 1:
        raise UserError(f"{found.sizes['case']} cases are not all of a sweep for a tornado plot")
    start = found.isel(case=slice(1))
    require_complete(start, "tornado plot without its first case")
    values: dict[str, object] = {}
    for name in numbers(found):
        value = found[name]
        values[f"{name}_tornado"] = (
            ("parameter", "end"),
            value.values[1:].reshape(-1, 2),
            value.attrs,
        )
        values[f"{name}_start"] = ((), value.values[0], value.attrs)
    ends = [found[p].values[2 * k + 1 : 2 * k + 3] for k, p in enumerate(parameters)]
    coordinates: dict[str, object] = {
        "parameter": parameters,
        "end": list(ENDS),
        "ends": (
            ("parameter", "end"),
            np.array(ends),
            {"long_name": "ends of the ranges, in the parameters' units"},
        ),
        "parameter_units": ("parameter", [str(found[p].units) for p in parameters]),
        "parameter_display_units": ("parameter", [_display_unit(found[p]) for p in parameters]),
    }
    return SweepResult(values, coordinates, {"model": found.attrs["model"], "design": TORNADO})


def _display_unit(parameter: xarray.DataArray) -> str:
    return str(parameter.attrs.get("display_units", parameter.units))


def table(effects: xarray.Dataset) -> Table:
    """Return a table of a tornado, with the most influential parameter first."""
    columns = ("from", "to", "at start", "at from", "at to")
    result = plain_table(None, "moved", "by", *columns, "unit", right=columns)
    for name in _numbers(effects):
        start, unit = results.displayed(effects[f"{name}_start"])
        for parameter in _ranked(effects, name):
            effect = effects.sel(parameter=parameter)
            ends, end_unit = _displayed_ends(effect)
            values = [_cell(value) for value in results.displayed(effect[f"{name}_tornado"])[0]]
            texts = [f"{end:.6g}{_unit_suffix(end_unit)}" for end in ends]
            result.add_row(name, parameter, *texts, f"{start:.6g}", *values, unit)
    return result


def _cell(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else "failed"


def _unit_suffix(unit: str) -> str:
    return f" {unit}" if unit != "1" else ""


def draw(effects: xarray.Dataset) -> Figure:
    """Draw a tornado for each number: bars to its values at both ends of every range."""
    names = names_to_draw(_numbers(effects))
    count = effects.sizes["parameter"]
    figure, panels = pictures.panels(
        len(names),
        f"{effects.attrs['model']}: one parameter at a time",
        "",
        0.9 + 0.3 * count,
        shared=False,
    )
    for panel, name in zip(panels, names, strict=True):
        _draw_bars(panel, effects, name)
    panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
    return figure


def omissions(effects: xarray.Dataset) -> list[str]:
    """Return a line on numbers that the picture of a tornado does not show, if there are any."""
    return describe_omission(_numbers(effects))


def _draw_bars(panel: Any, effects: xarray.Dataset, name: str) -> None:
    """Draw the bars of one number."""
    start, unit = results.displayed(effects[f"{name}_start"])
    ranked = _ranked(effects, name)[::-1]  # the largest at the top
    colours = (pictures.MEASURED, pictures.MODEL)
    for row, parameter in enumerate(ranked):
        values, _ = results.displayed(effects[f"{name}_tornado"].sel(parameter=parameter))
        for value, end, colour in zip(values, ENDS, colours, strict=True):
            label = _WORDS[end] if row == 0 else None
            panel.barh(row, value - start, 0.7, start, color=colour, alpha=0.85, label=label)
    panel.set_axisbelow(True)
    panel.axvline(start, color="black", lw=0.8)
    labels = [_range_label(effects, parameter) for parameter in ranked]
    pictures.name_ticks(panel.yaxis, range(len(ranked)), labels)
    panel.set_xlabel(pictures.with_unit(name.replace("_", " "), unit))


def _range_label(effects: xarray.Dataset, parameter: str) -> str:
    (low, high), unit = _displayed_ends(effects.sel(parameter=parameter))
    return f"{parameter}: {low:.4g}..{high:.4g}{_unit_suffix(unit)}"


def _displayed_ends(effect: xarray.Dataset) -> tuple[Array, str]:
    """Return both ends of the range of a parameter in its display unit, and that unit."""
    units = {
        "units": str(effect["parameter_units"].item()),
        "display_units": str(effect["parameter_display_units"].item()),
    }
    return results.displayed(effect["ends"].assign_attrs(units))


def _numbers(effects: xarray.Dataset) -> list[str]:
    """Return the names of the numbers of a tornado."""
    return [
        str(name).removesuffix("_tornado") for name in effects if str(name).endswith("_tornado")
    ]


def _ranked(effects: xarray.Dataset, name: str) -> list[str]:
    """Return the parameters in falling order of the range of a number; failed cases are last."""
    values = effects[f"{name}_tornado"].values
    start = np.full(len(values), effects[f"{name}_start"])
    swing = np.nan_to_num(np.ptp(np.column_stack([values, start]), axis=1))
    return [str(p) for p in effects["parameter"].values[np.argsort(-swing, kind="stable")]]
