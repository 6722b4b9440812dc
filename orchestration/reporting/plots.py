"""Interactive plots for plotly.js: panels above a shared axis, thinned to what can be seen."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.reporting.page import escaped

_GAP = 10.0  # times the steps on either side, from which on a line is broken
# points of a trace; of more, the smallest and the largest of each of half as many bins are drawn
MOST = 8000
_TITLE, _LEGEND, _STRIP, _BOTTOM = 26, 34, 18, 46  # pixels
_GREY, _GRID, _INK = "#9aa5af", "#e3e8ec", "#1c2733"
_FONT = {"family": "system-ui, sans-serif", "size": 13, "color": _INK}


@dataclass(frozen=True)
class Trace:
    """A line to draw.

    Attributes
    ----------
    label : str
        Traces of one label, wherever they are, are one entry of the legend; none for an empty one.
    x, y : ndarray, shape (n,)
        NaN in y is a gap.
    style : dict
        Of the line, as plotly.js has it: color, width, dash, shape.
    more : dict
        Other attributes, as plotly.js has them.
    """

    label: str
    x: Array
    y: Array
    style: dict[str, Any]
    more: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Panel:
    """Curves and marks that share a vertical axis.

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


def envelope(x: Array, y: Array) -> tuple[Array, Array]:
    """Thin out a line: of every bin the smallest and the largest value, each where it is.

    Parameters
    ----------
    x, y : ndarray, shape (n,)

    Returns
    -------
    x, y : ndarray, shape (m,)
        As they were if `MOST` or fewer.
    """
    n = len(y)
    if n <= MOST:
        return x, y
    size = -(-n // (MOST // 2))
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
) -> dict[str, Any]:
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
    dict
        ``data`` and ``layout``.
    """
    inner = sum(panel.height + _TITLE for panel in panels)
    top = _LEGEND + (_STRIP if boundary or marks else 0)
    layout: dict[str, Any] = {
        "height": inner + top + _BOTTOM,
        "font": _FONT,
        "hovermode": "x unified",
        "hoversubplots": "axis",
        "margin": {"l": 62, "r": 8, "t": top, "b": _BOTTOM},
        "paper_bgcolor": "#fff",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "legend": {
            "orientation": "h",
            "x": 0,
            "xanchor": "left",
            "xref": "container",
            "y": 1,
            "yanchor": "top",
            "yref": "container",
            "groupclick": "togglegroup",
            "font": {"size": 13},
        },
        "hoverlabel": {"font": {"size": 12}},
        "shapes": [],
        "annotations": [],
        "xaxis": _axis(logarithmic)
        | {"title": {"text": across, "standoff": 8, "font": _FONT}, "anchor": _y(len(panels) - 1)},
    }
    data: list[dict[str, Any]] = []
    named: set[str] = set()
    down = 0
    for k, panel in enumerate(panels):
        high, low = inner - down - _TITLE, inner - down - _TITLE - panel.height
        ends: dict[str, Any] = {"domain": [low / inner, high / inner], "nticks": 5}
        ends |= {"range": list(panel.span)} if panel.span else {}
        layout[_y(k).replace("y", "yaxis")] = _axis(panel.logarithmic) | ends
        layout["annotations"].append(_note(panel.title, 0.0, high / inner, "left"))
        if panel.band:
            ends = {
                "y0": panel.band[0],
                "y1": panel.band[1],
                "xref": "paper",
                "x0": 0,
                "x1": 1,
                "yref": _y(k),
            }
            layout["shapes"].append(_box(ends, "#e1e5e8"))
        for trace in panel.traces:
            data.append(_drawn(trace, k, bool(trace.label) and trace.label not in named))
            named.add(trace.label)
        down += panel.height + _TITLE
    if boundary:
        place = float(np.log10(boundary.place)) if logarithmic else boundary.place
        last = max(float(trace.x[-1]) for panel in panels for trace in panel.traces)
        ends = {"xref": "x", "x0": boundary.place, "x1": last, "yref": "paper", "y0": 0, "y1": 1}
        layout["shapes"].append(_box(ends, "#fbf5e6"))
        line = {"color": "#b98a2f", "width": 1, "dash": "dash"}
        layout["shapes"].append({**ends, "type": "line", "x1": boundary.place, "line": line})
        for text, side, shift in (
            (f"{boundary.before} ◂", "right", -3),
            (f"▸ {boundary.after}", "left", 3),
        ):
            more = {"xref": "x", "xshift": shift, "font": {"size": 12, "color": "#8a6116"}}
            layout["annotations"].append(_note(text, place, 1.0, side) | more)
    for place, text in marks:
        ends = {"xref": "x", "x0": place, "x1": place, "yref": "paper", "y0": 0, "y1": 1}
        name = {
            "text": text,
            "textposition": "end",
            "textangle": 0,
            "xanchor": "right",
            "font": {"size": 12},
        }
        layout["shapes"].append(
            {**ends, "type": "line", "line": {"color": "#b98a2f", "dash": "dot"}, "label": name}
        )
    return {"data": data, "layout": layout}


def _drawn(trace: Trace, panel: int, in_legend: bool) -> dict[str, Any]:
    """Return a line as plotly has it, thinned and broken at gaps."""
    x, y = envelope(*broken(trace.x, trace.y))
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _packed(x, "<f8"),
        "y": _packed(y, "<f4" if _is_single(y) else "<f8"),
        "xaxis": "x",
        "yaxis": _y(panel),
        "name": escaped(trace.label),
        "legendgroup": trace.label,
        "showlegend": in_legend,
        "line": trace.style,
        "hovertemplate": "%{y:.5~g}",
        "connectgaps": False,
        **trace.more,
    }


def _is_single(values: Array) -> bool:
    """Return whether all values but gaps are within the range of single precision."""
    return bool((np.abs(values[np.isfinite(values)]) <= np.finfo(np.float32).max).all())


def _packed(values: Array, kind: str) -> dict[str, str]:
    """Return numbers as plotly.js unpacks them; text would be four times as long."""
    return {"dtype": kind[1:], "bdata": base64.b64encode(values.astype(kind).tobytes()).decode()}


def _axis(logarithmic: bool) -> dict[str, Any]:
    about = {"type": "log"} if logarithmic else {"type": "linear"}
    shown = (
        {"tickformat": "~g"} if logarithmic else {"exponentformat": "none", "hoverformat": ".6~g"}
    )
    line = {
        "gridcolor": _GRID,
        "zerolinecolor": _GREY,
        "linecolor": _GREY,
        "showline": True,
        "ticks": "outside",
    }
    return {
        **about,
        **shown,
        **line,
        "tickcolor": _GREY,
        "tickfont": {"size": 12},
        "automargin": False,
    }


def _note(text: str, x: float, y: float, side: str) -> dict[str, Any]:
    return {
        "text": escaped(text),
        "x": x,
        "y": y,
        "xref": "paper",
        "yref": "paper",
        "xanchor": side,
        "yanchor": "bottom",
        "showarrow": False,
        "font": {"size": 13, "color": _INK},
    }


def _box(ends: dict[str, Any], colour: str) -> dict[str, Any]:
    return {"type": "rect", "layer": "below", "line": {"width": 0}, "fillcolor": colour, **ends}


def _y(panel: int) -> str:
    return f"y{panel + 1}" if panel else "y"


def heat_map(
    rows: Sequence[str],
    columns: Sequence[str],
    values: Array,
    texts: Sequence[Sequence[str]],
    title: str,
) -> dict[str, Any]:
    """Draw a table of positive numbers as colours on a logarithmic scale.

    Parameters
    ----------
    rows, columns : sequence of str
        Names, from above and from the left.
    values : ndarray, shape (rows, columns)
        Nothing is drawn where one is NaN.
    texts : sequence of sequence of str
        What is told of each.
    title : str
        Of the colours.

    Returns
    -------
    dict
        ``data`` and ``layout``.
    """
    powers = np.log10(values)
    known = powers[np.isfinite(powers)]
    low, high = (np.floor(known.min()), np.ceil(known.max())) if len(known) else (0.0, 1.0)
    high = max(high, low + 1.0)
    ticks = np.unique(np.round(np.linspace(low, high, 5)))
    longest = max((len(name) for name in columns), default=0)
    bottom, left = (
        24 + min(5 * longest, 170),
        24 + min(7 * max((len(name) for name in rows), default=0), 150),
    )
    drawn = {
        "type": "heatmap",
        "x": list(map(escaped, columns)),
        "y": list(map(escaped, rows)),
        "xgap": 2,
        "ygap": 2,
        "z": [[None if not np.isfinite(v) else float(v) for v in row] for row in powers],
        "zmin": low,
        "zmax": high,
        "text": [list(map(escaped, row)) for row in texts],
        "hovertemplate": "%{text}<extra></extra>",
        "colorscale": [[0.0, "#eef3f7"], [0.5, "#7fb0d0"], [0.8, "#0b6aa2"], [1.0, "#08304a"]],
        "colorbar": {
            "title": {"text": title, "font": _FONT},
            "tickvals": ticks.tolist(),
            "thickness": 14,
            "ticktext": [f"{10.0**t:,.0f}" for t in ticks],
            "outlinewidth": 0,
        },
    }
    axis = {
        "showgrid": False,
        "zeroline": False,
        "ticks": "",
        "fixedrange": True,
        "automargin": False,
    }
    layout = {
        "height": 30 * len(rows) + bottom + 40 + max(0, 110 - 30 * len(rows)),
        "font": _FONT,
        "margin": {"l": left, "r": 8, "t": 16, "b": bottom},
        "paper_bgcolor": "#fff",
        "plot_bgcolor": "#fff",
        "xaxis": {**axis, "tickangle": -40, "type": "category"},
        "yaxis": {**axis, "autorange": "reversed", "type": "category"},
    }
    return {"data": [drawn], "layout": layout}
