"""A user's model of an air vessel behind a valve, in bar and g/s: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State


class Vessel(Component):
    """C dp/dt = feed u - leak p: an isothermal volume that a valve fills."""

    name = "air_vessel"
    experiment = (300.0, 0.2)

    volume = Parameter(12.0, "g/bar", min=1e-3, max=1e6, nominal=10.0, doc="V / (R T)")
    feed = Parameter(5.0, "g/s", min=1e-4, max=1e4, doc="flow through the open valve")
    leak = Parameter(1.5, "g/s/bar", min=1e-6, max=1e4, doc="conductance of the outlet")

    opening = Input("1", nominal=0.5, doc="opening of the valve, 0 to 1 (u)")
    pressure = State("bar", rate="pressure_rate", nominal=1.0, doc="above the atmosphere's (p)")

    def inflow(self):
        """Mass flow through the valve."""
        return self.feed * self.opening

    def outflow(self):
        """Mass flow through the outlet."""
        return self.leak * self.pressure

    def pressure_rate(self):
        """Balance of mass."""
        return (self.inflow() - self.outflow()) / self.volume

    @Output("bar", nominal=1.0)
    def gauge(self):
        """As measured, above the atmosphere's."""
        return self.pressure

    @Output("g/s", nominal=2.0)
    def meter(self):
        """Flow that comes in, by a flow meter."""
        return self.inflow()
