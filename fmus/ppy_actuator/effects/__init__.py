"""Known ways the actuator model is wrong, each relaxing one assumption of the README.

Every effect is a mixin that overrides laws (never an output) through ``super()``, so that it serves
the force-driven and the length-driven actuator, and stacks with the others. At its neutral
parameter value the laws give the bits of the base model whatever the effect's own state holds: what
it adds is multiplied by zero. An id is that of a family; its further shapes have the same one, and
a qualifier.
"""

from __future__ import annotations

from ...kit import Effect
from ...kit.effects import effects_in
from . import ageing, coupling, electrical, mechanical
from .coupling import StrainLag, StrainSaturation

EFFECTS: dict[str, type[Effect]] = effects_in(electrical, ageing, coupling, mechanical)

__all__ = ["EFFECTS", "StrainLag", "StrainSaturation"]
