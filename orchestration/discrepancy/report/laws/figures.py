"""The curve of a correction, and the map of laws over signals, as figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.asked import Asked, named, shape_values
from orchestration.discrepancy.report.typography import pretty
from orchestration.reporting import pictures
from orchestration.reporting.page import Markup, escaped
from orchestration.reporting.plots import Panel, Trace, heat_map, stacked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_POINTS = 300  # of a curve
_HIGH = 360  # pixels
_MOST = 24  # laws, and signals, that a map has room for
_BAND = "rgba(11,106,162,0.18)"


def _grid(correction: Correction) -> tuple[Array, tuple[Array, Array, Array]]:
    """Places along the curve, its knots among them, and the curve and its band there."""
    basis = correction.entry.basis
    x = np.union1d(np.linspace(basis.knots[0], basis.knots[-1], _POINTS), basis.knots)
    return x, correction.band_at(x)


def titles(asked: Asked, correction: Correction) -> tuple[str, str]:
    """Of the vertical and of the horizontal axis, with units."""
    entry, (law, signal) = correction.entry, asked.units(correction)
    up = f"more in {entry.law}" if entry.kind == "add" else f"factor of {entry.law}, less 1"
    across = named(entry.signal)
    return _with(up, law), _with(across, signal)


def _with(text: str, unit: str) -> str:
    text = text.replace("_", " ")
    return text if unit == "1" else f"{text} [{unit}]"


def curve(asked: Asked, correction: Correction) -> dict[str, Any]:
    """Return the curve with its band, the shape that it looks like, and where the record has been."""
    x, (value, low, high) = _grid(correction)
    none, quiet = {"width": 0, "color": pictures.MODEL}, {"hoverinfo": "skip"}
    filled = {"fill": "tonexty", "fillcolor": _BAND, "hoverinfo": "skip"}
    traces = [
        Trace("", x, low, none, quiet),
        Trace("95 % band", x, high, none, filled),
        Trace("curve", x, value, {"color": pictures.MODEL, "width": 2.5}),
    ]
    if (like := shape_values(correction, x)) is not None:
        text = wording.shape_name(correction.shape)
        traces.append(
            Trace(text, x, like, {"color": pictures.FITTED, "width": 1.5, "dash": "dash"})
        )
    rug = correction.entry.visited
    floor = min(float(low.min()), 0.0) - 0.06 * float(high.max() - low.min())
    marker = {"symbol": "line-ns-open", "size": 9, "color": "#52616e"}
    more = {"mode": "markers", "marker": marker, "hoverinfo": "skip"}
    traces.append(Trace("where the record has been", rug, np.full(len(rug), floor), {}, more))
    up, across = titles(asked, correction)
    return stacked([Panel(_titled(up), _HIGH, traces)], _titled(across))


def _titled(text: str) -> Markup:
    name, bracket, unit = text.partition(" [")
    return Markup(f"{escaped(name)} [{pretty(unit.rstrip(']'))}]") if bracket else escaped(text)


def law_map(asked: Asked) -> tuple[dict[str, Any], str]:
    """Return the map of laws over signals, and what is not on it; of what is remembered of a signal the best."""
    found = asked.found.entries if asked.found else []
    best: dict[tuple[str, tuple[str, bool]], Entry] = {}
    for e in found:  # the most telling first
        best.setdefault((e.law, (e.signal.name, bool(e.signal.memory))), e)
    laws = list(dict.fromkeys(law for law, _ in best))
    signals = list(dict.fromkeys(signal for _, signal in best))
    left = f"{len(laws[_MOST:])} laws and {len(signals[_MOST:])} signals that tell less are not shown. "
    left = left if len(laws) > _MOST or len(signals) > _MOST else ""
    laws, signals = laws[:_MOST], signals[:_MOST]
    evidence = np.full((len(laws), len(signals)), np.nan)
    texts = [["" for _ in signals] for _ in laws]
    for i, law in enumerate(laws):
        for k, signal in enumerate(signals):
            if (one := best.get((law, signal))) is not None:
                evidence[i, k] = max(float(one.curve.gain), 1.0)
                factor = " as a factor" if one.kind == "multiply" else ""
                texts[i][k] = f"{law}{factor} over {named(one.signal)}: {one.curve.gain:.3g}"
    columns = [f"{name}{', remembered' if memory else ''}" for name, memory in signals]
    return heat_map(laws, columns, evidence, texts, "evidence"), left


def draw(asked: Asked, correction: Correction, path: Path | None = None) -> Figure:
    """Draw the curve with its band as a picture.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    x, (value, low, high) = _grid(correction)
    figure, (axis,) = pictures.panels(
        1, f"{correction.entry.law} over {named(correction.entry.signal)}"
    )
    figure.set_size_inches(7.5, 4.5)
    axis.fill_between(x, low, high, color=pictures.MODEL, alpha=0.18, lw=0, label="95 % band")
    axis.plot(x, value, color=pictures.MODEL, lw=2, label="curve")
    if (like := shape_values(correction, x)) is not None:
        axis.plot(
            x,
            like,
            color=pictures.FITTED,
            lw=1.2,
            ls="--",
            label=wording.shape_name(correction.shape),
        )
    rug = correction.entry.visited
    axis.plot(
        rug,
        np.full(len(rug), 0.02),
        "|",
        color="#52616e",
        ms=8,
        transform=axis.get_xaxis_transform(),
        label="where the record has been",
    )
    axis.axhline(0.0, color="#9aa5af", lw=0.8)
    up, across = titles(asked, correction)
    axis.set_ylabel(up)
    axis.set_xlabel(across)
    axis.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, borderaxespad=0.1
    )
    if path is not None:
        pictures.save(figure, path)
    return figure
