"""A grip that gives way: what it holds is shorter than the way that the bench has gone.

Put between a bench and an actuator that is driven by its length, it closes an algebraic loop: the
tension depends on the length at once, and the length on the tension.
"""

from fmus.kit import Component, Input, Output, Parameter


class CompliantGrip(Component):
    """A spring without mass in series: length = position - tension / stiffness."""

    name = "compliant_grip"
    experiment = (5.0, 1e-3)

    stiffness = Parameter(20e3, "N/m", min=1.0, max=1e9, nominal=20e3, doc="stiffness of the grip")

    position = Input("m", nominal=1e-3, doc="where the bench has moved the grip to")
    tension = Input("N", doc="tension of what is held")

    def elongation(self):
        """Hooke's law."""
        return self.tension / self.stiffness

    @Output("m", nominal=1e-3)
    def length_change(self):
        """Change of length that arrives at what is held."""
        return self.position - self.elongation()
