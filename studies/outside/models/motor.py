"""DC motor with a load; its current and speed are measured."""

from fmus.kit import Component, Input, Output, Parameter, State


class Motor(Component):
    """L di/dt = u - R i - K w, and J dw/dt = K i - b w."""

    name = "motor"
    experiment = (6.0, 0.005)
    resistance = Parameter(1.2, "ohm", min=0.01, max=100, doc="of the winding (R)")
    inductance = Parameter(0.03, "H", min=1e-4, max=1, doc="of the winding (L)")
    constant = Parameter(0.08, "N*m/A", min=1e-4, max=10, doc="torque of a current (K)")
    inertia = Parameter(0.002, "kg*m2", min=1e-6, max=1, doc="of rotor and load (J)")
    damping = Parameter(0.002, "N*m*s", min=1e-6, max=1, doc="viscous friction (b)")
    voltage = Input("V", nominal=10.0, doc="at the terminals (u)")
    current = State("A", rate="current_rate", nominal=3.0, doc="in the winding (i)")
    speed = State("rad/s", rate="speed_rate", nominal=60.0, doc="of the shaft (w)")

    def supply(self):
        """Voltage of the amplifier."""
        return self.voltage

    def ohmic(self):
        """Voltage over the winding's resistance."""
        return self.resistance * self.current

    def induced(self):
        """Voltage that the speed induces."""
        return self.constant * self.speed

    def torque(self):
        """Torque of the current."""
        return self.constant * self.current

    def friction(self):
        """Torque of friction."""
        return self.damping * self.speed

    def current_rate(self):
        """Balance of voltages."""
        return (self.supply() - self.ohmic() - self.induced()) / self.inductance

    def speed_rate(self):
        """Balance of torques."""
        return (self.torque() - self.friction()) / self.inertia

    @Output("A", nominal=3.0)
    def measured_current(self):
        """In the winding, as measured."""
        return self.current

    @Output("rad/s", nominal=60.0)
    def measured_speed(self):
        """Speed, as measured."""
        return self.speed
