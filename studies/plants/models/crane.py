"""A user's model of a load that swings out on a crane: under test, not the judge."""

from fmus.kit import Component, Output, Parameter, State, sin


class Crane(Component):
    """swing'' = -(g / l) sin(swing) - c swing': a free decay, nothing drives it."""

    name = "crane_load"
    experiment = (150.0, 0.1)

    g = Parameter(9.81, "m/s^2", min=9, max=10, doc="acceleration of gravity")
    rope = Parameter(9.0, "m", min=0.1, max=200, nominal=10.0, doc="length of the rope (l)")
    loss = Parameter(0.02, "1/s", min=0, max=10, nominal=0.02, doc="drag over inertia (c)")

    swing = State("rad", rate="swing_rate", nominal=0.3, display="deg", doc="angle of the rope")
    sway = State("rad/s", rate="sway_rate", nominal=0.3, doc="its rate")

    def pull(self):
        """Weight over inertia."""
        return self.g / self.rope * sin(self.swing)

    def air(self):
        """Drag over inertia."""
        return self.loss * self.sway

    def swing_rate(self):
        """Definition."""
        return self.sway

    def sway_rate(self):
        """Balance of torques."""
        return -self.pull() - self.air()

    @Output("rad", nominal=0.3, display="deg")
    def inclination(self):
        """By an inclinometer."""
        return self.swing
