"""Claims: the page of a fit says which values fit, how well and how surely, and what to do next."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, UserError
from orchestration.fmu.model import model_of
from orchestration.identify import comparison as work
from orchestration.records import read_record, write_record
from tests.support.browser import chromium
from tests.support.look import FAINT, OUTSIDE, UNREACHED
from tests.support.pages import charts_of, words_of

TRUE = 0.5


class LeadWire(Component):
    """Voltage over a wire."""

    name = "lead_wire"
    r_lead = Parameter(0.3, "ohm", min=0.0, title="resistance of the lead")
    feed_current = Input("A")

    @Output("V")
    def drop_1(self):
        """Voltage over the wire."""
        return self.r_lead * self.feed_current


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """A fit of a wire of 0.5 ohm, with an offset that no resistance makes."""
    path = tmp_path_factory.mktemp("wire") / "wire_1.csv"
    rng = np.random.default_rng(1)
    time = 0.1 * np.arange(600)
    current = np.repeat(rng.uniform(-1.0, 1.0, 60), 10)
    drop = TRUE * current + 0.002 * rng.normal(size=600)
    write_record(
        path, time, {"feed_current": current, "drop_1": drop}, {"feed_current": "A", "drop_1": "V"}
    )
    model = model_of(LeadWire)
    record = read_record(path, {"feed_current": "A", "drop_1": "V"})
    return work.compare(model, record, {}, ["r_lead"])


@pytest.fixture(scope="module")
def page(compared, tmp_path_factory):
    return compared.report(tmp_path_factory.mktemp("page") / "fit.html")


def test_what_the_command_has_written_is_not_advised(compared, tmp_path):
    advice = "Write the values for any system"
    for command, is_advised in (
        ("ppy compare r.csv --fit R", True),
        ("ppy identify --ssv x", False),
    ):
        page = compared.report(tmp_path / "fit.html", command)
        assert (advice in page.read_text(encoding="utf-8")) == is_advised


def test_the_first_sentences_have_the_values_and_the_errors(page):
    text = page.read_text(encoding="utf-8")
    title = words_of(re.search("<h1>.*?</h1>", text)[0])
    assert title == "What fits best: resistance of the lead 500 mΩ."
    error = re.search(r"Drop 1 is off by ([\d.]+) % instead of ([\d.]+) % of what", words_of(text))
    after, before = map(float, error.groups())
    assert before == pytest.approx(40.0, abs=0.5)  # 0.2 of 0.5 ohm
    assert after == pytest.approx(100.0 * 0.002 / (TRUE / 3.0**0.5), rel=0.2)


def wire_record(folder, name, current, offset=0.0):
    """A record of the wire with 2 mV of noise."""
    time = 0.1 * np.arange(current.size)
    noise = 0.002 * np.random.default_rng(len(name)).normal(size=current.size)
    columns = {"feed_current": current, "drop_1": TRUE * current + noise + offset}
    units = {"feed_current": "A", "drop_1": "V"}
    write_record(folder / name, time, columns, units)
    return read_record(folder / name, units)


def test_of_several_records_each_sentence_has_its_record_and_noise_alone_is_no_error(tmp_path):
    """At rest nothing but noise is measured: its whole spread is left, and nothing is wrong."""
    driven = np.repeat(np.random.default_rng(1).uniform(-1.0, 1.0, 60), 10)
    rest = np.zeros(600)
    records = [
        wire_record(tmp_path, "driven.csv", driven),
        wire_record(tmp_path, "rest.csv", rest),
        wire_record(tmp_path, "wrong.csv", rest, offset=0.05),
    ]
    joint = work.compare_fitted(model_of(LeadWire), records, {}, ["r_lead"])
    text = joint.report(tmp_path / "fit.html").read_text(encoding="utf-8")
    words = words_of(text)
    assert re.search(r"driven\.csv: Drop 1 is off by 0\.\d % instead of 40\.\d % of what", words)
    assert "rest.csv: Drop 1 is noise alone." in words
    assert re.search(r"wrong\.csv: Drop 1 is off by \d{4}\.\d %", words)
    lengths = re.findall(r"width:([\d.]+)%", text)
    assert lengths[2:4] == ["0.0", "0.0"]
    assert min(map(float, lengths[4:6])) > 99.0
    assert words.count("noise alone · ") == 2


def test_it_has_the_sections_of_every_page(page):
    assert re.findall("<h2>(.*?)</h2>", page.read_text(encoding="utf-8")) == [
        "What is wrong",
        "The model beside the record",
        "What to do next",
        "How sure this is",
        "How it was found",
    ]


def test_the_interval_and_the_command_are_on_it(compared, page):
    words = words_of(page.read_text(encoding="utf-8"))
    low, high = map(float, re.search(r"([\d.]+) … ([\d.]+) mΩ", words).groups())
    assert (1e-3 * low, 1e-3 * high) == pytest.approx(
        compared.fit.estimates["r_lead"].interval, rel=1e-3
    )
    assert "ppy identify" in words.split("How to reproduce")[1]
    assert "--fit r_lead" in words.split("How to reproduce")[1]


def test_every_output_is_drawn_above_what_is_left_of_it(page):
    (chart,) = charts_of(page.read_text(encoding="utf-8"))
    assert [panel.title for panel in chart] == ["Drop 1 [V]", "measured − simulated [V]"]


def test_without_a_fit_a_page_has_the_errors_of_the_one_run(compared, tmp_path):
    plain = work.compare(compared.model, compared.record)
    text = plain.report(tmp_path / "plain.html").read_text(encoding="utf-8")
    words = words_of(text)
    error = 100.0 * np.linalg.norm(plain.latest["drop_1"].residual)
    error /= np.linalg.norm(
        compared.record.signals["drop_1"] - compared.record.signals["drop_1"].mean()
    )
    assert f"{error:.1f} %" in words
    assert "ppy compare" in words.split("How to reproduce")[1]
    (chart,) = charts_of(text)
    assert len(chart) == 2


def test_a_fit_has_a_page_with_its_values_and_intervals(compared, tmp_path):
    path = compared.fit.report(tmp_path / "values.html")
    words = words_of(path.read_text(encoding="utf-8"))
    low, high = map(float, re.search(r"([\d.]+) … ([\d.]+) mΩ", words).groups())
    assert (1e-3 * low, 1e-3 * high) == pytest.approx(
        compared.fit.estimates["r_lead"].interval, rel=1e-3
    )


def test_a_page_is_a_file_of_html(compared, tmp_path):
    with pytest.raises(UserError, match=r"ends in \.html"):
        compared.report(tmp_path / "fit.txt")


@pytest.mark.parametrize("width", [1280, 390])
def test_a_browser_shows_it(browser, page, tmp_path, width):
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(page, width)
        assert tab.complaints == []
        assert tab.run("document.documentElement.scrollWidth") == width
        assert [tab.run(question) for question in (FAINT, UNREACHED, OUTSIDE)] == [[], [], []]
