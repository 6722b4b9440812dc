"""Claims: laws that are asked find what was hidden, and their file, FMU and page say so."""

from __future__ import annotations

import inspect
import runpy

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Effect, stack
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu.model import find_model
from studies.hidden.curves import dry_root
from tests.support.browser import chromium
from tests.support.lacking import motor
from tests.support.look import FAINT, OUTSIDE, UNREACHED
from tests.support.pace import slow_but
from tests.support.pages import words_of

HIDDEN = dry_root(0.01, 2.0)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    path = tmp_path_factory.mktemp("laws") / "motor.csv"
    return path, motor(path, HIDDEN)


@pytest.fixture(scope="module")
def result(drawn):
    return ppy.laws(drawn[0], drawn[1].plant.model)


@pytest.mark.slow
def test_what_was_hidden_is_found(result):
    assert (result.verdict, result.causes) == ("cause", ["friction(omega)"])
    assert (result.law_map[0]["law"], result.law_map[0]["signal"]) == ("friction", "omega")
    assert result.law_map[0]["units"] == {"law": "N*m", "signal": "rad/s"}
    assert all(result.gain.after[o] < 0.3 * result.gain.before[o] for o in result.gain.before)


@pytest.mark.slow
def test_the_whole_law_is_the_one_that_was_hidden(drawn, result):
    """Compare a law and its correction with the plant, wherever the record has been."""
    model, truth = result.model(), drawn[1].truth
    for speed in np.linspace(-100.0, 100.0, 21):
        model.omega = float(speed)
        expected = truth["damping"] * speed + HIDDEN(speed)
        assert model.friction() == pytest.approx(expected, abs=1.5e-3)


@pytest.mark.slow
def test_the_file_of_the_effect_does_what_the_model_does(drawn, result, tmp_path):
    """By simulation: laid over the component it gives what the fitted model gives."""
    path, record = drawn
    names = runpy.run_path(str(result.effect(tmp_path / "law.py")))
    effects = [
        one
        for one in names.values()
        if inspect.isclass(one) and issubclass(one, Effect) and one is not Effect
    ]
    laid_over = stack(find_model(record.plant.model).cls, *effects, defaults=names["FITTED"])
    data = ppy.read_record(path, record.plant.model)
    inputs = {name: data.signals[name] for name in ("voltage", "load")}
    ours, theirs = (ppy.simulate(cls, inputs, time=data.time) for cls in (laid_over, result.model))
    for output in ("current", "speed"):
        assert ours[output] == pytest.approx(theirs[output], rel=1e-6, abs=1e-6)
        assert np.std(ours[output] - data.signals[output]) < 0.1 * np.std(data.signals[output])


@pytest.mark.slow
def test_the_model_is_an_fmu(result, tmp_path):
    native, python = result.fmu(tmp_path / "better.fmu", [host_platform()])
    assert python.exists()
    assert "friction_of_omega" in find_model(str(native)).parameters


@pytest.mark.slow
@pytest.mark.parametrize("width", slow_but([1200, 390], 390))
def test_the_page_stands_in_a_browser(browser, result, tmp_path, width):
    path = result.report(tmp_path / "laws.html")
    words = words_of(path.read_text(encoding="utf-8"))
    assert "Which law over which signal" in words
    assert "ppy laws " in words.split("How to reproduce")[1]
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(path, width)
        assert tab.complaints == []
        assert all(address.startswith(("file:", "data:", "blob:")) for address in tab.requests)
        assert tab.run("document.documentElement.scrollWidth <= innerWidth")
        assert [tab.run(question) for question in (FAINT, UNREACHED, OUTSIDE)] == [[], [], []]
