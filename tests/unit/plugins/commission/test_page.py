"""Claims: the page of a protocol has every line, what was served, and a place to sign; texts of the
device are escaped; a chart has the courses of the rows.
"""

from __future__ import annotations

import numpy as np

from orchestration.plugins.commission.page import traces_of
from orchestration.plugins.commission.protocol import FAILED, PASS, Finding, Line, Protocol, Row
from orchestration.reporting import make_page

ROWS = tuple(
    Row(10.0 + 0.1 * k, "running", {"current": 0.1 * k}, {"current": a}, {"current": 0.05})
    for k, a in enumerate((0.0, None, 0.2))
)
LINES = (
    Line("Stop", "an operator stops", "safe", Finding(PASS, "0.1 s", ((10.1, "fault"),)), ROWS),
    Line("Door", "opens", "latched", Finding(FAILED, "the <door> is & open")),
)
PROTOCOL = Protocol(
    {"backend": "rig.py:Own", "date": "2026-11-29", "ppy-rig": "0.1.0", "SHA-256 of a": "f00"},
    {"current": "A"},
    LINES,
    ("a line of the server",),
)


def test_the_page_has_every_line_and_a_place_to_sign():
    text = make_page(PROTOCOL, "ppy rig commission").html()
    for part in (
        "Stop",
        "0.1 s",
        "latched",
        "Signature",
        "rig.py:Own",
        "f00",
        "ppy rig commission",
    ):
        assert part in text
    assert "a protection FAILED" in text
    assert "the &lt;door&gt; is &amp; open" in text
    assert text.count("<figure>") == 1  # a check without rows has none


def test_a_chart_has_what_was_commanded_applied_and_read_back():
    commanded, applied, read_back = traces_of(LINES[0], "current")
    assert np.allclose(commanded.x, [0.0, 0.1, 0.2])
    assert np.allclose(commanded.y, [0.0, 0.1, 0.2])
    assert np.array_equal(applied.y, [0.0, np.nan, 0.2], equal_nan=True)
    assert np.allclose(read_back.y, 0.05)
