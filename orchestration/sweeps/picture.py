"""Picture of a sweep: numbers over the first parameter, as curves of a grid or as points."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from fmus.kit import UserError
from orchestration.reporting import option, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 6  # panels


def draw(data: xarray.Dataset, path: Path | None = None) -> Figure:
    """Draw the first numbers of a sweep over its parameters.

    Parameters
    ----------
    data : xarray.Dataset
        Of `orchestration.sweeps.execution.dataset`.
    path : Path
        Picture: .png, .svg or .pdf.

    Raises
    ------
    UserError
        If there are no numbers, or the file cannot be written.
    """
    names = [
        str(name) for name, value in data.items() if name != "failure" and "time" not in value.dims
    ][:_MOST]
    if not names:
        raise UserError(
            f"no picture: numbers are drawn over parameters, such as"
            f" {option('keep', ['last'])}, and there are none"
        )
    first = data[next(str(name) for name in data.coords if name != "time")]
    figure, panels = pictures.panels(len(names), str(data.attrs["model"]))
    for panel, name in zip(panels, names, strict=True):
        value = data[name]
        if "case" in value.dims:
            panel.plot(first.values, value.values, ".", color=pictures.MODEL)
        else:
            _draw_curves(panel, data, value, first)
            others = value.size // len(first)
            if 1 < others <= _MOST and panel is panels[0]:
                panel.legend()
        pictures.label(panel, name, value.units)
    panels[-1].set_xlabel(f"{first.name} [{first.units}]")
    if path is not None:
        pictures.save(figure, path)
    return figure


def _draw_curves(
    panel: Any, data: xarray.Dataset, value: xarray.DataArray, first: xarray.DataArray
) -> None:
    """Draw a number over the first parameter of a grid, a curve for all values of the others."""
    others = [str(dim) for dim in value.dims if dim != first.name]
    curves = value.transpose(str(first.name), *others).values.reshape(len(first), -1).T
    shades = np.linspace(1.0, 0.25, len(curves))
    for curve, shade, label in zip(curves, shades, _labels(data, others), strict=True):
        panel.plot(first.values, curve, color=pictures.MODEL, alpha=float(shade), label=label)


def _labels(data: xarray.Dataset, parameters: list[str]) -> list[str]:
    """Return a label for every combination of values of parameters, the last changing fastest."""
    texts = [[f"{n} = {v:g} {data[n].units}" for v in data[n].values] for n in parameters]
    return [", ".join(one) for one in product(*texts)]
