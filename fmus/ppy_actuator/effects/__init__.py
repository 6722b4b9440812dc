"""Known ways the actuator model is wrong, each relaxing one assumption of the README.

Every effect is a mixin that overrides laws (never an output) through ``super()``, so that it serves the force-driven
and the length-driven actuator, and stacks with the others. At its neutral parameter value the laws give the bits of
the base model whatever the effect's own state holds: what it adds is multiplied by zero.
"""

from __future__ import annotations

from ...kit import Effect
from .ageing import CapacitanceFade, ResistanceGrowth, SelfHeating
from .coupling import (
    ChargeDependentStiffness,
    ForceToVoltage,
    QuadraticStrain,
    StrainHysteresis,
    StrainLag,
    StrainSaturation,
)
from .electrical import ChargeDependentCapacitance, Diffusion, DoubleLayer, NonlinearLeakage
from .mechanical import AsymmetricCreep, NonlinearStiffness, SecondKelvin, Slack, YieldThreshold

EFFECTS: dict[str, type[Effect]] = {
    effect.id: effect
    for effect in (
        DoubleLayer, Diffusion, NonlinearLeakage, ChargeDependentCapacitance,
        ResistanceGrowth, CapacitanceFade, SelfHeating,
        ForceToVoltage, QuadraticStrain, StrainSaturation, StrainLag, StrainHysteresis, ChargeDependentStiffness,
        SecondKelvin, NonlinearStiffness, AsymmetricCreep, YieldThreshold, Slack,
    )
}  # fmt: skip
