"""A user's model of a battery cell, with effects to attach: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import extra_kelvin


class Cell(Component):
    """A battery cell at one state of charge: open-circuit voltage, resistance, one RC pair."""

    name = "clean_cell"
    experiment = (600.0, 0.5)

    ocv = Parameter(3.3, "V", min=0, max=5, doc="open-circuit voltage")
    R0 = Parameter(0.03, "ohm", min=1e-6, max=100, nominal=0.01, doc="ohmic resistance")
    R1 = Parameter(0.02, "ohm", min=1e-6, max=100, nominal=0.01, doc="resistance of the pair")
    tau1 = Parameter(20.0, "s", min=1e-3, max=1e6, doc="time constant of the pair")

    current = Input("A", doc="current, positive in discharge")
    relaxed = State("A", rate="relaxed_rate", doc="current through the resistance of the pair")

    def relaxed_rate(self):
        """Return the rate of the pair."""
        return (self.current - self.relaxed) / self.tau1

    def drop(self):
        """Return the voltage lost inside."""
        return self.R0 * self.current + self.R1 * self.relaxed

    @Output("V", nominal=0.1)
    def voltage(self):
        """Return the voltage at the terminals."""
        return self.ocv - self.drop()


EFFECTS = {
    effect.id: effect
    for effect in (
        extra_kelvin(Cell, "drop", "current", "second", 3.0, unit="V", nominal=0.05),
        extra_kelvin(Cell, "drop", "current", "third", 200.0, unit="V", nominal=0.05),
    )
}
