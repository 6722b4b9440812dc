"""Effects that the model omits: a guide that rubs, weights that swing, an LVDT or frame askew.

Each is a mixin that overrides one law (never an output) through ``super()``. At its neutral
parameter value the law equals that of the base model to the last bit: added terms are multiplied by
zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kit import Effect, Parameter, Size, State, Term, arccos, sqrt, tanh
from ..kit.effects import effects_by_name
from .model import IsotonicStand

if TYPE_CHECKING:

    class StandEffect(Effect, IsotonicStand):
        """Laws of the stand that an effect overrides."""
else:
    StandEffect = Effect


class CoreFriction(StandEffect):
    """Dry friction of the core in its guide, which carries part of the load: ``F_c tanh(v / v_c)``
    less.

    ``v = (x - s) / T`` with ``ds/dt = v`` is the velocity of the core, late by T. Friction lowers
    the load of a sinking weight and raises that of a rising one, so that the load is not isotonic.
    Below ``v_c`` the core creeps where a real one sticks. Relaxes assumption 3, that the core moves
    freely; ``F_c = 0`` is the base model.
    """

    id = "core_friction"
    title = "Dry friction of the core"
    neutral = "core_friction"
    term = Term("carried_load", "displacement", "-F_c tanh(v / v_c)", "carried_load over velocity")
    assumption = 3
    sizes = (Size("{}", ("core_friction",)),)

    core_friction = Parameter(
        0.0, "N", min=0, max=100.0, nominal=0.1, doc="dry friction of the core (F_c)"
    )
    core_friction_velocity = Parameter(
        1e-3,
        "m/s",
        min=1e-7,
        max=1.0,
        nominal=1e-3,
        doc="velocity within which dry friction changes its sign (v_c)",
    )
    core_follow_time = Parameter(
        0.02,
        "s",
        min=1e-3,
        max=10.0,
        nominal=0.02,
        doc="time by which the velocity of the core is late (T)",
    )
    core_travel = State(
        "m",
        rate="core_velocity",
        nominal=1e-4,
        display="mm",
        doc="displacement of the core, late by its follow time",
    )

    def core_velocity(self) -> Any:
        """Velocity of the core, (x - s) / T."""
        return (self.displacement - self.core_travel) / self.core_follow_time

    def carried_load(self) -> Any:
        """Load less the friction against the motion."""
        return super().carried_load() - self.core_friction * tanh(
            self.core_velocity() / self.core_friction_velocity
        )


class SwingingWeight(StandEffect):
    """Weights that swing from the start: a pendulum of length l, which pulls the less the farther
    out it is.

    With ``a`` the amplitude, ``w^2 = g / l`` and the swing ``q`` from 1, ``dq/dt = w p`` and
    ``dp/dt = -w q - 2 p / T``, the weight is multiplied by ``1 + a^2 (p^2 - q^2 / 2)``: cosine and
    centripetal force, both to second order. The parameter is ``c = a^2``, whose derivative at zero
    does not vanish. Relaxes assumption 2, that weights hang still; ``c = 0`` is the base model.
    """

    id = "swinging_weight"
    title = "Weights that swing"
    neutral = "swing_square"
    term = Term("weight", "mass", "m g a^2 (p^2 - q^2 / 2)", "weight over time")
    assumption = 2
    sizes = (Size("{} to either side", ("swing_square",), "rad", sqrt),)

    swing_square = Parameter(
        0.0, "1", min=0, max=1.0, nominal=0.01, doc="square of the amplitude in rad (c)"
    )
    swing_length = Parameter(
        0.1, "m", min=1e-3, max=10.0, nominal=0.1, doc="from the pivot to the weights (l)"
    )
    swing_decay = Parameter(
        10.0, "s", min=1e-2, max=1e6, nominal=10.0, doc="time constant of its decay (T)"
    )
    swing_angle = State(
        "1", rate="swing_angle_rate", start=1.0, doc="angle over the amplitude at the start (q)"
    )
    swing_velocity = State(
        "1", rate="swing_velocity_rate", doc="rate of the angle over w and the amplitude (p)"
    )

    def swing_frequency(self) -> Any:
        """Angular frequency of the pendulum, w = sqrt(g / l)."""
        return sqrt(self.gravity / self.swing_length)

    def swing_angle_rate(self) -> Any:
        """Rate of the angle, w p."""
        return self.swing_frequency() * self.swing_velocity

    def swing_velocity_rate(self) -> Any:
        """Restoring weight and damping, -w q - 2 p / T."""
        return (
            -(self.swing_frequency() * self.swing_angle)
            - 2.0 * self.swing_velocity / self.swing_decay
        )

    def weight(self) -> Any:
        """Pull of the swinging weights, the weight times 1 + c (p^2 - q^2 / 2)."""
        pull = self.swing_velocity * self.swing_velocity - 0.5 * self.swing_angle * self.swing_angle
        return super().weight() * (1.0 + self.swing_square * pull)


class Misalignment(StandEffect):
    """LVDT that leans by an angle against the actuator: the core moves by ``x cos(angle)``, written
    ``x (1 - c)``.

    ``c`` is 0.004 at 5 degrees. Relaxes assumption 4, that both are in one line; ``c = 0`` is the
    base model.
    """

    id = "misalignment"
    title = "An LVDT that leans"
    neutral = "misalignment_loss"
    term = Term("core_position", "displacement", "-c x", "core_position over displacement")
    assumption = 4
    sizes = (Size("by {}", ("misalignment_loss",), "rad", lambda loss: arccos(1.0 - loss)),)

    misalignment_loss = Parameter(
        0.0,
        "1",
        min=0,
        max=0.99,
        nominal=0.01,
        doc="1 less the cosine of the angle between LVDT and actuator (c)",
    )

    def core_position(self) -> Any:
        """Position along the axis of the LVDT, times 1 - c."""
        return super().core_position() * (1.0 - self.misalignment_loss)


class FrameCompliance(StandEffect):
    """Frame that bends under the load: the actuator's end is lower by ``c F``.

    Relaxes assumption 5, that the fixture is rigid; ``c = 0`` is the base model.
    """

    id = "frame_compliance"
    title = "A frame that bends under the load"
    neutral = "frame_compliance"
    term = Term("end_position", "tension", "c F", "end_position over tension")
    assumption = 5
    sizes = (Size("{}", ("frame_compliance",)),)

    frame_compliance = Parameter(
        0.0,
        "m/N",
        min=0,
        max=1.0,
        nominal=1e-5,
        display="mm/N",
        doc="compliance of the fixture between actuator and LVDT (c)",
    )

    def end_position(self) -> Any:
        """Position of the actuator's end, lower by c F."""
        return super().end_position() + self.frame_compliance * self.tension


EFFECTS: dict[str, type[Effect]] = effects_by_name(
    CoreFriction, SwingingWeight, Misalignment, FrameCompliance
)
