"""Base of the actuator's effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...kit import Effect

if TYPE_CHECKING:
    from ..model import CurrentDriven

    class ActuatorEffect(Effect, CurrentDriven):
        """Laws of the actuator that an effect overrides."""
else:
    ActuatorEffect = Effect
