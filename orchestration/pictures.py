"""Pictures: one look for every plot, with units on every axis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED, MODEL, FITTED = "#8a97a3", "#0b6aa2", "#d1495b"
_STYLE = {
    "axes.grid": True, "grid.color": "#e3e8ec", "axes.edgecolor": "#9aa5af", "axes.spines.top": False,
    "axes.spines.right": False, "font.size": 9, "axes.titlesize": 10, "axes.titlelocation": "left",
    "lines.linewidth": 1.1, "legend.frameon": False, "figure.dpi": 110,
}  # fmt: skip


def panels(count: int, title: str, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Make a figure of panels that share the time axis, ``count`` rows of ``columns``."""
    import matplotlib.style
    from matplotlib.figure import Figure

    with matplotlib.style.context(_STYLE):
        figure = Figure(figsize=(9, 1.0 + 1.9 * count), layout="constrained")
        axes = figure.subplots(count, columns, sharex=True, squeeze=False)
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure, list(axes.flat)


def label(axis: Axes, name: str, unit: str) -> None:
    """Name the vertical axis with its unit."""
    text = name.replace("_", " ")
    axis.set_ylabel(text if unit == "1" else f"{text}\n[{unit}]")


def logarithmic(axes: list[Axes], time: NDArray[np.float64]) -> None:
    """Make the time axis logarithmic for records sampled that way, such as creep tests."""
    steps = np.diff(time)
    if len(steps) and steps.max() > 1000.0 * steps.min():
        axes[-1].set_xscale("log")


def save(figure: Figure, path: Path) -> None:
    """Write the figure, in the format of the file's ending.

    Raises
    ------
    UserError
        If it cannot be written, or the ending is no picture format.
    """
    figure.align_ylabels()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from error
    except ValueError as error:
        raise UserError(f"cannot write {path}: {str(error).splitlines()[0]}") from error
