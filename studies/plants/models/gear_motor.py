"""A user's model of a motor with a gear, seen from its output shaft: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State

RATIO = 20.0  # of the gear


class GearMotor(Component):
    """u = R i + n k w; J w' = n k i - b w, w behind the gear."""

    name = "gear_motor"
    experiment = (20.0, 0.01)

    R = Parameter(1.2, "ohm", min=1e-4, max=1e4, doc="resistance of the armature")
    k = Parameter(0.045, "N*m/A", min=1e-6, max=100, nominal=0.05, doc="constant of the motor")
    J = Parameter(0.1, "kg*m^2", min=1e-8, max=1e4, nominal=0.1, doc="inertia behind the gear")
    b = Parameter(0.02, "N*m*s/rad", min=0, max=1e3, nominal=0.02, doc="viscous friction")

    supply = Input("V", nominal=10.0, doc="voltage of the bridge (u)")
    shaft = State("rad/s", rate="shaft_rate", nominal=10.0, display="rpm", doc="output speed (w)")

    def armature(self):
        """Ohm's law, with what the motor induces."""
        return (self.supply - RATIO * self.k * self.shaft) / self.R

    def bearing(self):
        """Torque lost in gear and bearings."""
        return self.b * self.shaft

    def shaft_rate(self):
        """Balance of torques behind the gear."""
        return (RATIO * self.k * self.armature() - self.bearing()) / self.J

    @Output("A")
    def ammeter(self):
        """Return the current as measured."""
        return self.armature()

    @Output("rad/s", nominal=10.0, display="rpm")
    def tachometer(self):
        """Speed as measured."""
        return self.shaft
