"""A user's model of a heated building, in kW, kWh and K: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State

HOUR = 3600.0  # s


class House(Component):
    """C dT/dt = P - UA (T - To): one capacity, one loss."""

    name = "building"
    experiment = (691200.0, 900.0)

    UA = Parameter(0.25, "kW/K", min=1e-4, max=100, nominal=0.2, doc="loss of the envelope")
    C = Parameter(12.0, "kW*h/K", min=1e-2, max=1e5, nominal=10.0, doc="heat capacity")

    heating = Input("kW", nominal=4.0, doc="heat of the boiler (P)")
    outdoor = Input("K", nominal=10.0, start=275.0, display="degC", doc="outdoors (To)")
    room = State("K", rate="room_rate", nominal=10.0, start=291.0, doc="temperature inside (T)")

    def envelope(self):
        """Heat that is lost."""
        return self.UA * (self.room - self.outdoor)

    def room_rate(self):
        """Balance of heat."""
        return (self.heating - self.envelope()) / (HOUR * self.C)

    @Output("K", nominal=10.0, display="degC")
    def indoor(self):
        """Temperature in the hall."""
        return self.room
