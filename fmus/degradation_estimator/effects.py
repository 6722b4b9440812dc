"""Known ways the estimator is wrong: the sampled voltage is not that of the actuator at that
instant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kit import Discrete, Effect, Parameter, Size, Term
from ..kit.effects import effects_by_name

if TYPE_CHECKING:
    from .model import DegradationEstimator

    class EstimatorEffect(Effect, DegradationEstimator):
        """Laws of the estimator that an effect overrides."""
else:
    EstimatorEffect = Effect


class LeadResistance(EstimatorEffect):
    """Voltage of a two-wire measurement, with the drop across leads and contacts: ``v + R_l i``.

    It biases R1, R2 and C, since R_l is in series with the whole circuit. Relaxes assumption
    5, that the voltage is that across the actuator; ``R_l = 0`` is the base model.
    """

    id = "lead_resistance"
    title = "Resistance of the leads in the measured voltage"
    neutral = "resistance_of_leads"
    assumption = 5
    term = Term("measured_voltage", "current", "v + R_l i", "measured_voltage over current")
    sizes = (Size("{}", ("resistance_of_leads",)),)

    resistance_of_leads = Parameter(
        0.0,
        "ohm",
        min=-1e3,
        max=1e3,
        nominal=0.1,
        doc="resistance of leads and contacts in the measured voltage (R_l)",
    )

    def measured_voltage(self) -> Any:
        """Voltage plus the drop across the leads, R_l i."""
        return super().measured_voltage() + self.resistance_of_leads * self.measured_current()


class VoltageGain(EstimatorEffect):
    """Scale of the sampled voltage that is wrong: ``(1 + g) v``.

    The circuit follows from the ratio of voltage to current: a current that is 1 + g times too
    small looks the same. Relaxes assumption 5, that sensors are calibrated; ``g = 0`` is the base
    model.
    """

    id = "voltage_gain"
    title = "A scale error of the sampled voltage"
    neutral = "voltage_gain_error"
    assumption = 5
    term = Term("measured_voltage", "voltage", "g v", "measured_voltage over voltage")
    sizes = (
        Size("reads {} of the voltage", ("voltage_gain_error",), "%", lambda g: 100.0 * (1.0 + g)),
    )

    voltage_gain_error = Parameter(
        0.0,
        "1",
        min=-0.99,
        max=1e2,
        nominal=0.01,
        display="%",
        doc="relative error of the sampled voltage (g)",
    )

    def measured_voltage(self) -> Any:
        """Voltage times 1 + g."""
        return super().measured_voltage() * (1.0 + self.voltage_gain_error)


class SamplingSkew(EstimatorEffect):
    """Voltage that is sampled before the current by a share ``s`` of the period: ``v(t) + s (v(t -
    T_s) - v(t))``.

    The voltage is interpolated linearly between samples, an approximation of multiplexed converters
    and slow readings; at ``s = 1`` it is that of the previous sample. Relaxes assumption 2, that
    both are sampled together; ``s = 0`` is the base model.
    """

    id = "sampling_skew"
    title = "Voltage sampled before the current"
    neutral = "voltage_skew"
    assumption = 2
    term = Term(
        "measured_voltage",
        "voltage",
        "s (v(t - T_s) - v(t))",
        "measured_voltage remembering voltage",
    )
    sizes = (Size("old by {} of the period", ("voltage_skew",), "%", lambda s: 100.0 * s),)

    voltage_skew = Parameter(
        0.0,
        "1",
        min=0,
        max=1.0,
        nominal=0.1,
        display="%",
        doc="share of the period by which the voltage is old (s)",
    )
    punctual_voltage = Discrete(
        "V",
        update="next_punctual_voltage",
        period="sample_period",
        doc="voltage at the instant of the latest sample",
    )

    def next_punctual_voltage(self) -> Any:
        """Voltage at the instant of the sample."""
        return super().measured_voltage()

    def measured_voltage(self) -> Any:
        """Voltage a share s of the period before the sample."""
        now = super().measured_voltage()
        return now + self.voltage_skew * (self.punctual_voltage - now)


EFFECTS: dict[str, type[Effect]] = effects_by_name(LeadResistance, VoltageGain, SamplingSkew)
