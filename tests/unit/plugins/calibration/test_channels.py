"""Channels: the value of measured volts and the volts of a command are inverse to one another."""

from __future__ import annotations

import datetime
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.kit.errors import UserError
from orchestration.plugins.calibration import Channel
from orchestration.plugins.calibration.conversions import Divider, Polynomial


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    size = st.floats(1e-3, 1e3)
    low = draw(st.floats(-10, 9))
    return Channel(
        name="x",
        unit="m",
        place="ai0",
        command="",
        query="",
        terminal="default",
        gain=draw(size) * draw(st.sampled_from([-1, 1])),
        offset=draw(st.floats(-10, 10)),
        sign=draw(st.sampled_from([-1, 1])),
        low=low,
        high=low + draw(st.floats(0.1, 10)),
        safe=0.0,
        factor=draw(st.sampled_from([1.0, 1e-3, 1e-6, 4.4482216])),
        zero=draw(st.sampled_from([0.0, 273.15])),
        date=datetime.date(2007, 5, 1),
        source="",
    )


@given(channels(), st.floats(0, 1))
def test_there_and_back(channel: Channel, share: float) -> None:
    volts = min(channel.low + share * (channel.high - channel.low), channel.high)
    value = channel.measured(volts)
    # a large offset beside a small gain, as of kelvins, costs digits
    digits = 4e-16 * (abs(value) + abs(channel.zero) + abs(channel.factor * channel.offset))
    room = digits / abs(channel.gain * channel.factor)
    limit = channel.reachable()
    assert limit.min - digits <= value <= limit.max + digits
    if room < 1e-10 * (channel.high - channel.low):
        assert channel.volts(value) == pytest.approx(volts, rel=1e-12, abs=1e-12 + 8 * room)


@given(channels(), st.floats(0.0, 1.0))
def test_there_and_back_by_a_conversion(channel: Channel, share: float) -> None:
    # a cubic that rises everywhere
    cubic = Polynomial(coefficients=(0.3, 1.0, 0.0, 0.2))
    bent = replace(channel, conversion=cubic, offset=0.0, zero=0.0)
    volts = bent.low + share * (bent.high - bent.low)
    value = bent.measured(min(volts, bent.high))
    assert not bent.is_linear
    assert bent.volts(value) == pytest.approx(volts, abs=1e-6)
    assert bent.measured(bent.volts(value)) == pytest.approx(value, rel=1e-9, abs=1e-9)
    with pytest.raises(UserError, match="needs other volts at ai0; its range is"):
        bent.volts(bent.reachable().max + 1.0)


def test_a_reading_is_what_the_circuit_makes_of_the_volts() -> None:
    channel = Channel(
        name="x",
        unit="ohm",
        place="ai0",
        command="",
        query="",
        terminal="default",
        gain=2.0,
        offset=1.0,
        sign=-1,
        low=-1.0,
        high=60.0,
        safe=0.0,
        factor=1.0,
        zero=0.0,
        date=datetime.date(2007, 5, 1),
        source="",
        scale=0.1,
        divider=Divider(supply=5.0, resistor=1000.0),
    )
    # 25 V are 2.5 V at the divider, whose parts are equal
    assert channel.measured(25.0) == -(2.0 * 1000.0 + 1.0)
    assert channel.reading(-2001.0) == 1000.0
    assert math.isnan(channel.measured(55.0))
    assert "standard_uncertainty" not in channel.attributes
