"""Claims: the picture shows each signal in its tube and around its worst place, refused first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.experiment.regression import compare, read_tolerances
from orchestration.experiment.regression.picture import shown
from orchestration.records import Record
from orchestration.reporting import draw

TIME = np.linspace(0.0, 10.0, 101)


def compared(**change):
    signals = {f"s{k}": np.sin(TIME + k) for k in range(10)}
    units = dict.fromkeys(signals, "V")
    result = Record(TIME, signals | change, units, Path("result.csv"))
    reference = Record(TIME, signals, units, Path("reference.csv"))
    return compare(result, reference, read_tolerances("10mV", "--tube"))


def test_a_refused_signal_is_first_and_its_worst_place_marked():
    bumped = np.sin(TIME + 9)
    bumped[40] += 0.5
    regression = compared(s9=bumped)
    assert [one.signal for one in shown(regression)] == ["s9", *(f"s{k}" for k in range(7))]
    whole, near = draw(regression).axes[:2]
    (mark,) = [line for line in near.lines if line.get_marker() == "o"]
    assert (mark.get_xdata(), mark.get_ydata()) == ([TIME[40]], [bumped[40]])
    low, high = near.get_xlim()
    assert 3.4 < low < 4.0 < high < 4.6
    assert whole.get_ylabel() == "s9\n[V]"
    assert whole.get_xlim()[1] >= 10.0


def test_signals_that_agree_and_constants_are_drawn():
    draw(compared(s0=np.sin(TIME)))
    constant = Record(TIME, {"k": np.ones(101)}, {"k": "1"}, Path("a.csv"))
    draw(compare(constant, constant, read_tolerances("0s", "--tube")))


def test_without_a_signal_to_compare_there_is_none():
    one = Record(TIME, {"a": TIME, "b": TIME}, {"a": "V", "b": "V"}, Path("a.csv"))
    other = Record(TIME, {"a": TIME, "b": TIME}, {"a": "m", "b": "m"}, Path("b.csv"))
    with pytest.raises(UserError, match=r"a\.csv: no signal was compared"):
        draw(compare(one, other, read_tolerances("1%", "--tube")))
