"""Values that a user gives to a variable: bounds in other units, words, and units where there are
none.
"""

from __future__ import annotations

import math

import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.signal.signal import Signal
from orchestration.fmu.signal.values import numeric, read_setting

INDUCTANCE = Signal("L", "real", "H", "H", 1e-3, 1e-5, 10.0)
WEIGHT = Signal("remaining_weight", "real", "1", "%", 0.1, 1e-6, 0.999)
SWITCH = Signal("on", "boolean", "1", "1", 0.0, -math.inf, math.inf)
BITS = Signal("bits", "integer", "1", "1", 16, 4, 24)


@pytest.mark.parametrize(
    ("given", "signal", "value"),
    [
        ("10uH", INDUCTANCE, 1e-5),
        ("10000mH", INDUCTANCE, 10.0),
        ("99.9%", WEIGHT, 0.999),
        ("1e-4 %", WEIGHT, 1e-6),
        ("True", SWITCH, 1.0),
        ("false", SWITCH, 0.0),
        ("1", SWITCH, 1.0),
        ("24", BITS, 24.0),
    ],
)
def test_the_bounds_themselves_are_allowed_in_any_unit(given, signal, value):
    assert read_setting(given, signal, "--set") == value


@pytest.mark.parametrize(
    ("given", "signal", "message"),
    [
        ("9.99uH", INDUCTANCE, "out of range"),
        ("99.91%", WEIGHT, "out of range"),
        ("100%", SWITCH, "on is boolean and has no unit"),
        ("16 bits", BITS, "bits is integer and has no unit"),
        ("25", BITS, "out of range"),
        ("yes", SWITCH, "nor true or false"),
        ("2", SWITCH, "neither true"),
    ],
)
def test_others_are_refused(given, signal, message):
    with pytest.raises(UserError, match=message):
        read_setting(given, signal, "--set")


def test_what_computes_takes_no_text():
    with pytest.raises(UserError, match="endpoint = 'x' is a text"):
        numeric({"R1": 0.5, "endpoint": "x"})
