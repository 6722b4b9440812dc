"""Claims: a tolerance is a time, amounts and shares; those of one signal stand after its name."""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from orchestration.experiment.regression import read_tolerances
from orchestration.experiment.regression.tolerances import EXACT, Tolerance


def test_amounts_before_any_name_are_of_all_other_signals():
    read = read_tolerances("20ms, 1%, voltage=1mV, omega = 0.5 %, 1e-3 s", "--tube")
    assert read.of("anything") == Tolerance(0.02, ("1%",))
    assert read.of("voltage") == Tolerance(0.0, ("1mV",))
    assert read.of("omega").time == 1e-3
    assert read.of("omega").height("rad/s", 10.0, "") == pytest.approx(0.05)


def test_without_any_the_others_are_exact():
    assert read_tolerances("a[1,2]=1%", "--tube").others == EXACT
    assert list(read_tolerances("a[1,2]=1%", "--tube").named) == ["a[1,2]"]
    assert read_tolerances(["v=1mV", "w=1%"], "--tube").named.keys() == {"v", "w"}


@pytest.mark.parametrize(
    ("text", "unit", "height"),
    [
        ("1mV", "V", 1e-3),
        ("2", "mV", 2.0),
        ("1mV, 1%", "V", 0.021),
        ("0.5K", "degC", 0.5),
        ("0.5degC", "degC", 0.5),
    ],
)
def test_the_height_is_the_sum_in_the_unit_of_the_signal(text, unit, height):
    assert read_tolerances(text, "--tube").others.height(unit, 2.0, "v") == pytest.approx(height)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "--tube ''"),
        ("fast", "--tube 'fast': write a time"),
        ("-1%", "at least 0"),
        ("nan", "--tube 'nan'"),
        ("1 V%", "--tube '1 V%'"),
        ("1%,", "--tube ''"),
        ("=1%", "a name is missing"),
        ("v=1%, v=2%", "v is named twice"),
        ("1 furlongs_of_v", "furlongs_of_v"),
    ],
)
def test_what_is_no_tolerance_is_refused(text, message):
    with pytest.raises(UserError, match=message):
        read_tolerances(text, "--tube")
