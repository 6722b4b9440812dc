"""A DC motor behind its amplifier: winding, induced voltage, rotor and viscous friction.

The model that a control engineer begins with. Amplifiers have dead zones and bearings dry friction;
neither is in here. No effects are listed, so that a diagnosis lays over it what fits by the units::

    ppy diagnose record.csv --model examples/motor_drive.py:MotorDrive
"""

from fmus.kit import Component, Input, Output, Parameter, State


class MotorDrive(Component):
    """DC motor without inductance: u = R i + K w, J dw/dt = K i - d w."""

    name = "motor_drive"
    experiment = (30.0, 0.02)

    resistance = Parameter(2.0, "ohm", min=1e-6, max=1e6, doc="resistance of the winding (R)")
    constant = Parameter(
        0.05, "N*m/A", min=1e-9, max=1e6, nominal=0.05, doc="torque per current (K)"
    )
    inertia = Parameter(
        4e-4, "kg*m^2", min=1e-12, max=1e6, nominal=4e-4, doc="inertia of the rotor (J)"
    )
    damping = Parameter(2e-4, "N*m*s", min=0, max=1e6, nominal=2e-4, doc="viscous friction (d)")

    voltage = Input("V", nominal=5.0, doc="commanded voltage (u)")
    velocity = State("rad/s", rate="acceleration", nominal=100.0, doc="speed of the shaft (w)")

    def winding_current(self):
        """Ohm's law, with what the motor induces."""
        return (self.voltage - self.constant * self.velocity) / self.resistance

    def friction(self):
        """Torque of the bearings."""
        return self.damping * self.velocity

    def acceleration(self):
        """Balance of torques."""
        return (self.constant * self.winding_current() - self.friction()) / self.inertia

    @Output("A", nominal=1.0)
    def current(self):
        """Return the current of the winding, as measured."""
        return self.winding_current()

    @Output("rad/s", nominal=100.0)
    def speed(self):
        """Speed of the shaft, as measured."""
        return self.velocity
