"""Creep of a polymer: a spring, a dashpot and a Kelvin element in series, and more elements.

That is Burgers' chain for a material instead of a specimen: stress in, strain out. The defaults are
round numbers near those of a polyethylene melt whose record is public (CM3, in the examples of
RepTate, reptate.readthedocs.io)::

    ppy diagnose creep_polyethylene_cm3.csv --model examples/creep.py:Creep --hold
    spring_stress_start,flow_start

The stress does not move: what is seen is how the melt settles after a step at the start. Of where
it was before ``--hold`` says that it was at rest; without that it is fitted, and what the spring
takes at once is told from what it took before by nothing.
"""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import extra_kelvin


class Creep(Component):
    """Burgers' chain.

    strain = sigma / E + f J + flow, with T df/dt = sigma - f and d flow/dt = sigma / eta.
    """

    name = "creep"
    experiment = (3000.0, 1.0)

    modulus = Parameter(
        1e4, "Pa", min=1e-6, max=1e15, doc="modulus of the spring that answers at once (E)"
    )
    viscosity = Parameter(5e4, "Pa*s", min=1e-6, max=1e18, doc="viscosity of the dashpot (eta)")
    compliance = Parameter(
        1e-3, "1/Pa", min=1e-15, max=1e6, doc="compliance of the Kelvin element (J)"
    )
    retardation_time = Parameter(
        30.0, "s", min=1e-6, max=1e9, doc="time constant of the Kelvin element (T)"
    )

    stress = Input("Pa", nominal=10.0, doc="stress (sigma)")
    spring_stress = State(
        "Pa", rate="spring_stress_rate", nominal=10.0, doc="stress that the Kelvin spring bears (f)"
    )
    flow = State("1", rate="flow_rate", doc="strain of the dashpot")

    def spring_stress_rate(self):
        """Stress that the Kelvin dashpot gives up to the spring."""
        return (self.stress - self.spring_stress) / self.retardation_time

    def flow_rate(self):
        """Viscous flow, which never ends."""
        return self.stress / self.viscosity

    def elongation(self):
        """Strain of the chain."""
        return self.stress / self.modulus + self.compliance * self.spring_stress + self.flow

    @Output("1")
    def strain(self):
        """Strain, as measured."""
        return self.elongation()


# with the times from which a fit starts: slower and faster than the first element, and between
EFFECTS = {
    effect.id: effect
    for effect in (
        extra_kelvin(Creep, "elongation", "stress", ordinal, time, unit="1", nominal=0.01)
        for ordinal, time in (("second", 300.0), ("third", 0.3), ("fourth", 10.0))
    )
}
