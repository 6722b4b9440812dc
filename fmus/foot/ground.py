"""The ground: a dissipative contact law without adhesion, and friction.

Hunt and Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech.
42 (1975) 440, with Hertz's exponent; Coulomb friction with a smooth sign.
"""

from __future__ import annotations

from typing import Any

from ..kit import Component, Constant, Parameter, maximum, sqrt, tanh

# Smallest depth under the square root, which keeps its slope finite without contact.
_SHALLOW = Constant(1e-12, "m")


class Ground(Component):
    """Forces of the ground on a point that is below its surface."""

    ground_stiffness = Parameter(
        2e4,
        "N/m",
        min=0,
        max=1e9,
        nominal=1e4,
        source="assumed",
        doc="force per depth of the ground at ground_depth; 0 is no ground",
    )
    ground_depth = Parameter(
        1e-3,
        "m",
        min=1e-6,
        max=1.0,
        nominal=1e-3,
        display="mm",
        source="assumed",
        doc="depth at which ground_stiffness holds",
    )
    restitution_loss = Parameter(
        1.0,
        "s/m",
        min=0,
        max=1e3,
        source="assumed",
        doc="fall of the coefficient of restitution per velocity of a slow impact (alpha)",
    )
    ground_friction = Parameter(
        0.6, "1", min=0, max=10.0, source="assumed", doc="coefficient of friction of the ground"
    )
    slip_velocity = Parameter(
        0.02,
        "m/s",
        min=1e-6,
        max=1.0,
        nominal=1e-2,
        display="mm/s",
        source="assumed",
        doc="velocity along the ground within which friction changes its sign",
    )

    def ground_pressure(self, depth: Any, rate: Any) -> Any:
        """Normal force, k d sqrt(d / d0) (1 + 3/2 alpha dd/dt); 0 without contact and where it
        would pull.
        """
        penetration = maximum(depth, 0.0)
        elastic = penetration * sqrt(maximum(depth, _SHALLOW) / self.ground_depth)
        damping = maximum(1.0 + 1.5 * self.restitution_loss * rate, 0.0)
        return self.ground_stiffness * elastic * damping

    def ground_drag(self, pressure: Any, slip: Any) -> Any:
        """Tangential force against the slip velocity: Coulomb friction with a smooth sign."""
        return -self.ground_friction * pressure * tanh(slip / self.slip_velocity)
