"""Pictures: one look for every plot, with units on every axis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import UserError, files
from fmus.kit.arrays import Array
from fmus.kit.extras import optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.reporting.figure import ShownFigure

FORMATS = (".png", ".svg", ".pdf")
MEASURED, MODEL, FITTED = "#8a97a3", "#0b6aa2", "#d1495b"
_LINE = 26  # characters that go beside a panel of the usual height
_ROUNDING = 1e-12  # of a value: less than that is no course
_BESIDE_TRUTH = 0.1  # of an axis from false to true, below and above
_STYLE = {
    "axes.grid": True,
    "grid.color": "#e3e8ec",
    "axes.edgecolor": "#9aa5af",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "figure.dpi": 110,
}


def panels(
    count: int, title: str, below: str = "time [s]", height: float = 1.9, shared: bool = True
) -> tuple[ShownFigure, list[Axes]]:
    """Make a figure of panels, one above the other, that share a horizontal axis such as time.

    Parameters
    ----------
    count : int
    title : str
    below : str
        What the horizontal axis is called.
    height : float
        Of a panel, inches.
    shared : bool
        Whether there is one horizontal axis for all.
    """
    with optional():
        import matplotlib.style

        from orchestration.reporting.figure import ShownFigure

    with matplotlib.style.context(_STYLE):
        figure = ShownFigure(figsize=(9, 1.0 + height * count), layout="constrained")
        axes = figure.subplots(count, 1, sharex=shared, squeeze=False)
    _entitle(figure, title)
    axes[-1, 0].set_xlabel(below)
    return figure, list(axes.flat)


def mosaic(rows: Sequence[Sequence[str]], title: str) -> tuple[ShownFigure, dict[str, Axes]]:
    """Make a figure of panels that are arranged by their names.

    Parameters
    ----------
    rows : sequence of sequences of str
        Names from left to right; a panel reaches over all places that have its name.
    title : str
    """
    with optional():
        import matplotlib.style

        from orchestration.reporting.figure import ShownFigure

    with matplotlib.style.context(_STYLE):
        figure = ShownFigure(figsize=(10, 0.6 + 2.1 * len(rows)), layout="constrained")
        places: Any = [list(row) for row in rows]
        axes: dict[str, Axes] = figure.subplot_mosaic(places)
    _entitle(figure, title)
    return figure, axes


def _entitle(figure: Figure, title: str) -> None:
    # a file name may hold bytes that no font can draw
    text = plain(title.encode(errors="backslashreplace").decode())
    figure.suptitle(text, x=0.01, ha="left", fontweight="bold")


def plain(text: str) -> str:
    """Return a text of the user's as it is drawn to the letter, where $ begins a formula."""
    return text.replace("$", r"\$")


def label(axis: Axes, name: str, unit: str) -> None:
    """Name the vertical axis with its unit, in lines that a panel has room for."""
    lines = [line for part in name.splitlines() for line in wrap(part.replace("_", " "), _LINE)]
    text = plain("\n".join(lines))
    axis.set_ylabel(text if unit == "1" else f"{text}\n[{unit}]")


def fit_values(axis: Axes, boolean: bool = False) -> None:
    """Fit the vertical axis to lines that do not vary, whose rounding is not to look like noise.

    Of values of truth it goes from false to true.
    """
    low, high = axis.dataLim.intervaly
    if boolean:
        axis.set_ylim(-_BESIDE_TRUTH, 1.0 + _BESIDE_TRUTH)
        axis.set_yticks([0.0, 1.0], ["false", "true"])
    elif 0.0 <= high - low <= _ROUNDING * max(abs(low), abs(high)):
        room = 0.5 * abs(low) or 0.5
        axis.set_ylim(low - room, high + room)


def logarithmic(axes: list[Axes], time: Array) -> None:
    """Make the time axis logarithmic for records sampled that way, such as creep tests."""
    steps = np.diff(time)
    if len(steps) and steps.max() > 1000.0 * steps.min():
        axes[-1].set_xscale("log")


def logarithmic_values(axis: Axes) -> None:
    """Make the vertical axis logarithmic, with its values written out."""
    from matplotlib.ticker import LogFormatter

    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(LogFormatter())
    axis.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.5, 0.8)))


def whole_numbers(axis: Axes) -> None:
    """Mark the horizontal axis at whole numbers only, at as many as it has room for."""
    from matplotlib.ticker import MaxNLocator

    axis.xaxis.set_major_locator(MaxNLocator("auto", integer=True))


def picture_format(path: Path) -> str:
    """Tell the format from the file's ending.

    Raises
    ------
    UserError
        If it is none of those that are drawn.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise UserError(
            f"cannot draw {path}: its name must end in {', '.join(FORMATS)}, not"
            f" {ending or 'nothing'!r}"
        )
    return ending[1:]


def also_saved(figure: Figure, path: str | Path | None) -> Figure:
    """Return the figure, which is written as by `save` where a path is given."""
    if path is not None:
        save(figure, Path(path))
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write the figure, in the format of the file's ending, whole or not at all.

    Raises
    ------
    UserError
        If it cannot be written, or the ending is no picture format.
    """
    from orchestration.reporting.figure import rendered

    kind = picture_format(path)
    files.write(path, rendered(figure, kind))
