"""What a sweep comes to, drawn: a curve or a map over the parameters of a grid, else a cloud for each parameter."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import xarray

from fmus.kit.errors import UserError
from orchestration.reporting import pictures

_MOST = 6  # panels


def draw(data: xarray.Dataset, path: Path) -> None:
    """Draw the first numbers of a sweep over its parameters.

    Parameters
    ----------
    data : xarray.Dataset
        Of `orchestration.sweeps.run.dataset`.
    path : Path
        Picture: .png, .svg or .pdf.

    Raises
    ------
    UserError
        If there are no numbers, or the file cannot be written.
    """
    names = [str(n) for n, v in data.items() if n != "failure" and "time" not in v.dims][:_MOST]
    if not names:
        raise UserError(
            f"--plot {path}: numbers are drawn over parameters, such as --keep last; there are none"
        )
    parameters = [str(n) for n in data.coords if n != "time"]
    figure, panels = pictures.panels(len(names), str(data.attrs["model"]))
    first = data[parameters[0]]
    for panel, name in zip(panels, names, strict=True):
        value = data[name]
        if "case" in value.dims:
            panel.plot(first.values, value.values, ".", color=pictures.MODEL)
        else:
            others = [d for d in value.dims if d != parameters[0]]
            lines = value.transpose(parameters[0], *others).values.reshape(len(first), -1)
            shades, called = (
                np.linspace(1.0, 0.25, lines.shape[1]),
                _called(data, [str(d) for d in others]),
            )
            for line, shade, label in zip(lines.T, shades, called, strict=True):
                panel.plot(
                    first.values, line, color=pictures.MODEL, alpha=float(shade), label=label
                )
            if 1 < len(called) <= _MOST and panel is panels[0]:
                panel.legend()
        pictures.label(panel, name, value.units)
    panels[-1].set_xlabel(f"{parameters[0]} [{first.units}]")
    pictures.save(figure, path)


def _called(data: xarray.Dataset, parameters: list[str]) -> list[str]:
    """Lines by the values of the other parameters, the last changing fastest."""
    texts = [[f"{n} = {v:g} {data[n].units}" for v in data[n].values] for n in parameters]
    return [", ".join(one) for one in product(*texts)]
