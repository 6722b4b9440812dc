"""Claims: the report of a diagnosis shows what was found, in a real browser, on a desk and on a phone."""

from __future__ import annotations

import hashlib
import html
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects
import pytest
from plotly.offline import get_plotlyjs
from scipy.signal import lfilter

from fmus import COMPONENTS, component
from fmus.kit.errors import UserError
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.cli.diagnose import Files
from orchestration.discrepancy.candidates.candidate import catalogue
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment, ExpectedEvidence
from orchestration.discrepancy.design.stimuli import Stimulus
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.extended_model import Gain
from orchestration.discrepancy.report import elements as marks
from orchestration.discrepancy.report import figures
from orchestration.discrepancy.report import wording as words
from orchestration.discrepancy.report.page import Context, page
from orchestration.discrepancy.residuals.correlation import CrossCorrelation, Shown
from orchestration.discrepancy.residuals.lines import LevelShift, SpectralLine
from orchestration.discrepancy.selection.search import Dataset
from orchestration.fmu import model as models
from orchestration.identify.comparison import read_for
from orchestration.identify.estimate import Estimate
from orchestration.records import write_record
from orchestration.reporting.page import Markup, Page, escaped
from orchestration.reporting.plots import MOST, Boundary, Panel, Trace, broken, envelope, stacked
from orchestration.rig.emulator.records import UNITS, draw
from tests.support.browser import chromium
from tests.support.command import ppy

FEW = [EFFECTS[name] for name in ("strain_saturation", "quadratic_strain", "strain_lag", "force_to_voltage")]
NASTY = os.fsdecode(b"r\xff <script>alert(1)&.csv")
PAGES = ("cause", "ambiguous", "recalibrate", "consistent", "unexplained", "idle", "voltage", "holdout", "uneven")
PLOTLY = get_plotlyjs()


# --- one diagnosis, and what may become of it -----------------------------------------------------------------------


def record_of(path, seed, columns):
    """Write a record of the rig, with other names for its columns, that was broken off in the middle of a line."""
    drawn = draw("strain_saturation", seed, duration=300.0, rate=5.0)
    signals = {columns[n]: v for n, v in (drawn.inputs | drawn.outputs).items() if n in columns}
    write_record(path, drawn.time, signals, {column: UNITS[n] for n, column in columns.items()})
    with path.open("a", encoding="utf-8") as file:
        file.write("300.0,0.")


def read(folder, name, seed=1, outputs=("voltage", "displacement")):
    """Write a record of the rig, under any name, and read it again."""
    record_of(folder / name, seed, {n: n for n in ("current", "force", *outputs)})
    record = read_for(models.find_model("ppy_actuator"), folder / name)
    inputs = {n: record.signals[n] for n in ("current", "force")}
    return record, Dataset(record.time, inputs, {n: record.signals[n] for n in outputs})


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """A diagnosis with its context for every kind of page."""
    folder, model = tmp_path_factory.mktemp("pages"), models.find_model("ppy_actuator")
    record, data = read(folder, NASTY)
    found = diagnose(PpyActuator, data, FEW)
    context = Context(record, model, ["ppy", "diagnose", NASTY], FEW)
    (step, *_), bare = found.selection.steps, replace(found.selection, steps=[])
    plain = replace(found, selection=bare, estimates={n: found.estimates[n] for n in bare.base.problem.names})
    (rival, _), *others = step.rejected
    rivals = replace(found.selection, steps=[replace(step, rivals=[rival], rejected=others)])
    line, jumps = SpectralLine(0.83, 4e-3, 1e-12), [LevelShift(100.0 + k, 1e-4, 1e-12) for k in range(7)]
    voltage, displacement = found.left["voltage"], found.left["displacement"]
    left = {"voltage": replace(voltage, lines=[line]), "displacement": replace(displacement, jumps=jumps)}
    still = replace(data, inputs={name: np.full_like(values, 0.5) for name, values in data.inputs.items()})
    idle = diagnose(PpyActuator, still, FEW)
    alone = read(folder, "voltage.csv", outputs=("voltage",))
    uneven = data.where(np.unique(np.geomspace(1, data.time.size, 900).astype(int) - 1))
    other = read(folder, f"{'a_long_name_' * 15}.csv", 2)
    return {
        "cause": (found, context),
        "ambiguous": (replace(found, verdict="ambiguous", selection=rivals), context),
        "recalibrate": (replace(plain, verdict="recalibrate"), context),
        "consistent": (replace(plain, verdict="consistent", significantly_changed=[]), context),
        "unexplained": (replace(plain, verdict="unexplained", left=left, notes=["a note"]), context),
        "idle": (idle, context),
        "voltage": (diagnose(PpyActuator, alone[1], FEW[-1:]), replace(context, record=alone[0], effects=FEW[-1:])),
        "holdout": (diagnose(PpyActuator, data, FEW[:1], holdout=other[1]), replace(context, holdout=other[0])),
        "uneven": (diagnose(PpyActuator, uneven, FEW[:1]), context),
    }


@pytest.fixture(scope="session")
def made(pages):
    """Every page as text."""
    return {name: page(*pages[name]).html() for name in PAGES}


def content(text):
    """What is on a page, without the library that draws."""
    assert text.count(PLOTLY) == 1
    return text.replace(PLOTLY, "")


def words_of(text):
    """What is to be read on a page."""
    text = re.sub(r"<(script|style|noscript).*?</\1>", "", content(text), flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def figures_of(text):
    return [json.loads(data) for data in re.findall(r'<script type="application/json">(.*?)</script>', text)]


# --- what is told ---------------------------------------------------------------------------------------------------


def test_an_uneven_record_is_told_and_drawn_without_holes(pages, made):
    found, _ = pages["uneven"]
    there = np.isfinite(found.validation.data.measured["voltage"])
    assert f"every third sample was held out: fitted to {(~there).sum()}, judged on {there.sum()}." in words_of(
        made["uneven"]
    )
    assert "Only samples that were held out are shown." in words_of(made["uneven"])


@pytest.mark.parametrize("name", PAGES)
def test_the_verdict_comes_first(pages, made, name):
    found, _ = pages[name]
    verdict = re.search(r'<p class="verdict">(.*?)</p>', made[name])
    assert html.unescape(re.sub("<[^>]+>", "", verdict[1])).startswith(f"{found.verdict} {words.sentence(found)}")


def test_errors_are_those_of_the_diagnosis(pages, made):
    found, _ = pages["cause"]
    told = words_of(made["cause"])
    for output in ("voltage", "displacement"):
        missing = re.search(
            rf" {output} nominal ([\d.]+) % .*? refitted ([\d.]+) % .*? extended ([\d.]+) % · (\S+) (\S+)", told
        )
        assert float(missing[2]) == pytest.approx(100.0 * found.before[output], rel=5e-3)
        assert float(missing[3]) == pytest.approx(100.0 * found.after[output], rel=5e-3)
        y = found.validation.data.measured[output][found.validation.first :]
        size = found.after[output] * np.std(y) * {"V": 1.0, "mm": 1e3}[missing[5]]
        assert float(missing[4]) == pytest.approx(size, rel=5e-3)


def test_evidence_is_told_once_for_every_effect(pages, made):
    found, _ = pages["cause"]
    told = words_of(made["cause"])
    step = found.selection.steps[0]
    assert "strain_saturation Elongation that levels off" in told
    assert re.search(rf"relaxes assumption 5 {step.gain:.1f} .*? named", told)
    fitted = {e.effect_name for e, _ in (*step.rejected, *found.selection.rejected)}
    evidence = told.split("Evidence: what was tried")[1].split(" Parameters ")[0]
    assert evidence.count(" rejected ") == len(fitted)
    assert "beside strain_saturation it is not needed" in evidence
    missing = {effect.id for effect in FEW} - fitted - {"strain_saturation"}
    assert (f"not fitted: {', '.join(e.id for e in FEW if e.id in missing)}." in evidence) is bool(missing)
    assert " not told apart from strain_saturation" in words_of(made["ambiguous"])


def test_parameters_have_intervals_and_marks(pages, made):
    found, _ = pages["cause"]
    rows = re.findall(r"<tr>(.*?)</tr>", made["cause"])
    rows = {name: row for name in found.estimates for row in rows if f"<b>{name}</b>" in row}
    assert set(rows) == {name for name in found.estimates if not name.endswith("_start")}
    assert {name for name, row in rows.items() if "chip differs" in row} == set(found.changed)
    e = found.estimates["R1"]
    low, high = map(float, re.search(r'muted">([\d.]+) … ([\d.]+)<', rows["R1"]).groups())
    assert (low, high) == pytest.approx(e.interval, rel=1e-3)
    assert f"{e.value / 0.43 - 1.0:+.1%}"[1:-1] in rows["R1"]


def test_what_is_left_and_not_judged_is_told(made):
    told = words_of(made["unexplained"])
    assert "A line at 0.83 Hz with an amplitude of 0.004 V." in told
    assert told.count("A jump of 0.1 mm at 10") == 5
    assert "2 more jumps." in told
    assert "What could not be judged a note" in told
    assert "no input moves: neither a cause nor a parameter can be judged" in words_of(made["idle"])
    assert "current stays at 0.5 A; force stays at 0.5 N." in words_of(made["idle"])


def test_what_others_deliver_has_its_place(pages):
    """Simulations of the exported FMU, what the residual goes along with, and an experiment that would tell more."""
    found, context = pages["ambiguous"]
    perfect = {o: np.nan_to_num(y) for o, y in found.validation.data.measured.items()}
    gain = Gain(found.before, found.after, {}, {o: y + 1e-3 for o, y in perfect.items()}, perfect)
    seen = CrossCorrelation("voltage", "rate of charge", np.zeros(1), np.ones(1), 0.05, 0.0, 0.9, 1e-9)
    chance = replace(seen, signal="time", p_value=0.5)
    stimuli = {name: Stimulus("constant", {"value": 0.5}) for name in ("current", "force")}
    experiment = DiscriminatingExperiment(
        stimuli, 600.0, 0.1, [ExpectedEvidence("left", "right", 42.0)], found.selection.base
    )
    more = replace(context, gain=gain, experiment=experiment, shown={"voltage": Shown([seen, chance], [], None)})
    told = words_of(page(found, more).html())
    assert "extended 0 % · 0 V" in told
    assert re.search(r"displacement nominal .*? refitted [\d.]+ % · 1 mm extended 0 %", told)
    assert "Voltage goes along with rate of charge: correlation +0.90 at once" in told
    assert "goes along with time" not in told
    assert experiment.sentence() in told
    assert " ".join(experiment.toml("ppy_actuator").split()) in told


def test_uneven_samples_have_no_spectrum(pages):
    found, context = pages["cause"]
    time = np.where(np.arange(found.data.time.size) % 5, found.data.time, found.data.time + 0.15)
    told = page(replace(found, data=replace(found.data, time=time)), context).html()
    assert "Sampling is uneven" in told
    assert len(figures_of(told)) == 1


def test_it_can_be_reproduced(pages, made):
    _, context = pages["holdout"]
    told = words_of(made["holdout"])
    for record in (context.record, context.holdout):
        assert hashlib.sha256(record.source.read_bytes()).hexdigest() in told
    assert made["cause"] == page(*pages["cause"]).html()


def test_repairs_are_told(pages, made):
    _, context = pages["cause"]
    assert context.record.repairs
    told = words_of(made["cause"])
    assert all(repair.message in told for repair in context.record.repairs)


def test_a_name_that_is_code_stays_a_name(made):
    text = content(made["cause"])
    assert "<script>alert" not in text
    assert r"r\udcff &lt;script&gt;alert(1)&amp;.csv" in text
    text.encode()


def test_every_effect_is_described():
    for name in COMPONENTS:
        cls = component(name)
        for effect in catalogue(cls, models.catalogue(cls), [o.name for o in cls.layout.outputs]):
            text = words.does(effect)
            assert len(text) > 20
            assert "`" not in text


@pytest.mark.parametrize(
    ("plain", "printed"),
    [
        ("2e+06 N*s/m", "2·10<sup>6</sup> N·s/m"), ("-1.5e-07 1/C^2", "−1.5·10<sup>−7</sup> 1/C<sup>2</sup>"),
        ("0.43 ohm", "0.43 ohm"), ("-8.0 %", "−8.0 %"), ("a<b", "a&lt;b"), ("kg*m^-1", "kg·m<sup>−1</sup>"),
    ],
)  # fmt: skip
def test_values_as_they_are_printed(plain, printed):
    assert words.pretty(plain) == printed


@pytest.mark.parametrize(
    ("gains", "why"),
    [
        ([50.0, 2.0], "alone it lowers BIC by 50.0; beside a it is not needed"),
        ([3.0], "too little: 10 would be evidence"),
        ([-3.0], "it explains less than its parameters cost"),
        ([99.0], "another explains the record much better"),
    ],
)  # fmt: skip
def test_why_an_effect_is_not_named(gains, why):
    assert words.why_not(gains, "a") == why


def test_an_interval_is_drawn_to_scale():
    near, far = (Estimate(v, 1.0, (0.9 * v, 1.1 * v), "1") for v in (1.0, 2.0))
    scale = marks.Scale.of([near, far])
    middle, off = (float(re.search(r'cx="([\d.]+)"', scale.drawn(e, False))[1]) for e in (near, far))
    end = float(re.search(r'<svg width="(\d+)"', scale.title)[1])
    assert middle == end / 2
    assert (off - middle) / (end / 2) == pytest.approx(np.log(2.0) / scale.reach, abs=1e-3)
    assert middle < off < end
    assert scale.drawn(Estimate(1.0, 0.0, (0.0, 2.0), "1"), False) == ""


# --- what is drawn --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAGES)
def test_plotly_knows_everything_that_is_asked_of_it(made, name):
    """Its own schema refuses a misspelt property, which the browser would pass over."""
    drawn = figures_of(made[name])
    assert drawn
    for figure in drawn:
        plotly.graph_objects.Figure(figure)


def test_a_title_cannot_end_the_script_it_stands_in():
    made = Page("code", "code")
    made.plot(stacked([Panel("</script><script>", 100, [Trace("</script>", np.arange(2.0), np.ones(2), {})])], ""), "")
    (figure,) = figures_of("".join(made.parts))
    assert figure["data"][0]["legendgroup"] == "</script>"


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
        stacked([Panel("a", 100, lines), Panel("b", 100, lines)], "time [h]", boundary=Boundary(3.0, "a", "b")), ""
    )
    assert len("".join(made.parts)) < 2e6
    assert 4e6 < len(made.html()) < 8e6


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9])
def test_the_band_of_a_spectrum_holds_99_percent_of_noise(colour):
    inside = []
    for seed in range(40):
        noise = lfilter([1.0], [1.0, -colour], np.random.default_rng(seed).standard_normal(4000))
        frequency, density = figures.spectrum(noise, 0.1)
        low, high = figures.band(noise, frequency, density, 0.1)
        inside.append(np.mean((low < density) & (density < high)))
    assert np.mean(inside) == pytest.approx(0.99, abs=0.006)
    exact = np.sqrt(2.0 * 0.1) / np.abs(1.0 - colour * np.exp(-2j * np.pi * frequency * 0.1))
    assert np.mean((low < exact) & (exact < high)) > 0.99
    hum = noise + 2.0 * np.sin(2.0 * np.pi * 0.83 * 0.1 * np.arange(4000))
    frequency, density = figures.spectrum(hum, 0.1)
    beyond = frequency[density > 2.0 * figures.band(hum, frequency, density, 0.1)[1]]
    assert beyond == pytest.approx(0.83, abs=0.05)


def test_autocorrelation_is_that_of_the_definition():
    x = lfilter([1.0], [1.0, -0.9], np.random.default_rng(1).standard_normal(100_000))
    assert figures.autocorrelation(x)[:5] == pytest.approx(0.9 ** np.arange(1, 6), abs=0.02)
    assert figures.autocorrelation(np.zeros(400)).tolist() == [0.0] * 40


def test_a_long_name_fits_above_its_panel():
    found = figures._titled("displacement_of_the_second_stage_relative_to_the_frame", "N*s/m")
    assert len(found) < 60
    assert found.endswith(" [N·s/m]")


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
    ("name", "width"), [*((name, 390) for name in PAGES), ("cause", 1280), ("unexplained", 1280), ("holdout", 1280)]
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


def test_a_button_shows_what_was_held_out(tab, pages, made, tmp_path):
    found, _ = pages["cause"]
    file = tmp_path / "page.html"
    file.write_bytes(made["cause"].encode())
    tab.open(file, 1280)
    shown = 'document.querySelector("div.plot").layout.xaxis.range'
    tab.run("document.querySelectorAll('.views button')[1].click()")
    time, first = found.validation.data.time, found.validation.first
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


# --- the command ----------------------------------------------------------------------------------------------------


def test_the_command_writes_a_report_of_another_record(tmp_path):
    columns = {"current": "I", "force": "F", "voltage": "U", "displacement": "x"}
    for name, seed in ((NASTY, 1), ("other.csv", 2)):
        record_of(tmp_path / name, seed, columns)
    mapping = [f"--map={column}={name}" for name, column in columns.items()]
    arguments = ["diagnose", NASTY, *mapping, "--effects=strain_saturation", "--holdout=other.csv"]
    done = ppy(*arguments, "--report=r.html", "--json=r.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "repaired: other.csv: " in done.stderr
    told = words_of((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert "--holdout=other.csv" in told.split("How to reproduce")[1]
    written = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    shares = re.findall(r"refitted ([\d.]+) %", told.split("The record held out")[0])
    before = written["gain"]["holdout_nrmse_before"].values()
    assert [float(share) for share in shares] == pytest.approx([100.0 * error for error in before], rel=5e-3)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([NASTY, "other.csv", "r.html", "r.json"])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"report": "r.csv"}, "--report r.csv: this is the record itself; it will not be overwritten"),
        ({"result": "r.csv"}, "--json r.csv: this is the record itself; it will not be overwritten"),
        ({"report": "link.html"}, "--report link.html: this is the record itself; it will not be overwritten"),
        ({"holdout": "h.html", "report": "./h.html"}, "--report h.html: this is the record held out itself"),
        ({"holdout": "h.html", "result": "h.html"}, "--json h.html: this is the record held out itself"),
        ({"holdout": "r.csv"}, "--holdout r.csv: this is the record itself; nothing would be held out"),
        ({"report": "a.html", "result": "a.html"}, "--json and --report both name a.html"),
        ({"report": "a.pdf"}, "--report a.pdf: its name must end in .html"),
        ({"report": "folder"}, "--report folder: this is a folder; name a file in it"),
        ({"report": "a" * 300 + ".html"}, "File name too long"),
    ],
)
def test_nothing_is_lost(given, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("r.csv", "h.html"):
        Path(name).write_text("a record", encoding="utf-8")
    Path("link.html").symlink_to("r.csv")
    Path("folder").mkdir()
    with pytest.raises(UserError, match=re.escape(message)):
        Files(Path("r.csv"), **{key: Path(value) for key, value in given.items()}).check()
    Files(Path("r.csv"), Path("h.html"), Path("new.json"), Path("new.html")).check()


def test_markup_is_not_escaped_twice():
    assert escaped(escaped("a & b")) == "a &amp; b"
    assert isinstance(escaped("a"), Markup)
