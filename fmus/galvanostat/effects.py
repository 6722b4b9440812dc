"""Known ways the galvanostat is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kit import Effect, Parameter

if TYPE_CHECKING:
    from .model import Galvanostat

    class GalvanostatEffect(Effect, Galvanostat):
        """What an effect can count on: the laws of the galvanostat that it is laid over."""
else:
    GalvanostatEffect = Effect


class CurrentSaturation(GalvanostatEffect):
    """The drive clips at a lower current than declared: ``|i| <= (1 - l) I``.

    Relaxes assumption 1, that the current limit is the declared one (table 2-2); ``l = 0`` is the base model. The
    parameter is seen only in a record whose command reaches the limit that is left.
    """

    id = "current_saturation"
    neutral = "current_limit_loss"
    assumption = 1

    current_limit_loss = Parameter(
        0.0, "1", min=0, max=0.999, nominal=0.1, doc="share of the declared current limit that the drive lacks (l)"
    )

    def maximum_current(self) -> Any:
        """Current at which the drive really clips, (1 - l) of the base model."""
        return super().maximum_current() * (1.0 - self.current_limit_loss)


EFFECTS: dict[str, type[Effect]] = {effect.id: effect for effect in (CurrentSaturation,)}
