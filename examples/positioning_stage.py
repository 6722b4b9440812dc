"""A motor-driven positioning stage: a mass on a slide with viscous friction, and its effects.

The drive makes a force of the motor's voltage. The defaults are round numbers near those of EMPS,
an electromechanical stage whose record is public (Janot, Gautier, Brunot: Data set and reference
models of EMPS, 2019). A controller kept that stage in place, so the simulated position drifts with
every error in force: integrated twice, it says little of its cause. ``StageFollowed`` is the same
stage with the motion given and the voltage asked for, as that study does; its inputs are
derivatives of the measured position, all signals through one low-pass filter without delay, as
``follow_stage.py`` writes them. The force constant is the maker's: ``--hold force_constant``.
"""

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import asymmetric_friction, coulomb_friction, force_offset


class Stage(Component):
    """Mass, friction and drive of both causalities."""

    experiment = (25.0, 0.001)

    mass = Parameter(100.0, "kg", min=1e-3, max=1e6, doc="moving mass (M)")
    damping = Parameter(300.0, "N*s/m", min=0, max=1e9, doc="viscous friction (F_v)")
    force_constant = Parameter(
        35.15065, "N/V", min=1e-6, max=1e6, doc="force of the drive per volt (K)"
    )

    def friction(self):
        """Force of the slide against its velocity."""
        return self.damping * self.velocity


class PositioningStage(Stage):
    """Voltage in, position out: M dv/dt = K u - F_v v."""

    name = "positioning_stage"

    motor_voltage = Input("V", doc="command to the drive (u)")
    velocity = State(
        "m/s", rate="acceleration", nominal=0.1, output=True, doc="velocity of the slide (v)"
    )
    travel = State("m", rate="travel_rate", nominal=0.1, doc="position of the slide")

    def acceleration(self):
        """Newton's second law."""
        return (self.force_constant * self.motor_voltage - self.friction()) / self.mass

    def travel_rate(self):
        """Velocity of the slide."""
        return self.velocity

    @Output("m", nominal=0.1)
    def position(self):
        """Position, as measured."""
        return self.travel


class StageFollowed(Stage):
    """Motion in, voltage out: K u = M dv/dt + F_v v."""

    name = "positioning_stage_followed"

    velocity = Input("m/s", nominal=0.1, doc="velocity of the slide (v)")
    acceleration = Input("m/s^2", doc="acceleration of the slide")

    @Output("V")
    def motor_voltage(self):
        """Command to the drive (u)."""
        return (self.mass * self.acceleration + self.friction()) / self.force_constant


EFFECTS = {
    effect.id: effect
    for effect in (
        coulomb_friction(PositioningStage, "friction", "velocity"),
        asymmetric_friction(PositioningStage, "friction", "velocity"),
        force_offset(PositioningStage, "friction"),
    )
}
