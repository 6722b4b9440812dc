"""What every effect of the actuator stands on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...kit import Effect

if TYPE_CHECKING:
    from ..model import Actuator

    class ActuatorEffect(Effect, Actuator):
        """What an effect can count on: the laws of the actuator that it is laid over."""
else:
    ActuatorEffect = Effect
