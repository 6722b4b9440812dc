"""The free foot with the mechanical model of its actuators, driven by their displacements.

Thesis fig. 5-6: a spring k and a dashpot b in series with the displacement by charge. Springs are
stiff and links light; inside one component the integrator resolves them, so that the rest of a
system exchanges displacements and tensions that are slow.
"""

from __future__ import annotations

from typing import Any

from ..kit import Input, Output, PowerPort, State, maximum
from .free import FootFree
from .kinematics import ACTUATORS


def _displacement(actuator: str) -> Any:
    return Input(
        "m",
        nominal=1e-4,
        display="mm",
        doc=f"displacement of the {actuator} actuator without load, positive if it elongates",
    )


def _flow(actuator: str) -> Any:
    return State(
        "m",
        rate=f"{actuator}_flow_rate",
        nominal=1e-4,
        display="mm",
        doc=f"elongation of the {actuator} actuator's dashpot",
    )


def _muscle(actuator: str) -> PowerPort:
    """Return the port of an actuator behind its spring and dashpot."""
    displacement = f"{actuator}_displacement"
    return PowerPort(
        actuator, "translational", displacement, f"{actuator}_force", (actuator,), delivers=True
    )


class FootDisplacementDriven(FootFree):
    """Free foot whose actuators are springs and dashpots in series with given displacements
    (thesis fig. 5-6, eq. 5.17).
    """

    name = "foot_displacement_driven"
    tolerance = 1e-11  # builds would differ by more than 1e-9 after an impact against stiff springs
    ports = (*map(_muscle, ACTUATORS), *FootFree.ports[len(ACTUATORS) :])

    an_displacement, po_displacement, do_displacement, pl_displacement = map(
        _displacement, ACTUATORS
    )
    an_flow, po_flow, do_flow, pl_flow = map(_flow, ACTUATORS)

    def spring_tension(self, place: int) -> Any:
        """Tension of a spring k at its elongation, zero while the actuator is slack."""
        name = ACTUATORS[place]
        elongation = (
            self.length_changes()[place]
            - getattr(self, f"{name}_displacement")
            - getattr(self, f"{name}_flow")
        )
        return maximum(getattr(self, f"k_{name}") * elongation, 0.0)

    @property
    def an_tension(self) -> Any:
        """Tension in the an actuator."""
        return self.spring_tension(0)

    @property
    def po_tension(self) -> Any:
        """Tension in the po actuator."""
        return self.spring_tension(1)

    @property
    def do_tension(self) -> Any:
        """Tension in the do actuator."""
        return self.spring_tension(2)

    @property
    def pl_tension(self) -> Any:
        """Tension in the pl actuator."""
        return self.spring_tension(3)

    def an_flow_rate(self) -> Any:
        """Rate at which the dashpot of an flows, T / b."""
        return self.an_tension / self.b_an

    def po_flow_rate(self) -> Any:
        """Rate at which the dashpot of po flows, T / b."""
        return self.po_tension / self.b_po

    def do_flow_rate(self) -> Any:
        """Rate at which the dashpot of do flows, T / b."""
        return self.do_tension / self.b_do

    def pl_flow_rate(self) -> Any:
        """Rate at which the dashpot of pl flows, T / b."""
        return self.pl_tension / self.b_pl

    @Output("N")
    def an_force(self) -> Any:
        """Tension in the an actuator, T = k (length change - displacement - flow) or 0."""
        return self.an_tension

    @Output("N")
    def po_force(self) -> Any:
        """Tension in the po actuator."""
        return self.po_tension

    @Output("N")
    def do_force(self) -> Any:
        """Tension in the do actuator."""
        return self.do_tension

    @Output("N")
    def pl_force(self) -> Any:
        """Tension in the pl actuator."""
        return self.pl_tension
