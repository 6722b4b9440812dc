"""Feedforward: the current by which an actuator's model reaches a length under a known load.

Thesis section 6.2 proposes work loops that are tracked by feedback and feedforward. The model is
that of eqs. 3.4 to 3.9, sampled; its inverse takes a sample period, so that length and load must be
known one sample ahead.
"""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Input, Output, Parameter, clip, exp, maximum, minimum, where
from .signals import largest_current, sampled_length

_CIRCUIT = "thesis table 3-1, mean of three 12-layer data sets"
_FIGURE = "thesis fig. 3-9, 12-layer actuator 106, in N/m and N*s/m (errata 1)"


class Feedforward(Component):
    """Inverse of the force-driven actuator, from displacement and load a sample ahead to the
    current, with limits of current, rate and voltage (thesis eqs. 3.4-3.9, section 6.2).
    """

    name = "feedforward"
    experiment = (20.0, 0.25)

    sample_period = Parameter(
        0.25, "s", min=1e-4, max=1e4, doc="sample period (h), in which the inverse gets there"
    )
    current_limit = largest_current("largest current in either direction (I)")
    rate_limit = Parameter(
        5.2,
        "A/s",
        min=1e-9,
        max=1e9,
        source="choice: all of the galvanostat's range in half a second",
        tunable=True,
        doc="largest change of the current in a sample period, per time (S)",
    )
    voltage_limit = Parameter(
        1.0,
        "V",
        min=1e-3,
        max=100.0,
        source="thesis section 1.4.2",
        tunable=True,
        doc="largest voltage across the model in either direction (V)",
    )
    R1 = Parameter(
        0.43, "ohm", min=1e-6, max=1e6, source=_CIRCUIT, doc="series resistance of the model"
    )
    R2 = Parameter(
        2.35, "ohm", min=1e-6, max=1e12, source=_CIRCUIT, doc="leakage resistance of the model"
    )
    C = Parameter(2.70, "F", min=1e-9, max=1e9, source=_CIRCUIT, doc="capacitance of the model")
    alpha = Parameter(
        6.8e-5,
        "m/C",
        min=1e-12,
        max=1.0,
        nominal=1e-4,
        display="mm/C",
        source="thesis fig. 3-10",
        doc="displacement per charge of the model",
    )
    k1 = Parameter(
        6300.0,
        "N/m",
        min=1e-6,
        max=1e15,
        source=_FIGURE,
        doc="instantaneous stiffness of the model",
    )
    b1 = Parameter(
        1.7e6, "N*s/m", min=1e-6, max=1e18, source=_FIGURE, doc="viscous damping of the model"
    )
    k2 = Parameter(
        1.0e4, "N/m", min=1e-6, max=1e15, source=_FIGURE, doc="delayed stiffness of the model"
    )
    b2 = Parameter(
        2.0e6, "N*s/m", min=1e-6, max=1e18, source=_FIGURE, doc="delayed damping of the model"
    )

    next_reference = Input(
        "m", nominal=1e-4, display="mm", doc="displacement wanted a sample period from now"
    )
    force = Input("N", doc="load at the sample")
    next_force = Input("N", doc="load a sample period from now, to which it changes evenly")
    active = Input(
        "1", start=True, type="boolean", doc="whether the current is commanded; if not, none is"
    )

    charge = Discrete(
        "C",
        update="next_charge",
        period="sample_period",
        output=True,
        doc="charge of the model at the next sample",
    )
    kelvin_elongation = sampled_length(
        "next_kelvin", "elongation of the model's Kelvin element at the next sample"
    )
    maxwell_elongation = sampled_length(
        "next_maxwell", "elongation of the model's Maxwell dashpot at the next sample"
    )
    current_within_limits = Discrete(
        "A", update="next_current", period="sample_period", doc="current of the model"
    )
    limited = Discrete(
        "1",
        update="is_limited",
        period="sample_period",
        type="boolean",
        start=False,
        output=True,
        doc="whether a limit takes something off the commanded current that the displacement needs",
    )

    # --- mechanical
    # ----------------------------------------------------------------------------------------------

    def next_kelvin(self) -> Any:
        """Kelvin elongation at the next sample under a linear change of load (eq. 3.5, row 2)."""
        time = self.b2 / self.k2
        decay = exp(-self.sample_period / time)
        at_constant_load = decay * self.kelvin_elongation + (1.0 - decay) * self.force / self.k2
        share = 1.0 - (1.0 - decay) * time / self.sample_period
        return at_constant_load + share * (self.next_force - self.force) / self.k2

    def next_maxwell(self) -> Any:
        """Maxwell elongation at the next sample under the mean of both loads (eq. 3.5, row 3)."""
        mean = 0.5 * (self.force + self.next_force)
        return self.maxwell_elongation + self.sample_period * mean / self.b1

    # --- electrical
    # ----------------------------------------------------------------------------------------------

    def needed_charge(self) -> Any:
        """Charge whose elongation is the reference less that due to load (eqs. 3.4, 3.8)."""
        loaded = self.next_kelvin() + self.next_maxwell() + self.next_force / self.k1
        return (self.next_reference - loaded) / self.alpha

    def decay(self) -> Any:
        """Decay of the charge in a sample period without current, a (eq. 3.5, row 1)."""
        return exp(-self.sample_period / ((self.R1 + self.R2) * self.C))

    def charge_per_current(self) -> Any:
        """Charge per current in a sample, b = R2 C (1 - a) (eq. 3.5, row 1)."""
        return self.R2 * self.C * (1.0 - self.decay())

    def needed_current(self) -> Any:
        """Current that makes the needed charge in a sample: (Q - a q) / b."""
        free_response = self.decay() * self.charge
        return (self.needed_charge() - free_response) / self.charge_per_current()

    # --- limits
    # ----------------------------------------------------------------------------------------------

    def current_at_voltage(self, side: Any) -> Any:
        """Current that brings the voltage to its limit on a side, just after the sample or just
        before the next one, whichever is nearer (eq. 3.9).
        """
        resistance = self.R1 * self.R2 / (self.R1 + self.R2)
        per_charge = self.R2 / (self.R1 + self.R2) / self.C
        after = (self.voltage_limit - side * per_charge * self.charge) / resistance
        free_response = side * per_charge * self.decay() * self.charge
        per_current = resistance + per_charge * self.charge_per_current()
        before_next = (self.voltage_limit - free_response) / per_current
        return side * minimum(after, before_next)

    def limited_current(self, current: Any) -> Any:
        """Current within the limits of voltage and current."""
        below = minimum(current, self.current_at_voltage(1.0))
        within = maximum(below, self.current_at_voltage(-1.0))
        return clip(within, -self.current_limit, self.current_limit)

    def next_current(self) -> Any:
        """Needed current within the limits; the voltage limit overrides the rate limit."""
        change = self.rate_limit * self.sample_period
        before = self.current_within_limits
        return self.limited_current(clip(self.needed_current(), before - change, before + change))

    def next_charge(self) -> Any:
        """Charge of the model at the next sample: a q + b i (eq. 3.5, row 1)."""
        return self.decay() * self.charge + self.charge_per_current() * self.next_current()

    def is_limited(self) -> Any:
        """True if the controller is active and a limit reduces the needed current."""
        excess = abs(self.needed_current() - self.next_current())
        return where(self.active, where(excess > 0.0, 1.0, 0.0), 0.0)

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    def issued_current(self) -> Any:
        """Command of the controller to the actuator, zero while it is not active."""
        return where(self.active, self.current_within_limits, 0.0)

    @Output("A")
    def command(self) -> Any:
        """Current for the actuator, held between sample instants."""
        return self.issued_current()
