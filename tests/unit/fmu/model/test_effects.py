"""Claims: effects are found by name in the catalogue, among those of sensors and of inputs, and an
unknown name is refused with the nearest one.
"""

from __future__ import annotations

import sys
from types import ModuleType

import pytest

from fmus import component
from fmus.kit import Component, Output, Parameter, UserError, stack
from fmus.kit.effects import effect_name
from orchestration.fmu.model.effects import (
    catalogue,
    effects_of_inputs,
    find_effects,
    known_effects,
)


def test_effects_are_found_in_the_order_of_their_names():
    cls = component("ppy_actuator")
    saturation, lag = find_effects(cls, ["strain_saturation", "sensor_lag(voltage)"], "actuator")
    assert saturation is catalogue(cls)["strain_saturation"]
    assert effect_name(lag) == "sensor_lag(voltage)"
    assert lag.output == "voltage"
    assert set(catalogue(cls)) < set(known_effects(cls))
    assert find_effects(cls, [], "actuator") == []


def test_effects_of_inputs_are_known_by_name_for_the_model_without_other_effects():
    cls = component("ppy_actuator")
    (zone,) = find_effects(cls, ["dead_zone(current)"], "actuator")
    assert zone.term.signal == "current"
    assert zone is not find_effects(stack(cls, zone), ["dead_zone(current)"], "actuator")[0]
    assert {e.term.signal for e in effects_of_inputs(cls).values()} == {"current", "force"}
    assert not effects_of_inputs(cls).keys() & known_effects(cls).keys()


@pytest.mark.parametrize(
    ("written", "hint"),
    [("strain_saturatoin", " (did you mean strain_saturation?)"), ("zzz", "")],
)
def test_an_unknown_name_is_refused_with_the_nearest_one_and_what_lists_them(written, hint):
    with pytest.raises(UserError) as caught:
        find_effects(component("ppy_actuator"), [written], "ppy_actuator")
    message = f"ppy_actuator: no effect named {written!r}{hint}; ppy info ppy_actuator lists them"
    assert str(caught.value) == message


def test_a_list_of_effects_that_is_none_is_refused(monkeypatch):
    class Own(Component):
        """A model."""

        name = "own"
        gain = Parameter(1.0, "1", min=0.0, max=9.0, doc="a gain")

        @Output("1")
        def y(self):
            """The gain."""
            return self.gain

    module = ModuleType("own_module")
    module.__file__ = "own.py"
    monkeypatch.setitem(sys.modules, "own_module", module)
    Own.__module__ = "own_module"
    assert catalogue(Own) == {}
    module.EFFECTS = {"gain": Own}
    with pytest.raises(UserError, match=r"^own\.py: EFFECTS must be a dictionary"):
        catalogue(Own)
