"""A user's model of a DC motor, with effects to attach: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import asymmetric_friction, coulomb_friction, cubic_stiffness, force_offset


class Motor(Component):
    """DC motor without inductance: u = R i + K w, J dw/dt = K i - d w - load."""

    name = "clean_motor"
    experiment = (60.0, 0.02)

    resistance = Parameter(2.0, "ohm", min=1e-6, max=1e6, doc="resistance of the winding (R)")
    constant = Parameter(
        0.05, "N*m/A", min=1e-9, max=1e6, nominal=0.05, doc="torque per current (K)"
    )
    inertia = Parameter(
        5e-4, "kg*m^2", min=1e-12, max=1e6, nominal=5e-4, doc="inertia of the rotor (J)"
    )
    damping = Parameter(1e-4, "N*m*s", min=0, max=1e6, nominal=1e-4, doc="viscous friction (d)")

    voltage = Input("V", doc="voltage at the terminals (u)")
    load = Input("N*m", nominal=0.05, doc="torque of the load")
    omega = State("rad/s", rate="acceleration", nominal=100.0, doc="speed of the shaft (w)")

    def winding_current(self):
        """Ohm's law, with what the motor induces."""
        return (self.voltage - self.constant * self.omega) / self.resistance

    def friction(self):
        """Torque of friction."""
        return self.damping * self.omega

    def acceleration(self):
        """Balance of torques."""
        return (self.constant * self.winding_current() - self.friction() - self.load) / self.inertia

    @Output("A")
    def current(self):
        """Return the current of the winding."""
        return self.winding_current()

    @Output("rad/s", nominal=100.0)
    def speed(self):
        """Speed of the shaft."""
        return self.omega


EFFECTS = {
    effect.id: effect
    for effect in (
        coulomb_friction(Motor, "friction", "omega", unit="N*m", nominal=0.01),
        asymmetric_friction(Motor, "friction", "omega", unit="N*m", nominal=0.01),
        force_offset(Motor, "friction", unit="N*m", nominal=0.01),
        cubic_stiffness(Motor, "friction", "omega", unit="N*m", nominal=0.01),
    )
}
