"""Claims: a proxy of one's own has an age for each measured value, and the link's outputs last."""

from __future__ import annotations

import pytest

from fmus.kit import Input, UserError
from fmus.rig_proxy.proxy import AGE, CONNECTED, LINK_STATES, LOST, Measured, Proxy


class Heater(Proxy):
    """A rig that is in nobody's catalogue."""

    name = "heater"
    power = Input("W", doc="heat into the plate")
    temperature = Measured("K", min=0.0, nominal=300.0, doc="temperature of the plate")
    leak = Measured("W", doc="heat to the table")


def test_every_measured_value_brings_its_age():
    outputs = {o.name: o for o in Heater.layout.outputs}
    for name in ("temperature", "leak"):
        age = outputs[AGE.format(name)]
        assert (age.unit, age.min, age.doc) == ("s", 0.0, f"age of {name}")
    assert (outputs["temperature"].unit, outputs["temperature"].nominal) == ("K", 300.0)


def test_outputs_about_the_link_come_behind_those_of_the_rig():
    names = [o.name for o in Heater.layout.outputs]
    assert names[-3:] == ["round_trip_time", "missed_deadlines", "link_state"]
    assert set(names[:-3]) == {"temperature", "leak", "temperature_age", "leak_age"}


def test_the_state_of_the_link_is_one_of_those_that_are_named():
    state = Heater.layout.outputs[-1]
    assert (state.min, state.max) == (CONNECTED, LOST) == (0, len(LINK_STATES) - 1)
    assert state.doc == "0 connected, 1 commands refused, 2 stale, 3 lost"


def test_a_proxy_that_measures_nothing_is_refused():
    with pytest.raises(UserError, match=r"Blind: a proxy needs a measured output at least$"):

        class Blind(Proxy):
            name = "blind"
            power = Input("W")


def test_a_base_without_a_name_is_no_proxy_yet():
    class Base(Proxy):
        power = Input("W")

    assert not hasattr(Base, "link_state")
