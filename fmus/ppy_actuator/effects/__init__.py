"""Effects that the actuator model omits, each relaxing one assumption of the README.

Every effect is a mixin that overrides laws (never an output) through ``super()``, so that it serves
all causalities of the actuator, and stacks with the others. At its neutral parameter value the laws
equal those of the base model to the last bit, for any value of the effect's own states, because
added terms are multiplied by zero. Effects of one family share an id; all but the first have a
qualifier.
"""

from __future__ import annotations

from ...kit import Effect
from ...kit.effects import effects_in
from . import ageing, coupling, electrical, mechanical
from .coupling import StrainLag, StrainSaturation

EFFECTS: dict[str, type[Effect]] = effects_in(electrical, ageing, coupling, mechanical)

__all__ = ["EFFECTS", "StrainLag", "StrainSaturation"]
