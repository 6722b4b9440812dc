"""Two components that form a chain: one with states only, one with direct feedthrough only."""

from fmus.kit import Component, Input, Output, Parameter, State


class Mass(Component):
    """A mass on a spring of its own, pulled by two forces."""

    name = "mass"
    tolerance = 1e-11

    m = Parameter(1.0, "kg", min=1e-3, doc="mass")
    k = Parameter(1.0, "N/m", min=0, doc="stiffness of its own spring")
    left = Input("N", doc="force to the left")
    right = Input("N", doc="force to the right")
    position = State("m", rate="position_rate", output=True, doc="position")
    velocity = State("m/s", rate="velocity_rate", output=True, doc="velocity")

    def position_rate(self):
        return self.velocity

    def velocity_rate(self):
        return (self.right - self.left - self.k * self.position) / self.m


class Spring(Component):
    """A spring between two masses: all feedthrough, no state."""

    name = "spring"

    k = Parameter(2.0, "N/m", min=0, doc="stiffness")
    one = Input("m", doc="position of one end")
    other = Input("m", doc="position of the other end")

    @Output("N")
    def force(self):
        """Pull on both ends."""
        return self.k * (self.other - self.one)
