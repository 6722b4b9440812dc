"""Claims: a tolerance is a time, amounts and shares; those of one signal stand after its name."""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from orchestration.experiment.regression import read_tolerances
from orchestration.experiment.regression.tolerances import OTHERS, Tolerance


def test_amounts_before_any_name_are_of_all_other_signals():
    read = read_tolerances("20ms, 1%, voltage=1mV, omega = 0.5 %, 1e-3 s", "--tube")
    assert read[OTHERS] == Tolerance(0.02, 1.0)
    assert read["voltage"] == Tolerance(0.0, 0.0, ("1mV",))
    assert read["omega"] == Tolerance(1e-3, 0.5)
    assert read["omega"].height("rad/s", 10.0, "") == pytest.approx(0.05)


def test_names_may_have_commas_and_texts_be_several():
    assert list(read_tolerances("a[1,2]=1%", "--tube")) == ["a[1,2]"]
    assert read_tolerances(["v=1mV", "w=1%"], "--tube").keys() == {"v", "w"}


@pytest.mark.parametrize(
    ("text", "unit", "height"),
    [
        ("1mV", "V", 1e-3),
        ("2", "mV", 2.0),
        ("1mV, 1%", "V", 0.021),
        ("0.5K", "degC", 0.5),
        ("0.5degC", "degC", 0.5),
        ("0.5degC", "K", 0.5),
        ("0.9degF", "K", 0.5),
        ("0.5K", "degF", 0.9),
    ],
)
def test_the_height_is_the_sum_in_the_unit_of_the_signal(text, unit, height):
    assert read_tolerances(text, "--tube")[OTHERS].height(unit, 2.0, "v") == pytest.approx(height)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "--tube ''"),
        ("fast", "--tube 'fast': write a time"),
        ("v=", "--tube 'v=': write a time"),
        ("-1%", "at least 0"),
        ("nan", "--tube 'nan'"),
        ("1 V%", "--tube '1 V%'"),
        ("1%,", "--tube ''"),
        ("=1%", "a name is named twice or missing"),
        ("v=1%, v=2%", "v is named twice"),
        ("1 furlongs_of_v", "furlongs_of_v"),
    ],
)
def test_what_is_no_tolerance_is_refused(text, message):
    with pytest.raises(UserError, match=message):
        read_tolerances(text, "--tube")
