"""Plants that run under control alone, as a user writes them; a module that can go into an FMU."""

from fmus.kit import Component, Input, Output, Parameter, State, sin


class Upright(Component):
    """A heavy pendulum that a drive holds upright: J dw/dt = torque + W sin(angle) - friction."""

    name = "upright"
    experiment = (20.0, 0.02)

    inertia = Parameter(0.5, "kg*m^2", min=1e-3, max=1e2, doc="moment of inertia (J)")
    weight = Parameter(5.0, "N*m", min=1e-3, max=1e3, doc="largest moment of the weight (W)")
    damping = Parameter(0.4, "N*m*s/rad", min=0, max=1e2, doc="viscous friction")

    torque = Input("N*m", doc="torque of the drive")
    angle = State("rad", rate="angle_rate", nominal=0.2, doc="angle from upright")
    velocity = State("rad/s", rate="acceleration", nominal=1.0, doc="angular velocity")

    def friction(self):
        """Friction of the bearing."""
        return self.damping * self.velocity

    def gravity(self):
        """Moment of the weight."""
        return self.weight * sin(self.angle)

    def angle_rate(self):
        """Angular velocity."""
        return self.velocity

    def acceleration(self):
        """Newton's second law."""
        return (self.torque + self.gravity() - self.friction()) / self.inertia

    @Output("rad", nominal=0.2)
    def position(self):
        """Angle, as measured."""
        return self.angle


class Cart(Component):
    """A cart that a drive pushes along a rail: m dv/dt = force."""

    name = "cart"
    experiment = (20.0, 0.02)

    mass = Parameter(2.0, "kg", min=1e-3, max=1e3, doc="mass (m)")

    force = Input("N", doc="commanded force")
    place = State("m", rate="place_rate", nominal=0.5, doc="place on the rail")
    velocity = State("m/s", rate="acceleration", nominal=0.5, doc="velocity (v)")

    def drive(self):
        """Force of the drive."""
        return self.force

    def place_rate(self):
        """Velocity."""
        return self.velocity

    def acceleration(self):
        """Newton's second law."""
        return self.drive() / self.mass

    @Output("m", nominal=0.5)
    def position(self):
        """Place, as measured."""
        return self.place


class Tank(Component):
    """A tank that keeps what flows in through a valve that lags: area dh/dt = flow."""

    name = "tank"
    experiment = (600.0, 0.5)

    area = Parameter(0.5, "m^2", min=1e-3, max=1e3, doc="area")
    lag = Parameter(2.0, "s", min=1e-2, max=1e3, doc="lag of the valve")

    command = Input("m^3/s", doc="commanded flow")
    flow = State("m^3/s", rate="flow_rate", nominal=0.05, doc="flow through the valve")
    level = State("m", rate="level_rate", nominal=0.3, doc="level")

    def flow_rate(self):
        """Lag of the valve."""
        return (self.command - self.flow) / self.lag

    def level_rate(self):
        """Balance of the volume."""
        return self.flow / self.area

    @Output("m", nominal=0.3)
    def height(self):
        """Level, as measured."""
        return self.level
