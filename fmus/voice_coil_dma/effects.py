"""Effects that the bench model omits: friction, stops, force constant, amplifier, coil heating.

Noise, hum, a late controller and the protection are in :mod:`.disturbances`. Each effect is a mixin
that overrides one law (never an output) through ``super()``. At its neutral parameter value the law
equals that of the base model to the last bit: added terms are multiplied by zero, divisors are one.
"""

from __future__ import annotations

from typing import Any

from ..kit import Effect, Parameter, Size, Term, tanh
from ..kit.arms import lag_effect
from ..kit.curves import EffectNames, curve, tanhc
from ..kit.effects import effects_by_name
from ..kit.generic import describe_effect
from .disturbances import BenchEffect, BridgeNoise, ClockJitter, MainsHum, WindingProtection
from .model import VoiceCoilDma

_STROKE = 12.7e-3  # m from end to end, thesis section 2.2.2
_CONTINUOUS = 4.9 / 3.9  # A, current of the continuous force, thesis section 2.2.2


class CoulombFriction(BenchEffect):
    """Dry friction of the slide, ``F_c tanh(v / v_c)``; a sign of the velocity that is smooth
    within ``v_c``.

    Below ``v_c`` it is viscous: the slide creeps where a real one sticks. Relaxes assumption
    1, that friction is viscous; ``F_c = 0`` is the base model.
    """

    id = "coulomb_friction"
    title = "Dry friction of the slide"
    neutral = "coulomb_force"
    term = Term("slide_friction", "velocity", "F_c tanh(v / v_c)", "slide_friction over velocity")
    assumption = 1
    sizes = (Size("{}", ("coulomb_force",)),)

    coulomb_force = Parameter(
        0.0, "N", min=0, max=100.0, nominal=0.1, doc="dry friction of the slide (F_c)"
    )
    coulomb_velocity = Parameter(
        1e-3,
        "m/s",
        min=1e-6,
        max=1.0,
        nominal=1e-3,
        doc="velocity within which dry friction changes its sign (v_c)",
    )

    def slide_friction(self) -> Any:
        """Friction of the slide, F_c tanh(v / v_c) over the base model."""
        return super().slide_friction() + self.coulomb_force * tanh(
            self.velocity / self.coulomb_velocity
        )


class AsymmetricFriction(BenchEffect):
    """Dry friction that differs in the two directions: ``F_a s (1 + s) / 2`` more, with ``s =
    tanh(v / v_a)``.

    Friction is ``F_a`` larger while the coil stretches the actuator and unchanged on return; the
    term is zero at rest and never adds energy where ``F_a`` is positive. Relaxes assumption 1, that
    friction is viscous and the same in both directions; ``F_a = 0`` is the base model.
    """

    id = "asymmetric_friction"
    title = "Friction that differs in the two directions"
    neutral = "asymmetric_force"
    term = Term("slide_friction", "velocity", "F_a s (1 + s) / 2", "slide_friction over velocity")
    assumption = 1
    sizes = (Size("{} more while it stretches", ("asymmetric_force",)),)

    asymmetric_force = Parameter(
        0.0,
        "N",
        min=0,
        max=100.0,
        nominal=0.1,
        doc="dry friction that stretching meets and return does not (F_a)",
    )
    asymmetric_velocity = Parameter(
        1e-3,
        "m/s",
        min=1e-6,
        max=1.0,
        nominal=1e-3,
        doc="velocity within which this friction sets in (v_a)",
    )

    def slide_friction(self) -> Any:
        """Friction of the slide, larger in the direction of stretching."""
        direction = tanh(self.velocity / self.asymmetric_velocity)
        return super().slide_friction() + self.asymmetric_force * (
            0.5 * direction * (1.0 + direction)
        )


class PositionDependentForceConstant(BenchEffect):
    """Force constant that falls off the centre of the stroke: ``K / (1 + c (x - x_c)^2)``.

    Force and back-EMF fall together, by conservation of power. Relaxes assumption 2, that K does
    not depend on the position; ``c = 0`` is the base model.
    """

    id = "position_dependent_force_constant"
    title = "Force constant that falls off the centre"
    neutral = "force_constant_falloff"
    term = Term(
        "force_constant", "position", "K / (1 + c (x - x_c)^2)", "force_constant over position"
    )
    assumption = 2
    sizes = (
        Size(
            "half of it left {} off the centre", ("force_constant_falloff",), "m", lambda c: c**-0.5
        ),
        Size("which is at {}", ("force_constant_centre",)),
    )

    force_constant_falloff = Parameter(
        0.0,
        "1/m^2",
        min=0,
        max=1e8,
        nominal=1e4,
        doc="relative loss of force constant per square of distance (c)",
    )
    force_constant_centre = Parameter(
        0.0,
        "m",
        min=-1.0,
        max=1.0,
        nominal=1e-3,
        display="mm",
        doc="position of the largest force constant (x_c)",
    )

    def force_constant(self) -> Any:
        """Force constant, divided by 1 + c (x - x_c)^2."""
        distance = self.position - self.force_constant_centre
        return super().force_constant() / (
            1.0 + self.force_constant_falloff * (distance * distance)
        )


class AmplifierSaturation(BenchEffect):
    """Amplifier that levels off below its rails: ``v = V_s tanh(u / V_s)``, written with ``c = 1 /
    V_s^2``.

    The controller accounts for the limits of the base model, but not for this. The voltage is
    multiplied by ``tanh(z) / z``, ``z = sqrt(c) u``, which is 1 at ``c = 0``, the base model, where
    its slope by ``c`` is not zero. Relaxes assumption 3, that the amplifier passes every voltage
    between its limits unchanged.
    """

    id = "amplifier_saturation"
    title = "An amplifier that levels off below its rails"
    neutral = "amplifier_saturation_coefficient"
    term = Term(
        "drive_voltage",
        "voltage_command",
        "V_s tanh(u / V_s)",
        "drive_voltage over voltage_command",
    )
    assumption = 3
    sizes = (Size("beyond {}", ("amplifier_saturation_coefficient",), "V", lambda c: c**-0.5),)

    amplifier_saturation_coefficient = Parameter(
        0.0,
        "1/V^2",
        min=0,
        max=1e4,
        nominal=0.01,
        doc="inverse square of the voltage at which the amplifier levels off (c)",
    )

    def drive_voltage(self) -> Any:
        """Voltage across the coil, levelling off at V_s."""
        voltage = super().drive_voltage()
        square = self.amplifier_saturation_coefficient * (voltage * voltage)
        return voltage * tanhc(square)


_STRIBECK = describe_effect(
    curve(
        VoiceCoilDma,
        "slide_friction",
        "velocity",
        "stribeck",
        "N",
        scale=0.02,
        names=EffectNames(
            id="stribeck_friction",
            variables=("slide_friction_stribeck", "slide_friction_stribeck_velocity"),
        ),
    ),
    1,
    """Friction that is larger at low speed, after Stribeck: ``F_s sign(v) exp(-(v / v_s)^2)`` more,
    smooth.

    Relaxes assumption 1, that friction is viscous; ``F_s = 0`` is the base model.
    """,
    "Friction that is larger at low speed",
)
_STOPS = describe_effect(
    curve(
        VoiceCoilDma,
        "slide_friction",
        "position",
        "stops",
        "N",
        scale=_STROKE,  # the stop at either side begins at half of it
        names=EffectNames(
            id="end_stops",
            variables=("slide_friction_stop_stiffness", "slide_friction_stop_position"),
        ),
    ),
    4,
    """Stops at the ends of the stroke, as springs: ``k (x - clip(x, -w, w))`` more, where w is by
    default half of the 12.7 mm stroke; the position is 0 in its middle.

    Relaxes assumption 4, that the stroke is not limited; ``k = 0`` is the base model.
    """,
    "Stops at the ends of the stroke",
)
_HEATING = describe_effect(
    lag_effect(
        VoiceCoilDma,
        "coil_resistance",
        "coil_current",
        "warming",
        100.0,
        "ohm",
        nominal=0.3,
        scale=_CONTINUOUS,
        names=EffectNames(
            id="coil_heating",
            variables=("coil_heating", "coil_heating_time", "coil_mean_square"),
        ),
    ),
    7,
    """Coil whose resistance rises as it warms: ``a s`` more, ``T ds/dt = i^2 - s``, a thermal node
    of the dissipation.

    The continuous force of the coil, 4.9 N, needs 1.26 A. Relaxes assumption 7, that its resistance
    is constant; ``a = 0`` is the base model.
    """,
    "A coil whose resistance rises as it warms",
)

EFFECTS: dict[str, type[Effect]] = effects_by_name(
    CoulombFriction,
    AsymmetricFriction,
    _STRIBECK,
    _STOPS,
    PositionDependentForceConstant,
    AmplifierSaturation,
    _HEATING,
    WindingProtection,
    ClockJitter,
    MainsHum,
    BridgeNoise,
)
