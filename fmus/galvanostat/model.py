"""The potentiostat-galvanostat: limits, compliance, and the voltage protection of thesis section
4.2.

Thesis table 2-2 has the ratings of the instrument (Hokuto Denko HA-151), fig. 4-4 and its text the
protection. The voltage is sampled, so that current and voltage of the actuator form no algebraic
loop; between samples the current follows the command without delay.
"""

from __future__ import annotations

from typing import Any

from ..kit import (
    Component,
    Discrete,
    Input,
    Output,
    Parameter,
    PowerPort,
    Preset,
    State,
    clip,
    floor,
    logical_or,
    maximum,
    outside,
    where,
)

_TABLE = "thesis table 2-2 (HA-151)"
# Response time in seconds below which the instrument counts as ideal: such a lag would be too stiff
# to integrate.
_SHORTEST_RESPONSE = 1e-6
# Smallest share of the current under compliance; from zero it could not grow again by a factor.
_SMALLEST_SHARE = 1e-6
# Tolerance, in periods, of a recovery time that is a whole number of them: the quotient of two
# decimals is rounded.
_SAME_COUNT = 1e-9


class Galvanostat(Component):
    """Potentiostat-galvanostat: current in, limited current out, with voltage protection (thesis
    sections 2.3, 4.2).
    """

    name = "galvanostat"
    experiment = (60.0, 0.01)
    ports = (PowerPort("circuit", "electrical", "voltage", "current", ("p", "n"), delivers=True),)

    current_limit = Parameter(
        1.3,
        "A",
        min=1e-9,
        max=1e6,
        source=_TABLE,
        tunable=True,
        doc="largest current in either direction",
    )
    compliance_voltage = Parameter(
        15.0,
        "V",
        min=1e-6,
        max=1e6,
        source=_TABLE,
        tunable=True,
        doc="largest voltage against which the current is driven",
    )
    response_time = Parameter(
        0.0,
        "s",
        min=0,
        max=1e3,
        nominal=5e-5,
        display="us",
        doc="time constant of the current; below 1 us the instrument is ideal, without lag",
    )
    control_tolerance = Parameter(
        0.0,
        "A",
        min=0,
        max=1e3,
        nominal=1e-3,
        display="mA",
        tunable=True,
        doc=(
            "deviation of the setpoint from the current wanted, a dead band in either direction; 0"
            " is exact"
        ),
    )
    recovery_time = Parameter(
        0.5,
        "s",
        min=0,
        max=1e3,
        source="choice; thesis section 4.2 gives no number",
        tunable=True,
        doc=(
            "time without current after the voltage was beyond its limit, in whole protection"
            " periods and at least one"
        ),
    )
    protection_period = Parameter(
        0.01,
        "s",
        min=1e-4,
        max=1e3,
        doc="sample period at which protection and compliance look at the voltage",
    )
    potentiostat = Parameter(
        False,
        "1",
        type="boolean",
        doc="whether the voltage is regulated to voltage_command; current_command is unused",
    )
    control_period = Parameter(
        0.01, "s", min=1e-4, max=1e3, doc="sample period of the potentiostat's control law"
    )
    proportional_gain = Parameter(
        0.0, "A/V", min=0, max=1e6, tunable=True, doc="proportional gain of the potentiostat"
    )
    integral_gain = Parameter(
        100.0,
        "A/V/s",
        min=0,
        max=1e9,
        nominal=100.0,
        tunable=True,
        doc="integral gain of the potentiostat",
    )
    voltage_tolerance = Parameter(
        0.0,
        "V",
        min=0,
        max=1e3,
        nominal=1e-3,
        display="mV",
        tunable=True,
        doc="voltage error up to which the potentiostat is content; 0 is exact",
    )

    current_command = Input("A", doc="current wanted from the galvanostat")
    voltage = Input("V", doc="voltage across the actuator")
    voltage_limit = Input(
        "V", start=15.0, min=0, doc="magnitude of the voltage beyond which the protection acts"
    )
    voltage_command = Input("V", doc="voltage wanted from the potentiostat")

    lagged_current = State("A", rate="lagged_current_rate", doc="current behind the response time")
    recovery_samples = Discrete(
        "1",
        update="next_recovery_samples",
        period="protection_period",
        min=0,
        doc="protection periods left without current",
    )
    sampled_voltage = Discrete(
        "V",
        update="next_sampled_voltage",
        period="protection_period",
        doc="voltage at the latest sample",
    )
    compliance_share = Discrete(
        "1",
        update="next_compliance_share",
        period="protection_period",
        start=1.0,
        min=0,
        max=1,
        doc="share of the largest current that the compliance voltage allows",
    )
    control_current = Discrete(
        "A",
        update="next_control_current",
        period="control_period",
        doc="current wanted by the potentiostat",
    )
    control_error = Discrete(
        "V",
        update="next_control_error",
        period="control_period",
        doc="voltage error at the latest control sample",
    )

    # --- limits
    # ----------------------------------------------------------------------------------------------

    def maximum_current(self) -> Any:
        """Current at which the instrument clips (table 2-2)."""
        return self.current_limit

    def upper_current(self) -> Any:
        """Largest current; reduced while the voltage is positive and at the compliance."""
        return self.maximum_current() * where(
            self.sampled_voltage > 0.0, self.compliance_share, 1.0
        )

    def lower_current(self) -> Any:
        """Smallest current; reduced in magnitude while the voltage is negative and at the
        compliance.
        """
        return -(
            self.maximum_current() * where(self.sampled_voltage < 0.0, self.compliance_share, 1.0)
        )

    def next_compliance_share(self) -> Any:
        """Share times V_c / |v|, at most doubled; the current through a resistance R converges to
        V_c / R.
        """
        factor = self.compliance_voltage / maximum(abs(self.voltage), 0.5 * self.compliance_voltage)
        return clip(self.compliance_share * factor, _SMALLEST_SHARE, 1.0)

    def next_sampled_voltage(self) -> Any:
        """Sample of the voltage; its sign is that of the current that the compliance limits."""
        return self.voltage

    # --- protection
    # ----------------------------------------------------------------------------------------------

    def recovery_count(self) -> Any:
        """Recovery time in protection periods, rounded up and at least one."""
        return maximum(-floor(_SAME_COUNT - self.recovery_time / self.protection_period), 1.0)

    def next_recovery_samples(self) -> Any:
        """Protection periods left without current; at the end of a recovery the next one begins
        if the voltage is still beyond its limit (fig. 4-4).
        """
        trip = where(abs(self.voltage) > self.voltage_limit, self.recovery_count(), 0.0)
        return where(self.recovery_samples > 1.5, self.recovery_samples - 1.0, trip)

    def in_recovery(self) -> Any:
        """True while the protection keeps the current at zero."""
        return self.recovery_samples > 0.5

    # --- potentiostat
    # ----------------------------------------------------------------------------------------------

    def voltage_error(self) -> Any:
        """Command less voltage, behind the dead band of the tolerance."""
        error = self.voltage_command - self.voltage
        return outside(error, -self.voltage_tolerance, self.voltage_tolerance)

    def next_control_error(self) -> Any:
        """Sample of the voltage error."""
        return self.voltage_error()

    def next_control_current(self) -> Any:
        """PI law in its velocity form, i + k_i T e + k_p (e - e_before), clipped to the limits and
        frozen in recovery.
        """
        error = self.voltage_error()
        change = self.integral_gain * self.control_period * error + self.proportional_gain * (
            error - self.control_error
        )
        clipped = clip(self.control_current + change, self.lower_current(), self.upper_current())
        regulated = where(self.in_recovery(), self.control_current, clipped)
        return where(self.potentiostat, regulated, 0.0)

    # --- current
    # ----------------------------------------------------------------------------------------------

    def wanted_current(self) -> Any:
        """Command of the galvanostat, or output of the potentiostat's control law."""
        return where(self.potentiostat, self.control_current, self.current_command)

    def tolerated_current(self) -> Any:
        """Wanted current behind the dead band of the tolerance, which is continuous."""
        wanted = self.wanted_current()
        return outside(wanted, -self.control_tolerance, self.control_tolerance)

    def setpoint(self) -> Any:
        """Current that the instrument regulates to: within the limits, zero in recovery."""
        limited = clip(self.tolerated_current(), self.lower_current(), self.upper_current())
        return where(self.in_recovery(), 0.0, limited)

    def lagged_current_rate(self) -> Any:
        """First-order response to the setpoint, (i_set - i) / T; zero for an ideal instrument."""
        response = maximum(self.response_time, _SHORTEST_RESPONSE)
        return where(
            self.response_time < _SHORTEST_RESPONSE,
            0.0,
            (self.setpoint() - self.lagged_current) / response,
        )

    def delivered_current(self) -> Any:
        """Current of the instrument: the lagged one, or the setpoint if the instrument is ideal."""
        return where(self.response_time < _SHORTEST_RESPONSE, self.setpoint(), self.lagged_current)

    def is_saturated(self) -> Any:
        """True if the wanted current is beyond its limits, or at them for the potentiostat, whose
        current is clipped.
        """
        wanted, upper, lower = self.wanted_current(), self.upper_current(), self.lower_current()
        at_limit = logical_or(wanted >= upper, wanted <= lower)
        return where(self.potentiostat, at_limit, logical_or(wanted > upper, wanted < lower))

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    @Output("A")
    def current(self) -> Any:
        """Current into the actuator."""
        return self.delivered_current()

    @Output("1", type="boolean")
    def saturated(self) -> Any:
        """True if the current wanted is beyond what the current limit and the compliance allow."""
        return self.is_saturated()

    @Output("1", type="boolean")
    def recovering(self) -> Any:
        """True if the protection holds the current at zero; a controller freezes its integrator
        meanwhile.
        """
        return self.in_recovery()

    presets = {
        "ha_151": Preset(
            {
                "current_limit": 1.3,
                "compliance_voltage": 15.0,
                "response_time": 50e-6,
                "control_tolerance": 1e-3,
                "voltage_tolerance": 3e-3,
            },
            doc=(
                "Hokuto Denko HA-151 with the response time and the tolerances of thesis table 2-2,"
                " where the printed response, an upper bound, is taken as the time constant; a lag"
                " so short takes many internal steps"
            ),
        ),
    }
