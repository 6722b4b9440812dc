"""Claims: effects, laws and variables have names for people, which no identifier shines through."""

from __future__ import annotations

import pytest

from fmus import COMPONENTS, component, effects
from fmus.kit import Component, Effect, Input, Output, Parameter, stack
from fmus.kit.arms import lag_effect
from fmus.kit.curves import curve
from fmus.kit.inputs import dead_zone
from fmus.kit.sensors import measurement_effects, sensor_lag
from fmus.kit.titles import effect_title, law_title, titled, variable_title


class Heater(Component):
    """Heat that a wire gives off."""

    name = "heater"
    R0 = Parameter(2.0, "ohm", title="cold resistance")
    wire_current = Input("A")

    @titled("resistance of the wire")
    def wire_resistance(self):
        return self.R0

    def lead_drop(self):
        return 0.1 * self.wire_current

    @Output("V", title="clamp voltage")
    def clamp_voltage(self):
        return self.wire_resistance() * self.wire_current + self.lead_drop()


class Warming(Effect):
    id = "wire_warming"
    neutral = "warmth"
    warmth = Parameter(0.0, "ohm/A")

    def wire_resistance(self):
        return super().wire_resistance() + self.warmth * self.wire_current


class Titled(Warming):
    title = "A wire that warms"


def test_what_declares_a_name_has_it():
    assert variable_title(Heater.declared["R0"]) == "cold resistance"
    assert law_title(Heater, "wire_resistance") == "resistance of the wire"
    assert law_title(Heater, "clamp_voltage") == "clamp voltage"
    assert effect_title(Titled) == "A wire that warms"


def test_an_effect_keeps_the_name_of_the_law_that_it_overrides():
    assert law_title(stack(Heater, Warming), "wire_resistance") == "resistance of the wire"


def test_what_declares_none_is_called_by_its_identifier_in_words():
    assert variable_title(Heater.declared["wire_current"]) == "wire current"
    assert law_title(Heater, "lead_drop") == "lead drop"
    assert effect_title(Warming) == "wire warming"


def test_a_law_may_be_called_title():
    class Book(Component):
        name = "book"

        @Output("1")
        def title(self):
            return 1.0

    class Raised(Effect):
        id = "raised"
        title = "A larger title"
        neutral = "more"
        more = Parameter(0.0, "1")

    assert stack(Book, Raised)().outputs() == [1.0]
    assert effect_title(Raised) == "A larger title"


@pytest.mark.parametrize(
    ("effect", "title"),
    [
        (
            curve(Heater, "lead_drop", "wire_current", "cubic", "V"),
            "A cubic part in lead drop",
        ),
        (
            lag_effect(Heater, "wire_resistance", "wire_current", "warming", 10.0, "ohm"),
            "A part that rises as it warms in resistance of the wire",
        ),
        (dead_zone(Heater, "wire_current"), "A dead zone in wire current"),
        (sensor_lag(Heater, "clamp_voltage"), "A lag of the clamp voltage sensor"),
    ],
)
def test_what_is_made_for_a_law_names_it(effect, title):
    assert effect_title(effect) == title


@pytest.mark.parametrize("name", COMPONENTS)
def test_every_effect_of_every_component_has_a_name_of_its_own(name):
    known = (*effects(name).values(), *measurement_effects(component(name)))
    titles = [effect_title(effect) for effect in known]
    assert len(set(titles)) == len(titles)
    for title in titles:
        assert title[0].isupper()
        assert "_" not in title
