"""Claims: a law that lacks something is found without any catalogue, shown, and written."""

from __future__ import annotations

import base64
import html
import inspect
import json
import runpy

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Effect, stack
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from orchestration.discrepancy.laws.map import LawMap
from orchestration.fmu.model import find_model
from studies.hidden.curves import dry_root
from tests.support.browser import chromium
from tests.support.lacking import motor
from tests.support.look import FAINT, OUTSIDE, UNREACHED
from tests.support.pace import slow_but
from tests.support.pages import words_of
from tests.support.reference import documented_of_laws, fields

HIDDEN = dry_root(0.01, 2.0)
FEW = 8  # entries of a map


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    path = tmp_path_factory.mktemp("laws") / "motor.csv"
    return path, motor(path, HIDDEN)


@pytest.fixture(scope="module")
def result(drawn):
    """Fit the entries of the map that tell most; a diagnosis is tested with all of them."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(LawMap, "entries", lambda self, known=LawMap.entries: known(self)[:FEW])
        return ppy.laws(drawn[0], drawn[1].plant.model)


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    path = tmp_path_factory.mktemp("clean") / "clean.csv"
    return ppy.laws(path, motor(path, None).plant.model, time=30.0)


@pytest.mark.slow
def test_what_was_hidden_is_found_and_confirmed(result):
    best = result.law_map[0]
    assert (best["law"], best["signal"], best["memory"], best["kind"]) == (
        "friction",
        "omega",
        "",
        "add",
    )
    assert best["confirmed"] is True
    assert best["units"] == {"law": "N*m", "signal": "rad/s"}
    assert all(a["delta_bic"] > 0.0 for a in result.law_map)
    assert result.sentence.startswith(
        "Friction depends on omega beyond what the model has: it looks like "
    )
    assert "on data that no fit has seen the error of " in result.sentence


@pytest.mark.slow
def test_the_whole_law_is_the_one_that_was_hidden(drawn, result):
    """Compare a law and its correction with the plant, wherever the record has been."""
    model, truth = result.model(), drawn[1].truth
    for speed in np.linspace(-100.0, 100.0, 21):
        model.omega = float(speed)
        assert model.friction() == pytest.approx(
            truth["damping"] * speed + HIDDEN(speed), abs=1.5e-3
        )


@pytest.mark.slow
def test_the_curve_has_a_band_about_it(result):
    for one in result.law_map:
        x, y, low, high = (np.array(one["curve"][name]) for name in ("x", "y", "low", "high"))
        assert len(x) == len(y) == len(low) == len(high) >= 2
        assert (np.diff(x) > 0.0).all()
        assert (low <= y).all()
        assert (y <= high).all()
        assert len(one["alike"]) <= 5


@pytest.mark.slow
def test_figures_are_plain_and_the_same_everywhere(result):
    figures = result.to_dict()
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert figures["law_map"] == result.law_map
    assert {path for path, _ in fields(figures)} <= documented_of_laws().keys()
    assert figures["sentence"] == result.sentence
    after, before = (figures["errors"][f"holdout_nrmse_{when}"] for when in ("after", "before"))
    assert all(after[o] < before[o] for o in before)
    assert str(result).splitlines()[0] == result.sentence
    shown = result._repr_mimebundle_()
    assert shown["text/html"].startswith(f"<p>{html.escape(result.sentence)}</p>")
    assert "<table" in shown["text/html"]
    assert base64.b64decode(shown["image/png"]).startswith(b"\x89PNG")
    assert list(result.to_frame()["law"]) == [one["law"] for one in result.law_map]
    assert result.diagnosis.causes == []


@pytest.mark.slow
def test_the_file_of_the_effect_does_what_the_model_does(drawn, result, tmp_path):
    """By simulation: laid over the component it gives what the fitted model gives."""
    path, record = drawn
    names = runpy.run_path(str(result.effect(tmp_path / "law.py")))
    (effect,) = (
        c
        for c in names.values()
        if inspect.isclass(c) and issubclass(c, Effect) and c is not Effect
    )
    motor_class = find_model(record.plant.model).cls
    laid_over = stack(motor_class, effect, defaults=names["FITTED"])
    data = ppy.read_record(path, record.plant.model)
    inputs = {name: data.signals[name] for name in ("voltage", "load")}
    ours, theirs = (ppy.simulate(cls, inputs, time=data.time) for cls in (laid_over, result.model))
    for output in ("current", "speed"):
        assert ours[output] == pytest.approx(theirs[output], rel=1e-6, abs=1e-6)
        assert np.std(ours[output] - data.signals[output]) < 0.1 * np.std(data.signals[output])
    with pytest.raises(UserError, match=r"ends in \.py"):
        result.effect(tmp_path / "law.txt")


@pytest.mark.slow
def test_the_model_is_an_fmu(result, tmp_path):
    native, python = result.fmu(tmp_path / "better.fmu", [host_platform()])
    assert python.exists()
    assert "friction_of_omega" in find_model(str(native)).parameters


@pytest.mark.slow
def test_a_picture_is_drawn(result, tmp_path):
    figure = result.plot(tmp_path / "curve.png")
    assert figure.axes[0].get_xlabel() == "omega [rad/s]"
    assert figure.axes[0].get_ylabel() == "more in friction [N*m]"
    assert (tmp_path / "curve.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_page_tells_it(result, tmp_path):
    text = result.report(tmp_path / "laws.html").read_text(encoding="utf-8")
    words = words_of(text)
    assert "Friction depends on omega beyond what the model has" in words
    for heading in (
        "Which law over which signal",
        "Corrections that were fitted",
        "What to do next",
    ):
        assert heading in words
    assert "ppy laws " in words.split("How to reproduce")[1]
    assert "where the record has been" in words
    assert '<table class="heat">' in text
    assert words.split("Which law over which signal")[1].split(" friction ")[0].count("evidence")
    with pytest.raises(UserError, match=r"ends in \.html"):
        result.report(tmp_path / "laws.txt")


@pytest.mark.slow
@pytest.mark.parametrize("width", slow_but([1200, 390], 390))
def test_the_page_stands_in_a_browser(browser, result, tmp_path, width):
    path = result.report(tmp_path / "laws.html")
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(path, width)
        assert tab.complaints == []
        assert all(address.startswith(("file:", "data:", "blob:")) for address in tab.requests)
        assert tab.run("document.documentElement.scrollWidth <= innerWidth")
        assert [tab.run(question) for question in (FAINT, UNREACHED, OUTSIDE)] == [[], [], []]


def test_a_model_that_is_right_lacks_nothing(clean, tmp_path):
    assert clean.sentence == "No law is found to lack anything."
    assert clean.law_map == []
    assert clean.model is None
    assert clean.to_frame().empty
    text = clean.report(tmp_path / "clean.html").read_text(encoding="utf-8")
    assert "No law is found to lack anything." in text
    for write, name in (
        (clean.effect, "law.py"),
        (clean.fmu, "better.fmu"),
        (clean.plot, "curve.png"),
    ):
        with pytest.raises(UserError, match="no law is found to lack anything"):
            write(tmp_path / name)
        assert not (tmp_path / name).exists()


def test_a_record_in_which_nothing_moves_asks_nothing(drawn):
    record = ppy.read_record(drawn[0], drawn[1].plant.model)
    for name, values in record.signals.items():
        values[:] = (
            0.5
            if name in ("voltage", "load")
            else 1e-3 * np.random.default_rng(1).standard_normal(values.size)
        )
    result = ppy.laws(record, drawn[1].plant.model)
    assert result.details is None
    assert "no input moves" in result.sentence
    assert result.law_map == []
    assert "inputs move" in str(result)
