"""Channels: the value of measured volts and the volts of a command are inverse to one another."""

from __future__ import annotations

import datetime
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.kit.errors import UserError
from orchestration.plugins.calibration import Channel


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    size = st.floats(1e-3, 1e3)
    low = draw(st.floats(-10, 9))
    unit = draw(st.sampled_from(["m", "mm", "µm", "degC"]))
    return Channel(
        name="x",
        unit=unit,
        si="m" if unit != "degC" else "K",
        channel="ai0",
        gain=draw(size) * draw(st.sampled_from([-1, 1])),
        offset=draw(st.floats(-10, 10)),
        sign=draw(st.sampled_from([-1, 1])),
        range=(low, low + draw(st.floats(0.1, 10))),
        date=datetime.date(2007, 5, 1),
    )


@given(channels(), st.floats(0, 1))
def test_there_and_back(channel: Channel, share: float) -> None:
    low, high = channel.range
    volts = min(low + share * (high - low), high)
    value = channel.measured(volts)
    factor = {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "degC": 1.0}[channel.unit]
    # a large offset beside a small gain, as of kelvins, costs digits
    digits = 4e-16 * (abs(value) + 273.15 * (channel.unit == "degC") + abs(factor * channel.offset))
    room = digits / abs(channel.gain * factor)
    assert channel.reach.min - digits <= value <= channel.reach.max + digits
    if room < 1e-10 * (high - low):
        assert channel.volts(value) == pytest.approx(volts, rel=1e-12, abs=1e-12 + 8 * room)


@given(channels(), st.floats(0.0, 1.0))
def test_there_and_back_by_a_conversion(channel: Channel, share: float) -> None:
    # a cubic that rises everywhere
    cubic = {"polynomial": {"coefficients": [0.3, 1.0, 0.0, 0.2]}}
    values = channel.model_dump(include=channel.model_fields_set) | {"unit": "m", "si": "m"}
    bent = Channel(**values | {"conversion": cubic, "offset": 0.0})
    low, high = bent.range
    volts = min(low + share * (high - low), high)
    value = bent.measured(volts)
    assert value == pytest.approx(bent.sign * bent.gain * (0.3 + volts + 0.2 * volts**3))
    assert bent.volts(value) == pytest.approx(volts, abs=1e-6)
    assert bent.measured(bent.volts(value)) == pytest.approx(value, rel=1e-9, abs=1e-9)
    with pytest.raises(UserError, match="the range of ai0 allows"):
        bent.volts(bent.reach.max + 1.0)


def test_a_reading_is_what_the_circuit_makes_of_the_volts() -> None:
    channel = Channel(
        name="x",
        unit="ohm",
        si="ohm",
        channel="ai0",
        gain=2.0,
        offset=1.0,
        sign=-1,
        range=(-1.0, 60.0),
        date=datetime.date(2007, 5, 1),
        amplification=10.0,
        divider={"supply": 5.0, "resistor": 1000.0},
    )
    # 25 V are 2.5 V at the divider, whose parts are equal
    assert channel.measured(25.0) == -(2.0 * 1000.0 + 1.0)
    assert channel.reading(-2001.0) == 1000.0
    assert math.isnan(channel.measured(55.0))
    assert "standard_uncertainty" not in channel.attributes
