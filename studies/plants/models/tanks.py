"""A user's model of two tanks in a row, in m and l/s: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State


class Tanks(Component):
    """A pump fills the upper tank, which runs into the lower one, which drains."""

    name = "tanks"
    experiment = (14400.0, 10.0)

    A1 = Parameter(2.0, "m^2", min=1e-3, max=1e4, doc="area of the upper tank")
    A2 = Parameter(3.0, "m^2", min=1e-3, max=1e4, doc="area of the lower tank")
    pipe = Parameter(0.01, "m^2/s", min=1e-7, max=10, nominal=0.01, doc="flow per level, between")
    drain = Parameter(0.008, "m^2/s", min=1e-7, max=10, nominal=0.01, doc="flow per level, out")

    pump = Input("m^3/s", nominal=0.01, doc="flow of the pump")
    upper = State("m", rate="upper_rate", nominal=1.0, start=2.0, doc="level of the upper tank")
    lower = State("m", rate="lower_rate", nominal=1.0, start=1.2, doc="level of the lower tank")

    def passing(self):
        """Flow from the upper to the lower tank."""
        return self.pipe * (self.upper - self.lower)

    def draining(self):
        """Flow out of the lower tank."""
        return self.drain * self.lower

    def upper_rate(self):
        """Balance of the upper tank."""
        return (self.pump - self.passing()) / self.A1

    def lower_rate(self):
        """Balance of the lower tank."""
        return (self.passing() - self.draining()) / self.A2

    @Output("m", display="cm")
    def upper_level(self):
        """By a float."""
        return self.upper

    @Output("m", display="cm")
    def lower_level(self):
        """By a pressure cell."""
        return self.lower
