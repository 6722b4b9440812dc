"""Claims: a comparison with a reference is shown, judged and written as figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestration.cli.regression import as_json, cases, show, write
from orchestration.experiment.regression import compare, read_tolerances
from orchestration.records import Record

TIME = np.linspace(0.0, 1.0, 11)


@pytest.fixture
def regression():
    reference = Record(TIME, {"v": TIME, "w": TIME}, {"v": "V", "w": "1"}, Path("right.csv"))
    signals = {"v": TIME + 0.2 * (TIME > 0.55), "new": TIME}
    result = Record(TIME, signals, {"v": "V", "new": "1"}, Path("now.csv"))
    return compare(result, reference, read_tolerances("10%", "--tube"))


def test_it_is_shown(regression, capsys):
    show(regression)
    printed = capsys.readouterr()
    assert "not as in right.csv: v differs by 0.2 V at " in printed.out
    assert "not as in right.csv: w is missing in now.csv" in printed.out
    assert "now.csv and right.csv: 2 of 2 signals differ" in printed.out
    assert "not in right.csv, not compared: new" in printed.err


def test_where_one_signal_has_a_tolerance_those_without_are_named(capsys):
    units = {"v": "V", "w": "1"}
    reference = Record(TIME, {"v": TIME, "w": TIME}, units, Path("right.csv"))
    show(compare(reference, reference, read_tolerances("v=0.5V, 1%", "--tube")))
    assert "without a tolerance, the same to the last bit: w" in capsys.readouterr().err
    for tolerances in ("1%, v=0.5V", ""):
        read = read_tolerances(tolerances, "--tube") if tolerances else {}
        show(compare(reference, reference, read))
        assert "to the last bit:" not in capsys.readouterr().err


def test_each_signal_is_a_case_and_has_figures(regression):
    v, w = cases(regression)
    assert (v.subject, v.name, v.failure[:10]) == ("now.csv", "v", "differs by")
    assert w.failure == "is missing in now.csv"
    figures = as_json(regression)
    assert (figures["same"], figures["new"]) == (False, ["new"])
    assert figures["signals"]["v"]["difference"] == pytest.approx(0.2)
    assert figures["signals"]["v"]["outside"] == 5
    assert figures["signals"]["w"]["at"] is None


def test_what_is_asked_for_is_written(regression, tmp_path):
    write(regression, tmp_path / "page.html", tmp_path / "picture.svg")
    write(regression, None)
    assert {path.name for path in tmp_path.iterdir()} == {"page.html", "picture.svg"}
