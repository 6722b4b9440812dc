"""Words and drawings of a page of ours."""

from __future__ import annotations

import html
import re
from typing import NamedTuple

_CHART = re.compile(r'<div class="chart">.*?</figure>', re.S)
_PANEL = re.compile(r'<p class="title">(.*?)</p><div class="plot".*?<svg.*?>(.*?)</svg>', re.S)
_LINE = re.compile(r'<path d="(M[^"]*)" stroke="(#[0-9a-f]+)"')


class DrawnPanel(NamedTuple):
    """A panel of a chart: its title, and lines by colour, each as its points in the panel."""

    title: str
    lines: dict[str, list[tuple[int, int]]]


def words_of(text):
    """Return the visible words of a page."""
    text = re.sub(r"<(script|style|noscript).*?</\1>", "", text, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def charts_of(text):
    """The charts of a page, each as its panels."""
    return [
        [
            DrawnPanel(html.unescape(re.sub(r"<[^>]+>", "", title)), _lines(drawn))
            for title, drawn in _PANEL.findall(chart)
        ]
        for chart in _CHART.findall(text)
    ]


def _lines(drawn):
    return {colour: points_of(path) for path, colour in _LINE.findall(drawn)}


def points_of(path):
    """Points of a path of SVG, whose commands are M and l alone."""
    points = []
    for x, y, steps in re.findall(r"M(-?\d+) (-?\d+)(?:l([-\d ]+))?", path):
        points.append((int(x), int(y)))
        numbers = list(map(int, steps.split()))
        for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
            points.append((points[-1][0] + dx, points[-1][1] + dy))
    return points
