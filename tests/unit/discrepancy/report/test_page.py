"""Claims: the report of a diagnosis shows what was diagnosis, in a real browser, on a desk and on a phone."""

from __future__ import annotations

import hashlib
import html
import os
import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects
import pytest

from fmus.ppy_actuator.effects import EFFECTS
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment, ExpectedEvidence
from orchestration.discrepancy.design.stimuli import Stimulus
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.extended_model import Gain
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import Options, diagnose
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.page import page
from orchestration.discrepancy.residuals.correlation import CrossCorrelation
from orchestration.discrepancy.residuals.jumps import LevelShift
from orchestration.discrepancy.residuals.lines import SpectralLine
from orchestration.fmu.model import find_model
from orchestration.identify.comparison import read_for
from tests.support.browser import chromium
from tests.support.diagnosis import FEW as EFFECTS_OF_A_STRAIN
from tests.support.diagnosis import broken_off
from tests.support.pace import slow_but
from tests.support.pages import content, figures_of, words_of

NASTY = os.fsdecode(b"r\xff <script>alert(1)&.csv")
COMMAND = f"ppy diagnose '{NASTY}'"
FEW = [effect for effect in EFFECTS_OF_A_STRAIN if effect.id != "strain_lag"]
PAGES = (
    "cause",
    "ambiguous",
    "recalibrate",
    "consistent",
    "unexplained",
    "idle",
    "voltage",
    "holdout",
    "uneven",
)


# --- one diagnosis, and what may become of it -----------------------------------------------------------------------


def named(result, verdict, **changes):
    """The same with another verdict, and with what else is different in the diagnosis."""
    return replace(result, diagnosis=replace(result.diagnosis, verdict=verdict, **changes))


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """A diagnosis for every kind of page."""
    folder, model = tmp_path_factory.mktemp("pages"), find_model("ppy_actuator")

    def read(name, seed=1, outputs=("voltage", "displacement")):
        return read_for(
            model, broken_off(folder / name, seed, {n: n for n in ("current", "force", *outputs)})
        )

    def diagnosed(record, effects=FEW, holdout=None):
        return diagnose(record, model, holdout, Options(effects=[effect.id for effect in effects]))

    record = read(NASTY)
    cause = diagnosed(record)
    diagnosis, selection = cause.diagnosis, cause.diagnosis.selection
    (step, *_), bare = selection.steps, replace(selection, steps=[])
    plain = {
        "selection": bare,
        "estimates": {n: diagnosis.estimates[n] for n in bare.base.problem.names},
    }
    (alternative, _), *others = step.rejected
    alike = replace(selection, steps=[replace(step, alternatives=[alternative], rejected=others)])
    line, shifts = (
        SpectralLine(0.83, 4e-3, 1e-12),
        [LevelShift(100.0 + k, 1e-4, 1e-12) for k in range(7)],
    )
    residuals = {
        "voltage": replace(diagnosis.residuals["voltage"], lines=[line]),
        "displacement": replace(diagnosis.residuals["displacement"], level_shifts=shifts),
    }
    unexplained = named(cause, Verdict.UNEXPLAINED, **plain, residuals=residuals)
    still = {name: np.full_like(record.time, 0.5) for name in ("current", "force")}
    uneven = np.unique(np.geomspace(1, record.time.size, 900).astype(int) - 1)
    sampled = replace(
        record, time=record.time[uneven], signals={n: v[uneven] for n, v in record.signals.items()}
    )
    return {
        "cause": cause,
        "ambiguous": named(cause, Verdict.AMBIGUOUS, selection=alike),
        "recalibrate": named(cause, Verdict.RECALIBRATE, **plain),
        "consistent": named(cause, Verdict.CONSISTENT, **plain, changed=[]),
        "unexplained": replace(unexplained, notes=[Note(NoteCode.NO_TRACE, "slack")]),
        "idle": diagnosed(replace(record, signals=record.signals | still)),
        "voltage": diagnosed(read("voltage.csv", outputs=("voltage",)), FEW[-1:]),
        "holdout": diagnosed(record, (), read(f"{'a_long_name_' * 15}.csv", 2)),
        "uneven": diagnosed(sampled, ()),
    }


@pytest.fixture(scope="session")
def made(results):
    """Every page as text."""
    return {name: page(results[name], COMMAND).html() for name in PAGES}


# --- what is told ---------------------------------------------------------------------------------------------------


def test_an_uneven_record_is_told_and_drawn_without_holes(results, made):
    diagnosis = results["uneven"].diagnosis
    there = np.isfinite(diagnosis.validation.data.measured["voltage"])
    assert (
        f"every third sample was held out: fitted to {(~there).sum()}, judged on {there.sum()}."
        in words_of(made["uneven"])
    )
    assert "Only samples that were held out are shown." in words_of(made["uneven"])


@pytest.mark.parametrize("name", PAGES)
def test_the_verdict_comes_first(results, made, name):
    diagnosis = results[name].diagnosis
    verdict = re.search(r'<p class="verdict">(.*?)</p>', made[name])
    assert html.unescape(re.sub("<[^>]+>", "", verdict[1])).startswith(
        f"{diagnosis.verdict} {wording.sentence(diagnosis)}"
    )


def test_errors_are_those_of_the_diagnosis(results, made):
    diagnosis = results["cause"].diagnosis
    text = words_of(made["cause"])
    for output in ("voltage", "displacement"):
        missing = re.search(
            rf" {output} nominal ([\d.]+) % .*? refitted ([\d.]+) % .*? extended ([\d.]+) % · (\S+) (\S+)",
            text,
        )
        assert float(missing[2]) == pytest.approx(100.0 * diagnosis.before[output], rel=5e-3)
        assert float(missing[3]) == pytest.approx(100.0 * diagnosis.after[output], rel=5e-3)
        y = diagnosis.validation.data.measured[output][diagnosis.validation.first :]
        size = diagnosis.after[output] * np.std(y) * {"V": 1.0, "mm": 1e3}[missing[5]]
        assert float(missing[4]) == pytest.approx(size, rel=5e-3)


def test_evidence_is_told_once_for_every_effect(results, made):
    diagnosis = results["cause"].diagnosis
    text = words_of(made["cause"])
    step = diagnosis.selection.steps[0]
    assert "strain_saturation Elongation that levels off" in text
    assert re.search(rf"relaxes assumption 5 {step.gain:.1f} .*? named", text)
    fitted = {e.effect_name for e, _ in (*step.rejected, *diagnosis.selection.rejected)}
    evidence = text.split("Evidence: what was tried")[1].split(" Parameters ")[0]
    assert evidence.count(" rejected ") == len(fitted)
    assert "another explains the record much better" in evidence
    of_few = {name for name, effect in EFFECTS.items() if effect.id in {few.id for few in FEW}}
    missing = of_few - fitted - {"strain_saturation"}
    told = re.search(r"not fitted: (.*?)\.", evidence)
    assert set(told[1].split(", ") if told else ()) == missing
    assert " not told apart from strain_saturation" in words_of(made["ambiguous"])


def test_parameters_have_intervals_and_marks(results, made):
    diagnosis = results["cause"].diagnosis
    rows = re.findall(r"<tr>(.*?)</tr>", made["cause"])
    rows = {name: row for name in diagnosis.estimates for row in rows if f"<b>{name}</b>" in row}
    assert set(rows) == {name for name in diagnosis.estimates if not name.endswith("_start")}
    assert {name for name, row in rows.items() if "chip differs" in row} == set(diagnosis.changed)
    e = diagnosis.estimates["R1"]
    low, high = map(float, re.search(r'muted">([\d.]+) … ([\d.]+)<', rows["R1"]).groups())
    assert (low, high) == pytest.approx(e.interval, rel=1e-3)
    assert f"{e.value / 0.43 - 1.0:+.1%}"[1:-1] in rows["R1"]


def test_what_is_left_and_not_judged_is_told(made):
    text = words_of(made["unexplained"])
    assert "A line at 0.83 Hz with an amplitude of 0.004 V." in text
    assert text.count("A jump of 0.1 mm at 10") == 5
    assert "2 more jumps." in text
    assert (
        "What could not be judged slack was not judged: it leaves no trace in what was measured"
        in text
    )
    assert "no input moves: neither a cause nor a parameter can be judged" in words_of(made["idle"])
    assert "current stays at 0.5 A; force stays at 0.5 N." in words_of(made["idle"])


def test_what_follows_from_a_diagnosis_has_its_place(results):
    """Simulations of the exported FMU, what the residual correlates with, and an experiment that would tell more."""
    ambiguous, diagnosis = results["ambiguous"], results["ambiguous"].diagnosis
    perfect = {o: np.nan_to_num(y) for o, y in diagnosis.validation.data.measured.items()}
    gain = Gain(
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
    more = named(ambiguous, Verdict.AMBIGUOUS, residuals=diagnosis.residuals | {"voltage": voltage})
    text = words_of(page(replace(more, gain=gain, experiment=experiment), COMMAND).html())
    assert "extended 0 % · 0 V" in text
    assert re.search(r"displacement nominal .*? refitted [\d.]+ % · 1 mm extended 0 %", text)
    assert "Voltage correlates with rate of charge: +0.90 at once" in text
    assert "correlates with time" not in text
    sentence = wording.experiment(experiment)
    assert sentence in text
    assert " ".join(experiment.toml("ppy_actuator", sentence).split()) in text


def test_uneven_samples_have_no_spectrum(results):
    cause, estimation = results["cause"], results["cause"].diagnosis.estimation
    time = estimation.time[-1] * (estimation.time / estimation.time[-1]) ** 3
    text = page(
        named(cause, Verdict.CAUSE, estimation=replace(estimation, time=time)), COMMAND
    ).html()
    assert "Sampling is uneven" in text
    assert len(figures_of(text)) == 1


def test_it_can_be_reproduced(results, made):
    result = results["holdout"]
    text = words_of(made["holdout"])
    for record in (result.record, result.holdout):
        assert hashlib.sha256(record.source.read_bytes()).hexdigest() in text
    assert made["cause"] == page(results["cause"], COMMAND).html()


def test_repairs_are_told(results, made):
    repairs = results["cause"].record.repairs
    assert repairs
    text = words_of(made["cause"])
    assert all(repair.message in text for repair in repairs)


def test_a_name_that_is_code_stays_a_name(made):
    text = content(made["cause"])
    assert "<script>alert" not in text
    assert r"r\udcff &lt;script&gt;alert(1)&amp;.csv" in text
    text.encode()


# --- what is drawn --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAGES)
def test_plotly_knows_everything_that_is_asked_of_it(made, name):
    """Its own schema refuses a misspelt property, which the browser would pass over."""
    drawn = figures_of(made[name])
    assert drawn
    for figure in drawn:
        plotly.graph_objects.Figure(figure)


# --- in a browser ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def tab(browser, tmp_path_factory):
    if os.name != "posix":
        pytest.skip("the browser is spoken to over pipes as POSIX has them")

    with chromium(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


LOOK = """(box => [...document.querySelectorAll("div.plot")].map(place => ({
  traces: place._fullData.map(trace => trace.visible === true),
  drawn: place.querySelectorAll(".scatterlayer .trace path.js-line, .scatterlayer .trace path.js-fill").length,
  long: [...place.querySelectorAll("path.js-line")].filter(path => path.getTotalLength() > 50).length,
  panels: Object.values(place._fullLayout._plots).map(panel => panel.plot.node().querySelectorAll(".trace").length),
  legend: box(place.querySelector(".legend")).bottom,
  notes: Math.min(...[...place.querySelectorAll(".annotation-text, .shape-label")].map(n => box(n).top)),
  right: Math.max(...[...place.querySelectorAll("text")].map(n => box(n).right)),
  left: Math.min(...[...place.querySelectorAll("text")].map(n => box(n).left)),
})))(n => n.getBoundingClientRect())"""
SMALLEST = """Math.min(...[...document.querySelectorAll("p, li, td, th, h1, h2, button, figcaption, code, svg text")]
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
    bad = '<body><p style="width:900px;font-size:5px">wide</p><script src="http://example.com/a.js"></script><script>'
    file = tmp_path / "bad.html"
    file.write_text(f"{bad}console.error('oh'); undefined.x</script>", encoding="utf-8")
    tab.open(file, 390)
    assert len(tab.requests) == 2
    assert {"oh", "TypeError"} <= set(re.findall("oh|TypeError", " ".join(tab.complaints)))
    assert tab.run("document.documentElement.scrollWidth") > 390
    assert tab.run(SMALLEST) == 5.0
