"""Claims: the page of a system has a verdict on each member, and the diagnosis of each part."""

from __future__ import annotations

import re
from pathlib import Path

from orchestration.reporting import make_page
from tests.support.system.judged import rubbing_system


def test_the_page_of_a_system(tmp_path: Path) -> None:
    html = make_page(rubbing_system(tmp_path)).html()
    for text in (
        "<h1>The laws of plant are wrong.</h1>",
        'class="chip wrong"',
        'class="chip cannotbejudged"',
        "none of its outputs is measured",
        "<h2>Plant: &gt; 99 % friction over velocity",
        "<h3>The model beside the record</h3>",
        "measured − simulated [m]",
        "friction_of_velocity",
        "SHA-256 of rubbing.csv",
        f"ppy diagnose {tmp_path / 'rubbing.csv'} --system rig",
    ):
        assert text in html, text
    assert html.count('class="chart"') == 2
    assert [html.count(f"<h{level}>") for level in (1, 2)] == [1, 2], "members, and a part"
    assert "builds it" not in html, "a member of a loop is no model that can be built alone"
    levels = [int(level) for level in re.findall(r"<h(\d)>", html)]
    assert max(levels) <= 4
