"""Small drawings in the text of a report: chips, bars, intervals about a nominal value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from orchestration.identify.estimate import Estimate
from orchestration.reporting.page import Markup, escaped
from orchestration.reporting.pictures import FITTED

STYLE = """
body { max-width: 64rem } h1 { font-size: 1.7rem } h2 { margin-top: 2.4rem; border-top: 1px solid #e3e8ec;
  padding-top: 1.2rem } p.verdict { background: #f7f9fb; padding: 0.8rem 1rem; border-radius: 0 6px 6px 0 }
.chip { display: inline-block; padding: 0.02rem 0.55rem; border-radius: 1rem; font-size: 0.85em; white-space: nowrap;
  background: #e9eef2; color: #3c4a57 }
.chip.consistent, .chip.named { background: #dcefe2; color: #155c2e } .chip.recalibrate { background: #dcebf6;
  color: #0b4f7a } .chip.cause, .chip.differs { background: #fbe0e3; color: #8f1f30 }
.chip.ambiguous, .chip.nottoldapart { background: #fbedcf; color: #734d05 } .chip.unexplained { background: #e9e1f5;
  color: #4d2c82 } p.verdict .chip { font-weight: 600; margin-right: 0.4rem }
.detail { display: block; font-size: 0.95rem; color: #3c4a57; margin-top: 0.35rem } sup { line-height: 0 }
table { width: 100% } td .two { display: block; white-space: normal } td:first-child .two { min-width: 12rem }
td .two b { font-weight: 600 } td .two .muted { display: block; line-height: 1.35 }
.bars { display: grid; grid-template-columns: minmax(6rem, max-content) 1fr max-content; gap: 0.25rem 0.8rem;
  align-items: center; margin: 0.6rem 0 1.2rem; font-variant-numeric: tabular-nums }
.bars b { grid-column: 1 / -1 } .bars .track { height: 0.8rem; background: #f2f5f8; border-radius: 2px }
.bars .track i { display: block; height: 100%; min-width: 2px; border-radius: 2px }
math { font-size: 1.25rem; margin: 0.8rem 0 1rem; overflow-x: auto; max-width: 100% }
.gain { display: block; height: 4px; border-radius: 2px; background: #0b6aa2; margin-top: 0.3rem; min-width: 1px }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 0 1.2rem }
.pair figure { min-width: 0; margin: 0.4rem 0 } svg.interval { display: block; margin-top: 0.35rem }
@media (max-width: 640px) {
  .bars { grid-template-columns: 1fr max-content; grid-auto-flow: dense } .bars .track { grid-column: 1 / -1 }
  tr:has(th) { display: none } table, tbody { display: block; border: 0 }
  tr { display: block; border-bottom: 1px solid #c9d3dc; padding: 0.6rem 0 }
  td { display: block; position: relative; border: 0; padding: 0.1rem 0 0.1rem 8rem } td:first-child { padding-left: 0 }
  td:not(:first-child)::before { content: attr(data-label); position: absolute; left: 0; color: #52616e } }
"""
_WIDTH, _HEIGHT = 180, 18  # pixels of an interval
_LEAST, _MOST = (
    math.log(1.1),
    math.log(4.0),
)  # of the logarithm of the ratio to nominal that fits in


def chip(kind: str, text: str) -> Markup:
    """Return a word on a coloured ground."""
    return Markup(f'<span class="chip {kind.replace(" ", "")}">{escaped(text)}</span>')


def two(first: str, second: str) -> Markup:
    """Return a line in bold above a lighter one."""
    below = f'<span class="muted">{escaped(second)}</span>' if second else ""
    return Markup(f'<span class="two"><b>{escaped(first)}</b>{below}</span>')


def bar(value: float, most: float) -> Markup:
    """Return a number above a bar as long as it is."""
    share = 100.0 * max(value, 0.0) / most if most > 0.0 else 0.0
    return Markup(f'{value:.1f}<span class="gain" style="width:{share:.1f}%"></span>')


def bars(title: str, rows: Sequence[tuple[str, str, float, str]]) -> Markup:
    """Return bars, each with its name, its colour, its length and a text."""
    most = max((size for *_, size, _ in rows if math.isfinite(size)), default=0.0)
    parts = [f"<b>{escaped(title)}</b>"]
    for name, colour, size, text in rows:
        share = 100.0 * size / most if most > 0.0 and math.isfinite(size) else 0.0
        parts.append(
            f'<span>{escaped(name)}</span><span class="track"><i style="width:{share:.1f}%;background:{colour}"></i>'
            f'</span><span class="size">{escaped(text)}</span>'
        )
    return Markup(f'<div class="bars">{"".join(parts)}</div>')


def aside(text: str) -> Markup:
    """Return a paragraph that explains."""
    return Markup(f'<p class="muted">{escaped(text)}</p>')


@dataclass(frozen=True)
class Scale:
    """How intervals are drawn beside nominal values: the logarithm of their ratio, from -reach to reach."""

    reach: float

    @classmethod
    def of(cls, estimates: Sequence[Estimate]) -> Scale:
        """Take one on which all values can be seen."""
        ratios = [
            abs(math.log(e.value / e.nominal))
            for e in estimates
            if e.nominal and e.value / e.nominal > 0.0
        ]
        return cls(min(max([1.15 * r for r in ratios] + [_LEAST]), _MOST))

    @property
    def title(self) -> Markup:
        """Its ends and its middle."""
        factor = f"{math.exp(self.reach):.2g}"
        ends = "".join(
            f'<text x="{x}" y="12" text-anchor="{side}">{text}</text>'
            for x, side, text in (
                (2, "start", f"÷ {factor}"),
                (_WIDTH / 2, "middle", "nominal"),
                (_WIDTH - 2, "end", f"× {factor}"),
            )
        )
        style = 'font-size="12" font-weight="400" fill="#52616e"'
        return Markup(f'<svg width="{_WIDTH}" height="16" {style} role="img">{ends}</svg>')

    def drawn(self, e: Estimate, differs: bool) -> str:
        """Draw an estimate: a dot on its interval, cut where the scale ends."""
        if not (e.nominal and e.value / e.nominal > 0.0):
            return ""
        ends = sorted(self._place(end / e.nominal) for end in e.interval)
        colour = FITTED if differs else "#52616e"
        y, middle, dot = _HEIGHT / 2, _WIDTH / 2, self._place(e.value / e.nominal)
        return Markup(
            f'<svg class="interval" width="{_WIDTH}" height="{_HEIGHT}" role="img" aria-label="interval">'
            f'<line x1="{middle}" x2="{middle}" y1="0" y2="{_HEIGHT}" stroke="#c9d3dc"/>'
            f'<line x1="{ends[0]:.1f}" x2="{ends[1]:.1f}" y1="{y}" y2="{y}" stroke="{colour}" stroke-width="2"/>'
            f'<circle cx="{dot:.1f}" cy="{y}" r="3.5" fill="{colour}"/></svg>'
        )

    def _place(self, ratio: float) -> float:
        at = (
            math.log(ratio) / self.reach
            if 0.0 < ratio < math.inf
            else (-1.0 if ratio <= 0.0 else 1.0)
        )
        return _WIDTH / 2 * (1.0 + min(max(at, -1.0), 1.0))
