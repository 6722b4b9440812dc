"""Elements that several kinds of pages share: chips, names, bar charts and quantities."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from orchestration.reporting.html.page import Markup, escaped


def chip(kind: str, text: str) -> Markup:
    """Return a short text on a rounded background; the kind is the CSS class of its colour."""
    return Markup(f'<span class="chip {escaped(kind.replace(" ", ""))}">{escaped(text)}</span>')


def two_lines(first: str, second: str) -> Markup:
    """Return a line in bold above a grey one."""
    below = f'<span class="muted">{escaped(second)}</span>' if second else ""
    return Markup(f'<span class="two"><b>{escaped(first)}</b>{below}</span>')


def named(title: str, identifier: str, text: str) -> Markup:
    """Return a title in bold, its identifier in small print, and a description below."""
    small = "" if title == identifier else f'<code class="id">{escaped(identifier)}</code>'
    is_repetition = text == title[:1].lower() + title[1:]
    below = f'<span class="muted">{escaped(text)}</span>' if text and not is_repetition else ""
    return Markup(f'<span class="two"><b>{escaped(title)}</b> {small}{below}</span>')


def muted_paragraph(text: str) -> Markup:
    """Return a paragraph in grey, for an explanation of the element above it."""
    return Markup(f'<p class="muted">{escaped(text)}</p>')


class Bar(NamedTuple):
    """A bar of a bar chart.

    Attributes
    ----------
    name : str
        Text to the left of the bar.
    colour : str
        Colour in CSS.
    length : float
        Length relative to other bars; no bar is drawn if it is infinite or NaN.
    text : str
        Text to the right of the bar.
    """

    name: str
    colour: str
    length: float
    text: str


def bar_chart(title: str, bars: Sequence[Bar]) -> Markup:
    """Return horizontal bars below a title, the longest as wide as its column."""
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
    """Return an interval as text, with the unit once if both ends have the same."""
    number, space, unit = low.partition(" ")
    is_shared = bool(space) and high.partition(" ")[2] == unit
    return f"{number if is_shared else low} … {high}"


def format_quantities(text: str) -> Markup:
    """Return values with units in mathematical notation: 2·10⁶ N·s/m for ``2e+06 N*s/m``."""
    dotted = re.sub(r"(?<=\d )degC\b", "°C", escaped(text)).replace("*", "·")
    powers_of_ten = re.sub(r"(?<=\d)e([+-])0*(\d+)", _power_of_ten, dotted)
    signed = re.sub(r"(?<![\w.])-(?=\d)", "−", powers_of_ten)
    return Markup(re.sub(r"\^([-−]?\d+)", _superscript, signed))


def _power_of_ten(exponent: re.Match[str]) -> str:
    sign = exponent[1].replace("+", "").replace("-", "−")
    return f"·10<sup>{sign}{exponent[2]}</sup>"


def _superscript(exponent: re.Match[str]) -> str:
    return f"<sup>{exponent[1].replace('-', '−')}</sup>"
