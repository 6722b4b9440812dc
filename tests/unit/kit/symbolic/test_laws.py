"""Laws of models and their units. Oracles: small models, read by eye; pint."""

from __future__ import annotations

import pytest

from fmus.kit import Component, Input, Output, Parameter, State, sin, units
from fmus.kit.symbolic.laws import list_laws
from tests.support.pushed_mass import MASS, Tank


def test_laws_are_told_with_their_units_in_the_order_of_their_calls():
    assert [(law.name, law.unit, law.is_output) for law in list_laws(MASS)] == [
        ("elongation_rate", "m/s", False),
        ("acceleration", "m/s^2", False),
        ("damper_force", "N", False),
        ("spring_force", "N", False),
        ("position", "m", True),
    ]
    tank = {law.name: law.unit for law in list_laws(Tank)}
    assert tank["outflow"] == "m^3/s"
    assert tank["level_rate"] == "m/s"
    assert not tank["odd"], "a sum that has no unit"


class Boiler(Component):
    """A vessel in kW, bar, g/s, mm and km/h, with numbers written into its laws."""

    name = "boiler"
    loss = Parameter(0.25, "kW/K")
    capacity = Parameter(12.0, "kW*h/K")
    valve = Parameter(2.0, "g/s/bar")
    volume = Parameter(16.0, "g/bar")
    spring = Parameter(3.0, "N/mm")
    mass = Parameter(0.2, "kg")
    drag = Parameter(0.1, "1/s")
    damping = Parameter(0.3, "N*m*s")
    inertia = Parameter(0.5, "kg*m^2")
    heating = Input("kW", nominal=4.0)
    room = State("K", rate="warming", start=291.0)
    ash = State("kg", rate="settling", start=1.0)
    pressure = State("bar", rate="filling", start=2.0)
    place = State("mm", rate="moving", start=1.0)
    speed = State("m/s", rate="pushed", start=0.5)
    way = State("km", rate="driven", start=1.0)
    angle = State("rad", rate="turning", start=0.3)
    spin = State("rad/s", rate="twisting", start=0.3)

    def envelope(self):
        """Heat lost."""
        return self.loss * (self.room - 280.0)

    def warming(self):
        """Balance."""
        return (self.heating - self.envelope()) / (3600.0 * self.capacity)

    def settling(self):
        """Decay with a rate that is written into it."""
        return -0.01 * self.ash

    def outflow(self):
        """Over the pressure of the air."""
        return self.valve * (self.pressure - 1.013)

    def filling(self):
        """Balance."""
        return -self.outflow() / self.volume

    def bent(self):
        """Spring."""
        return self.spring * self.place

    def moving(self):
        """Definition, mm/s of m/s."""
        return 1e3 * self.speed

    def weight(self):
        """With the acceleration of gravity written into it."""
        return 9.81 * self.mass

    def pushed(self):
        """Newton's law."""
        return (self.weight() - self.bent()) / self.mass

    def driven(self):
        """Definition, km/s of m/s."""
        return self.speed / 1000.0

    def turning(self):
        """Definition."""
        return -self.spin

    def friction(self):
        """In a unit without the angle."""
        return self.damping * self.spin

    def restoring(self):
        """Of a pendulum, over inertia, whose length is written into it."""
        return 9.81 / 0.5 * sin(self.angle)

    def twisting(self):
        """Balance."""
        return self.restoring() - self.friction() / self.inertia

    @Output("mm")
    def shown(self):
        """As measured."""
        return self.place


def test_the_unit_of_a_law_is_that_of_its_numbers():
    """Oracle: by hand, and the number of a law in its unit is what pint makes of the product."""
    found = {law.name: law.unit for law in list_laws(Boiler)}
    assert found == {
        "envelope": "kW",
        "warming": "K/s",
        "settling": "kg/s",
        "outflow": "g/s",
        "filling": "bar/s",
        "bent": "N",
        "moving": "mm/s",
        "weight": "N",
        "pushed": "m/s^2",
        "driven": "km/s",
        "turning": "rad/s",
        "friction": "N*m",
        "restoring": "rad/s^2",
        "twisting": "rad/s^2",
        "shown": "mm",
    }
    one = Boiler()
    registry = units.registry()
    lost = registry.Quantity(0.25, "kW/K") * registry.Quantity(11.0, "K")
    assert registry.Quantity(one.envelope(), found["envelope"]).to("W") == lost.to("W")
    flow = registry.Quantity(2.0, "g/s/bar") * registry.Quantity(2.0 - 1.013, "bar")
    assert registry.Quantity(one.outflow(), found["outflow"]).to("kg/s").magnitude == (
        pytest.approx(flow.to("kg/s").magnitude)
    )
