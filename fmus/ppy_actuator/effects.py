"""Known ways the actuator model is wrong, each relaxing one assumption of thesis section 3.1.

Every effect is a mixin that overrides one law (never an output) through ``super()``, so that it serves the
force-driven and the length-driven actuator, and stacks with the others. At its neutral parameter value the laws give
the bits of the base model whatever the effect's own state holds: what it adds is multiplied by zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kit import Effect, Parameter, State, sqrt, tanh, where

if TYPE_CHECKING:
    from .model import Actuator

    class ActuatorEffect(Effect, Actuator):
        """What an effect can count on: the laws of the actuator that it is laid over."""
else:
    ActuatorEffect = Effect

# Time constant below which a lag is not resolved, in seconds. A lag of zero time would be infinitely stiff.
_SHORTEST_LAG = 0.05
# z^2 below which tanh(z)/z is taken from its series; what is left out is below rounding, and in the slope below 1e-12.
_SMALL = 1e-6


class DoubleLayer(ActuatorEffect):
    """Double layer at the interface of electrolyte and polymer: a fast RC branch in series with R1 and C.

    ``V_C = Q/C + R_dl i_f`` and ``tau_dl di_f/dt = dQ/dt - i_f``, where ``i_f`` is the part of the charging current
    that crosses the interface through ``R_dl`` and the rest charges ``C_dl = tau_dl / R_dl``. Relaxes assumption 4,
    that the double layer charges too fast to be seen (section 3.1.1); ``R_dl = 0`` is the base model.
    """

    id = "double_layer"
    neutral = "double_layer_resistance"
    assumption = 4

    double_layer_resistance = Parameter(
        0.0, "ohm", min=0, max=1e6, doc="charge-transfer resistance across the double layer; 0 is without"
    )
    double_layer_time = Parameter(
        0.2, "s", min=1e-3, max=1e6, doc="time constant of the double layer, its resistance times its capacitance"
    )
    faradaic_current = State("A", rate="faradaic_current_rate", doc="current that crosses the double layer")

    def faradaic_current_rate(self) -> Any:
        """Rate of the current across the double layer, (dQ/dt - i_f) / tau_dl."""
        return (self.capacitor_current() - self.faradaic_current) / self.double_layer_time

    def capacitor_voltage(self) -> Any:
        """Voltage behind R1: the film capacitance and the double layer in series."""
        return super().capacitor_voltage() + self.double_layer_resistance * self.faradaic_current


class ResistanceGrowth(ActuatorEffect):
    """Ageing: the series resistance grows with the charge moved into and out of the films.

    ``R = R1 (1 + gamma q)`` with ``dq/dt = |dQ/dt|``. Relaxes assumption 6, that the parameters do not change with
    use; ``gamma = 0`` is the base model.
    """

    id = "resistance_growth"
    neutral = "resistance_growth_rate"
    assumption = 6

    resistance_growth_rate = Parameter(
        0.0,
        "1/C",
        min=0,
        max=1e3,
        nominal=1e-3,
        doc="relative growth of the series resistance per charge moved (gamma)",
    )
    throughput = State("C", rate="throughput_rate", min=0, doc="charge moved into and out of the films so far")

    def throughput_rate(self) -> Any:
        """Rate of the charge throughput, |dQ/dt|."""
        return abs(self.capacitor_current())

    def series_resistance(self) -> Any:
        """Grown series resistance, R1 (1 + gamma q) over the base model."""
        return super().series_resistance() * (1.0 + self.resistance_growth_rate * self.throughput)


class QuadraticStrain(ActuatorEffect):
    """Elongation with a quadratic part: ``x_e = alpha Q + beta Q^2``.

    Relaxes assumption 5, that elongation is proportional to charge (eq. 3.4); ``beta = 0`` is the base model.
    """

    id = "quadratic_strain"
    neutral = "beta"
    assumption = 5

    beta = Parameter(
        0.0, "m/C^2", min=-1.0, max=1.0, nominal=1e-5, display="mm/C^2", doc="quadratic displacement coefficient"
    )

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, alpha Q + beta Q^2 over the base model."""
        return super().charge_elongation(charge) + self.beta * (charge * charge)


class StrainSaturation(ActuatorEffect):
    """Elongation that levels off: ``x_e = alpha Q_sat tanh(Q / Q_sat)``, written with ``c = 1 / Q_sat^2``.

    The elongation of the layers below is multiplied by ``tanh(z) / z``, ``z = sqrt(c) Q``, which is 1 at ``c = 0``,
    the base model. With ``1 / Q_sat`` itself for the parameter, its sensitivity there would be zero. Relaxes
    assumption 5, the proportionality of eq. 3.4, at large charge (fig. 3-11).
    """

    id = "strain_saturation"
    neutral = "strain_saturation_coefficient"
    assumption = 5

    strain_saturation_coefficient = Parameter(
        0.0, "1/C^2", min=0, max=1e6, nominal=0.01,
        doc="inverse square of the charge at which elongation levels off (c)",
    )  # fmt: skip

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, levelling off; alpha Q_sat tanh(Q / Q_sat) over the base model."""
        square = self.strain_saturation_coefficient * (charge * charge)
        small = square < _SMALL
        z = sqrt(where(small, 1.0, square))  # at zero the root has no slope
        series = 1.0 - square * (1.0 / 3.0 - square * (2.0 / 15.0))
        return super().charge_elongation(charge) * where(small, series, tanh(z) / z)


class StrainLag(ActuatorEffect):
    """Elongation that follows the charge with a time constant ``T``.

    The charge ``q`` that has not yet acted obeys ``dq/dt = dQ/dt - q / (T + m)``; the elongation of the layers below
    is that of the charge that has, ``Q - T / (T + m) q``. Over the base model this is
    ``X_e / Q = alpha (m s + 1) / ((T + m) s + 1)``: a first-order lag of time T but for the fixed, short time
    m = 0.05 s, which keeps the equations regular at ``T = 0``, the base model. Starting at zero, ``q`` means a start
    at rest. Relaxes assumption 5, that elongation is proportional to charge at every instant (eq. 3.4, fig. 3-10).
    """

    id = "strain_lag"
    neutral = "lag_time"
    assumption = 5

    lag_time = Parameter(0.0, "s", min=0, max=1e6, doc="time constant with which elongation follows charge")
    pending_charge = State("C", rate="pending_charge_rate", doc="charge that has not yet elongated the films")

    def pending_charge_rate(self) -> Any:
        """Rate of the charge not yet acting, dQ/dt - q / (T + m)."""
        return self.capacitor_current() - self.pending_charge / (self.lag_time + _SHORTEST_LAG)

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to the charge that has acted, alpha (Q - T / (T + m) q) over the base model."""
        share = self.lag_time / (self.lag_time + _SHORTEST_LAG)
        return super().charge_elongation(charge - share * self.pending_charge)


EFFECTS: dict[str, type[Effect]] = {
    effect.id: effect for effect in (DoubleLayer, ResistanceGrowth, QuadraticStrain, StrainSaturation, StrainLag)
}
