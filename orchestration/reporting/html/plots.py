"""Charts of a page: panels above a shared axis, thinned to what a screen can show.

Lines are drawn as SVG that is stretched to the width of the page, and texts stand beside them as
HTML, so that a chart is as readable on a phone as on a desk, and needs neither a script nor a
library.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from orchestration.reporting.html.page import Markup, escaped

_GAP = 10.0  # times the steps on either side, from which on a line is broken
MOST = 1600  # points of a line: two for every pixel of a wide page
_MOST_OF_ALL = 40_000  # points of a chart, which are shared out among its lines
_WIDTH, _HEIGHT = 2000, 1000  # of the coordinates of a panel, whatever its size on the screen
_MARGIN = 0.05  # of the range of a panel, above and below its lines
_TICKS = 5
_FARTHEST = 1e150  # value on an axis: the range of runaway simulations has to be a number
_DARK = 0.5  # share of the darkest ground of a map, from which on ink is white
_FEWEST_DECADES = 2  # of a logarithmic axis, below which values between powers of ten are told


@dataclass(frozen=True)
class Trace:
    """A line to draw.

    Attributes
    ----------
    label : str
        Traces of one label, wherever they are, are one entry of the legend; none for an empty one.
    x, y : ndarray, shape (n,)
        NaN in y is a gap.
    colour : str
        As CSS has it.
    width : float
        Pixels.
    dashed : bool
    stepped : bool
        Whether values are held until the next one.
    low : ndarray, shape (n,), optional
        Lower edge of a band, of which y is the upper one; the line is not drawn then.
    dots : bool
        Whether there is a tick at every value, in place of a line.
    makes_room : bool
        Whether the axis reaches as far as the line; else the line is cut off at the panel.
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
        With the unit.
    height : int
        Pixels.
    traces : list of Trace
    band : pair of float, optional
        A range to be marked.
    span : pair of float, optional
        Range of the axis; that of the traces if it is not given.
    logarithmic : bool
    """

    title: str
    height: int
    traces: list[Trace]
    band: tuple[float, float] | None = None
    span: tuple[float, float] | None = None
    logarithmic: bool = False


@dataclass(frozen=True)
class Boundary:
    """A place on the horizontal axis, such as the begin of validation data, and words beside it."""

    place: float
    before: str
    after: str


@dataclass(frozen=True)
class _Axis:
    """An axis from one end to the other, linear or logarithmic."""

    low: float
    high: float
    logarithmic: bool = False

    @classmethod
    def over(cls, values: Sequence[Array], logarithmic: bool, margin: float = 0.0) -> _Axis:
        """Return the axis that holds all values, with a margin as a share of their range."""
        known = [v[np.isfinite(v) & ((v > 0.0) | (not logarithmic))] for v in values]
        ends = [float(end) for v in known if len(v) for end in (v.min(), v.max())]
        ends = [min(max(end, -_FARTHEST), _FARTHEST) for end in ends] or [0.1, 1.0]
        low, high = min(ends), max(ends)
        if logarithmic:
            room = (high / low) ** margin if high > low else 2.0
            return cls(low / room, high * room, True)
        room = margin * (high - low) if high > low else 0.5 * abs(high) or 0.5
        return cls(low - room, high + room)

    def share(self, values: Array) -> Array:
        """Return where values are, from 0 at the lower end to 1 at the upper one."""
        if not self.logarithmic:
            return np.asarray((values - self.low) / (self.high - self.low))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))

    def ticks(self) -> list[float]:
        """Return a few round values on it."""
        if self.logarithmic:
            powers = np.arange(np.ceil(np.log10(self.low)), np.floor(np.log10(self.high)) + 1.0)
            if len(powers) > _FEWEST_DECADES:
                every = -(-len(powers) // (_TICKS + 1))
                return [float(10.0**power) for power in powers[::every]]
            powers = np.arange(np.floor(np.log10(self.low)), np.ceil(np.log10(self.high)) + 1.0)
            known = [float(m * 10.0**power) for power in powers for m in (1.0, 2.0, 5.0)]
            return [value for value in known if self.low <= value <= self.high]
        rough = (self.high - self.low) / _TICKS
        power = 10.0 ** np.floor(np.log10(rough))
        step = power * next(m for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough)
        first, last = np.ceil(self.low / step), np.floor(self.high / step)
        return [float(k * step) for k in np.arange(first, last + 1.0)]


def envelope(x: Array, y: Array, most: int = MOST) -> tuple[Array, Array]:
    """Thin out a line: of every bin the smallest and the largest value, each where it is.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
    most : int
        Points that are left.

    Returns
    -------
    x, y : ndarray, shape (m,)
        As they were if there are no more.
    """
    n = len(y)
    if n <= most:
        return x, y
    size = -(-n // (most // 2))
    bins = np.full((-(-n // size), size), np.nan)
    bins.flat[:n] = y
    gap = np.isnan(bins)
    ends = [np.where(gap, np.inf, bins).argmin(axis=1), np.where(gap, -np.inf, bins).argmax(axis=1)]
    at = (np.sort(ends, axis=0) + size * np.arange(len(bins))).T.ravel()
    return x[at], y[at]


def broken(x: Array, y: Array) -> tuple[Array, Array]:
    """Break a line where a record has a gap: nothing is drawn where nothing was measured."""
    step = np.diff(x, prepend=np.nan, append=np.nan)
    after = np.flatnonzero(step[1:-1] > _GAP * np.fmax(step[:-2], step[2:])) + 1
    return np.insert(x, after, 0.5 * (x[after] + x[after - 1])), np.insert(y, after, np.nan)


def stacked(
    panels: Sequence[Panel],
    across: str,
    logarithmic: bool = False,
    boundary: Boundary | None = None,
    marks: Sequence[tuple[float, str]] = (),
) -> Markup:
    """Draw panels, one above the other.

    Parameters
    ----------
    panels : sequence of Panel
    across : str
        Title of the horizontal axis, with the unit.
    logarithmic : bool
        Whether that axis is.
    boundary : Boundary, optional
    marks : sequence of float and str
        Places on the horizontal axis, and what is there.

    Returns
    -------
    Markup
    """
    traces = [trace for panel in panels for trace in panel.traces]
    axis = _Axis.over([trace.x for trace in traces], logarithmic)
    most = min(MOST, max(_MOST_OF_ALL // max(len(traces), 1), 100))
    places = [place for place, _ in marks] + ([boundary.place] if boundary else [])
    lines = [float(axis.share(np.array(place))) for place in places]
    held = float(axis.share(np.array(boundary.place))) if boundary else None
    parts = [_legend(traces), _strip(axis, boundary, marks)]
    parts += [_draw_panel(panel, axis, most, lines, held) for panel in panels]
    labels = "".join(
        f'<span style="left:{_percent(share)}">{_number(tick)}</span>'
        for tick, share in _shares(axis)
    )
    parts.append(f'<div class="x">{labels}</div><p class="across">{escaped(across)}</p>')
    return Markup(f'<div class="chart">{"".join(parts)}</div>')


def _legend(traces: Sequence[Trace]) -> str:
    """Return the entries of the legend, one for every label."""
    named = {trace.label: trace for trace in reversed(traces) if trace.label}
    entries = "".join(
        f'<li><i style="background:{trace.colour}"></i>{escaped(label)}</li>'
        for label, trace in reversed(named.items())
    )
    return f"<ul>{entries}</ul>" if entries else ""


def _strip(axis: _Axis, boundary: Boundary | None, marks: Sequence[tuple[float, str]]) -> str:
    """Return the words above the panels, beside the places that they are about."""
    texts = [(place, text, "before") for place, text in marks]
    if boundary:
        texts += [
            (boundary.place, f"{boundary.before} ◂", "before"),
            (boundary.place, f"▸ {boundary.after}", "after"),
        ]
    words = ""
    for place, text, side in texts:
        share = float(axis.share(np.array(place)))
        edge = "left" if side == "after" else "right"
        words += (
            f'<span style="{edge}:{_percent(share if side == "after" else 1.0 - share)}">'
            f"{escaped(text)}</span>"
        )
    return f'<div class="strip">{words}</div>' if words else ""


def _draw_panel(
    panel: Panel, axis: _Axis, most: int, lines: Sequence[float], held: float | None
) -> str:
    """Return a panel with its title, its grid, its lines, and the values beside its axis."""
    upright = _upright_axis(panel)
    drawn = "" if held is None else _box(held, 1.0, 0.0, 1.0, "#fbf5e6")
    if panel.band is not None:
        low, high = upright.share(np.array(panel.band))
        drawn += _box(0.0, 1.0, float(low), float(high), "#e1e5e8")
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


def _upright_axis(panel: Panel) -> _Axis:
    if panel.span is not None:
        return _Axis(*panel.span, panel.logarithmic)
    shown = [trace for trace in panel.traces if trace.makes_room] or panel.traces
    values = [edge for trace in shown for edge in (trace.y, trace.low) if edge is not None]
    return _Axis.over(values, panel.logarithmic, _MARGIN)


def _draw_trace(trace: Trace, axis: _Axis, upright: _Axis, most: int) -> str:
    """Return a line, a band or ticks as a path of SVG."""
    if trace.low is not None:
        edges = [envelope(trace.x, edge, most) for edge in (trace.y, trace.low)]
        there, back = (_points(x, y, axis, upright) for x, y in edges)
        path = _path(np.concatenate((there, back[::-1])))
        return f'<path d="{path}z" fill="{trace.colour}" stroke="none"/>'
    if trace.dots:
        places = _points(*envelope(trace.x, trace.y, most), axis, upright)
        path = "".join(f"M{x} {y - 20}v40" for x, y in places.tolist())
    else:
        x, y = envelope(*broken(trace.x, trace.y), most)
        if trace.stepped:
            x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
        points = _points(x, y, axis, upright)
        runs = np.split(np.arange(len(y)), np.flatnonzero(~np.isfinite(y)))
        path = "".join(_path(points[run[np.isfinite(y[run])]]) for run in runs)
    dashes = ' stroke-dasharray="6 4"' if trace.dashed else ""
    return f'<path d="{path}" stroke="{trace.colour}" stroke-width="{trace.width:g}"{dashes}/>'


def _points(x: Array, y: Array, axis: _Axis, upright: _Axis) -> Array:
    """Return whole coordinates of points, shape (n, 2); what is far off the panel stays near it."""
    high = np.clip(np.nan_to_num(1.0 - upright.share(y)), -1.0, 2.0)
    along = np.nan_to_num(axis.share(x))
    return np.column_stack((np.rint(_WIDTH * along), np.rint(_HEIGHT * high))).astype(int)


def _path(points: Array) -> str:
    """Return a line through points as the commands of a path, each relative to the one before."""
    if not len(points):
        return ""
    steps = " ".join(f"{x} {y}" for x, y in np.diff(points, axis=0).tolist())
    return f"M{points[0, 0]} {points[0, 1]}l{steps}" if steps else f"M{points[0, 0]} {points[0, 1]}"


def _box(left: float, right: float, low: float, high: float, colour: str) -> str:
    return (
        f'<rect x="{_along(left)}" width="{_along(right) - _along(left)}" y="{_down(high)}"'
        f' height="{_down(low) - _down(high)}" fill="{colour}"/>'
    )


def _along(share: float) -> int:
    return round(_WIDTH * min(max(share, 0.0), 1.0))


def _down(share: float) -> int:
    return round(_HEIGHT * (1.0 - min(max(share, 0.0), 1.0)))


def _shares(axis: _Axis) -> list[tuple[float, float]]:
    """Return the ticks of an axis, each with its place."""
    return [(tick, float(axis.share(np.array(tick)))) for tick in axis.ticks()]


def _percent(share: float) -> str:
    return f"{100.0 * share:.2f}%"


def _number(value: float) -> str:
    """Write the value of a tick, without the noise of its last digits."""
    return f"{float(f'{value:.10g}') + 0.0:g}".replace("-", "−")


def heat_map(
    rows: Sequence[str],
    columns: Sequence[str],
    values: Array,
    texts: Sequence[Sequence[str]],
    title: str,
) -> Markup:
    """Draw a table of positive numbers on grounds that are the darker the larger they are.

    Parameters
    ----------
    rows, columns : sequence of str
        Names, from above and from the left.
    values : ndarray, shape (rows, columns)
        Nothing is drawn where one is NaN.
    texts : sequence of sequence of str
        What is told of each.
    title : str
        Of the numbers.

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
    """Return a number on a ground between white and dark blue, in ink that can be read on it."""
    if not np.isfinite(number):
        return "<td></td>"
    red, green, blue = (round(238 + share * (dark - 238)) for dark in (8, 48, 74))
    ink = "#fff" if share > _DARK else "#1c2733"
    style = f"background:rgb({red},{green},{blue});color:{ink}"
    return f'<td style="{style}" title="{escaped(text)}">{number:.3g}</td>'
