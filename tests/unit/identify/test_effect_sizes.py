"""Claims: a size is the function of its parameter, and so are both ends of its interval."""

from __future__ import annotations

import math

import pytest

from fmus.kit import Component, Output, Parameter, Size
from fmus.kit.effects import make_effect
from orchestration.fmu.signal import Signal
from orchestration.identify.effect_sizes import fitted_sizes, interval_cells
from orchestration.identify.uncertainty import Estimate

LEVEL = Size("levels off at {}", ("c",), "C", lambda c: c**-0.5)
TIME = Size("a time constant of {}", ("T",))
BOTH = Size("a loop {} wide", ("c", "T"), "C", lambda c, time: c * time)
EFFECT = make_effect(
    "Levelling",
    {"c": Parameter(0.0, "1/C^2", min=0.0), "T": Parameter(3.0, "s", min=1e-3)},
    id="levelling",
    neutral="c",
    sizes=(LEVEL, TIME, BOTH),
)


class Plain(Component):
    """Something of which a resistance is fitted."""

    name = "plain"
    R = Parameter(1.0, "ohm")

    @Output("ohm")
    def shown(self):
        return self.R


def sizes(**intervals):
    """The sizes of the effect with c = 0.16 and T = 18 s, fitted with these intervals."""
    values = {"c": 0.16, "T": 18.0}
    estimates = {
        name: Estimate(values[name], 0.0, interval, "1") for name, interval in intervals.items()
    }
    return fitted_sizes(EFFECT, estimates, EFFECT.declared)


def texts(**intervals):
    return [size.text for size in sizes(**intervals)]


def test_the_interval_goes_through_the_function_of_the_size():
    level, time, both = sizes(c=(0.1, 0.25), T=(16.0, 20.0))
    assert level.value == pytest.approx(1.0 / math.sqrt(0.16))
    assert level.interval == pytest.approx((1.0 / math.sqrt(0.25), 1.0 / math.sqrt(0.1)))
    assert level.text == "levels off at 2.5 C (95 %: 2.0 … 3.2 C)"
    assert time.text == "a time constant of 18 s (95 %: 16 … 20 s)"
    assert both.text == "a loop 2.88 C wide"  # the fit has no interval of a product
    assert level.to_dict() == {
        "phrase": "levels off at {}",
        "value": level.value,
        "ci95": list(level.interval),
        "unit": "C",
    }
    assert both.to_dict()["ci95"] == [None, None]
    assert time.to_dict()["unit"] == "s"


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        ((-0.1, 0.25), "levels off at 2.5 C (95 %: above 2.0 C)"),  # none at c = 0
        ((-math.inf, math.inf), "levels off at 2.5 C (not determined)"),
        ((0.16, 0.16), "levels off at 2.50 C"),  # of a record without noise
        ((0.1599, 0.1601), "levels off at 2.5000 C (95 %: 2.4992 … 2.5008 C)"),
    ],
)
def test_an_interval_with_an_open_end_or_of_no_length(interval, text):
    assert texts(c=interval)[0] == text


@pytest.mark.parametrize(
    ("value", "interval", "unit", "written"),
    [
        (1.9003, (1.8998, 1.9008), "F", ("1.9003 F", "1.8998 … 1.9008 F")),
        (1.1e6, (1.0996e6, 1.1004e6), "N*s/m", ("1.1000 MN·s/m", "1.0996 … 1.1004 MN·s/m")),
        (8313.0, (8100.0, 8440.0), "N/m", ("8.31 kN/m", "8.10 … 8.44 kN/m")),
        (3.4, (-math.inf, 5.0), "ohm", ("3.400 Ω", "-inf … 5.000 Ω")),
        (3.4, (3.4, 3.4), "ohm", ("3.400 Ω", "3.400 … 3.400 Ω")),
    ],
)
def test_an_interval_of_a_table_is_not_rounded_to_nothing(value, interval, unit, written):
    declared = Signal("x", "real", unit, unit, 0.0, 0.0, 1e9)
    assert interval_cells(value, interval, declared) == written
