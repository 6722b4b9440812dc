"""Claims: elements of a page show a name for people first, and numbers as they are printed."""

from __future__ import annotations

import pytest

from orchestration.reporting.html import elements
from orchestration.reporting.html.elements import Bar
from tests.support.pages import words_of


def test_the_identifier_stands_in_small_print():
    text = elements.named("Series resistance", "R1", "of leads & contacts")
    assert words_of(text) == "Series resistance R1 of leads & contacts"
    assert '<code class="id">R1</code>' in text


@pytest.mark.parametrize(
    ("identifier", "text", "words"),
    [("Speed", "how fast", "Speed how fast"), ("v", "speed", "Speed v")],
)
def test_nothing_is_told_twice(identifier, text, words):
    assert words_of(elements.named("Speed", identifier, text)) == words


def test_the_longest_bar_is_as_wide_as_the_page():
    bars = [Bar(str(length), "#000", length, "") for length in (1.0, 4.0, float("inf"))]
    chart = elements.bar_chart("errors", bars)
    assert [part.split("%")[0] for part in chart.split("width:")[1:]] == ["25.0", "100.0", "0.0"]


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        ("1.0 mV", "2.0 mV", "1.0 … 2.0 mV"),
        ("900 mV", "1.1 V", "900 mV … 1.1 V"),
        ("0.1", "0.2", "0.1 … 0.2"),
    ],
)
def test_a_unit_that_both_ends_have_is_told_once(low, high, text):
    assert elements.format_ends(low, high) == text
