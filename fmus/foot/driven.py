"""The free foot with the mechanical model of its actuators, driven by their displacements.

Thesis fig. 5-6: a spring k and a dashpot b in series with the displacement by charge. Springs are
stiff and links light; inside one component the integrator resolves them, so that the rest of a
system exchanges displacements and tensions that are slow.
"""

from __future__ import annotations

from typing import Any

from ..kit import Input, Output, Parameter, PowerPort, State, maximum
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


def _compression_limit(actuator: str) -> Any:
    return Parameter(
        0.0,
        "N",
        min=0,
        max=1e9,
        source="thesis section 3.1.2: used in tension only, films buckle under small compression",
        fitted=False,
        tunable=True,
        doc=f"compression above which the films of {actuator} are slack",
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
    an_compression_limit, po_compression_limit, do_compression_limit, pl_compression_limit = map(
        _compression_limit, ACTUATORS
    )

    def spring_force(self, place: int) -> Any:
        """Force of a spring k at its elongation, as if the films could push."""
        name = ACTUATORS[place]
        elongation = (
            self.length_changes()[place]
            - getattr(self, f"{name}_displacement")
            - getattr(self, f"{name}_flow")
        )
        return getattr(self, f"k_{name}") * elongation

    def spring_tension(self, place: int) -> Any:
        """Tension of a spring, zero while the actuator is slack."""
        return maximum(self.spring_force(place), 0.0)

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

    @Output("N", measured=False)
    def an_compression_margin(self) -> Any:
        """Compression of an that is left to its limit, negative while it is slack."""
        return self.an_compression_limit + self.spring_force(0)

    @Output("N", measured=False)
    def po_compression_margin(self) -> Any:
        """Compression of po that is left to its limit, negative while it is slack."""
        return self.po_compression_limit + self.spring_force(1)

    @Output("N", measured=False)
    def do_compression_margin(self) -> Any:
        """Compression of do that is left to its limit, negative while it is slack."""
        return self.do_compression_limit + self.spring_force(2)

    @Output("N", measured=False)
    def pl_compression_margin(self) -> Any:
        """Compression of pl that is left to its limit, negative while it is slack."""
        return self.pl_compression_limit + self.spring_force(3)
