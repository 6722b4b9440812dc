"""Impedance (compliance) control: the force of a virtual spring and damper at a measured length.

Thesis section 1.5.2 finds that compliance control has not been applied to linear actuators. The
force is the reference of a force loop.
"""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Input, Output, Parameter, clip

_LAW = "Hogan, J. Dyn. Syst. Meas. Control 107, 1985"


class ImpedanceController(Component):
    """Force wanted at a length: stiffness, damping and rest length, within limits (thesis section
    1.5.2).
    """

    name = "impedance_controller"
    experiment = (10.0, 0.02)

    sample_period = Parameter(
        0.02, "s", min=1e-4, max=10.0, nominal=0.01, doc="sample period of the controller (h)"
    )
    stiffness = Parameter(
        1e3,
        "N/m",
        min=-1e9,
        max=1e9,
        nominal=1e3,
        source=_LAW,
        tunable=True,
        doc="force per elongation (K)",
    )
    damping = Parameter(
        50.0,
        "N*s/m",
        min=-1e9,
        max=1e9,
        nominal=10.0,
        source=_LAW,
        tunable=True,
        doc="force per rate (B)",
    )
    filter_time = Parameter(
        0.05, "s", min=0, max=1e4, tunable=True, doc="time constant of the filter of the rate (T_f)"
    )
    preload = Parameter(
        0.5, "N", min=-1e6, max=1e6, tunable=True, doc="force at the rest length (F_0)"
    )
    force_min = Parameter(
        0.0,
        "N",
        min=-1e6,
        max=1e6,
        source="films buckle under compression (thesis section 3.1)",
        tunable=True,
        doc="smallest force",
    )
    force_max = Parameter(
        3.0,
        "N",
        min=1e-6,
        max=1e6,
        source="below the 4.9 N of the coil",
        tunable=True,
        doc="largest force",
    )

    length = Input("m", nominal=1e-3, display="mm", doc="measured length, or change of it")
    rest_length = Input("m", nominal=1e-3, display="mm", doc="length at which only preload is left")

    previous_length = Discrete(
        "m",
        update="next_length",
        period="sample_period",
        nominal=1e-3,
        display="mm",
        doc="length at the latest sample",
    )
    length_rate = Discrete(
        "m/s",
        update="next_rate",
        period="sample_period",
        nominal=1e-2,
        output=True,
        doc="rate of the length behind its filter",
    )
    unlimited_force = Discrete(
        "N", update="wanted_force", period="sample_period", doc="force before its limits"
    )

    def next_length(self) -> Any:
        """Sample of the length."""
        return self.length

    def next_rate(self) -> Any:
        """Rate of the length, s / (T_f s + 1) by the backward difference."""
        change = self.length - self.previous_length
        return (self.filter_time * self.length_rate + change) / (
            self.filter_time + self.sample_period
        )

    def wanted_force(self) -> Any:
        """Force of spring, damper and preload, before its limits."""
        spring = self.stiffness * (self.length - self.rest_length)
        return self.preload + spring + self.damping * self.next_rate()

    def issued_force(self) -> Any:
        """Reference of the controller to the force loop, within its limits."""
        return clip(self.unlimited_force, self.force_min, self.force_max)

    @Output("N")
    def force_reference(self) -> Any:
        """Force for a force loop, held between sample instants."""
        return self.issued_force()
