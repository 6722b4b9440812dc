"""Claims: the report of a diagnosis shows what was diagnosis, in a real browser, on a desk and on a
phone.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import os
import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects
import pytest

from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import dataset_of
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment, ExpectedEvidence
from orchestration.discrepancy.design.stimuli import Stimulus
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.extended_model import ExtensionGain
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.page import diagnosis_page
from orchestration.discrepancy.residuals.correlation import CrossCorrelation
from orchestration.fmu.model import find_model
from orchestration.identify.comparison import read_for
from studies.emulator.records import draw, write
from tests.support.browser import chromium
from tests.support.pace import slow_but
from tests.support.pages import content, figures_of, words_of
from tests.support.report_results import COMMAND, PAGES, with_verdict


@pytest.mark.parametrize("name", PAGES)
def test_the_verdict_comes_first(results, made, name):
    diagnosis = results[name].diagnosis
    verdict = re.search(r'<p class="verdict">(.*?)</p>', made[name])
    assert html.unescape(re.sub("<[^>]+>", "", verdict[1])).startswith(
        f"{diagnosis.verdict} {wording.sentence(diagnosis)}"
    )


def test_what_follows_from_a_diagnosis_has_its_place(results):
    """Simulations of the exported FMU, what the residual correlates with, and an experiment that
    would tell more.
    """
    ambiguous, diagnosis = results["ambiguous"], results["ambiguous"].diagnosis
    perfect = {o: np.nan_to_num(y) for o, y in diagnosis.validation.data.measured.items()}
    gain = ExtensionGain(
        diagnosis.before, diagnosis.after, {}, {o: y + 1e-3 for o, y in perfect.items()}, perfect
    )
    seen = CrossCorrelation(
        "voltage", "rate of charge", np.zeros(1), np.ones(1), 0.05, 0.0, 0.9, 1e-9
    )
    chance = replace(seen, signal="time", p_value=0.5)
    stimuli = {name: Stimulus("constant", {"value": 0.5}) for name in ("current", "force")}
    experiment = DiscriminatingExperiment(
        stimuli, 600.0, 0.1, [ExpectedEvidence("left", "right", 42.0)], diagnosis.selection.base
    )
    voltage = replace(diagnosis.residuals["voltage"], correlations=[seen, chance])
    more = with_verdict(
        ambiguous, Verdict.AMBIGUOUS, residuals=diagnosis.residuals | {"voltage": voltage}
    )
    text = words_of(diagnosis_page(replace(more, gain=gain, experiment=experiment), COMMAND).html())
    assert "extended 0 % · 0 V" in text
    assert re.search(r"displacement nominal .*? refitted [\d.]+ % · 1 mm extended 0 %", text)
    assert "Voltage correlates with rate of charge: +0.90 at once" in text
    assert "correlates with time" not in text
    sentence = wording.describe_experiment(experiment)
    assert sentence in text
    assert " ".join(experiment.toml("ppy_actuator", sentence).split()) in text


def test_it_can_be_reproduced(results, made):
    result = results["holdout"]
    text = words_of(made["holdout"])
    for record in (result.record, result.holdout):
        assert hashlib.sha256(record.source.read_bytes()).hexdigest() in text
    assert made["cause"] == diagnosis_page(results["cause"], COMMAND).html()


def test_a_name_that_is_code_stays_a_name(made):
    text = content(made["cause"])
    assert "<script>alert" not in text
    assert r"r\udcff &lt;script&gt;alert(1)&amp;.csv" in text
    text.encode()


# --- what is drawn
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAGES)
def test_plotly_knows_everything_that_is_asked_of_it(made, name):
    """Its own schema refuses a misspelt property, which the browser would pass over."""
    drawn = figures_of(made[name])
    assert drawn
    for figure in drawn:
        plotly.graph_objects.Figure(figure)


# --- in a browser
# --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def tab(browser, tmp_path_factory):
    if os.name != "posix":
        pytest.skip("the browser is spoken to over pipes as POSIX has them")

    with chromium(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


LOOK = """(box => [...document.querySelectorAll("div.plot")].map(place => ({
  traces: place._fullData.map(trace => trace.visible === true),
  drawn: place.querySelectorAll(
    ".scatterlayer .trace path.js-line, .scatterlayer .trace path.js-fill").length,
  long: [...place.querySelectorAll("path.js-line")]
    .filter(path => path.getTotalLength() > 50).length,
  panels: Object.values(place._fullLayout._plots)
    .map(panel => panel.plot.node().querySelectorAll(".trace").length),
  legend: box(place.querySelector(".legend")).bottom,
  notes: Math.min(...[...place.querySelectorAll(".annotation-text, .shape-label")]
    .map(n => box(n).top)),
  right: Math.max(...[...place.querySelectorAll("text")].map(n => box(n).right)),
  left: Math.min(...[...place.querySelectorAll("text")].map(n => box(n).left)),
})))(n => n.getBoundingClientRect())"""
SMALLEST = """Math.min(...[...document.querySelectorAll(
  "p, li, td, th, h1, h2, button, figcaption, code, svg text")]
  .filter(e => e.textContent.trim() && e.getClientRects().length && !e.closest("sup"))
  .map(e => parseFloat(getComputedStyle(e).fontSize)))"""


@pytest.mark.parametrize(
    ("name", "width"),
    slow_but(
        [
            *((name, 390) for name in PAGES),
            ("cause", 1280),
            ("unexplained", 1280),
            ("holdout", 1280),
        ],
        *((name, 390) for name in PAGES if name not in ("idle", "voltage")),
        ("cause", 1280),
    ),
)
def test_a_browser_shows_it(tab, made, name, width, tmp_path):
    file = tmp_path / f"{name}.html"
    file.write_bytes(made[name].encode())
    tab.open(file, width)
    assert tab.complaints == []
    assert tab.requests == [file.as_uri()]
    assert tab.run("[document.documentElement.scrollWidth, innerWidth]") == [width, width]
    assert tab.run(SMALLEST) >= 12.0
    plots = tab.run(LOOK)
    for plot, figure in zip(plots, figures_of(made[name]), strict=True):
        axes = [place for place in figure["layout"] if place.startswith("yaxis")]
        assert len(plot["panels"]) == len(axes)
        assert min(plot["panels"]) > 0
        assert plot["drawn"] >= sum(plot["traces"]) > 0
        assert plot["long"] >= sum(plot["traces"]) - 2  # the ends of a band have no line
        assert plot["legend"] <= plot["notes"]
        assert plot["left"] >= 0
        assert plot["right"] <= width


def test_a_button_shows_what_was_held_out(tab, results, made, tmp_path):
    diagnosis = results["cause"].diagnosis
    file = tmp_path / "page.html"
    file.write_bytes(made["cause"].encode())
    tab.open(file, 1280)
    shown = 'document.querySelector("div.plot").layout.xaxis.range'
    tab.run("document.querySelectorAll('.views button')[1].click()")
    time, first = diagnosis.validation.data.time, diagnosis.validation.first
    assert tab.run(shown) == pytest.approx([time[first], time[-1]])
    tab.run("document.querySelectorAll('.views button')[0].click()")
    assert tab.run(shown) == pytest.approx([time[0], time[-1]])


def test_the_probe_would_notice(tab, tmp_path):
    bad = (
        '<body><p style="width:900px;font-size:5px">wide</p><script'
        ' src="http://example.com/a.js"></script><script>'
    )
    file = tmp_path / "bad.html"
    file.write_text(f"{bad}console.error('oh'); undefined.x</script>", encoding="utf-8")
    tab.open(file, 390)
    assert len(tab.requests) == 2
    assert {"oh", "TypeError"} <= set(re.findall("oh|TypeError", " ".join(tab.complaints)))
    assert tab.run("document.documentElement.scrollWidth") > 390
    assert tab.run(SMALLEST) == 5.0


# --- one sign: measured minus simulated in the figures, in the words and in the picture
# --------------------------------------------------------------------------------------------------

SIZE = 1e-4  # m
QUIET = 3.0  # s on either side of the jump in which no input moves


def quiet_time(drawn):
    """The instant in the part that is fitted to that is furthest from every step of an input."""
    moves = np.any(
        [np.diff(values, prepend=values[0]) != 0.0 for values in drawn.inputs.values()], axis=0
    )
    steps = drawn.time[moves]
    candidates = drawn.time[(drawn.time > 60.0) & (drawn.time < 150.0)]
    distance = np.abs(candidates[:, np.newaxis] - steps).min(axis=1)
    assert distance.max() > QUIET
    return float(candidates[distance.argmax()])


@pytest.fixture(scope="module", params=slow_but([1.0, -1.0], -1.0), ids=["up", "down"])
def jumped(request, tmp_path_factory):
    """A diagnosis of a clean record of the rig, whose measured displacement jumps once, and when
    and by how much.
    """
    drawn = draw(None, 1, duration=300.0, rate=5.0)
    time, size = quiet_time(drawn), request.param * SIZE
    displacement = drawn.outputs["displacement"] + np.where(drawn.time >= time, size, 0.0)
    path = tmp_path_factory.mktemp("sign") / "record.csv"
    write(replace(drawn, outputs=drawn.outputs | {"displacement": displacement}), path)
    model = find_model("ppy_actuator")
    record = read_for(model, path)
    diagnosis = diagnose(PpyActuator, dataset_of(record, model, {}), [])
    return Result([record], [], model, [], diagnosis, None, None, None, []), time, size


@pytest.fixture(scope="module")
def jumped_page(jumped):
    return "\n".join(diagnosis_page(jumped[0], "ppy diagnose record.csv").parts)


def drawn_residual(text, output, model):
    """What is drawn below an output as measured minus simulated: time (s) and values, as a browser
    unpacks them.
    """
    figure, *_ = (
        json.loads(data)
        for data in re.findall(r'<script type="application/json">(.*?)</script>', text)
    )
    titles = [note["text"] for note in figure["layout"]["annotations"]]
    panel = 1 + next(k for k, title in enumerate(titles) if title.startswith(output))
    assert titles[panel].startswith("measured − simulated [mm]")
    (trace,) = (t for t in figure["data"] if (t["yaxis"], t["name"]) == (f"y{panel + 1}", model))
    return (
        np.frombuffer(base64.b64decode(trace[axis]["bdata"]), trace[axis]["dtype"]) for axis in "xy"
    )


def test_a_jump_has_the_sign_of_what_was_measured(jumped):
    result, time, size = jumped
    (shift,) = result.diagnosis.residuals["displacement"].level_shifts
    assert shift.time == pytest.approx(time)
    assert shift.size == pytest.approx(size, rel=0.1)


def test_the_words_have_the_sign_of_the_number(jumped, jumped_page):
    result, time, _ = jumped
    (shift,) = result.diagnosis.residuals["displacement"].level_shifts
    words = html.unescape(re.sub(r"<[^>]+>", "", jumped_page))
    ((sign, size, at),) = re.findall(r"A jump of ([-−]?)(0\.\d+)\smm at ([\d.]+) s\.", words)
    assert bool(sign) == (shift.size < 0.0)
    assert float(size) == pytest.approx(1e3 * abs(shift.size), abs=5e-4)
    assert float(at) == pytest.approx(time)


def test_the_picture_steps_as_the_words_say(jumped, jumped_page):
    _, time, size = jumped
    at, residual = drawn_residual(jumped_page, "displacement", "refitted")
    before, after = (at > time - QUIET) & (at < time), (at >= time) & (at < time + QUIET)
    assert residual[after].mean() - residual[before].mean() == pytest.approx(1e3 * size, rel=0.1)
