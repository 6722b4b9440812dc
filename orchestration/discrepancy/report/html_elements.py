"""HTML fragments of a report: chips, bars, intervals, and numbers with units as printed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fmus.kit import Effect, summary
from fmus.kit.units import Described, format_value
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict
from orchestration.discrepancy.report.wording import NOT_DETERMINED
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting import FITTED, Markup, escaped

STYLE = """
body { max-width: 64rem } h1 { font-size: 1.7rem } h2 { margin-top: 2.4rem; border-top: 1px solid \
#e3e8ec;
  padding-top: 1.2rem } p.verdict { background: #f7f9fb; padding: 0.8rem 1rem; border-radius: 0 \
6px 6px 0 }
.chip { display: inline-block; padding: 0.02rem 0.55rem; border-radius: 1rem; font-size: 0.85em; \
white-space: nowrap;
  background: #e9eef2; color: #3c4a57 }
.chip.consistent, .chip.named { background: #dcefe2; color: #155c2e } .chip.recalibrate { \
background: #dcebf6;
  color: #0b4f7a } .chip.cause, .chip.differs { background: #fbe0e3; color: #8f1f30 }
.chip.ambiguous, .chip.nottoldapart { background: #fbedcf; color: #734d05 } .chip.unexplained { \
background: #e9e1f5;
  color: #4d2c82 } p.verdict .chip { font-weight: 600; margin-right: 0.4rem }
.detail { display: block; font-size: 0.95rem; color: #3c4a57; margin-top: 0.35rem } sup { \
line-height: 0 }
table { width: 100% } td .two { display: block; white-space: normal } td:first-child .two { \
min-width: 12rem }
td .two b { font-weight: 600 } td .two .muted { display: block; line-height: 1.35 }
.bars { display: grid; grid-template-columns: minmax(6rem, max-content) 1fr max-content; gap: \
0.25rem 0.8rem;
  align-items: center; margin: 0.6rem 0 1.2rem; font-variant-numeric: tabular-nums }
.bars b { grid-column: 1 / -1 } .bars .track { height: 0.8rem; background: #f2f5f8; border-radius: \
2px }
.bars .track i { display: block; height: 100%; min-width: 2px; border-radius: 2px }
math { font-size: 1.25rem; margin: 0.8rem 0 1rem; overflow-x: auto; max-width: 100% }
.gain { display: block; height: 4px; border-radius: 2px; background: #0b6aa2; margin-top: 0.3rem; \
min-width: 1px }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); \
gap: 0 1.2rem }
.pair figure { min-width: 0; margin: 0.4rem 0 } svg.interval { display: block; margin-top: 0.35rem }
@media (max-width: 640px) {
  .bars { grid-template-columns: 1fr max-content; grid-auto-flow: dense } .bars .track { \
grid-column: 1 / -1 }
  tr:has(th) { display: none } table, tbody { display: block; border: 0 }
  tr { display: block; border-bottom: 1px solid #c9d3dc; padding: 0.6rem 0 }
  td { display: block; position: relative; border: 0; padding: 0.1rem 0 0.1rem 8rem } \
td:first-child { padding-left: 0 }
  td:not(:first-child)::before { content: attr(data-label); position: absolute; left: 0; color: \
#52616e } }
"""
_INTERVAL_WIDTH = 180  # pixels
_INTERVAL_HEIGHT = 18  # pixels
_SHORTEST_REACH = math.log(1.1)  # of an axis of ratios to nominal, however close all values are
_LONGEST_REACH = math.log(4.0)  # beyond which intervals are cut
_MARGIN = 1.15  # of an axis beyond the farthest value
_GREY = "#52616e"
_UNINFORMATIVE = 1e4  # ratio of the ends of an interval beyond which it says nothing


def chip(kind: str, text: str) -> Markup:
    """Return a word on a ground that is coloured by its kind."""
    return Markup(f'<span class="chip {kind.replace(" ", "")}">{escaped(text)}</span>')


def two_lines(first: str, second: str) -> Markup:
    """Return a line in bold above a lighter one."""
    below = f'<span class="muted">{escaped(second)}</span>' if second else ""
    return Markup(f'<span class="two"><b>{escaped(first)}</b>{below}</span>')


def muted_paragraph(text: str) -> Markup:
    """Return a paragraph in grey, which explains what stands above it."""
    return Markup(f'<p class="muted">{escaped(text)}</p>')


def number_above_bar(value: float, longest: float) -> Markup:
    """Return a number above a bar, whose length is the share of the number in the largest one."""
    share = 100.0 * max(value, 0.0) / longest if longest > 0.0 else 0.0
    return Markup(f'{value:.1f}<span class="gain" style="width:{share:.1f}%"></span>')


class Bar(NamedTuple):
    """A bar of a bar chart.

    Attributes
    ----------
    name : str
        Shown to the left of it.
    colour : str
        As CSS has it.
    length : float
        Relative to the other bars; infinite or NaN is drawn as none.
    text : str
        Shown to the right of it.
    """

    name: str
    colour: str
    length: float
    text: str


def bar_chart(title: str, bars: Sequence[Bar]) -> Markup:
    """Return horizontal bars below a title, the longest as wide as the page."""
    finite = [bar.length for bar in bars if math.isfinite(bar.length)]
    longest = max(finite, default=0.0)
    parts = [f"<b>{escaped(title)}</b>"]
    for bar in bars:
        is_drawn = longest > 0.0 and math.isfinite(bar.length)
        share = 100.0 * bar.length / longest if is_drawn else 0.0
        parts.append(
            f'<span>{escaped(bar.name)}</span><span class="track"><i'
            f' style="width:{share:.1f}%;background:{bar.colour}"></i></span><span'
            f' class="size">{escaped(bar.text)}</span>'
        )
    return Markup(f'<div class="bars">{"".join(parts)}</div>')


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


def format_quantities(text: str) -> Markup:
    """Return values with units as they are printed: 2·10⁶ N·s/m for ``2e+06 N*s/m``."""
    dotted = escaped(text).replace("*", "·")
    powers_of_ten = re.sub(r"(?<=\d)e([+-])0*(\d+)", _power_of_ten, dotted)
    signed = re.sub(r"(?<![\w.])-(?=\d)", "−", powers_of_ten)
    return Markup(re.sub(r"\^([-−]?\d+)", _superscript, signed))


def _power_of_ten(exponent: re.Match[str]) -> str:
    sign = exponent[1].replace("+", "").replace("-", "−")
    return f"·10<sup>{sign}{exponent[2]}</sup>"


def _superscript(exponent: re.Match[str]) -> str:
    return f"<sup>{exponent[1].replace('-', '−')}</sup>"


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
        unit = f" {declared.display or declared.unit}"
        ends = [format_value(end, declared, digits).removesuffix(unit) for end in e.interval]
        interval = " … ".join(ends)
    else:
        interval = NOT_DETERMINED
    return FormattedEstimate(
        format_quantities(format_value(e.value, declared, digits)),
        format_quantities(interval),
        format_quantities(format_value(e.nominal, declared)),
    )


def effect_summary(effect: type[Effect]) -> Markup:
    """Return the first line of an effect's doc, and which assumption of its model it relaxes."""
    text = re.sub(r"``(.+?)``", r"<code>\1</code>", escaped(summary(effect)))
    assumption = effect.assumption
    relaxed = f"assumption {assumption}" if isinstance(assumption, int) else escaped(assumption)
    return Markup(f"{text}; relaxes {relaxed}" if relaxed else text)


def verdict_details(diagnosis: Diagnosis) -> list[Markup]:
    """Return lines that explain a verdict: what the effects do, or how far parameters differ."""
    lines = []
    for step in diagnosis.selection.steps:
        for fitted in (step.chosen, *step.alternatives):
            lines.append(
                Markup(f"<b>{escaped(fitted.effect_name)}</b>: {effect_summary(fitted.effect)}")
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
        f"<b>{escaped(name)}</b>: {formatted.value} instead of {formatted.nominal}{change};"
        f" {escaped(declared.doc)}"
    )
