"""A lithium-ion cell: open-circuit voltage, series resistance and one RC pair.

The circuit that a battery engineer begins with (Plett: Battery Management Systems, volume 1, 2015,
chapter 2). Its one relaxation is seldom enough: with a record of current and voltage ::

    ppy diagnose record.csv --model examples/battery_cell.py:BatteryCell --map 'Strom (A)=current'
    --map 'Spannung (V)=voltage'

tells whether a second pair is missing, and how large it is.
"""

from fmus.kit import Component, Input, Output, Parameter, State, smooth_table

HOUR = 3600.0  # s
# state of charge, and the voltage at rest there: of NMC against graphite, to the millivolt
CHARGES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
VOLTAGES = (2.955, 3.192, 3.313, 3.43, 3.499, 3.563, 3.639, 3.738, 3.838, 3.928, 4.025, 4.135)


class BatteryCell(Component):
    """One RC pair: v = U(z) - R0 i - u with C1 du/dt = i - u / R1 and Q dz/dt = -i."""

    name = "battery_cell"
    experiment = (3600.0, 1.0)

    capacity = Parameter(2.5, "A*h", min=1e-3, max=1e4, doc="capacity (Q)")
    R0 = Parameter(0.03, "ohm", min=1e-6, max=100, nominal=0.01, doc="series resistance")
    R1 = Parameter(0.02, "ohm", min=1e-6, max=100, nominal=0.01, doc="resistance of the RC pair")
    C1 = Parameter(2000.0, "F", min=1e-3, max=1e9, nominal=1e3, doc="capacitance of the RC pair")

    current = Input("A", nominal=2.5, doc="current, positive in discharge (i)")
    charge = State("1", rate="charge_rate", start=0.9, doc="state of charge (z)")
    pair_voltage = State("V", rate="pair_rate", nominal=0.05, doc="voltage of the RC pair (u)")

    def charge_rate(self):
        """Coulomb counting."""
        return -self.current / (HOUR * self.capacity)

    def pair_rate(self):
        """Charge of the capacitor, by what its resistor leaves of the current."""
        return (self.current - self.pair_voltage / self.R1) / self.C1

    def open_circuit_voltage(self):
        """Voltage at rest."""
        return smooth_table(self.charge, CHARGES, VOLTAGES)

    def voltage_drop(self):
        """Voltage lost inside."""
        return self.R0 * self.current + self.pair_voltage

    @Output("V", nominal=0.1)
    def voltage(self):
        """Voltage at the terminals."""
        return self.open_circuit_voltage() - self.voltage_drop()
