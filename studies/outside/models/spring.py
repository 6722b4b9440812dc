"""Mass on a spring, pushed by a force; its position is measured."""

from fmus.kit import Component, Input, Output, Parameter, State


class Spring(Component):
    """m dv/dt = F - k x - c v."""

    name = "spring"
    experiment = (24.0, 0.02)
    mass = Parameter(1.0, "kg", min=0.01, max=100, doc="mass (m)")
    stiffness = Parameter(20.0, "N/m", min=0.1, max=1e4, doc="stiffness (k)")
    damping = Parameter(1.5, "N*s/m", min=1e-3, max=1e3, doc="viscous friction (c)")
    force = Input("N", nominal=5.0, doc="force that pushes (F)")
    position = State("m", rate="position_rate", nominal=0.3, doc="position (x)")
    velocity = State("m/s", rate="acceleration", nominal=1.0, doc="velocity (v)")

    def push(self):
        """Force of the actuator."""
        return self.force

    def elastic(self):
        """Force of the spring."""
        return self.stiffness * self.position

    def friction(self):
        """Force of friction."""
        return self.damping * self.velocity

    def position_rate(self):
        """Velocity."""
        return self.velocity

    def acceleration(self):
        """Balance of forces."""
        return (self.push() - self.elastic() - self.friction()) / self.mass

    @Output("m", nominal=0.3)
    def place(self):
        """Position, as measured."""
        return self.position
