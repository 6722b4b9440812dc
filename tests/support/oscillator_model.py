"""A mass on a spring with a damper; a module that can go into a Python FMU."""

from fmus.kit import Component, Input, Output, Parameter, State


class Oscillator(Component):
    """One degree of freedom: m dv/dt = F - friction - k x."""

    name = "oscillator"
    experiment = (20.0, 0.02)

    mass = Parameter(1.0, "kg", min=1e-3, max=1e3, doc="moving mass (m)")
    damping = Parameter(0.8, "N*s/m", min=0, max=1e3, doc="viscous damping (d)")
    stiffness = Parameter(20.0, "N/m", min=1e-3, max=1e6, doc="stiffness of the spring (k)")

    force = Input("N", doc="force on the mass (F)")
    elongation = State("m", rate="elongation_rate", nominal=0.1, doc="elongation of the spring (x)")
    velocity = State("m/s", rate="acceleration", nominal=0.5, doc="velocity of the mass (v)")

    def friction(self):
        """Force of the damper."""
        return self.damping * self.velocity

    def spring_force(self):
        """Force of the spring."""
        return self.stiffness * self.elongation

    def elongation_rate(self):
        """Velocity of the mass."""
        return self.velocity

    def acceleration(self):
        """Newton's second law."""
        return (self.force - self.friction() - self.spring_force()) / self.mass

    @Output("m", nominal=0.1)
    def position(self):
        """Position, as measured."""
        return self.elongation
