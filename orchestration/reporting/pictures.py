"""Figures of matplotlib in one style, with units on every axis, and their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError, files
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from fmus.kit.units import printed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from orchestration.reporting.figure import ShownFigure

FORMATS = (".png", ".svg", ".pdf")
_LIGHTEST = 0.9  # of a scale of colours that ends in yellow
MEASURED, MODEL, FITTED = "#8a97a3", "#0b6aa2", "#d1495b"
_LABEL_WIDTH = 26  # characters along the height of a panel
_TITLE_LINES = 2
_TITLE_DENSITY = 8.7  # characters of a title in an inch, most of them wide
_TITLE_SIZE, _SMALLEST_TITLE = 10.8, 6.0  # points
_LINE_HEIGHT = 1.3  # of the size of letters
_POINTS = 72  # in an inch
_ROUNDING = 1e-12  # relative variation below which a line is drawn as constant
_BOOLEAN_MARGIN = 0.1  # space below false and above true
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
        Title of the horizontal axis, with the unit.
    height : float
        Height of a panel in inches.
    shared : bool
        Whether all panels share one horizontal axis.

    Returns
    -------
    figure : ShownFigure
    axes : list of matplotlib.axes.Axes
        From above to below.
    """
    with _new_figure(title, 9.0, 1.0 + height * count) as figure:
        axes = figure.subplots(count, 1, sharex=shared, squeeze=False)
    axes[-1, 0].set_xlabel(below)
    return figure, list(axes.flat)


def mosaic(rows: Sequence[Sequence[str]], title: str) -> tuple[ShownFigure, dict[str, Axes]]:
    """Make a figure of panels arranged in a grid of their names.

    Parameters
    ----------
    rows : sequence of sequences of str
        Names from left to right; a panel covers all cells that have its name.
    title : str

    Returns
    -------
    figure : ShownFigure
    axes : dict of str to matplotlib.axes.Axes
        By name.
    """
    cells: Any = [list(row) for row in rows]
    with _new_figure(title, 10.0, 0.6 + 2.1 * len(rows)) as figure:
        axes: dict[str, Axes] = figure.subplot_mosaic(cells)
    return figure, axes


@contextmanager
def _new_figure(title: str, width: float, height: float) -> Iterator[ShownFigure]:
    """Yield an empty figure of a size in inches, in the style of its axes, and add the title.

    A title of more lines than there is room for makes the figure higher.
    """
    with optional():
        import matplotlib.style

        from orchestration.reporting.figure import ShownFigure

    lines, size = _title_lines(title, width)
    height += max(len(lines) - _TITLE_LINES, 0) * _LINE_HEIGHT * size / _POINTS
    with matplotlib.style.context(_STYLE):
        figure = ShownFigure(figsize=(width, height), layout="constrained")
        yield figure
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontweight="bold", fontsize=size)


def _title_lines(title: str, width: float) -> tuple[list[str], float]:
    """Return a title in lines for a width in inches, and the size of its letters in points.

    A title for which two lines are too short has smaller letters, and one of the smallest letters
    that are read more lines.
    """
    size = _TITLE_SIZE
    lines = wrap(title, int(_TITLE_DENSITY * width))
    while len(lines) > _TITLE_LINES and size > _SMALLEST_TITLE:
        size -= 0.4
        lines = wrap(title, int(_TITLE_DENSITY * width * _TITLE_SIZE / size))
    return lines, size


def colors(count: int) -> list[Any]:
    """Return colours of lines in an order, from dark to light; that of a model for one line."""
    from matplotlib import colormaps

    if count == 1:
        return [MODEL]
    return [colormaps["viridis"](share) for share in np.linspace(0.0, _LIGHTEST, count)]


def name_ticks(axis: Axis, places: ArrayLike, names: Sequence[str]) -> None:
    """Write names at places of an axis; matplotlib takes these texts from where they are set."""
    from orchestration.reporting.figure import LONGEST_AT_TICK, shown

    axis.set_ticks(places, [shown(name, LONGEST_AT_TICK) for name in names])


def label(axis: Axes, name: str, unit: str) -> None:
    """Label the vertical axis with a name, wrapped to the height of a panel, and its unit."""
    from orchestration.reporting.figure import shown

    lines: list[str] = []
    for part in name.splitlines():
        lines += wrap(shown(part.replace("_", " ")), _LABEL_WIDTH)
    axis.set_ylabel(with_unit("\n".join(lines), unit, "\n"))


def legend_above(axis: Axes, columns: int) -> None:
    """Put the legend above an axis, to the right."""
    axis.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        frameon=False,
        borderaxespad=0.1,
    )


def with_unit(title: str, unit: str, between: str = " ") -> str:
    """Return a title with its unit in brackets, which the unit 1 does not have."""
    return title if unit == "1" else f"{title}{between}[{printed(unit)}]"


def fit_values(axis: Axes, boolean: bool = False) -> None:
    """Set the range of the vertical axis if its lines are constant or boolean.

    The axis of constant lines is so wide that rounding errors are not visible; that of boolean ones
    reaches from false to true.
    """
    low, high = axis.dataLim.intervaly
    if boolean:
        axis.set_ylim(-_BOOLEAN_MARGIN, 1.0 + _BOOLEAN_MARGIN)
        axis.set_yticks([0.0, 1.0], ["false", "true"])
    elif 0.0 <= high - low <= _ROUNDING * max(abs(low), abs(high)):
        room = 0.5 * abs(low) or 0.5
        axis.set_ylim(low - room, high + room)


def logarithmic(axes: list[Axes], time: Array) -> None:
    """Make the time axis logarithmic if that suits the steps."""
    if has_logarithmic_steps(time):
        axes[-1].set_xscale("log")


def has_logarithmic_steps(time: Array) -> bool:
    """Return whether steps differ by a factor above 1000, as in creep tests."""
    steps = np.diff(time)
    return bool(len(steps) and steps.max() > 1000.0 * steps.min())


def logarithmic_values(axis: Axes) -> None:
    """Make the vertical axis logarithmic, with ticks as plain numbers in place of powers of ten."""
    from matplotlib.ticker import LogFormatter

    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(LogFormatter())
    axis.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.5, 0.8)))


def whole_numbers(axis: Axes) -> None:
    """Place the ticks of the horizontal axis at whole numbers only."""
    from matplotlib.ticker import MaxNLocator

    axis.xaxis.set_major_locator(MaxNLocator("auto", integer=True))


def picture_format(path: Path) -> str:
    """Return the format of a picture by its file's ending, without the dot.

    Raises
    ------
    UserError
        If the ending is not in `FORMATS`.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise UserError(
            f"cannot draw {path}: its name must end in {', '.join(FORMATS)}, not"
            f" {ending or 'nothing'!r}"
        )
    return ending[1:]


def also_saved(figure: Figure, path: str | Path | None) -> Figure:
    """Return the figure, after writing it with `save` if a path is given."""
    if path is not None:
        save(figure, Path(path))
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write the figure in the format of the file's ending; a failure leaves no partial file.

    Raises
    ------
    UserError
        If the file cannot be written, or its ending is not in `FORMATS`.
    """
    from orchestration.reporting.figure import rendered

    kind = picture_format(path)
    files.write(path, rendered(figure, kind))
