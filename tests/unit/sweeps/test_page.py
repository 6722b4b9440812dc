"""Claims: the page of a sweep says what comes out, what moves it, and how it was run."""

from __future__ import annotations

import re
from functools import partial

import numpy as np
import pytest
import xarray

from orchestration.reporting import plain_table
from orchestration.sweeps import curves
from orchestration.sweeps.page import Extreme, extremes, sweep_page
from tests.support.browser import chromium
from tests.support.look import FAINT, OUTSIDE, UNREACHED
from tests.support.pages import words_of

COMMAND = "ppy sweep m --over a=1..4:4"


def swept(failure=""):
    """Twelve cases of y = 10 a - b, in millivolts, whose first may have failed."""
    a, b = np.arange(1.0, 5.0), np.arange(3.0)
    y = 1e-3 * (10.0 * a[:, np.newaxis] - b)
    failures = np.full(y.shape, "", dtype=object)
    if failure:
        y[0, 0], failures[0, 0] = np.nan, failure
    return xarray.Dataset(
        {
            "cell_voltage_last": (("load", "b"), y, {"units": "V"}),
            "failure": (("load", "b"), failures),
        },
        {"load": ("load", a, {"units": "N"}), "b": ("b", b, {"units": "1"})},
        {"model": "m_1", "engine": "fmu", "design": "grid", "over": "load b"},
    )


def page_of(data, tables=()):
    return sweep_page(data, partial(curves.draw_curves, data), [*tables], COMMAND).html()


def test_the_first_sentence_has_the_range_and_the_second_what_moves_it():
    text = page_of(swept())
    title, verdict = (
        words_of(re.search(rf"<{tag}.*?</{tag.split()[0]}>", text)[0])
        for tag in ("h1", 'p class="verdict"')
    )
    assert title == "Cell voltage at the end goes from 8.00 mV to 40.0 mV over 12 cases."
    assert verdict.startswith("It rises with load (rank correlation +0.9")
    assert "_" not in title


def test_it_has_the_sections_of_every_page():
    assert re.findall("<h2>(.*?)</h2>", page_of(swept())) == [
        "What comes out",
        "The picture",
        "What to do next",
        "How sure this is",
        "How it was found",
    ]


def test_what_failed_is_told_first():
    words = words_of(page_of(swept("it diverged")))
    assert "Look at the 1 cases that failed." in words.split("What to do next")[1][:60]
    assert "12 cases were run; 1 of them failed. The first: it diverged." in words
    assert "goes from 9.00 mV to 40.0 mV" not in words
    assert "goes from 8.00 mV to 40.0 mV" in words


def test_tables_of_an_analysis_are_on_the_page():
    table = plain_table(None, "moved", "by")
    table.add_row("cell_voltage_last", "load")
    assert "moved by cell_voltage_last load" in words_of(page_of(swept(), [table]))


def test_what_was_swept_and_how_can_be_done_again():
    words = words_of(page_of(swept()))
    assert "load 1 N 4 N b 0 2" in words
    assert COMMAND in words


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("voltage_last", "voltage at the end"),
        ("film_voltage_rms", "root mean square of film voltage"),
        ("position", "position"),
        ("last", "last"),
    ],
)
def test_numbers_have_names_for_people(name, title):
    assert Extreme(name, 0.0, 1.0, "1").title == title


def test_extremes_are_those_of_numpy_over_what_is_finite():
    (extreme,) = extremes(swept("failed"))
    values = swept("failed")["cell_voltage_last"].values
    assert (extreme.smallest, extreme.largest) == (np.nanmin(values), np.nanmax(values))


@pytest.mark.parametrize("width", [1280, 390])
def test_a_browser_shows_it(browser, tmp_path, width):
    file = tmp_path / "sweep.html"
    file.write_text(page_of(swept()), encoding="utf-8")
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(file, width)
        assert tab.complaints == []
        assert tab.run("document.documentElement.scrollWidth") == width
        assert [tab.run(question) for question in (FAINT, UNREACHED, OUTSIDE)] == [[], [], []]
