"""A mass on a spring with a damper, driven by a force; and a spring that hardens as Duffing's.

The defaults are round numbers near those of Silverbox, an electronic circuit that obeys this
equation and whose record is public (Wigren, Schoukens: Three free data sets for development and
benchmarking in nonlinear system identification, 2013). Its volts in are read as newtons, its volts
out as metres, and its input is smooth between samples: ``--map 'input=force[N]' --map
'output=position[m]' --interpolate``.
"""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import asymmetric_friction, coulomb_friction, cubic_stiffness, force_offset


class MassSpringDamper(Component):
    """One degree of freedom: m dv/dt = F - d v - k x."""

    name = "mass_spring_damper"
    experiment = (10.0, 1e-3)

    mass = Parameter(5e-6, "kg", min=1e-9, max=1e6, doc="moving mass (m)")
    damping = Parameter(2e-4, "N*s/m", min=0, max=1e9, doc="viscous damping (d)")
    stiffness = Parameter(1.0, "N/m", min=1e-6, max=1e12, doc="stiffness of the spring at rest (k)")

    force = Input("N", doc="force on the mass (F)")
    elongation = State("m", rate="elongation_rate", nominal=0.1, doc="elongation of the spring (x)")
    velocity = State("m/s", rate="acceleration", nominal=40.0, doc="velocity of the mass (v)")

    def damper_force(self):
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
        return (self.force - self.damper_force() - self.spring_force()) / self.mass

    @Output("m", nominal=0.1)
    def position(self):
        """Position, as measured."""
        return self.elongation


EFFECTS = {
    effect.id: effect
    for effect in (
        cubic_stiffness(MassSpringDamper, "spring_force", "elongation", nominal=0.1),
        coulomb_friction(MassSpringDamper, "damper_force", "velocity", nominal=0.1),
        asymmetric_friction(MassSpringDamper, "damper_force", "velocity", nominal=0.1),
        force_offset(MassSpringDamper, "spring_force", nominal=0.1),
    )
}
