"""Adaptive gain by the MIT rule: the loop adapts to the displacement per current of the actuator.

Thesis section 1.5.2, after Bowers, who tracks sinusoidal displacements by adaptive control. The
displacement follows a first-order model. A fixed law achieves that for the nominal actuator; its
current is multiplied by a gain, which is adapted along the negative gradient of the squared error.
"""

from __future__ import annotations

from typing import Any

from ..kit import Discrete, Input, Parameter, clip, exp, where
from .signals import CurrentController, largest_current, sampled_length

_RULE = "Astrom, Wittenmark: Adaptive Control, 2nd edition, section 5.3"
_CIRCUIT = "the nominal actuator at 50 Hz"


class AdaptiveController(CurrentController):
    """Model reference adaptive control of the displacement: one gain, by the normalised MIT rule
    (thesis section 1.5.2).
    """

    name = "adaptive_controller"
    experiment = (100.0, 0.02)

    model_time = Parameter(
        1.0,
        "s",
        min=1e-3,
        max=1e4,
        tunable=True,
        doc="time constant of the model to be followed (T_m)",
    )
    decay = Parameter(
        0.9973390116840287,
        "1",
        min=0,
        max=1.0,
        source=_CIRCUIT,
        doc="share of a displacement that is left after a sample, nominal (a)",
    )
    displacement_per_current = Parameter(
        1.1481100188089826e-06,
        "m/A",
        min=1e-15,
        max=1e12,
        nominal=1e-6,
        source=_CIRCUIT,
        doc="displacement that a current makes in a sample, nominal (b)",
    )
    adaptation_gain = Parameter(
        0.02,
        "1",
        min=0,
        max=10.0,
        source=_RULE,
        tunable=True,
        doc="adaptation per sample (g); unstable from 1",
    )
    smallest_sensitivity = Parameter(
        1e-6,
        "m",
        min=1e-15,
        max=1e12,
        nominal=1e-6,
        source=_RULE,
        tunable=True,
        doc="sensitivity to the gain from which on it is adapted at full speed (d)",
    )
    gain_min = Parameter(0.2, "1", min=1e-6, max=1.0, tunable=True, doc="smallest gain")
    gain_max = Parameter(5.0, "1", min=1.0, max=1e6, tunable=True, doc="largest gain")
    current_limit = largest_current()

    displacement = Input("m", nominal=1e-4, display="mm", doc="measured displacement, 0 at rest")

    gain = Discrete(
        "1",
        update="next_gain",
        period="sample_period",
        start=1.0,
        min=0,
        output=True,
        doc="gain of the current, 1 for the nominal actuator",
    )
    model_displacement = sampled_length(
        "next_model", "displacement of the model that is followed", output=True
    )
    sensitivity = Discrete(
        "m",
        update="next_sensitivity",
        period="sample_period",
        nominal=1e-5,
        doc="change of the displacement per relative change of the gain",
    )
    command_within_limits = Discrete(
        "A", update="next_command", period="sample_period", doc="current within its limits"
    )

    def model_decay(self) -> Any:
        """Decay of the model's displacement in a sample period h, exp(-h / T_m)."""
        return exp(-self.sample_period / self.model_time)

    def nominal_current(self) -> Any:
        """Current that makes the nominal actuator follow the model."""
        pole = self.model_decay()
        driven = (pole - self.decay) * self.displacement + (1.0 - pole) * self.reference
        return driven / self.displacement_per_current

    def next_model(self) -> Any:
        """Displacement of the model at the next sample."""
        pole = self.model_decay()
        return pole * self.model_displacement + (1.0 - pole) * self.reference

    def next_sensitivity(self) -> Any:
        """Derivative of the displacement by the gain, in a loop that follows the model."""
        driven = self.displacement_per_current * self.nominal_current()
        return self.model_decay() * self.sensitivity + driven

    def next_command(self) -> Any:
        """Nominal current times the gain, within its limits."""
        wanted = self.gain * self.nominal_current()
        return clip(wanted, -self.current_limit, self.current_limit)

    def adaptation(self) -> Any:
        """Change of the gain: the normalised MIT rule, -g e s / (d^2 + s^2)."""
        error = self.displacement - self.model_displacement
        size = self.smallest_sensitivity**2 + self.sensitivity**2
        return -self.adaptation_gain * error * self.sensitivity / size

    def next_gain(self) -> Any:
        """Gain after this sample; unchanged while the current is at its limit."""
        is_free = abs(self.gain * self.nominal_current()) < self.current_limit
        unlimited = self.gain + where(is_free, self.adaptation(), 0.0)
        return clip(unlimited, self.gain_min, self.gain_max)

    def issued_current(self) -> Any:
        """Command of the controller to the actuator."""
        return self.command_within_limits
