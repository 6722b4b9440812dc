"""Claims: charts show what they are given, where it is, and make no large page."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from orchestration.reporting.html.page import Page
from orchestration.reporting.html.plots import (
    MOST,
    Boundary,
    Panel,
    Trace,
    break_at_gaps,
    envelope,
    heat_map,
    stacked,
)
from tests.support.pages import charts_of, points_of, words_of

WIDE, HIGH = 2000, 1000  # of the coordinates of a panel
RED = "#ff0000"


def unit_panel(trace):
    """A panel from 0 to 1: a line that leaves its margins, beside one that makes no room."""
    frame = Trace("frame", trace.x[[0, -1]], np.array([0.05, 1.05]) / 1.1, "#0000ff")
    return Panel("a", 100, [replace(trace, makes_room=False), frame])


def drawn(trace, **about):
    """The points of a line in a panel from 0 to 1."""
    text = f"{stacked([unit_panel(trace)], 's', **about)}</figure>"
    return charts_of(text)[0][0].lines[RED]


def test_a_thinned_line_keeps_its_extremes():
    n = 180_000
    x, y = np.arange(n) * 0.1, np.random.default_rng(1).standard_normal(n)
    y[70_000], y[120_001], y[50_000:52_000] = 40.0, -40.0, np.nan
    at, values = envelope(x, y)
    assert values.size <= MOST
    assert np.all(np.diff(at) >= 0.0)
    known = np.isfinite(values)
    assert np.array_equal(values[known], y[np.searchsorted(x, at[known])])
    assert (values[known].max(), values[known].min()) == (40.0, -40.0)
    assert not known[(at > 5030.0) & (at < 5170.0)].any()
    assert np.array_equal(envelope(x[:MOST], y[:MOST])[0], x[:MOST])


def test_a_line_is_broken_at_a_gap_only():
    even, uneven = np.arange(20.0), np.logspace(0.0, 4.0, 60)
    rare = np.append(even, [120.0, 220.0])  # a step of many, as long as the one after it
    for x in (even, uneven, rare, even[:2]):
        assert np.array_equal(break_at_gaps(x, x)[1], x)
    x, y = break_at_gaps(np.delete(np.arange(60.0), np.s_[20:40]), np.ones(40))
    assert np.flatnonzero(np.isnan(y)).tolist() == [20]
    assert 19.0 < x[20] < 40.0


def test_a_long_record_of_many_outputs_makes_no_large_page():
    """Five hours at 10 Hz, ten outputs with three simulations and residuals each."""
    time, values = np.arange(180_000) / 36000.0, np.random.default_rng(1).standard_normal(180_000)
    lines = [Trace(str(k), time, values, RED) for k in range(4)]
    made = Page("long", "long")
    panels = [Panel(str(k), 100, lines) for k in range(20)]
    made.chart(stacked(panels, "time [h]", boundary=Boundary(3.0, "a", "b")), "")
    assert 1e5 < len(made.html()) < 7e5


def test_points_are_where_the_axes_say():
    x, y = np.array([0.0, 1.0, 3.0, 4.0]), np.array([0.0, 0.5, 0.25, 1.0])
    expected = [(0, HIGH), (WIDE // 4, HIGH // 2), (3 * WIDE // 4, 3 * HIGH // 4), (WIDE, 0)]
    assert drawn(Trace("line", x, y, RED)) == expected


def test_a_value_is_held_until_the_next_where_it_is_stepped():
    x, y = np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 0.5])
    held = [(0, HIGH), (WIDE // 2, HIGH), (WIDE // 2, 0), (WIDE, 0), (WIDE, HIGH // 2)]
    assert drawn(Trace("line", x, y, RED, stepped=True)) == held


def test_nothing_is_drawn_in_a_gap():
    x, y = np.arange(5.0), np.array([0.0, 0.0, np.nan, 1.0, 1.0])
    text = stacked([unit_panel(Trace("line", x, y, RED))], "s")
    (path,) = re.findall(rf'd="(M[^"]*)" stroke="{RED}"', text)
    assert path.count("M") == 2
    assert points_of(path) == [(0, HIGH), (500, HIGH), (1500, 0), (2000, 0)]


def test_a_logarithmic_axis_is_even_in_ratios():
    x = np.array([1.0, 10.0, 100.0])
    points = drawn(Trace("line", x, np.full(3, 0.5), RED), logarithmic=True)
    assert [place for place, _ in points] == [0, WIDE // 2, WIDE]


@pytest.mark.parametrize(
    ("low", "high", "logarithmic", "ticks"),
    [
        (0.0, 1.0, False, "0 0.2 0.4 0.6 0.8 1"),
        (-3.0, 40.0, False, "0 10 20 30 40"),
        (0.0, 3e-5, False, "0 1e−05 2e−05 3e−05"),
        (1.0, 1e4, True, "1 10 100 1000 10000"),
        (0.03, 0.7, True, "0.05 0.1 0.2 0.5"),
    ],
)
def test_ticks_are_round_and_within_the_axis(low, high, logarithmic, ticks):
    x = np.array([low, high])
    text = stacked([Panel("", 100, [Trace("", x, np.ones(2), RED)])], "", logarithmic)
    assert words_of(text.split('<div class="x">')[1]) == ticks


def test_what_makes_no_room_does_not_widen_the_axis():
    near = Trace("near", np.arange(3.0), np.array([0.0, 1.0, 0.5]), RED)
    far = Trace("far", np.arange(3.0), np.array([0.0, 1e9, 0.5]), "#0000ff", makes_room=False)
    alone, both = (stacked([Panel("a", 100, lines)], "s") for lines in ([near], [near, far]))
    red = [charts_of(f"{text}</figure>")[0][0].lines[RED] for text in (alone, both)]
    assert red[0] == red[1]


def test_the_words_beside_a_boundary_and_marks_are_told():
    line = Trace("line", np.array([0.0, 10.0]), np.ones(2), RED)
    text = stacked([Panel("a", 99, [line])], "s", boundary=Boundary(5.0, "fitted", "held out"))
    assert "fitted ◂ ▸ held out" in words_of(text)
    assert '<path class="mark" d="M1000 0v1000"/>' in text


@pytest.mark.parametrize("values", [[0.0, 0.0], [np.nan, np.nan], [1e308, -1e308], [5.0, 5.0]])
def test_any_values_are_drawn(values):
    line = Trace("line", np.array([1.0, 2.0]), np.array(values), RED)
    for logarithmic in (False, True):
        text = stacked([Panel("a", 99, [line])], "s", logarithmic)
        assert "nan" not in text
        assert "inf" not in text


def test_a_map_tells_its_numbers_in_ink_that_can_be_read():
    values = np.array([[1.0, 1000.0], [np.nan, 30.0]])
    texts = [["a", "b"], ["", "c"]]
    text = heat_map(["first", "second"], ["x", "y"], values, texts, "evidence")
    assert words_of(text) == "evidence x y first 1 1e+03 second 30"
    inks = re.findall(r"background:rgb\((\d+),\d+,\d+\);color:(#\w+)", text)
    assert {ink for ground, ink in inks if int(ground) < 100} == {"#fff"}
    assert {ink for ground, ink in inks if int(ground) > 150} == {"#1c2733"}
