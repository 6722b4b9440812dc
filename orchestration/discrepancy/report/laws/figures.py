"""Figures of a correction, drawn as a curve, and of the map of laws over signals."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.titles import in_words
from orchestration.discrepancy.laws import Correction, Entry
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.law_report import (
    LawReport,
    describe_signal,
    shape_beside_line,
)
from orchestration.reporting import pictures
from orchestration.reporting.html import (
    Markup,
    Panel,
    Trace,
    escaped,
    format_quantities,
    heat_map,
    stacked,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS = 300  # of a curve
_HEIGHT = 360  # pixels
_LARGEST_MAP = 24  # laws, and signals, that a map has room for
_BAND_COLOUR = "#d4e5ef"


class _Curve(NamedTuple):
    """A correction with its 95 % band, over values of its signal; each shape (n,), SI."""

    x: Array
    value: Array
    low: Array
    high: Array


def _curve(correction: Correction) -> _Curve:
    """Return the curve at many places, its knots among them."""
    knots = correction.entry.basis.knots
    x = np.union1d(np.linspace(knots[0], knots[-1], _POINTS), knots)
    return _Curve(x, *correction.band_at(x))


def axis_titles(law_report: LawReport, correction: Correction) -> tuple[str, str]:
    """Return the titles of the vertical and of the horizontal axis, with units."""
    entry = correction.entry
    law_unit, signal_unit = law_report.units(correction)
    vertical = f"more in {entry.law}" if entry.kind == "add" else f"factor of {entry.law}, less 1"
    horizontal = describe_signal(entry.signal)
    return _with_unit(vertical, law_unit), _with_unit(horizontal, signal_unit)


def _with_unit(name: str, unit: str) -> str:
    text = in_words(name)
    return text if unit == "1" else f"{text} [{unit}]"


def plot_curve(law_report: LawReport, correction: Correction) -> Markup:
    """Draw the curve with its band, its named shape, and where the record has been."""
    curve = _curve(correction)
    traces = [
        Trace("95 % band", curve.x, curve.high, _BAND_COLOUR, low=curve.low),
        Trace("curve", curve.x, curve.value, pictures.MODEL, 2.5),
    ]
    shape = shape_beside_line(correction, curve.x)
    if shape is not None:
        name = wording.shape_name(correction.shape)
        traces.append(Trace(name, curve.x, shape, pictures.FITTED, dashed=True))
    visited = correction.entry.visited
    lowest = float(curve.low.min())
    floor = min(lowest, 0.0) - 0.06 * float(curve.high.max() - curve.low.min())
    at_floor = np.full(len(visited), floor)
    traces.append(Trace("where the record has been", visited, at_floor, "#52616e", dots=True))
    vertical, horizontal = axis_titles(law_report, correction)
    return stacked([Panel(_typeset_title(vertical), _HEIGHT, traces)], _typeset_title(horizontal))


def _typeset_title(text: str) -> Markup:
    """Return the title of an axis for a page, its unit as it is printed."""
    name, bracket, unit = text.partition(" [")
    if not bracket:
        return escaped(text)
    return Markup(f"{escaped(name)} [{format_quantities(unit.rstrip(']'))}]")


def plot_law_map(law_report: LawReport) -> tuple[Markup, str]:
    """Draw the map of laws over signals; of what is remembered of a signal the best.

    Returns
    -------
    chart : Markup
    omitted : str
        Sentence on what has no room on it; empty where all has.
    """
    best = _best_entries(law_report)
    all_laws = list(dict.fromkeys(law for law, _ in best))
    all_signals = list(dict.fromkeys(signal for _, signal in best))
    omitted = ""
    if len(all_laws) > _LARGEST_MAP or len(all_signals) > _LARGEST_MAP:
        omitted = (
            f"{len(all_laws[_LARGEST_MAP:])} laws and {len(all_signals[_LARGEST_MAP:])} signals"
            " that tell less are not shown. "
        )
    laws = all_laws[:_LARGEST_MAP]
    signals = all_signals[:_LARGEST_MAP]
    evidence = np.full((len(laws), len(signals)), np.nan)
    texts = [["" for _ in signals] for _ in laws]
    for i, law in enumerate(laws):
        for k, signal in enumerate(signals):
            entry = best.get((law, signal))
            if entry is not None:
                evidence[i, k] = max(float(entry.curve.gain), 1.0)
                texts[i][k] = _describe_entry(entry)
    columns = [f"{name}, remembered" if remembered else name for name, remembered in signals]
    return heat_map(laws, columns, evidence, texts, "evidence"), omitted


def _best_entries(law_report: LawReport) -> dict[tuple[str, tuple[str, bool]], Entry]:
    """Return the best entry for every law and signal, by the law and whether it is remembered."""
    best: dict[tuple[str, tuple[str, bool]], Entry] = {}
    entries = law_report.found.entries if law_report.found else []
    for entry in entries:  # the most telling first
        best.setdefault((entry.law, (entry.signal.name, bool(entry.signal.memory))), entry)
    return best


def _describe_entry(entry: Entry) -> str:
    factor = " as a factor" if entry.kind == "multiply" else ""
    return f"{entry.law}{factor} over {describe_signal(entry.signal)}: {entry.curve.gain:.3g}"


def draw_curve(law_report: LawReport, correction: Correction) -> Figure:
    """Draw the curve with its band as a picture.

    Parameters
    ----------
    law_report : LawReport
    correction : Correction

    Returns
    -------
    matplotlib.figure.Figure
    """
    curve = _curve(correction)
    entry = correction.entry
    figure, (axis,) = pictures.panels(1, f"{entry.law} over {describe_signal(entry.signal)}")
    figure.set_size_inches(7.5, 4.5)
    axis.fill_between(
        curve.x, curve.low, curve.high, color=pictures.MODEL, alpha=0.18, lw=0, label="95 % band"
    )
    axis.plot(curve.x, curve.value, color=pictures.MODEL, lw=2, label="curve")
    shape = shape_beside_line(correction, curve.x)
    if shape is not None:
        name = wording.shape_name(correction.shape)
        axis.plot(curve.x, shape, color=pictures.FITTED, lw=1.2, ls="--", label=name)
    axis.plot(
        entry.visited,
        np.full(len(entry.visited), 0.02),
        "|",
        color="#52616e",
        ms=8,
        transform=axis.get_xaxis_transform(),
        label="where the record has been",
    )
    axis.axhline(0.0, color="#9aa5af", lw=0.8)
    vertical, horizontal = axis_titles(law_report, correction)
    axis.set_ylabel(vertical)
    axis.set_xlabel(horizontal)
    axis.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, borderaxespad=0.1
    )
    return figure
