"""The foot as a design: force and stroke of its toe as functions of geometry and attachments.

They follow from virtual work: in equilibrium the force of the ground on the toe times its lever
about a joint equals the tension of the actuator times its moment arm. Thesis section 5.3.3: the
values of table 5-1 "provide a starting point for optimization of the design".
"""

from __future__ import annotations

from typing import Any

from ..kit import Constant, Output, Parameter, maximum, minimum
from .model import Foot

# Smallest lever; that of the toe joint vanishes where the toe points along the leg.
_NO_LEVER = Constant(1e-4, "m")


class FootDesign(Foot):
    """Foot with the force and the stroke of its toe along the leg, by actuators that shorten."""

    name = "foot_design"

    actuator_force = Parameter(
        3.0,
        "N",
        min=0,
        max=1e4,
        source="thesis table 2-1 and section 1.2: approximately 3 N",
        tunable=True,
        doc="largest tension of an actuator",
    )
    actuator_stroke = Parameter(
        1.8e-4,
        "m",
        min=0,
        max=1.0,
        nominal=1e-4,
        display="mm",
        source="thesis fig. 3-10 and table 3-1: 0.068 mm/C, 2.7 F at 1 V",
        tunable=True,
        doc="by how much an actuator shortens",
    )

    def levers(self) -> tuple[Any, Any]:
        """Levers of a force along the leg on the toe, about ankle and toe joint (eq. 5.3), at the
        size of table 5-1.
        """
        ankle, _, mtp = self.shape_jacobian()
        return maximum(-ankle[0], _NO_LEVER), maximum(-mtp[0], _NO_LEVER)

    def force_gains(self) -> tuple[Any, Any]:
        """Force at the toe per tension of po about the ankle, and of pl about the toe joint.

        Arms and levers are proportional to ``scale``, so that their ratios do not depend on it.
        """
        ankle, mtp = self.levers()
        _, po, _, pl = self.arms()
        return po / ankle, pl / mtp

    @Output("N")
    def ankle_limited_force(self) -> Any:
        """Force with which the toe presses down while po pulls with its largest tension."""
        return self.actuator_force * self.force_gains()[0]

    @Output("N")
    def toe_limited_force(self) -> Any:
        """Force with which the toe presses down while pl pulls with its largest tension."""
        return self.actuator_force * self.force_gains()[1]

    @Output("N")
    def toe_force(self) -> Any:
        """Force with which the toe can press down: both joints have to hold it."""
        ankle, mtp = self.force_gains()
        return self.actuator_force * minimum(ankle, mtp)

    @Output("m", nominal=1e-3, display="mm")
    def toe_stroke(self) -> Any:
        """Travel of the unloaded toe downwards while po and pl shorten."""
        ankle, mtp = self.force_gains()
        return self.actuator_stroke * (1.0 / ankle + 1.0 / mtp)
