"""Values given for signals and options: those allowed pass, all others are refused in a line."""

from __future__ import annotations

from math import inf, nan

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.signals import (
    KNOWN_LIMITS,
    SIGNALS,
    UNITS,
    checked_step,
    commands,
    integer,
    one_of,
    seconds,
)

INPUTS = {"current": "A", "force": "N"}


def test_every_signal_of_a_rig_has_a_unit_and_limits_are_of_known_signals():
    for signals in SIGNALS.values():
        assert {*signals.inputs, *signals.outputs} <= {*UNITS}
        assert {*signals.inputs} <= {*KNOWN_LIMITS}, "whatever is commanded has limits"
    assert {*KNOWN_LIMITS} <= {*UNITS}


@pytest.mark.parametrize(("text", "value"), [("0", 0), ("7", 7), ("0042", 42)])
def test_a_whole_number(text, value):
    assert integer("seed", text) == value


@pytest.mark.parametrize("text", ["", "-1", "1.0", "٣", "1" * 19, "one"])
def test_no_whole_number(text):
    with pytest.raises(UserError, match=r"option seed = .* a whole number of at least 0"):
        integer("seed", text)


def test_a_duration():
    assert seconds("timeout", "0.5", 10.0) == 0.5
    assert seconds("timeout", "10", 10.0) == 10.0
    for text in ("0", "-1", "10.1", "nan", "inf", "soon"):
        with pytest.raises(UserError, match=r"option timeout = .* above 0, at most 10"):
            seconds("timeout", text, 10.0)


def test_a_choice():
    assert one_of("noise", "on", ("on", "off")) == "on"
    with pytest.raises(UserError, match=r"option noise = 'of' \(did you mean off\?\)"):
        one_of("noise", "of", ("on", "off"))


def test_commands_are_complete_known_and_finite():
    assert commands({"force": 2, "current": 0.5}, INPUTS) == {"current": 0.5, "force": 2.0}
    for values, part in (
        ({"current": 0.5}, "command force = missing: must be a finite number"),
        ({"current": nan, "force": 1.0}, "command current = nan"),
        ({"current": -inf, "force": 1.0}, "command current = -inf"),
        ({"current": 0.5, "force": 1.0, "forse": 1.0}, "command 'forse': not an input of this rig"),
    ):
        with pytest.raises(UserError, match=part):
            commands(values, INPUTS)


def test_a_step_of_time():
    assert checked_step(0, 60.0) == 0.0
    assert checked_step(60.0, 60.0) == 60.0
    for step in (-1e-9, 60.1, nan, inf):
        with pytest.raises(UserError, match="must be from 0 to 60 s"):
            checked_step(step, 60.0)
