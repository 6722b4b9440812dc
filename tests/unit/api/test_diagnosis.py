"""Claims: where a diagnosis leaves something, a law that lacks it is a cause, and is written."""

from __future__ import annotations

import json
from functools import partial
from math import sin

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit.build.toolchain import host_platform
from orchestration.discrepancy.law_corrections import leaves_something
from orchestration.discrepancy.pipeline import DiagnosisOptions
from studies.hidden.curves import dry_root
from tests.support.browser import chromium
from tests.support.hosts import run_fmpy
from tests.support.lacking import motor
from tests.support.pages import words_of

by_effects = partial(ppy.diagnose, engine="old")
FINER = 20  # steps of an FMU in one sample
NOWHERE = lambda speed: 0.01 * sin(speed / 25.0)  # noqa: E731 - no catalogue has a friction like this
KNOWN = dry_root(0.01, 2.0)


def drawn(folder, curve, seed=1, name="motor.csv"):
    path = folder / name
    return path, motor(path, curve, seed)


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return drawn(tmp_path_factory.mktemp("unknown"), NOWHERE)


@pytest.fixture(scope="module")
def result(record):
    return by_effects(record[0], record[1].plant.model, effects=[])


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    native, python = result.fmu(tmp_path_factory.mktemp("fmu") / "better.fmu", [host_platform()])
    return {"native": native, "python": python}


@pytest.mark.slow
def test_a_law_that_lacks_something_is_a_cause(result):
    assert (result.verdict, result.causes) == ("cause", ["friction(omega)"])
    assert result.sentence.startswith("Friction that depends on omega: it looks like ")
    assert "Confirmed on the held-out third." in result.sentence
    (cause,) = result.to_dict()["causes"]
    assert (cause["effect"], cause["law"], cause["signal"]) == (
        "friction(omega)",
        "friction",
        "omega",
    )
    assert cause["confirmation"] == "confirmed"
    assert cause["evidence"]["delta_bic"] > 10.0
    best = result.law_map[0]
    assert (best["effect"], best["law"], best["signal"], best["confirmed"]) == (
        cause["effect"],
        "friction",
        "omega",
        True,
    )
    assert set(cause["parameters"]) == set(best["parameters"]) <= set(result.parameters)


@pytest.mark.slow
def test_everything_told_is_of_the_model_with_it(result, tmp_path):
    figures = result.to_dict()
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert figures["law_map"] == result.law_map
    assert all(result.gain.after[o] < 0.2 * result.gain.before[o] for o in result.gain.before)
    assert figures["errors"]["validation"]["extended"] == pytest.approx(result.gain.after, rel=0.05)
    assert "friction_of_omega" in {p.name for p in result.model.layout.parameters}
    assert str(result).startswith("cause  Friction that depends on omega: it looks like ")
    text = result.report(tmp_path / "r.html").read_text(encoding="utf-8")
    words = words_of(text)
    for heading in (
        "Friction over omega",
        "Which law over which signal",
        "Corrections that were fitted",
    ):
        assert heading in words
    assert 'class="equation"' in text
    assert "95 % band" in words


@pytest.mark.slow
def test_the_page_stands_in_a_browser(browser, result, tmp_path):
    path = result.report(tmp_path / "r.html")
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(path, 390)
        assert tab.complaints == []
        assert tab.run("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.slow
@pytest.mark.parametrize("runtime", ["native", "python"])
def test_the_fmu_follows_what_was_held_out(record, result, written, runtime):
    """By FMPy, with the error that is stated, though it is fitted to all of the record since.

    A co-simulation FMU holds its inputs, and the record's go on in straight lines: so its steps are
    finer.
    """
    measured = ppy.read_record(record[0], record[1].plant.model)
    assert result.to_dict()["inputs"]["voltage"]["between_samples"] == "linear"
    time = measured.time
    fine = np.interp(np.arange(FINER * (len(time) - 1) + 1) / FINER, np.arange(len(time)), time)
    held = {
        n: np.interp(fine + 0.5 * (fine[1] - fine[0]), time, measured.signals[n])
        for n in ("voltage", "load")
    }
    ran = run_fmpy(written[runtime], fine, held, ["current", "speed"])
    held_at = {n: np.interp(fine, time, measured.signals[n]) for n in held}
    ran["current"] += (held_at["voltage"] - held["voltage"]) / result.parameters[
        "resistance"
    ].value  # feeds through
    ran = {output: values[::FINER] for output, values in ran.items()}
    last = slice(2 * len(measured.time) // 3, None)
    for output, error in result.gain.after.items():
        y = measured.signals[output][last]
        assert np.std(y - ran[output][last]) / np.std(y) == pytest.approx(error, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("runtime", ["native", "python"])
def test_the_sentence_the_curve_and_the_fmu_agree(result, written, runtime):
    """Read off the FMU what is added: at constant speed friction is what the winding gives."""
    best = result.law_map[0]
    x, y, low, high = (np.array(best["curve"][name]) for name in ("x", "y", "low", "high"))
    added = {}
    for voltage in np.linspace(-6.0, 6.0, 13):
        time = np.linspace(0.0, 8.0, 41)
        ran = run_fmpy(
            written[runtime], time, {"voltage": voltage, "load": 0.0}, ["current", "speed"]
        )
        speed, current = ran["speed"][-1], ran["current"][-1]
        assert ran["speed"][-2] == pytest.approx(speed, rel=1e-4, abs=1e-4)
        values = {p.name: p.start for p in result.model.layout.parameters}
        added[speed] = values["constant"] * current - values["damping"] * speed
    speeds = np.array([one for one in added if x[0] < one < x[-1]])
    read = np.array([added[one] for one in speeds])
    assert len(speeds) >= 7
    half = 0.5 * float(np.max(high - low))
    assert read == pytest.approx(np.interp(speeds, x, y), abs=half + 0.02 * np.ptp(y))
    amount = next(iter(best["parameters"].values()))["value"]
    assert amount == pytest.approx(1.0, abs=0.05)  # of a table: all of it


@pytest.mark.slow
def test_what_the_catalogue_has_is_told_as_the_catalogue_does(tmp_path):
    """With the catalogue and without it the answer is the same, by name and by parameters."""
    path, plant = drawn(tmp_path, KNOWN)
    with_it, without = (
        by_effects(path, plant.plant.model, effects=e) for e in (["coulomb_friction"], [])
    )
    assert with_it.causes == without.causes == ["coulomb_friction"]
    assert with_it.law_map == []
    assert without.law_map[0]["effect"] == "coulomb_friction"
    assert without.to_dict()["causes"][0]["effect"] == "coulomb_friction"
    named = "friction_coulomb"
    assert without.parameters[named].value == pytest.approx(
        with_it.parameters[named].value, rel=0.02
    )
    alone = ppy.laws(path, plant.plant.model)
    assert alone.law_map[0]["effect"] == "coulomb_friction"
    assert "coulomb_friction" in str(alone)


def test_laws_may_be_left_out(record):
    left = by_effects(record[0], record[1].plant.model, effects=[], laws=False, engine="old")
    assert (left.verdict, left.causes, left.law_map) == ("unexplained", [], [])
    assert left.details.laws is None
    assert left.to_dict()["law_map"] == []
    assert DiagnosisOptions().laws is False


def test_time_that_is_spent_asks_no_law(record, monkeypatch):
    """The clock jumps when the search is over, so that the verdict itself hangs on no clock."""
    monkeypatch.setattr(
        "orchestration.discrepancy.pipeline.search_laws",
        lambda *given, budget: pytest.fail("a law was asked"),
    )

    def much_later(diagnosis):
        monkeypatch.setattr("orchestration.discrepancy.budget.spent_time", lambda: float("inf"))
        return leaves_something(diagnosis)

    monkeypatch.setattr("orchestration.discrepancy.pipeline.leaves_something", much_later)
    said = by_effects(record[0], record[1].plant.model, effects=[], time=60.0, engine="old")
    assert (said.verdict, said.law_map) == ("unexplained", [])
    assert any("not tried: what its laws lack" in note for note in said.notes)
    assert "(The time was spent before all was tried.)" in said.sentence


def test_a_failure_of_the_laws_leaves_the_diagnosis(record, monkeypatch):
    def fails(*given, budget):
        raise ZeroDivisionError("at rest")

    monkeypatch.setattr("orchestration.discrepancy.pipeline.search_laws", fails)
    said = by_effects(record[0], record[1].plant.model, effects=[], engine="old")
    assert said.verdict == "unexplained"
    assert any(
        "what its laws lack was not judged: ZeroDivisionError: at rest" in note
        for note in said.notes
    )


def test_a_record_that_is_explained_asks_nothing(tmp_path, monkeypatch):
    path, plant = drawn(tmp_path, None)
    monkeypatch.setattr(
        "orchestration.discrepancy.pipeline.search_laws",
        lambda *given, budget: pytest.fail("a law was asked"),
    )
    said = by_effects(path, plant.plant.model, engine="old")
    assert said.verdict in ("consistent", "recalibrate")
    assert said.law_map == []


@pytest.mark.slow
def test_several_records_are_asked_as_one_is(tmp_path):
    paths = [tmp_path / f"{seed}.csv" for seed in (1, 4, 5)]
    first = motor(paths[0], NOWHERE)
    for seed, path in zip((4, 5), paths[1:], strict=True):
        motor(path, NOWHERE, seed, first)
    said = by_effects(paths, first.plant.model, effects=[], engine="old")
    assert (said.verdict, said.causes) == ("cause", ["friction(omega)"])
    assert said.law_map[0]["confirmed"] is True
    errors = {
        (run["record"], output): error
        for run in said.to_dict()["runs"]
        for output, error in run["nrmse"].items()
    }
    assert len(errors) == 6
    assert all(error < 0.05 for error in errors.values())
