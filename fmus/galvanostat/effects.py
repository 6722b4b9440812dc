"""Effects that the model of the galvanostat omits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kit import Effect, Parameter, Size, Term
from ..kit.effects import effects_by_name

if TYPE_CHECKING:
    from .model import Galvanostat

    class GalvanostatEffect(Effect, Galvanostat):
        """Laws of the galvanostat that an effect overrides."""
else:
    GalvanostatEffect = Effect


class CurrentSaturation(GalvanostatEffect):
    """The drive clips at a lower current than declared: ``|i| <= (1 - l) I``.

    Relaxes assumption 1, that the current limit is the declared one (table 2-2); ``l = 0`` is the
    base model. Only a record whose command reaches the lowered limit shows it.
    """

    id = "current_saturation"
    title = "A drive that clips too early"
    neutral = "current_limit_loss"
    term = Term(
        "maximum_current", "current_command", "(1 - l) I", "maximum_current over current_command"
    )
    assumption = 1
    sizes = (
        Size(
            "clips at {} of the declared limit",
            ("current_limit_loss",),
            "%",
            lambda loss: 100.0 * (1.0 - loss),
        ),
    )

    current_limit_loss = Parameter(
        0.0,
        "1",
        min=0,
        max=0.999,
        nominal=0.1,
        doc="share of the declared current limit that the drive lacks (l)",
    )

    def maximum_current(self) -> Any:
        """Current at which the drive really clips, (1 - l) of the base model."""
        return super().maximum_current() * (1.0 - self.current_limit_loss)


class CurrentOffset(GalvanostatEffect):
    """Current that flows where none is wanted: an offset of the drive, within its limits and not in
    recovery.

    Relaxes assumption 2, that the instrument is ideal between its limits; ``b = 0`` is the base
    model.
    """

    id = "current_offset"
    title = "An offset of the current"
    neutral = "drive_offset"
    assumption = 2
    term = Term("tolerated_current", "", "b", "tolerated_current offset")
    sizes = (Size("{} more than wanted", ("drive_offset",)),)

    drive_offset = Parameter(
        0.0,
        "A",
        min=-1e3,
        max=1e3,
        nominal=1e-3,
        display="mA",
        doc="current besides the wanted (b)",
    )

    def tolerated_current(self) -> Any:
        """Wanted current plus the offset b."""
        return super().tolerated_current() + self.drive_offset


class CurrentGain(GalvanostatEffect):
    """Drive whose scale is wrong: ``(1 + g)`` times the wanted current, within its limits.

    Relaxes assumption 2, that the instrument is ideal between its limits; ``g = 0`` is the base
    model.
    """

    id = "current_gain"
    title = "A scale error of the current"
    neutral = "drive_gain_error"
    assumption = 2
    term = Term(
        "tolerated_current", "current_command", "g i", "tolerated_current over current_command"
    )
    sizes = (Size("{} of what is wanted", ("drive_gain_error",), "%", lambda g: 100.0 * (1.0 + g)),)

    drive_gain_error = Parameter(
        0.0, "1", min=-0.99, max=1e2, nominal=0.01, doc="relative error of the current (g)"
    )

    def tolerated_current(self) -> Any:
        """Wanted current times 1 + g."""
        return super().tolerated_current() * (1.0 + self.drive_gain_error)


EFFECTS: dict[str, type[Effect]] = effects_by_name(CurrentSaturation, CurrentOffset, CurrentGain)
