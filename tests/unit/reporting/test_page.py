"""Texts on a page stay texts, whatever stands in them."""

from __future__ import annotations

import numpy as np

from orchestration.reporting.page import Markup, Page, escaped
from orchestration.reporting.plots import Panel, Trace, stacked
from tests.support.pages import figures_of


def test_a_title_cannot_end_the_script_it_stands_in():
    made = Page("code", "code")
    made.plot(
        stacked(
            [Panel("</script><script>", 100, [Trace("</script>", np.arange(2.0), np.ones(2), {})])],
            "",
        ),
        "",
    )
    (figure,) = figures_of("".join(made.parts))
    assert figure["data"][0]["legendgroup"] == "</script>"


def test_markup_is_not_escaped_twice():
    assert escaped(escaped("a & b")) == "a &amp; b"
    assert isinstance(escaped("a"), Markup)
