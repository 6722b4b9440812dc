"""Lines that are thinned keep their extremes and break at gaps only, and make no large page."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from orchestration.reporting.page import Page
from orchestration.reporting.plots import MOST, Boundary, Panel, Trace, broken, envelope, stacked


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
    assert not known[(at > 5010.0) & (at < 5190.0)].any()
    assert envelope(x[:MOST], y[:MOST])[1] is not None
    assert np.array_equal(envelope(x[:MOST], y[:MOST])[0], x[:MOST])


def test_a_line_is_broken_at_a_gap_only():
    even, uneven = np.arange(20.0), np.logspace(0.0, 4.0, 60)
    for x in (even, uneven, even[:2]):
        assert np.array_equal(broken(x, x)[1], x)
    x, y = broken(np.delete(np.arange(60.0), np.s_[20:40]), np.ones(40))
    assert np.flatnonzero(np.isnan(y)).tolist() == [20]
    assert 19.0 < x[20] < 40.0


def test_a_long_record_makes_no_large_page():
    """Five hours at 10 Hz, two outputs with three simulations each, two inputs."""
    time, values = np.arange(180_000) / 36000.0, np.random.default_rng(1).standard_normal(180_000)
    lines = [Trace(str(k), time, values, {}) for k in range(7)]
    made = Page("long", "long")
    made.plot(
        stacked(
            [Panel("a", 100, lines), Panel("b", 100, lines)],
            "time [h]",
            boundary=Boundary(3.0, "a", "b"),
        ),
        "",
    )
    assert len("".join(made.parts)) < 2e6
    assert 4e6 < len(made.html()) < 8e6


@pytest.mark.parametrize("largest", [1e38, 1e39])
def test_values_beyond_single_precision_are_drawn_as_they_are(largest):
    """Single precision ends at 3.4e38; what a simulation that runs away comes to is more."""
    values = np.array([1.0, np.nan, largest])
    (drawn,) = stacked([Panel("a", 100, [Trace("x", np.arange(3.0), values, {})])], "s")["data"]
    read = np.frombuffer(base64.b64decode(drawn["y"]["bdata"]), "<" + drawn["y"]["dtype"])
    assert read[-1] == pytest.approx(largest, rel=1e-6)
