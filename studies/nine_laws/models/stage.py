"""Stage on a spring, driven by a command; its position is measured."""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import asymmetric_friction, coulomb_friction, cubic_stiffness, force_offset


class Stage(Component):
    """m dv/dt = G u - k x - d v."""

    name = "stage"
    experiment = (30.0, 0.03)
    mass = Parameter(0.8, "kg", min=0.01, max=100, doc="moving mass (m)")
    stiffness = Parameter(12.0, "N/m", min=0.01, max=1e4, doc="spring (k)")
    damping = Parameter(2.0, "N*s/m", min=1e-3, max=1e3, doc="viscous friction (d)")
    gain = Parameter(1.0, "N/V", min=0.01, max=100, doc="force of the drive (G)")
    command = Input("V", nominal=5.0, doc="command of the drive (u)")
    position = State("m", rate="position_rate", nominal=0.3, doc="position (x)")
    velocity = State("m/s", rate="acceleration", nominal=1.0, doc="velocity (v)")

    def drive(self):
        """Force of the drive."""
        return self.gain * self.command

    def elastic(self):
        """Force of the spring."""
        return self.stiffness * self.position

    def friction(self):
        """Force of friction."""
        return self.damping * self.velocity

    def position_rate(self):
        """Definition."""
        return self.velocity

    def acceleration(self):
        """Balance of forces."""
        return (self.drive() - self.elastic() - self.friction()) / self.mass

    @Output("m", nominal=0.3)
    def place(self):
        """Position, as measured."""
        return self.position


EFFECTS = {
    effect.id: effect
    for effect in (
        coulomb_friction(Stage, "friction", "velocity"),
        asymmetric_friction(Stage, "friction", "velocity"),
        cubic_stiffness(Stage, "elastic", "position"),
        force_offset(Stage, "drive"),
    )
}
