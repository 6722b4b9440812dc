"""What is to be read and drawn on a page of ours."""

from __future__ import annotations

import html
import json
import re

from plotly.offline import get_plotlyjs

PLOTLY = get_plotlyjs()


def content(text):
    """What is on a page, without the library that draws."""
    assert text.count(PLOTLY) == 1
    return text.replace(PLOTLY, "")


def words_of(text):
    """What is to be read on a page."""
    text = re.sub(r"<(script|style|noscript).*?</\1>", "", content(text), flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def figures_of(text):
    return [
        json.loads(data)
        for data in re.findall(r'<script type="application/json">(.*?)</script>', text)
    ]
