"""Picture of a sweep: its numbers over the first parameter, as curves of a grid or as points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from fmus.kit import UserError
from orchestration.experiment import results
from orchestration.reporting import option, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 6  # panels of a picture, and curves in a legend


def names_to_draw(names: Sequence[str]) -> list[str]:
    """Return the first names, one for each panel of a picture."""
    return list(names[:MOST])


def describe_omission(names: Sequence[str]) -> list[str]:
    """Return a line on the names for which a picture has no panel; no line if it shows all."""
    if len(names) <= MOST:
        return []
    return [
        f"the picture shows the first {MOST} of {len(names)} numbers, without"
        f" {', '.join(names[MOST:])}; {option('outputs')} and {option('keep')} choose others"
    ]


def draw_curves(data: xarray.Dataset) -> Figure:
    """Draw the first numbers of a sweep over its parameters, in display units.

    Parameters
    ----------
    data : xarray.Dataset
        As `orchestration.sweeps.execution.dataset` returns it.

    Raises
    ------
    UserError
        If there are no numbers.
    """
    names = names_to_draw(_names_of_numbers(data))
    if not names:
        raise no_numbers()
    first = _names_of_parameters(data)[0]
    x, unit = results.displayed(data[first])
    figure, panels = pictures.panels(len(names), str(data.attrs["model"]))
    for panel, name in zip(panels, names, strict=True):
        values, value_unit = results.displayed(data[name])
        if "case" in data[name].dims:
            panel.plot(x, values, ".", color=pictures.MODEL)
        else:
            _draw_grid(panel, data, data[name].copy(data=values), first, x)
        pictures.label(panel, name, value_unit)
    if 1 < _count_curves(data[names[0]], first) <= MOST:
        panels[0].legend()
    panels[-1].set_xlabel(pictures.with_unit(first, unit))
    return figure


def no_numbers() -> UserError:
    """Return the error for a picture of numbers of a sweep that kept none."""
    return UserError(
        "no picture: numbers are drawn over parameters, such as"
        f" {option('keep', ['last'])}, and there are none"
    )


def omissions(data: xarray.Dataset) -> list[str]:
    """Return a line on each part of a sweep that its picture does not show."""
    numbers = _names_of_numbers(data)
    first, *others = _names_of_parameters(data)
    return [*describe_omission(numbers), *_describe_others(data[numbers[0]], first, others)]


def _names_of_numbers(data: xarray.Dataset) -> list[str]:
    return [
        str(name) for name, value in data.items() if name != "failure" and "time" not in value.dims
    ]


def _names_of_parameters(data: xarray.Dataset) -> list[str]:
    return [str(name) for name in data.coords if name != "time"]


def _count_curves(value: xarray.DataArray, first: str) -> int:
    """Return the number of curves of a number of a grid; 0 if its cases are points."""
    return 0 if "case" in value.dims else value.size // value.sizes[first]


def _describe_others(value: xarray.DataArray, first: str, others: Sequence[str]) -> list[str]:
    """Return a line if the picture does not show or label the parameters after the first."""
    listed = ", ".join(others)
    curves = _count_curves(value, first)
    if others and not curves:
        return [f"the picture shows the cases over {first} alone, not over {listed}"]
    if curves > MOST:
        return [
            f"the picture has {curves} curves, from dark to light in the order of {listed},"
            " and no room for a legend"
        ]
    return []


def _draw_grid(
    panel: Any, data: xarray.Dataset, value: xarray.DataArray, first: str, x: Any
) -> None:
    """Draw a number over the first parameter of a grid, a curve for each combination of others."""
    others = [str(dim) for dim in value.dims if dim != first]
    curves = value.transpose(first, *others).values.reshape(len(x), -1).T
    shades = np.linspace(1.0, 0.25, len(curves))
    for curve, shade, label in zip(curves, shades, _labels(data, others), strict=True):
        panel.plot(x, curve, color=pictures.MODEL, alpha=float(shade), label=label)


def _labels(data: xarray.Dataset, parameters: list[str]) -> list[str]:
    """Return a label for every combination of values; the last parameter changes fastest."""
    texts = []
    for name in parameters:
        values, unit = results.displayed(data[name])
        suffix = "" if unit == "1" else f" {unit}"
        texts.append([f"{name} = {value:g}{suffix}" for value in values])
    return [", ".join(combination) for combination in product(*texts)]
