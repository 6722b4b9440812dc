"""A user's model of a chain of thermal nodes, with effects to attach: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import cubic_stiffness, extra_kelvin, force_offset


class ThermalNodes(Component):
    """Two heat capacities in a row between a heater and the surroundings."""

    name = "clean_thermal_nodes"
    experiment = (3000.0, 1.0)

    C1 = Parameter(40.0, "J/K", min=1e-6, max=1e9, doc="heat capacity inside")
    C2 = Parameter(200.0, "J/K", min=1e-6, max=1e9, doc="heat capacity outside")
    R12 = Parameter(1.5, "K/W", min=1e-9, max=1e6, doc="thermal resistance between them")
    R2 = Parameter(1.0, "K/W", min=1e-9, max=1e6, doc="thermal resistance to the surroundings")

    power = Input("W", nominal=10.0, doc="heat of the heater")
    ambient = Input("K", start=293.0, nominal=10.0, doc="temperature of the surroundings")
    inner = State("K", rate="inner_rate", start=293.0, nominal=10.0, doc="temperature inside")
    outer = State("K", rate="outer_rate", start=293.0, nominal=10.0, doc="temperature outside")

    def conduction(self):
        """Heat from inside to outside."""
        return (self.inner - self.outer) / self.R12

    def loss(self):
        """Heat to the surroundings."""
        return (self.outer - self.ambient) / self.R2

    def inner_rate(self):
        """Balance of heat inside."""
        return (self.power - self.conduction()) / self.C1

    def outer_rate(self):
        """Balance of heat outside."""
        return (self.conduction() - self.loss()) / self.C2

    @Output("K", nominal=10.0)
    def inner_temperature(self):
        """Temperature inside."""
        return self.inner

    @Output("K", nominal=10.0)
    def outer_temperature(self):
        """Temperature outside."""
        return self.outer


EFFECTS = {
    effect.id: effect
    for effect in (
        force_offset(ThermalNodes, "loss", unit="W"),
        extra_kelvin(ThermalNodes, "loss", "power", "second", 300.0, unit="W"),
        cubic_stiffness(ThermalNodes, "conduction", "inner", unit="W"),
    )
}
