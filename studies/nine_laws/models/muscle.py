"""Pneumatic muscle: its pressure follows a command, its length the pressure."""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import cubic_stiffness, force_offset


class Muscle(Component):
    """T dp/dt = u - p, and d dx/dt = A p - k x."""

    name = "muscle"
    experiment = (120.0, 0.12)
    filling_time = Parameter(1.5, "s", min=0.01, max=100, doc="of the pressure (T)")
    area = Parameter(2.0, "N/bar", min=0.01, max=100, doc="force of a pressure (A)")
    stiffness = Parameter(40.0, "N/m", min=0.1, max=1e4, doc="of the load (k)")
    damping = Parameter(30.0, "N*s/m", min=0.1, max=1e4, doc="of the load (d)")
    command = Input("bar", nominal=2.0, doc="pressure that is asked for (u)")
    pressure = State("bar", rate="filling", nominal=2.0, doc="in the muscle (p)")
    stroke = State("m", rate="stroke_rate", nominal=0.1, doc="of the load (x)")

    def filling(self):
        """Rate of the pressure."""
        return (self.command - self.pressure) / self.filling_time

    def pull(self):
        """Force of the pressure."""
        return self.area * self.pressure

    def elastic(self):
        """Force of the load's spring."""
        return self.stiffness * self.stroke

    def stroke_rate(self):
        """Balance of forces over the damping."""
        return (self.pull() - self.elastic()) / self.damping

    @Output("m", nominal=0.1)
    def measured_stroke(self):
        """Stroke, as measured."""
        return self.stroke


EFFECTS = {
    effect.id: effect
    for effect in (
        cubic_stiffness(Muscle, "elastic", "stroke"),
        force_offset(Muscle, "pull"),
    )
}
