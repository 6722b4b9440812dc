"""Elements of pages that several kinds of them share: chips, names, bars, and quantities."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from orchestration.reporting.html.page import Markup, escaped


def chip(kind: str, text: str) -> Markup:
    """Return a word on a ground that is coloured by its kind."""
    return Markup(f'<span class="chip {kind.replace(" ", "")}">{escaped(text)}</span>')


def two_lines(first: str, second: str) -> Markup:
    """Return a line in bold above a lighter one."""
    below = f'<span class="muted">{escaped(second)}</span>' if second else ""
    return Markup(f'<span class="two"><b>{escaped(first)}</b>{below}</span>')


def named(title: str, identifier: str, text: str) -> Markup:
    """Return a name for people above the identifier in small print, and what it is."""
    small = "" if title == identifier else f'<code class="id">{escaped(identifier)}</code>'
    says_more = text and text != title[:1].lower() + title[1:]
    below = f'<span class="muted">{escaped(text)}</span>' if says_more else ""
    return Markup(f'<span class="two"><b>{escaped(title)}</b> {small}{below}</span>')


def muted_paragraph(text: str) -> Markup:
    """Return a paragraph in grey, which explains what stands above it."""
    return Markup(f'<p class="muted">{escaped(text)}</p>')


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


def format_ends(low: str, high: str) -> str:
    """Return the ends of an interval, with the unit once where both have the same."""
    number, space, unit = low.partition(" ")
    is_shared = bool(space) and high.partition(" ")[2] == unit
    return f"{number if is_shared else low} … {high}"


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
