"""Charts of a page: panels above a shared axis, with lines thinned to the pixels of a screen.

Lines are SVG that is stretched to the width of the page, and texts are HTML, so that a chart can be
read on a phone and needs neither a script nor a library.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.reporting.html.page import Markup, escaped

_GAP = 10.0  # a line is broken at a step this many times longer than both of its neighbours
MOST = 1600  # points of a line: two for every pixel of a wide page
_MOST_OF_ALL = 40_000  # points of a chart, divided equally among its lines
_WIDTH, _HEIGHT = 2000, 1000  # coordinates of a panel, independent of its size on the screen
_HALF_MARK = 20  # half the height of the mark of a point, of a panel's height
_MARGIN = 0.05  # space above and below the lines, relative to their range
_TICKS = 5
_FARTHEST = 1e150  # largest value of an axis, so that unstable simulations have a finite range
_PALEST = 238  # each of red, green and blue of the palest cell of a heat map
_DARKEST = (8, 48, 74)  # red, green and blue of the darkest
_DARK = 0.5  # share of the darkest background above which the text is white
_FEWEST_DECADES = 2  # with fewer, a logarithmic axis has ticks between powers of ten


@dataclass(frozen=True)
class Trace:
    """A line to draw.

    Attributes
    ----------
    label : str
        Entry of the legend, shared by all traces with the same label; empty for no entry.
    x, y : ndarray, shape (n,)
        NaN in y is a gap.
    colour : str
        Colour in CSS.
    width : float
        Width of the line in pixels.
    dashed : bool
    stepped : bool
        Whether y is constant from each point to the next.
    low : ndarray, shape (n,), optional
        Lower edge of a band with the upper edge y, drawn in place of the line.
    dots : bool
        Whether a short vertical mark is drawn at every point, in place of the line.
    makes_room : bool
        Whether the range of the axis includes the line; else the panel cuts it off.
    """

    label: str
    x: Array
    y: Array
    colour: str
    width: float = 1.5
    dashed: bool = False
    stepped: bool = False
    low: Array | None = None
    dots: bool = False
    makes_room: bool = True


@dataclass(frozen=True)
class Panel:
    """Lines that share a vertical axis.

    Attributes
    ----------
    title : str
        Title with the unit.
    height : int
        Height in pixels.
    traces : list of Trace
    """

    title: str
    height: int
    traces: list[Trace]


@dataclass(frozen=True)
class Boundary:
    """A boundary on the horizontal axis, such as the start of validation data.

    Attributes
    ----------
    place : float
        Its position.
    before, after : str
        Texts to the left and to the right of it.
    """

    place: float
    before: str
    after: str


@dataclass(frozen=True)
class _Axis:
    """A linear or logarithmic axis with its range."""

    low: float
    high: float
    logarithmic: bool = False

    @classmethod
    def over(cls, values: Sequence[Array], logarithmic: bool, margin: float = 0.0) -> _Axis:
        """Return an axis that includes all finite values, with a margin relative to their range."""
        every = np.concatenate([np.empty(0), *map(np.ravel, values)])
        shown = every[np.isfinite(every) & ((every > 0.0) | (not logarithmic))]
        ends = [shown.min(), shown.max()] if shown.size else [0.1, 1.0]
        low, high = np.clip(ends, -_FARTHEST, _FARTHEST).tolist()
        if logarithmic:
            room = 1.0 if high > low else 2.0
            return cls(low / room, high * room, True)
        room = margin * (high - low) if high > low else 0.5 * abs(high) or 0.5
        return cls(low - room, high + room)

    def share(self, values: Array) -> Array:
        """Return positions of values along the axis, 0 at its lower end and 1 at its upper end."""
        if not self.logarithmic:
            return np.asarray((values - self.low) / (self.high - self.low))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))

    def place(self, value: float) -> float:
        """Return the position of one value."""
        return float(self.share(np.array(value)))

    def ticks(self) -> list[float]:
        """Return a few round values within the range."""
        if self.logarithmic:
            return self._logarithmic_ticks()
        shortest_step = (self.high - self.low) / _TICKS
        power = 10.0 ** np.floor(np.log10(shortest_step))
        step = power * next(m for m in (1.0, 2.0, 5.0, 10.0) if m * power >= shortest_step)
        first = np.ceil(self.low / step)
        last = np.floor(self.high / step)
        return [float(k * step) for k in np.arange(first, last + 1.0)]

    def _logarithmic_ticks(self) -> list[float]:
        """Return powers of ten, with values between them if the range has too few."""
        low = np.log10(self.low)
        high = np.log10(self.high)
        powers_within = np.arange(np.ceil(low), np.floor(high) + 1.0)
        if len(powers_within) > _FEWEST_DECADES:
            every = math.ceil(len(powers_within) / (_TICKS + 1))
            return [float(10.0**power) for power in powers_within[::every]]
        powers_around = np.arange(np.floor(low), np.ceil(high) + 1.0)
        values = [float(m * 10.0**power) for power in powers_around for m in (1.0, 2.0, 5.0)]
        return [value for value in values if self.low <= value <= self.high]


def envelope(x: Array, y: Array, most: int = MOST) -> tuple[Array, Array]:
    """Reduce a line to the lowest and the highest point of each of equally long runs of points.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
    most : int
        Largest number of points to return.

    Returns
    -------
    x, y : ndarray, shape (m,)
        The line itself if it has no more points.
    """
    kept = extremes(y, most)
    return x[kept], y[kept]


def extremes(y: Array, most: int) -> Indices:
    """Return indices of the lowest and the highest point of each of equally long runs of points.

    Parameters
    ----------
    y : ndarray, shape (n,)
        NaN is a gap.
    most : int
        Largest number of indices to return; all of a line that has no more points.
    """
    n = len(y)
    if n <= most:
        return np.arange(n)
    size = math.ceil(n / (most // 2))  # points of a bin, of which two remain
    bins = np.full((math.ceil(n / size), size), np.nan)
    bins.flat[:n] = y
    is_gap = np.isnan(bins)
    lowest = np.where(is_gap, np.inf, bins).argmin(axis=1)
    highest = np.where(is_gap, -np.inf, bins).argmax(axis=1)
    ends = np.sort([lowest, highest], axis=0) + size * np.arange(len(bins))
    return np.asarray(ends.T.ravel())  # in the order of the points


def break_at_gaps(x: Array, y: Array) -> tuple[Array, Array]:
    """Insert a point with y = NaN into every gap of a record, so that no line crosses it."""
    step = np.diff(x, prepend=np.nan, append=np.nan)  # before the first and after the last: NaN
    after = np.flatnonzero(step[1:-1] > _GAP * np.fmax(step[:-2], step[2:])) + 1
    return np.insert(x, after, 0.5 * (x[after] + x[after - 1])), np.insert(y, after, np.nan)


def stacked(
    panels: Sequence[Panel],
    across: str,
    logarithmic: bool = False,
    boundary: Boundary | None = None,
    marks: Sequence[tuple[float, str]] = (),
) -> Markup:
    """Draw panels with a shared horizontal axis, one above the other.

    Parameters
    ----------
    panels : sequence of Panel
    across : str
        Title of the horizontal axis, with the unit.
    logarithmic : bool
        Whether the horizontal axis is logarithmic.
    boundary : Boundary, optional
    marks : sequence of (float, str)
        Positions on the horizontal axis, each with its text.

    Returns
    -------
    Markup
    """
    traces = [trace for panel in panels for trace in panel.traces]
    axis = _Axis.over([trace.x for trace in traces], logarithmic)
    most = min(MOST, max(_MOST_OF_ALL // max(len(traces), 1), 100))
    texts = [(axis.place(place), text) for place, text in marks]
    validation_start = None
    if boundary:
        validation_start = axis.place(boundary.place)
        texts.append((validation_start, f"{boundary.before} ◂"))
    lines = [place for place, _ in texts]
    strip = "".join(
        f'<span style="right:{_percent(1.0 - place)}">{escaped(text)}</span>'
        for place, text in texts
    )
    if boundary:
        text = escaped(f"▸ {boundary.after}")
        strip += f'<span style="left:{_percent(lines[-1])}">{text}</span>'
    parts = [_legend(traces), f'<div class="strip">{strip}</div>' if strip else ""]
    parts += [_draw_panel(panel, axis, most, lines, validation_start) for panel in panels]
    labels = "".join(
        f'<span style="left:{_percent(share)}">{_number(tick)}</span>'
        for tick, share in _shares(axis)
    )
    parts.append(f'<div class="x">{labels}</div><p class="across">{escaped(across)}</p>')
    return Markup(f'<div class="chart">{"".join(parts)}</div>')


def _legend(traces: Sequence[Trace]) -> str:
    """Return the legend, with an entry for every label."""
    # reversed twice: the first trace of each label, in the order of the last ones
    first = {trace.label: trace for trace in reversed(traces) if trace.label}
    entries = "".join(
        f'<li><i style="background:{trace.colour}"></i>{escaped(label)}</li>'
        for label, trace in reversed(first.items())
    )
    return f"<ul>{entries}</ul>" if entries else ""


def _draw_panel(
    panel: Panel, axis: _Axis, most: int, lines: Sequence[float], validation_start: float | None
) -> str:
    """Return a panel with its title, grid, traces, and values at the ticks of its vertical axis.

    Parameters
    ----------
    panel : Panel
    axis : _Axis
        The horizontal axis.
    most : int
        Largest number of points of a trace.
    lines : sequence of float
        Positions of vertical lines, from 0 to 1.
    validation_start : float or None
        Position from which on the panel is shaded.
    """
    included = [trace for trace in panel.traces if trace.makes_room] or panel.traces
    edges = [edge for trace in included for edge in (trace.y, trace.low) if edge is not None]
    upright = _Axis.over(edges, False, _MARGIN)
    drawn = ""
    if validation_start is not None:
        left = _along(validation_start)
        drawn = (
            f'<rect x="{left}" width="{_WIDTH - left}" y="0" height="{_HEIGHT}" fill="#fbf5e6"/>'
        )
    ticks = _shares(upright)
    drawn += "".join(f'<path class="grid" d="M0 {_down(y)}h{_WIDTH}"/>' for _, y in ticks)
    drawn += "".join(f'<path class="grid" d="M{_along(x)} 0v{_HEIGHT}"/>' for _, x in _shares(axis))
    drawn += "".join(f'<path class="mark" d="M{_along(x)} 0v{_HEIGHT}"/>' for x in lines)
    drawn += "".join(_draw_trace(trace, axis, upright, most) for trace in panel.traces)
    values = "".join(
        f'<span style="bottom:{_percent(share)}">{_number(tick)}</span>' for tick, share in ticks
    )
    title = escaped(panel.title)
    return (
        f'<p class="title">{title}</p><div class="plot" style="height:{panel.height}px">'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" role="img"'
        f' aria-label="{title}">{drawn}</svg>{values}</div>'
    )


def _draw_trace(trace: Trace, axis: _Axis, upright: _Axis, most: int) -> str:
    """Return the line, band or marks of a trace as a path of SVG."""
    if trace.low is not None:
        edges = [envelope(trace.x, edge, most) for edge in (trace.y, trace.low)]
        upper, lower = (_points(x, y, axis, upright) for x, y in edges)
        path = _path(np.concatenate((upper, lower[::-1])))
        return f'<path d="{path}z" fill="{trace.colour}" stroke="none"/>'
    if trace.dots:
        places = _points(*envelope(trace.x, trace.y, most), axis, upright)
        mark = f"v{2 * _HALF_MARK}"
        path = "".join(f"M{x} {y - _HALF_MARK}{mark}" for x, y in places.tolist())
    else:
        x, y = envelope(*break_at_gaps(trace.x, trace.y), most)
        if trace.stepped:
            x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
        points = _points(x, y, axis, upright)
        # indices between gaps; each run after the first begins with the NaN of its gap
        runs = np.split(np.arange(len(y)), np.flatnonzero(~np.isfinite(y)))
        path = "".join(_path(points[run[np.isfinite(y[run])]]) for run in runs)
    dashes = ' stroke-dasharray="6 4"' if trace.dashed else ""
    return f'<path d="{path}" stroke="{trace.colour}" stroke-width="{trace.width:g}"{dashes}/>'


def _points(x: Array, y: Array, axis: _Axis, upright: _Axis) -> Array:
    """Return integer coordinates of points, shape (n, 2), at most one height off the panel."""
    high = np.clip(np.nan_to_num(1.0 - upright.share(y)), -1.0, 2.0)
    along = np.nan_to_num(axis.share(x))
    return np.column_stack((np.rint(_WIDTH * along), np.rint(_HEIGHT * high))).astype(int)


def _path(points: Array) -> str:
    """Return a line through points in the syntax of an SVG path, with relative coordinates."""
    if not len(points):
        return ""
    start = f"M{points[0, 0]} {points[0, 1]}"
    steps = " ".join(f"{x} {y}" for x, y in np.diff(points, axis=0).tolist())
    return f"{start}l{steps}" if steps else start


def _along(share: float) -> int:
    """Return the horizontal coordinate of a position on the axis."""
    return round(_WIDTH * min(max(share, 0.0), 1.0))


def _down(share: float) -> int:
    """Return the vertical coordinate, which points down, of a position on the axis."""
    return round(_HEIGHT * (1.0 - min(max(share, 0.0), 1.0)))


def _shares(axis: _Axis) -> list[tuple[float, float]]:
    """Return the ticks of an axis, each with its position from 0 to 1."""
    return [(tick, axis.place(tick)) for tick in axis.ticks()]


def _percent(share: float) -> str:
    return f"{100.0 * share:.2f}%"


def _number(value: float) -> str:
    """Return the value of a tick as text, without rounding errors."""
    return f"{float(f'{value:.10g}') + 0.0:g}".replace("-", "−")


def heat_map(
    rows: Sequence[str],
    columns: Sequence[str],
    values: Array,
    texts: Sequence[Sequence[str]],
    title: str,
) -> Markup:
    """Draw a table of positive numbers, with a darker background for larger numbers.

    Parameters
    ----------
    rows, columns : sequence of str
        Names of the rows from above and of the columns from the left.
    values : ndarray, shape (rows, columns)
        Positive numbers; a cell is empty where one is NaN.
    texts : sequence of sequence of str
        Tooltips of the cells.
    title : str
        Name of the numbers.

    Returns
    -------
    Markup
    """
    powers = np.log10(values)
    axis = _Axis.over([powers], False)
    head = "".join(f'<th scope="col"><span>{escaped(name)}</span></th>' for name in columns)
    body = ""
    for name, numbers, shares, words in zip(rows, values, axis.share(powers), texts, strict=True):
        cells = "".join(map(_heat_cell, numbers, shares, words))
        body += f'<tr><th scope="row">{escaped(name)}</th>{cells}</tr>'
    return Markup(
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escaped(title)}">'
        f'<table class="heat"><tr><th>{escaped(title)}</th>{head}</tr>{body}</table></div>'
    )


def _heat_cell(number: float, share: float, text: str) -> str:
    """Return a cell with a number on a background from grey (share 0) to dark blue (share 1)."""
    if not np.isfinite(number):
        return "<td></td>"
    red, green, blue = (round(_PALEST + share * (dark - _PALEST)) for dark in _DARKEST)
    ink = "#fff" if share > _DARK else "#1c2733"
    style = f"background:rgb({red},{green},{blue});color:{ink}"
    return f'<td style="{style}" title="{escaped(text)}">{number:.3g}</td>'
