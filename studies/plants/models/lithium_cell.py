"""A user's model of a lithium cell over hours, in A*h: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State

HOUR = 3600.0  # s


class LithiumCell(Component):
    """v = U0 - s q - R i, q the charge drawn since the record began."""

    name = "lithium_cell"
    experiment = (10800.0, 10.0)

    U0 = Parameter(3.9, "V", min=1, max=5, doc="open-circuit voltage at the beginning")
    slope = Parameter(0.12, "V/A/h", min=1e-4, max=10, nominal=0.1, doc="of the voltage (s)")
    R = Parameter(0.04, "ohm", min=1e-6, max=10, nominal=0.05, doc="inner resistance")

    load = Input("A", nominal=1.0, doc="current, positive in discharge (i)")
    drawn = State("A*h", rate="drawn_rate", nominal=2.0, doc="charge drawn (q)")

    def drawn_rate(self):
        """Count the charge."""
        return self.load / HOUR

    def sag(self):
        """Open-circuit voltage that the charge takes."""
        return self.slope * self.drawn

    def inner(self):
        """Voltage lost inside."""
        return self.R * self.load

    @Output("V", nominal=0.2)
    def terminal(self):
        """At the terminals."""
        return self.U0 - self.sag() - self.inner()
