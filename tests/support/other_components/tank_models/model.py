"""A tank that empties through a pipe."""

from fmus.kit import Component, Input, Output, Parameter, State


class Tank(Component):
    """A tank that empties through a pipe."""

    name = "tank"
    experiment = (600.0, 1.0)

    area = Parameter(0.5, "m^2", min=1e-3, max=1e3, doc="cross section")
    conductance = Parameter(2e-3, "m^2/s", min=0, max=1, doc="flow per level")
    inflow = Input("m^3/s", doc="flow into the tank")
    level = State("m", rate="level_rate", start=1.0, min=0, output=True, doc="level above the pipe")

    def pipe_flow(self):
        """Laminar flow through the pipe."""
        return self.conductance * self.level

    def level_rate(self):
        """Volume balance."""
        return (self.inflow - self.pipe_flow()) / self.area

    @Output("m^3/s")
    def outflow(self):
        """Flow out of the tank, as measured."""
        return self.pipe_flow()
