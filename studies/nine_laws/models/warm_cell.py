"""Cell that its current warms; temperature rise and voltage are measured."""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import cubic_stiffness, force_offset


class WarmCell(Component):
    """C dT/dt = R i^2 - G T, and U = E - S q - R i."""

    name = "warm_cell"
    experiment = (4000.0, 4.0)
    resistance = Parameter(0.05, "ohm", min=1e-4, max=10, doc="that warms (R)")
    heat_capacity = Parameter(40.0, "J/K", min=0.1, max=1e5, doc="of the cell (C)")
    loss_rate = Parameter(0.15, "W/K", min=1e-3, max=100, doc="to the air (G)")
    full_voltage = Parameter(4.1, "V", min=0.1, max=10, doc="at no charge drawn (E)")
    slope = Parameter(1e-4, "V/C", min=1e-7, max=1, doc="of the voltage (S)")
    current = Input("A", nominal=3.0, doc="that is drawn (i)")
    charge = State("C", rate="charge_rate", nominal=3600.0, doc="that was drawn (q)")
    rise = State("K", rate="rise_rate", nominal=5.0, doc="of the temperature (T)")

    def charge_rate(self):
        """Definition."""
        return self.current

    def heating(self):
        """Heat of the current."""
        return self.resistance * self.current**2

    def loss(self):
        """Heat lost to the air."""
        return self.loss_rate * self.rise

    def rise_rate(self):
        """Balance of heat."""
        return (self.heating() - self.loss()) / self.heat_capacity

    def terminal(self):
        """Voltage at the terminals."""
        return self.full_voltage - self.slope * self.charge - self.resistance * self.current

    @Output("K", nominal=5.0)
    def measured_rise(self):
        """Temperature rise, as measured."""
        return self.rise

    @Output("V", nominal=1.0)
    def voltage(self):
        """Voltage, as measured."""
        return self.terminal()


EFFECTS = {
    effect.id: effect
    for effect in (
        cubic_stiffness(WarmCell, "loss", "rise", unit="W"),
        force_offset(WarmCell, "heating", unit="W"),
    )
}
