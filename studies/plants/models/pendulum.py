"""A user's model of a pendulum, with effects to attach: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State, sin
from fmus.kit.generic import asymmetric_friction, coulomb_friction, cubic_stiffness, force_offset


class Pendulum(Component):
    """J ddtheta/dt = tau - W sin(theta) - d dtheta/dt."""

    name = "clean_pendulum"
    experiment = (60.0, 0.05)

    inertia = Parameter(0.5, "kg*m^2", min=1e-9, max=1e6, doc="inertia about the hinge (J)")
    weight = Parameter(
        5.0, "N*m", min=1e-9, max=1e6, doc="torque of the weight, arm horizontal (W)"
    )
    damping = Parameter(0.4, "N*m*s", min=0, max=1e6, doc="viscous friction of the hinge (d)")

    torque = Input("N*m", doc="torque on the hinge (tau)")
    angle = State("rad", rate="angle_rate", doc="angle from hanging (theta)")
    velocity = State("rad/s", rate="acceleration", doc="angular velocity")

    def friction(self):
        """Torque of friction."""
        return self.damping * self.velocity

    def gravity(self):
        """Torque of the weight."""
        return self.weight * sin(self.angle)

    def angle_rate(self):
        """Definition."""
        return self.velocity

    def acceleration(self):
        """Balance of torques."""
        return (self.torque - self.gravity() - self.friction()) / self.inertia

    @Output("rad")
    def position(self):
        """Angle as measured."""
        return self.angle


EFFECTS = {
    effect.id: effect
    for effect in (
        coulomb_friction(Pendulum, "friction", "velocity", unit="N*m"),
        asymmetric_friction(Pendulum, "friction", "velocity", unit="N*m"),
        force_offset(Pendulum, "gravity", unit="N*m"),
        cubic_stiffness(Pendulum, "gravity", "angle", unit="N*m"),
    )
}
