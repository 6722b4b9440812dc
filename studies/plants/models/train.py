"""A user's model of a train that coasts, in km and km/h: under test, not the judge."""

from fmus.kit import Component, Output, Parameter, State

HOUR = 3600.0  # s


class Train(Component):
    """v' = -(A + B v): rolling resistance; nothing drives it."""

    name = "coasting_train"
    experiment = (600.0, 0.5)

    rolling = Parameter(0.07, "km/h/s", min=0, max=10, nominal=0.1, doc="at rest (A)")
    growth = Parameter(4e-4, "1/s", min=0, max=1, nominal=5e-4, doc="per speed (B)")

    pace = State("km/h", rate="pace_rate", nominal=100.0, start=120.0, doc="speed (v)")
    way = State("km", rate="way_rate", nominal=10.0, doc="way since the motors were cut")

    def resistance(self):
        """Deceleration."""
        return self.rolling + self.growth * self.pace

    def pace_rate(self):
        """Newton's second law."""
        return -self.resistance()

    def way_rate(self):
        """Definition."""
        return self.pace / HOUR

    @Output("km/h", nominal=100.0)
    def speedometer(self):
        """By a wheel."""
        return self.pace

    @Output("km", nominal=10.0)
    def position(self):
        """By satellite."""
        return self.way
