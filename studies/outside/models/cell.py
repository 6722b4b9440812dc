"""Cell with a curve of the open-circuit voltage, a resistance and one RC pair."""

from fmus.kit import Component, Input, Output, Parameter, State


class Cell(Component):
    """v = v0 - s q / Q - b (q / Q)^2 - R0 i - R1 i1, with q drawn of the capacity Q."""

    name = "cell"
    experiment = (3600.0, 4.0)
    full = Parameter(4.1, "V", min=1, max=10, doc="voltage of the full cell (v0)")
    slope = Parameter(0.5, "V", min=0.01, max=5, doc="fall of the voltage over the capacity (s)")
    bow = Parameter(0.2, "V", min=0.001, max=5, doc="bow of the voltage over the capacity (b)")
    R0 = Parameter(0.04, "ohm", min=1e-4, max=10, doc="ohmic resistance")
    R1 = Parameter(0.02, "ohm", min=1e-4, max=10, doc="polarisation resistance")
    tau1 = Parameter(60.0, "s", min=1, max=1e4, doc="polarisation time constant")
    current = Input("A", nominal=2.0, doc="current, positive in discharge (i)")
    drawn = State("A*s", rate="drawn_rate", nominal=3000.0, doc="charge drawn (q)")
    relaxed = State("A", rate="relaxed_rate", nominal=2.0, doc="current through R1 (i1)")

    def drawn_rate(self):
        """Count of the charge."""
        return self.current

    def relaxed_rate(self):
        """RC pair."""
        return (self.current - self.relaxed) / self.tau1

    def open_voltage(self):
        """Open-circuit voltage; the capacity is 2 A h."""
        used = self.drawn / 7200.0
        return self.full - self.slope * used - self.bow * used * used

    def ohmic(self):
        """Ohmic drop."""
        return self.R0 * self.current

    def polarisation(self):
        """Drop of the RC pair."""
        return self.R1 * self.relaxed

    @Output("V", nominal=0.1)
    def voltage(self):
        """At the terminals."""
        return self.open_voltage() - self.ohmic() - self.polarisation()
