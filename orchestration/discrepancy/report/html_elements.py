"""HTML fragments of a report: chips, bars, intervals, and numbers with units as printed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fmus.kit import Component, Effect
from fmus.kit.build import relaxed_assumption
from fmus.kit.declare import summary
from fmus.kit.titles import capitalised, effect_title
from fmus.kit.units import Described, format_prefixed
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict
from orchestration.discrepancy.report.wording import parameter_title
from orchestration.identify.effect_sizes import NOT_DETERMINED
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting.html import Markup, escaped, format_ends, format_quantities
from orchestration.reporting.pictures import FITTED

_INTERVAL_WIDTH = 180  # pixels
_INTERVAL_HEIGHT = 18  # pixels
_SHORTEST_REACH = math.log(1.1)  # of an axis of ratios to nominal, however close all values are
_LONGEST_REACH = math.log(4.0)  # beyond which intervals are cut
_MARGIN = 1.15  # of an axis beyond the farthest value
_GREY = "#52616e"
_UNINFORMATIVE = 1e4  # ratio of the ends of an interval beyond which it says nothing


def number_above_bar(value: float, longest: float) -> Markup:
    """Return a number above a bar, whose length is the share of the number in the largest one."""
    share = 100.0 * max(value, 0.0) / longest if longest > 0.0 else 0.0
    return Markup(f'{value:.1f}<span class="gain" style="width:{share:.1f}%"></span>')


@dataclass(frozen=True)
class AxisScale:
    """Axis on which confidence intervals are drawn as ratios to their nominal values.

    Attributes
    ----------
    reach : float
        Logarithm of the ratio at the right end; minus that is at the left end.
    """

    reach: float

    @classmethod
    def covering(cls, estimates: Sequence[Estimate]) -> AxisScale:
        """Return the shortest axis with all values on it; of one too far out, the end is shown."""
        distances = [
            abs(math.log(e.value / e.nominal))
            for e in estimates
            if e.nominal and e.value / e.nominal > 0.0
        ]
        farthest = max([_MARGIN * distance for distance in distances] + [_SHORTEST_REACH])
        return cls(min(farthest, _LONGEST_REACH))

    @property
    def header(self) -> Markup:
        """The ratios at both ends and the middle, as the heading of a column of intervals."""
        factor = f"{math.exp(self.reach):.2g}"
        labels = (
            (2, "start", f"÷ {factor}"),
            (_INTERVAL_WIDTH / 2, "middle", "nominal"),
            (_INTERVAL_WIDTH - 2, "end", f"× {factor}"),
        )
        texts = "".join(
            f'<text x="{x}" y="12" text-anchor="{anchor}">{text}</text>'
            for x, anchor, text in labels
        )
        style = f'font-size="12" font-weight="400" fill="{_GREY}"'
        return Markup(
            f'<svg width="{_INTERVAL_WIDTH}" height="16" {style} role="img">{texts}</svg>'
        )

    def draw_interval(self, e: Estimate, differs: bool) -> str:
        """Return an estimate as a dot on its interval, cut where the axis ends.

        Parameters
        ----------
        e : Estimate
        differs : bool
            Whether it differs significantly from nominal, and is coloured.

        Returns
        -------
        str
            Empty where the ratio to nominal has no logarithm.
        """
        if not (e.nominal and e.value / e.nominal > 0.0):
            return ""
        ends = sorted(self._position(end / e.nominal) for end in e.interval)
        dot = self._position(e.value / e.nominal)
        colour = FITTED if differs else _GREY
        y = _INTERVAL_HEIGHT / 2
        middle = _INTERVAL_WIDTH / 2
        return Markup(
            f'<svg class="interval" width="{_INTERVAL_WIDTH}" height="{_INTERVAL_HEIGHT}"'
            f' role="img" aria-label="interval"><line x1="{middle}" x2="{middle}" y1="0"'
            f' y2="{_INTERVAL_HEIGHT}" stroke="#c9d3dc"/><line x1="{ends[0]:.1f}"'
            f' x2="{ends[1]:.1f}" y1="{y}" y2="{y}" stroke="{colour}" stroke-width="2"/><circle'
            f' cx="{dot:.1f}" cy="{y}" r="3.5" fill="{colour}"/></svg>'
        )

    def _position(self, ratio: float) -> float:
        """Return where a ratio to nominal is drawn, pixels from the left."""
        if ratio <= 0.0:
            share = -1.0
        elif ratio < math.inf:
            share = math.log(ratio) / self.reach
        else:
            share = 1.0
        return _INTERVAL_WIDTH / 2 * (1.0 + min(max(share, -1.0), 1.0))


def format_probability(p: float) -> Markup:
    """Return a small probability as people write it."""
    if p >= 1e-3:
        return Markup(f"{p:.2g}")
    if p == 0.0:
        return Markup("&lt; 10<sup>−300</sup>")
    return format_quantities(f"{p:.1e}")


def format_change(e: Estimate) -> str:
    """Return by how much a value differs from nominal; empty where nominal is zero."""
    if not e.nominal:
        return ""
    return format_quantities(f"{100.0 * (e.value / e.nominal - 1.0):+.1f} %")


class FormattedEstimate(NamedTuple):
    """An estimate as a page prints it, with units."""

    value: Markup
    interval: Markup
    nominal: Markup


def format_estimate(e: Estimate, declared: Described) -> FormattedEstimate:
    """Return an estimate with as many digits as its interval gives meaning to.

    Parameters
    ----------
    e : Estimate
        SI.
    declared : Described
        Says in which unit it is shown.
    """
    low, high = e.interval
    half = 0.5 * (high - low)
    known = math.log10(abs(e.value) / half) if e.value and 0.0 < half < math.inf else 0.0
    digits = min(max(math.ceil(known) + 2, 3), 8)
    is_vague = 0.0 < _UNINFORMATIVE * low < high
    if math.isfinite(low) and math.isfinite(high) and not is_vague:
        ends = (format_prefixed(end, declared, digits, like=e.value) for end in e.interval)
        interval = format_ends(*ends)
    else:
        interval = NOT_DETERMINED
    return FormattedEstimate(
        escaped(format_prefixed(e.value, declared, digits)),
        escaped(interval),
        escaped(format_prefixed(e.nominal, declared, like=e.value)),
    )


def effect_summary(cls: type[Component], effect: type[Effect]) -> Markup:
    """Return the first line of an effect's doc, and what its model assumes in place of that.

    Parameters
    ----------
    cls : type[Component]
        The model.
    effect : type[Effect]
    """
    text = re.sub(r"``(.+?)``", r"<code>\1</code>", escaped(summary(effect)))
    words, number = relaxed_assumption(cls, effect)
    small = f" <small>({number})</small>" if number else ""
    return Markup(f"{text}; {escaped(words)}{small}" if words else f"{text}{small}")


def verdict_details(diagnosis: Diagnosis) -> list[Markup]:
    """Return lines that explain a verdict: what the effects do, or how far parameters differ."""
    lines = []
    cls = diagnosis.selection.base.candidate.cls
    for step in diagnosis.selection.steps:
        for fitted in (step.chosen, *step.alternatives):
            lines.append(
                Markup(
                    f"<b>{escaped(effect_title(fitted.effect))}</b>"
                    f' <code class="id">{escaped(fitted.effect_name)}</code>:'
                    f" {effect_summary(cls, fitted.effect)}"
                )
            )
    if diagnosis.verdict is Verdict.RECALIBRATE:
        lines += [_parameter_change(diagnosis, name) for name in diagnosis.changed]
    return lines


def _parameter_change(diagnosis: Diagnosis, name: str) -> Markup:
    """Return value and nominal value of a parameter in one line, and what the parameter is."""
    e = diagnosis.estimates[name]
    declared = diagnosis.final.problem.declared[name]
    formatted = format_estimate(e, declared)
    change = f" ({format_change(e)})" if e.nominal else ""
    return Markup(
        f"<b>{escaped(capitalised(parameter_title(diagnosis, name)))}</b>"
        f' <code class="id">{escaped(name)}</code>: {formatted.value} instead of'
        f" {formatted.nominal}{change}; {escaped(declared.doc)}"
    )
