"""Claims: the report of a diagnosis shows what was diagnosis, in a real browser, on a desk and on a
phone.
"""

from __future__ import annotations

import base64
import hashlib
import html
import os
import re
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread

from demonstrations.records import draw, write
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import dataset_of
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.extended_model import ExtensionGain
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.effect_picture import WITHOUT
from orchestration.discrepancy.report.figures import COLOURS
from orchestration.discrepancy.report.page import diagnosis_page
from orchestration.discrepancy.report.wording import EXTENDED, REFITTED
from orchestration.discrepancy.residuals.correlation import CrossCorrelation
from orchestration.experiment.design import DiscriminatingExperiment, ExpectedEvidence, Rehearsal
from orchestration.experiment.design.menu import Stimulus
from orchestration.fmu.model import find_model
from orchestration.identify.comparison import read_for
from orchestration.reporting.html import elements
from tests.support.browser import chromium
from tests.support.look import FAINT, OUTSIDE, UNREACHED
from tests.support.pace import slow_but
from tests.support.pages import charts_of, words_of
from tests.support.report_results import COMMAND, PAGES, with_verdict

pytestmark = pytest.mark.slow  # each test needs a diagnosis


@pytest.mark.parametrize("name", PAGES)
def test_the_verdict_comes_first(results, made, name):
    diagnosis = results[name].diagnosis
    answer = wording.answer(diagnosis)
    text = words_of(re.search(r"<h1>(.*?)</h1>.*?</p>", made[name], re.S)[0])
    first, *support = map(
        words_of, map(elements.format_quantities, (answer.first, *answer.support))
    )
    assert text.startswith(f"{first} {diagnosis.verdict}")
    assert all(sentence in text for sentence in support)


@pytest.mark.parametrize("name", PAGES)
def test_title_and_first_sentence_are_words(results, made, name):
    """Whatever the file, the model and the effects are called."""
    for place in ("title", "h1"):
        text = re.search(rf"<{place}>(.*?)</{place}>", made[name])[1]
        assert "_" not in text
        assert len(text) > 20
    assert "_" not in wording.answer(results[name].diagnosis).first


@pytest.mark.parametrize("name", PAGES)
def test_every_page_has_the_same_sections(results, made, name):
    headings = re.findall(r"<h2>(.*?)</h2>", made[name])
    effect = ["The effect itself"] if results[name].diagnosis.selection.steps else []
    last = ["What to do next", "How sure this is", "How it was found"]
    assert headings == ["What is wrong", *effect, *last]


def test_the_law_is_drawn_with_the_effect_and_without(results, made):
    """A saturation by hand: far from no charge there is less elongation of either sign."""
    section = made["cause"].split("<h2>The effect itself</h2>")[1]
    ((panel,), *_) = charts_of(section)
    assert panel.title == "charge elongation [µm]"
    without, with_effect = (panel.lines[colour] for colour in (WITHOUT, COLOURS[EXTENDED]))
    heights = [[-line[end][1] for line in (without, with_effect)] for end in (0, -1)]
    (left_without, left_with), (right_without, right_with) = heights
    assert left_without < left_with < right_with < right_without
    steps = np.diff([height for _, height in with_effect])
    assert (steps <= 0).all()  # it rises throughout, and coordinates count downwards


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_small(made, name):
    assert len(made[name].encode()) < 1.5e6


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
    rehearsal = Rehearsal({"current": "A", "force": "N"}, ["voltage"])
    experiment = DiscriminatingExperiment(
        stimuli, 600.0, 0.1, [ExpectedEvidence("left", "right", 42.0)], rehearsal
    )
    voltage = replace(diagnosis.residuals["voltage"], tests=[seen, chance])
    more = with_verdict(
        ambiguous, Verdict.AMBIGUOUS, residuals=diagnosis.residuals | {"voltage": voltage}
    )
    text = words_of(diagnosis_page(replace(more, gain=gain, experiment=experiment), COMMAND).html())
    assert "with the effect 0 % · 0 V" in text
    assert re.search(
        r"Displacement as it is .*? refitted [\d.]+ % · 1.00 mm with the effect 0 %", text
    )
    assert "Voltage correlates with rate of charge: +0.90 at once" in text
    assert "correlates with time" not in text
    sentence = experiment.sentence
    assert sentence in text
    assert " ".join(experiment.toml("ppy_actuator", sentence).split()) in text


def test_it_can_be_reproduced(results, made):
    result = results["holdout"]
    text = words_of(made["holdout"])
    for record in (result.record, result.holdout):
        assert hashlib.sha256(record.source.read_bytes()).hexdigest() in text
    assert made["cause"] == diagnosis_page(results["cause"], COMMAND).html()


def test_a_name_that_is_code_stays_a_name(made):
    text = made["cause"]
    assert "<script" not in text
    assert r"r\udcff &lt;script&gt;alert(1)&amp;.csv" in text
    text.encode()


# --- in a browser
# --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def tab(browser, tmp_path_factory):
    if os.name != "posix":
        pytest.skip("the browser is spoken to over pipes as POSIX has them")

    with chromium(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


SMALLEST = """Math.min(...[...document.querySelectorAll(
  "p, li, td, th, h1, h2, h3, summary, figcaption, code, span, svg text")]
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
    assert tab.run(FAINT) == []
    assert tab.run(UNREACHED) == []
    assert tab.run(OUTSIDE) == []


def edges(tab, selector):
    """Colours of the left and the right edge of an element, each of shape (n, 3), from 0 to 1."""
    box = tab.run(
        f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView();"
        " const b = e.getBoundingClientRect();"
        " return {x: b.x + scrollX, y: b.bottom + scrollY - 12, width: b.width, height: 8}; })()"
    )
    shot = tab.call("Page.captureScreenshot", format="png", clip={**box, "scale": 1})
    pixels = imread(BytesIO(base64.b64decode(shot["data"])))[..., :3]
    return pixels[:, 1], pixels[:, -2]


@pytest.mark.parametrize(("width", "wide"), [(390, True), (1280, False)])
def test_a_table_shows_at_which_edge_it_goes_on(tab, made, width, wide, tmp_path):
    file = tmp_path / "page.html"
    file.write_bytes(made["cause"].encode())
    tab.open(file, width)
    assert tab.run("(e => e.scrollWidth > e.clientWidth)(document.querySelector('.table'))") is wide
    left, right = edges(tab, ".table")
    assert left.min() > 0.95
    assert bool(right.max() < 0.7) is wide  # below a luminance of 0.3, white has 3:1
    tab.run("document.querySelector('.table').scrollLeft = 1e6")
    left, right = edges(tab, ".table")
    assert right.min() > 0.95
    assert bool(left.max() < 0.7) is wide
    tab.call("Emulation.setEmulatedMedia", media="print")
    drawn = tab.run("getComputedStyle(document.querySelector('.table')).backgroundImage")
    tab.call("Emulation.setEmulatedMedia", media="")
    assert drawn == "none"


def test_the_probe_would_notice(tab, tmp_path):
    bad = (
        '<body><p style="width:900px;font-size:5px">wide</p><p style="color:#999">grey</p>'
        '<div class="wide" style="width:90px;overflow-x:auto"><pre>a line too long for it</pre>'
        '</div><div class="chart"><span style="position:absolute;left:2000px">tick</span></div>'
        "<script"
        ' src="http://example.com/a.js"></script><script>'
    )
    file = tmp_path / "bad.html"
    file.write_text(f"{bad}console.error('oh'); undefined.x</script>", encoding="utf-8")
    tab.open(file, 390)
    assert len(tab.requests) == 2
    assert {"oh", "TypeError"} <= set(re.findall("oh|TypeError", " ".join(tab.complaints)))
    assert tab.run("document.documentElement.scrollWidth") > 390
    assert tab.run(SMALLEST) == 5.0
    assert tab.run(FAINT) == ["grey"]
    assert tab.run(UNREACHED) == ["DIV wide"]
    assert tab.run(OUTSIDE) == ["tick"]


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


def drawn_residual(text, output, colour):
    """What is drawn below an output as measured minus simulated: shares of the panel, from its left
    and from below.
    """
    first, *_ = charts_of(text)
    below = 1 + next(k for k, panel in enumerate(first) if panel.title.startswith(output))
    assert first[below].title == "measured − simulated [mm]"
    points = np.array(first[below].lines[colour])
    return points[:, 0] / 2000.0, 1.0 - points[:, 1] / 1000.0


def test_a_jump_has_the_sign_of_what_was_measured(jumped):
    result, time, size = jumped
    (shift,) = result.diagnosis.residuals["displacement"].level_shifts
    assert shift.time == pytest.approx(time)
    assert shift.size == pytest.approx(size, rel=0.1)


def test_the_words_have_the_sign_of_the_number(jumped, jumped_page):
    result, time, _ = jumped
    (shift,) = result.diagnosis.residuals["displacement"].level_shifts
    words = html.unescape(re.sub(r"<[^>]+>", "", jumped_page))
    ((sign, size, at),) = re.findall(r"A jump of ([-−]?)([\d.]+)\sµm at ([\d.]+) s\.", words)
    assert bool(sign) == (shift.size < 0.0)
    assert float(size) == pytest.approx(1e6 * abs(shift.size), rel=5e-3)
    assert float(at) == pytest.approx(time)


def test_the_picture_steps_as_the_words_say(jumped, jumped_page):
    result, time, size = jumped
    end = result.record.time[-1]
    at, residual = drawn_residual(jumped_page, "displacement", COLOURS[REFITTED])
    around = at * end - time
    before = residual[(around > -QUIET) & (around < 0.0)].mean()
    after = residual[(around > 0.0) & (around < QUIET)].mean()
    assert np.sign(after - before) == np.sign(size)
    assert abs(after - before) > 0.2  # of the height of the panel, which the jump dominates
