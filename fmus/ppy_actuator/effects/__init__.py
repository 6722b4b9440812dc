"""Known ways the actuator model is wrong, each relaxing one assumption of the README.

Every effect is a mixin that overrides laws (never an output) through ``super()``, so that it serves
the force-driven and the length-driven actuator, and stacks with the others. At its neutral
parameter value the laws give the bits of the base model whatever the effect's own state holds: what
it adds is multiplied by zero. An id is that of a family; its further shapes have the same one, and
a qualifier.
"""

from __future__ import annotations

from ...kit import Effect
from ...kit.effects import effects_by_name
from .ageing import CapacitanceFade, ResistanceGrowth, SelfHeating
from .coupling import (
    ChargeDependentStiffness,
    ForceToVoltage,
    QuadraticStrain,
    SlowStrainSaturation,
    StrainHysteresis,
    StrainLag,
    StrainSaturation,
    TwoStageStrainLag,
    UnequalStrain,
)
from .electrical import (
    CapacitanceOverModulus,
    ChargeDependentCapacitance,
    Diffusion,
    DoubleLayer,
    EvenCapacitance,
    NonlinearLeakage,
)
from .mechanical import (
    AsymmetricCreep,
    NonlinearStiffness,
    SecondKelvin,
    Slack,
    SmoothSlack,
    YieldThreshold,
)

EFFECTS: dict[str, type[Effect]] = effects_by_name(
    DoubleLayer,
    Diffusion,
    NonlinearLeakage,
    ChargeDependentCapacitance,
    CapacitanceOverModulus,
    EvenCapacitance,
    ResistanceGrowth,
    CapacitanceFade,
    SelfHeating,
    ForceToVoltage,
    QuadraticStrain,
    UnequalStrain,
    StrainSaturation,
    SlowStrainSaturation,
    StrainLag,
    TwoStageStrainLag,
    StrainHysteresis,
    ChargeDependentStiffness,
    SecondKelvin,
    NonlinearStiffness,
    AsymmetricCreep,
    YieldThreshold,
    Slack,
    SmoothSlack,
)

__all__ = ["EFFECTS", "StrainLag", "StrainSaturation"]
