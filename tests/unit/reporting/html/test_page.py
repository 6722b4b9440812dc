"""Claims: texts on a page stay texts, and the page says what it was made from."""

from __future__ import annotations

import base64
import hashlib
import os
import re

import numpy as np
import pytest

from orchestration.reporting import pictures
from orchestration.reporting.html.page import SCROLLED, Markup, Page, escaped
from orchestration.reporting.html.plots import Panel, Trace, stacked
from tests.support.browser import chromium
from tests.support.pages import words_of

NASTY = "</style><script>hurt()</script>"


def test_what_looks_like_code_stays_a_text():
    made = Page(NASTY, NASTY, NASTY)
    line = Trace(NASTY, np.arange(2.0), np.ones(2), "#000000")
    made.chart(stacked([Panel(NASTY, 100, [line])], NASTY), NASTY)
    made.heading(NASTY)
    made.table([NASTY], [[NASTY]])
    made.items([NASTY])
    made.code([NASTY])
    with made.folded(NASTY):
        made.reproduction([], NASTY)
    assert "<script" not in made.html()
    assert made.html().count("</style>") == 1


def test_markup_is_not_escaped_twice():
    assert escaped(escaped("a & b")) == "a &amp; b"
    assert isinstance(escaped("a"), Markup)


def test_the_title_of_the_window_has_no_markup():
    assert "<title>10 N /m</title>" in Page(Markup("10 N<b>/m</b>"), "").html()


def test_what_scrolls_is_reached_by_the_keyboard():
    made = Page("", "")
    made.table(["a"], [["b"]])
    made.code(["c"])
    assert made.html().count('tabindex="0"') == 2


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="the browser is spoken to over pipes as POSIX has them")
@pytest.mark.parametrize("width", [1280, 390])
def test_no_column_of_a_table_is_beyond_the_edge(browser, tmp_path, width):
    """All cells of a wide table are seen without scrolling, each with its heading."""
    head = ["parameter", "value", "95 % interval", "nominal"]
    made = Page("title", "verdict")
    made.table(head, [["torque_in_fmu_of_omega_simulated_width", *3 * ["0.1174 rad/s"]]])
    made.write(tmp_path / "page.html")
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(tmp_path / "page.html", width)
        cells = tab.run(
            "[...document.querySelectorAll('td')].map(e => [e.getBoundingClientRect().left,"
            " e.getBoundingClientRect().right, getComputedStyle(e, '::before').content])"
        )
    assert len(cells) == 4
    for name, (left, right, label) in zip(head, cells, strict=True):
        assert 0 <= left < right <= width
        assert (label == f'"{name}"') == (width == 390)


def test_files_are_told_with_their_digests(tmp_path):
    file = tmp_path / "record.csv"
    content = b"time [s]\n"
    file.write_bytes(content)
    made = Page("", "")
    made.reproduction([file, tmp_path / "gone.csv"], "ppy list")
    text = words_of(made.html())
    assert f"SHA-256 of record.csv: {hashlib.sha256(content).hexdigest()}" in text
    assert "SHA-256 of gone.csv: cannot be read again" in text
    assert "ppy list" in text


def luminance(colour):
    """WCAG 2.1, of a colour from 0 to 255."""
    c = np.asarray(colour) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_the_sign_of_what_goes_on_is_seen_and_leaves_texts_readable():
    """A bar on a light ground and a dark one, and texts of our pages and of notebooks over the
    shadow beside it.
    """
    bar = np.array([int(pair, 16) for pair in re.findall(r"\w\w", SCROLLED.split("#")[1][:6])])
    *shadow, share = map(
        float, re.search(r"rgb\((\d+) (\d+) (\d+) / ([\d.]+)\)", SCROLLED).groups()
    )
    for ground, texts in (
        ((255, 255, 255), [(28, 39, 51), (82, 97, 110)]),
        ((17, 17, 17), [(255, 255, 255)]),
    ):
        assert contrast(bar, ground) >= 3.0
        shaded = share * np.array(shadow) + (1.0 - share) * np.array(ground)
        assert all(contrast(text, shaded) >= 4.5 for text in texts)


def test_a_figure_is_a_png_with_its_caption():
    made = Page("title", "")
    figure, _ = pictures.panels(1, "one")
    made.figure(figure, "what <it> shows")
    (shown,) = re.findall(r'src="data:image/png;base64,([^"]+)"', made.html())
    assert base64.b64decode(shown).startswith(b"\x89PNG\r\n")
    assert "<figcaption>what &lt;it&gt; shows</figcaption>" in made.html()
