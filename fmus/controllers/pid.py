"""The PID controller in its incremental form, with the PI of thesis eq. 2.2 as a preset.

In the incremental form the command itself is the integral. Back-calculation removes the part that
the actuator could not carry out (``tracking.py``), and after a manual command the law continues
from that, without a bump.
"""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Input, Output, Parameter, Preset, clip, where
from .tracking import back_calculated, tracking_share

_FORM = "Astrom, Hagglund: Advanced PID Control, 2006, chapter 3"


class Pid(Component):
    """PID controller of a force by a voltage: filtered derivative, limits, back-calculation,
    bumpless transfer.
    """

    name = "pid"
    experiment = (10.0, 0.01)

    sample_period = Parameter(
        0.01, "s", min=1e-4, max=3600.0, nominal=0.01, doc="sample period of the controller (h)"
    )
    proportional_gain = Parameter(
        0.3, "V/N", min=-1e12, max=1e12, source=_FORM, tunable=True, doc="proportional gain (K)"
    )
    integral_time = Parameter(
        0.5,
        "s",
        min=1e-4,
        max=1e9,
        source=_FORM,
        tunable=True,
        doc="integral time (T_i); 1e9 s is without",
    )
    derivative_time = Parameter(
        0.0,
        "s",
        min=0,
        max=1e4,
        source=_FORM,
        tunable=True,
        doc="derivative time (T_d); 0 is without",
    )
    filter_time = Parameter(
        0.05,
        "s",
        min=0,
        max=1e4,
        source=_FORM,
        tunable=True,
        doc="time constant of the derivative's filter (T_f)",
    )
    tracking_time = Parameter(
        0.5,
        "s",
        min=0,
        max=1e9,
        tunable=True,
        doc="time in which a command that was not carried out is forgotten (T_t)",
    )
    command_min = Parameter(-10.0, "V", min=-1e12, max=1e12, tunable=True, doc="lowest command")
    command_max = Parameter(10.0, "V", min=-1e12, max=1e12, tunable=True, doc="highest command")

    reference = Input("N", doc="wanted value")
    measured = Input("N", doc="measured value")
    manual = Input("1", start=False, type="boolean", doc="whether the command is manual_command")
    manual_command = Input("V", doc="command by hand")
    tracking = Input(
        "1", start=False, type="boolean", doc="whether the law goes on from applied_command"
    )
    applied_command = Input("V", doc="latest command as it was carried out")

    unlimited_command = Discrete(
        "V",
        update="next_command",
        period="sample_period",
        nominal=5.0,
        doc="command before its limits",
    )
    previous_error = Discrete(
        "N", update="error", period="sample_period", doc="error at the latest sample"
    )
    previous_measured = Discrete(
        "N",
        update="next_measured",
        period="sample_period",
        doc="measured value at the latest sample",
    )
    derivative = Discrete(
        "V", update="next_derivative", period="sample_period", doc="derivative part"
    )

    def error(self) -> Any:
        """Reference less measured value, e."""
        return self.reference - self.measured

    def next_measured(self) -> Any:
        """Sample of the measured value."""
        return self.measured

    def error_gain(self) -> Any:
        """Coefficient of the present error, K (1 + h / T_i): the integral by the backward
        difference.
        """
        return self.proportional_gain * (1.0 + self.sample_period / self.integral_time)

    def previous_error_gain(self) -> Any:
        """Coefficient of the previous error, -K."""
        return -self.proportional_gain

    def next_derivative(self) -> Any:
        """Derivative of the measured value behind its filter, -K T_d s / (T_f s + 1) by the
        backward difference.
        """
        change = self.measured - self.previous_measured
        driven = self.proportional_gain * self.derivative_time * change
        return (self.filter_time * self.derivative - driven) / (
            self.filter_time + self.sample_period
        )

    def increment(self) -> Any:
        """Change of the command from sample to sample."""
        errors = self.error_gain() * self.error() + self.previous_error_gain() * self.previous_error
        return errors + (self.next_derivative() - self.derivative)

    def limited(self, command: Any) -> Any:
        """Command within its limits."""
        return clip(command, self.command_min, self.command_max)

    def tracking_command(self) -> Any:
        """Latest command after back-calculation, from which the law continues."""
        applied = where(self.tracking, self.applied_command, self.limited(self.unlimited_command))
        share = tracking_share(self.sample_period, self.tracking_time)
        return back_calculated(self.unlimited_command, applied, share)

    def next_command(self) -> Any:
        """Command until the next sample: the manual one, or that of the law."""
        automatic = self.tracking_command() + self.increment()
        return where(self.manual, self.limited(self.manual_command), automatic)

    def issued_voltage(self) -> Any:
        """Command of the controller to the plant, within its limits."""
        return self.limited(self.unlimited_command)

    @Output("V")
    def command(self) -> Any:
        """Command, within its limits, held between sample instants."""
        return self.issued_voltage()

    @Output("1", type="boolean")
    def saturated(self) -> Any:
        """True if the unlimited command is beyond the limits."""
        return abs(self.unlimited_command - self.limited(self.unlimited_command)) > 0.0

    presets = {
        "thesis_pi": Preset(
            {
                "sample_period": 1.0 / 30.0,
                "proportional_gain": 0.06,
                # 1/300 s less two units in the last place: the coefficient is exactly 0.66
                "integral_time": 0.0033333333333333327,
                "derivative_time": 0.0,
                "tracking_time": 0.0,
                "command_min": 0.0,
                "command_max": 10.0,
            },
            doc=(
                "the force loop of the bench, V(t) = V(t-1) + 0.66 E(t) - 0.06 E(t-1) within 0 to"
                " 10 V (thesis eq. 2.2, section 2.2.3)"
            ),
        ),
    }
