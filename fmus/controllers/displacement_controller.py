"""Displacement control by current, within limits of the estimated charge and of the voltage.

Thesis sections 1.4.2 and 1.5: a loop that is designed for bandwidth alone applies large voltages
to the films when its reference jumps, which degrades them; a controller with an estimate of the
charge protects the actuator. Here a PI controller computes the wanted current, and limits of charge
and voltage bound it; back-calculation removes the excess from the integral.
"""

from __future__ import annotations

from typing import Any

from ..kit import Discrete, Input, Parameter, maximum, minimum, where
from .signals import CurrentController, largest_current, sampled_length
from .tracking import back_calculated, tracking_share

_CIRCUIT = "thesis table 3-1, mean of three 12-layer data sets"
_SPREAD = "circuits of table 3-1 within 30 %"


class DisplacementController(CurrentController):
    """PI controller of the displacement by a current, with limits of charge and voltage (thesis
    sections 1.4.2, 1.5).
    """

    name = "displacement_controller"
    experiment = (20.0, 0.02)

    proportional_gain = Parameter(
        3.5e4,
        "A/m",
        min=0,
        max=1e9,
        nominal=1e4,
        source="time constant of the loop of 0.5 s: 7.5 s / (alpha R2 C 0.5 s)",
        tunable=True,
        doc="current per error of the displacement (K)",
    )
    integral_time = Parameter(
        7.5,
        "s",
        min=1e-4,
        max=1e9,
        source="the circuit's time constant, (R1 + R2) C",
        tunable=True,
        doc="integral time (T_i)",
    )
    tracking_time = Parameter(
        7.5,
        "s",
        min=0,
        max=1e9,
        source="the integral time",
        tunable=True,
        doc="time in which a command that was not carried out is forgotten (T_t)",
    )
    current_limit = largest_current()
    voltage_limit = Parameter(
        1.0,
        "V",
        min=1e-3,
        max=100.0,
        source="thesis section 1.4.2",
        tunable=True,
        doc="largest voltage across the actuator in either direction",
    )
    charge_limit = Parameter(
        2.5,
        "C",
        min=1e-9,
        max=1e9,
        tunable=True,
        doc="largest charge on the films in either direction",
    )
    charge_uncertainty = Parameter(
        0.5,
        "1",
        min=0,
        max=10.0,
        display="%",
        source=_SPREAD,
        tunable=True,
        doc="share by which the films may hold more than the estimate",
    )
    approach_time = Parameter(
        0.5,
        "s",
        min=1e-3,
        max=1e4,
        tunable=True,
        doc="time constant with which the charge nears its limit",
    )
    R1 = Parameter(
        0.43, "ohm", min=0, max=1e6, source=_CIRCUIT, doc="series resistance of the estimate"
    )
    R2 = Parameter(
        2.35, "ohm", min=1e-6, max=1e12, source=_CIRCUIT, doc="leakage resistance of the estimate"
    )
    C = Parameter(2.70, "F", min=1e-9, max=1e9, source=_CIRCUIT, doc="capacitance of the estimate")
    largest_resistance = Parameter(
        0.5,
        "ohm",
        min=1e-6,
        max=1e6,
        source=_SPREAD,
        doc="largest immediate rise of the voltage per current",
    )
    smallest_resistance = Parameter(
        0.25,
        "ohm",
        min=1e-6,
        max=1e6,
        source=_SPREAD,
        doc="smallest immediate fall of the voltage per current",
    )
    largest_elastance = Parameter(
        0.5,
        "1/F",
        min=0,
        max=1e9,
        source=_SPREAD,
        doc="largest rise of the voltage between samples per charge",
    )

    voltage = Input("V", doc="voltage across the actuator")
    current = Input("A", doc="current that flows into the actuator")
    hold = Input(
        "1", start=False, type="boolean", doc="keeps the command, as while a protection recovers"
    )
    command_beside = Input(
        "A", doc="command of a feedforward, added to that of the controller within the limits"
    )

    unlimited_command = Discrete(
        "A", update="next_unlimited", period="sample_period", doc="current before its limits"
    )
    command_within_limits = Discrete(
        "A", update="next_limited", period="sample_period", doc="current within all limits"
    )
    previous_error = sampled_length("error", "error at the latest sample")
    sampled_beside = Discrete(
        "A",
        update="next_beside",
        period="sample_period",
        doc="command_beside at the latest sample",
    )
    charge = Discrete(
        "C",
        update="estimated_charge",
        period="sample_period",
        output=True,
        doc="estimate of the charge on the films",
    )

    limited = Discrete(
        "1",
        update="is_limited",
        period="sample_period",
        type="boolean",
        start=False,
        output=True,
        doc="whether a limit takes something off the wanted current",
    )

    # --- limits
    # ----------------------------------------------------------------------------------------------

    def film_voltage(self) -> Any:
        """Voltage of the films, from that across the actuator: v (1 + R1/R2) - R1 i."""
        return self.voltage * (1.0 + self.R1 / self.R2) - self.R1 * self.current

    def estimated_charge(self) -> Any:
        """Charge on the films by voltage and current, C v_f."""
        return self.C * self.film_voltage()

    def current_for_voltage(self, headroom: Any) -> Any:
        """Change of the current towards the limit that uses up the headroom of the voltage, with
        the resistance that errs on the safe side.
        """
        return where(
            headroom > 0.0,
            headroom / self.largest_resistance,
            headroom / self.smallest_resistance,
        )

    def usable_voltage(self) -> Any:
        """Voltage limit less the largest rise of the voltage until the next sample."""
        rise = self.largest_elastance * self.sample_period * self.current_limit
        return self.voltage_limit - rise

    def current_for_charge(self, side: Any) -> Any:
        """Current at which the charge approaches its limit of one sign with the approach time:
        leakage, and charging current times 1 + R1/R2 (eq. 3.5).
        """
        largest = (1.0 + self.charge_uncertainty) * self.estimated_charge()
        charging = (side * self.charge_limit - largest) / self.approach_time
        return self.film_voltage() / self.R2 + charging * (1.0 + self.R1 / self.R2)

    def upper_current(self) -> Any:
        """Largest current that all limits allow."""
        rising = self.current_for_voltage(self.usable_voltage() - self.voltage)
        within = minimum(self.current + rising, self.current_for_charge(1.0))
        return maximum(minimum(within, self.current_limit), -self.current_limit)

    def lower_current(self) -> Any:
        """Smallest current that all limits allow."""
        falling = self.current_for_voltage(self.usable_voltage() + self.voltage)
        within = maximum(self.current - falling, self.current_for_charge(-1.0))
        return minimum(maximum(within, -self.current_limit), self.current_limit)

    # --- law
    # ----------------------------------------------------------------------------------------------

    def error(self) -> Any:
        """Reference less measured displacement, e."""
        return self.reference - self.displacement

    def increment(self) -> Any:
        """Change of the wanted current: K (1 + h/T_i) e - K e_before."""
        ratio = 1.0 + self.sample_period / self.integral_time
        return self.proportional_gain * (ratio * self.error() - self.previous_error)

    def next_unlimited(self) -> Any:
        """Wanted current, continued from the limited one by back-calculation; unchanged on hold."""
        share = tracking_share(self.sample_period, self.tracking_time)
        latest = back_calculated(self.unlimited_command, self.command_within_limits, share)
        return where(self.hold, self.unlimited_command, latest + self.increment())

    def next_beside(self) -> Any:
        """Sample of ``command_beside``, for which the limits of this sample are computed."""
        return self.command_beside

    def next_limited(self) -> Any:
        """Wanted current, limited so that its sum with ``command_beside`` is within the limits."""
        upper = self.upper_current() - self.command_beside
        lower = self.lower_current() - self.command_beside
        return maximum(minimum(self.next_unlimited(), upper), lower)

    def is_limited(self) -> Any:
        """True if a limit reduces the wanted current."""
        return where(abs(self.next_unlimited() - self.next_limited()) > 0.0, 1.0, 0.0)

    def issued_current(self) -> Any:
        """Command of the controller to the actuator: feedback plus ``command_beside``."""
        return self.command_within_limits + self.sampled_beside
