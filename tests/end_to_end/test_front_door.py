"""Claims: ``import ppy_rig as ppy`` has what a user needs, as the commands show it."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import orchestration
import ppy_rig as ppy
from demonstrations.records import draw, write
from orchestration.reporting import console, in_shell
from tests.support.command import works

EFFECTS = ["strain_saturation", "quadratic_strain"]


@pytest.fixture(scope="module")
def hidden(tmp_path_factory) -> Path:
    """Record a strain that saturates, with samples enough to tell the creep from it."""
    path = tmp_path_factory.mktemp("front") / "hidden.csv"
    write(draw("strain_saturation", 1, duration=300.0, rate=10.0), path)
    return path


@pytest.fixture(scope="module")
def result(hidden):
    return ppy.diagnose(ppy.read_record(hidden), effects=EFFECTS)


def test_importing_loads_neither_numpy_nor_any_name():
    code = (
        "import sys, ppy_rig; print([m for m in ('numpy', 'casadi', 'rich', 'pint') if m in"
        " sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_name_is_there_and_says_how_it_is_used():
    for name in set(ppy.__all__) - {"__version__"}:
        value = getattr(ppy, name)
        assert inspect.getdoc(value), name
        assert name in dir(ppy)
    with pytest.raises(AttributeError, match=r"attribute.*diagnoze"):
        ppy.diagnoze  # noqa: B018


def test_it_offers_what_orchestration_does_and_is_listed_so():
    assert dir(ppy) == dir(orchestration)
    assert all(getattr(ppy, name) is getattr(orchestration, name) for name in ppy.__all__)


@pytest.mark.slow
def test_a_result_prints_as_the_command_does(hidden, result, tmp_path, monkeypatch):
    monkeypatch.setattr(console.out, "width", console.TEXT_WIDTH)
    text = works(
        "diagnose",
        str(hidden),
        "--effects",
        ",".join(EFFECTS),
        "--json",
        str(tmp_path / "d.json"),
        cwd=tmp_path,
    )
    with in_shell():  # which options are written for
        printed = str(result)
        given = json.loads(json.dumps(result.to_dict()))
    assert text.partition("wrote ")[0].split() == printed.split()
    written = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))
    del written["shown"], given["shown"]  # as printed, with the next commands or calls
    assert written == given


@pytest.mark.slow
def test_what_was_found_is_reachable_by_name(result):
    assert result.verdict == "cause"
    assert result.causes == ["strain_saturation"]
    assert "% strain that levels off at large charge: beyond " in result.sentence
    low, high = result.parameters["R1"].interval
    assert low < result.parameters["R1"].value < high
    assert result.parameters["R1"].unit == "ohm"
    assert result.gain.after["displacement"] < 0.5 * result.gain.before["displacement"]
    assert len(repr(result)) < 120
    assert "strain that levels off at large charge: beyond " in result._repr_html_()


@pytest.mark.slow
def test_a_result_is_drawn_reported_and_built(result, tmp_path):
    assert len(result.plot(tmp_path / "d.png").axes) == 2
    assert (tmp_path / "d.png").stat().st_size > 10_000
    text = result.report(tmp_path / "d.html").read_text(encoding="utf-8")
    assert "ppy diagnose" in text
    native, python = result.fmu(
        tmp_path / "better.fmu", platforms=["linux64"] if sys.platform == "linux" else None
    )
    assert native.exists()
    assert python.exists()
    with pytest.raises(ppy.UserError, match=r"ends in \.html"):
        result.report(tmp_path / "d.txt")


@pytest.mark.slow
def test_the_extended_model_goes_on(result, hidden):
    """Compare with the record: the extended model follows it, the first one does not."""
    record = ppy.read_record(hidden)
    inputs = {name: record.signals[name] for name in ("current", "force")}
    for model, limit in ((result.model, 0.05), ("ppy_actuator", 1.0)):
        simulated = ppy.simulate(model, inputs, time=record.time)["displacement"]
        error = np.sqrt(np.mean((simulated - record.signals["displacement"]) ** 2))
        share = error / np.std(record.signals["displacement"])
        assert share < limit
    assert share > 0.2
    compared = ppy.compare(record, result.model)
    assert compared.before["displacement"].fit_percent > 95.0


def test_what_cannot_be_used_is_refused_in_a_line(hidden, tmp_path):
    with pytest.raises(ppy.UserError, match="no component named 'ppy_actuatr'"):
        ppy.diagnose(hidden, "ppy_actuatr")
    with pytest.raises(ppy.UserError, match="no effect named 'strain_saturatoin'"):
        ppy.diagnose(hidden, effects=["strain_saturatoin"])
    with pytest.raises(ppy.UserError, match="no parameter named 'R3'"):
        ppy.diagnose(hidden, hold=["R3"])
    with pytest.raises(ppy.UserError, match="no input named 'curent'"):
        ppy.simulate("ppy_actuator", {"curent": 1.0})
    with pytest.raises(ppy.UserError, match=r"current: shape \(3,\) for 101 points"):
        ppy.simulate("ppy_actuator", {"current": [1.0, 2.0, 3.0]}, stop=10.0)
    flat = tmp_path / "flat.csv"
    drawn = draw(None, 1, duration=300.0, rate=5.0)
    for values in drawn.outputs.values():
        values[:] = 1.0
    write(drawn, flat)
    with pytest.raises(ppy.UserError, match="no output is left that could be trusted"):
        ppy.diagnose(flat, effects=[])
