"""A user's model of a ship that is steered, in degrees: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State


class Ship(Component):
    """T r' = K delta - r (Nomoto, first order)."""

    name = "ship"
    experiment = (3600.0, 2.0)

    K = Parameter(0.05, "1/s", min=1e-5, max=10, nominal=0.05, doc="rate of turn per rudder")
    T = Parameter(60.0, "s", min=0.1, max=1e5, nominal=60.0, doc="time constant of the hull")

    rudder = Input("deg", nominal=10.0, doc="angle of the rudder (delta)")
    yaw = State("deg/s", rate="yaw_rate", nominal=0.5, doc="rate of turn (r)")
    course = State("deg", rate="course_rate", nominal=90.0, doc="heading")

    def steering(self):
        """Rate of turn that the rudder asks for."""
        return self.K * self.rudder

    def hull(self):
        """Resistance of the hull to a turn, as a rate of turn."""
        return self.yaw

    def yaw_rate(self):
        """First order."""
        return (self.steering() - self.hull()) / self.T

    def course_rate(self):
        """Definition."""
        return self.yaw

    @Output("deg", nominal=90.0)
    def compass(self):
        """Heading by the gyro compass, counted on through north."""
        return self.course

    @Output("deg/s", nominal=0.5, display="deg/min")
    def turn(self):
        """Rate of turn by the indicator."""
        return self.yaw
