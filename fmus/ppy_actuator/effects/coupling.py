"""Effects of the coupling between charge and mechanics, in both directions."""

from __future__ import annotations

from typing import Any

from ...kit import Parameter, Preset, Size, State, Term, absolute, exp, where
from ...kit.curves import tanhc
from .base import ActuatorEffect

# Time constant in seconds below which a lag is not resolved; at zero it would be infinitely stiff.
_SHORTEST_LAG = 0.05


def _regular(time: Any) -> Any:
    """Return the regularised time constant of a lag, T + m exp(-T / m).

    It is m at T = 0 and approaches T where T is several times m, as in
    `fmus.kit.sensors.sensor_lag`.
    """
    return time + _SHORTEST_LAG * exp(-time / _SHORTEST_LAG)


# Charge of both signs separates the even from the odd part, so these are two causes.
_EVEN, _ODD = (f"{part} part of charge_elongation over charge" for part in ("even", "odd"))
_BEHIND = "charge_elongation remembering charge"
_SOFTNESS = "spring_elongation over charge"


class ForceToVoltage(ActuatorEffect):
    """Load that changes the voltage of the films: ``V_C = Q/C + s F``.

    Relaxes assumption 5, that the coupling is unidirectional (section 3.1.3, fig. 3-3); ``s = 0``
    is the base model. The reciprocal coupling adds ``-alpha F``, the reaction to the elongation
    ``alpha Q``.
    """

    id = "force_to_voltage"
    title = "Load that changes the voltage"
    neutral = "voltage_per_force"
    term = Term("capacitor_voltage", "force", "s F", "capacitor_voltage over force")
    assumption = 5
    sizes = (Size("{}", ("voltage_per_force",)),)

    voltage_per_force = Parameter(
        0.0,
        "V/N",
        min=-10.0,
        max=10.0,
        nominal=0.01,
        display="mV/N",
        doc="voltage of the films per tensile load (s)",
    )
    # boolean, so that no fit takes it beside s, which acts alike
    reciprocal = Parameter(
        False,
        "1",
        type="boolean",
        doc="whether the load also acts by -alpha, so that the current pays for the elongation",
    )

    def load_voltage(self) -> Any:
        """Voltage of the films that the load makes: s F, less alpha F if reciprocal."""
        reaction = where(self.reciprocal, self.alpha, 0.0)
        return (self.voltage_per_force - reaction) * self.load()

    def capacitor_voltage(self) -> Any:
        """Voltage behind R1, more by that of the load."""
        return super().capacitor_voltage() + self.load_voltage()

    presets = {
        "reciprocal": Preset(
            {"reciprocal": 1.0},
            doc=(
                "reciprocal coupling, whatever alpha is: the current pays for the work that the"
                " charge does on the load, so that energy is conserved"
            ),
        ),
    }


class QuadraticStrain(ActuatorEffect):
    """Elongation with a quadratic part: ``x_e = alpha Q + beta Q^2``.

    Relaxes assumption 5, that elongation is proportional to charge (eq. 3.4); ``beta = 0`` is the
    base model.
    """

    id = "quadratic_strain"
    title = "Strain with a quadratic part"
    neutral = "beta"
    term = Term("charge_elongation", "charge", "beta Q^2", _EVEN)
    assumption = 5
    sizes = (Size("{} more at 1 C", ("beta",), "m"),)

    beta = Parameter(
        0.0,
        "m/C^2",
        min=-1.0,
        max=1.0,
        nominal=1e-5,
        display="mm/C^2",
        title="quadratic displacement coefficient",
        doc="quadratic displacement coefficient",
    )

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, alpha Q + beta Q^2 over the base model."""
        return super().charge_elongation(charge) + self.beta * (charge * charge)


class UnequalStrain(ActuatorEffect):
    """Elongation that differs between oxidation and reduction: ``x_e = alpha Q + beta_1 |Q|``.

    It has a corner at zero, while `QuadraticStrain` is curved everywhere. Relaxes assumption 5,
    that elongation is proportional to charge (eq. 3.4); ``beta_1 = 0`` is the base model.
    """

    id = "quadratic_strain"
    title = "Strain that differs for the two signs of charge"
    neutral = "strain_asymmetry"
    assumption = 5
    term = Term("charge_elongation", "charge", "beta_1 |Q|", _EVEN, "modulus")
    sizes = (Size("{} more whatever the sign of the charge", ("strain_asymmetry",)),)

    strain_asymmetry = Parameter(
        0.0,
        "m/C",
        min=-1.0,
        max=1.0,
        nominal=1e-5,
        display="mm/C",
        doc="displacement per modulus of the charge",
    )

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, alpha Q + beta_1 |Q| over the base model."""
        return super().charge_elongation(charge) + self.strain_asymmetry * absolute(charge)


class StrainSaturation(ActuatorEffect):
    """Elongation that levels off: ``x_e = alpha Q_sat tanh(Q / Q_sat)``, written with ``c = 1 /
    Q_sat^2``.

    The elongation of the base model is multiplied by ``tanh(z) / z``, ``z = sqrt(c) Q``, which is 1
    at ``c = 0``. With ``1 / Q_sat`` as the parameter, the sensitivity would be zero there. Relaxes
    assumption 5, the proportionality of eq. 3.4, at large charge (fig. 3-11).
    """

    id = "strain_saturation"
    title = "Strain that levels off at large charge"
    neutral = "strain_saturation_coefficient"
    term = Term("charge_elongation", "charge", "alpha Q_sat tanh(Q / Q_sat)", _ODD)
    assumption = 5
    sizes = (Size("beyond {}", ("strain_saturation_coefficient",), "C", lambda c: c**-0.5),)

    strain_saturation_coefficient = Parameter(
        0.0,
        "1/C^2",
        min=0,
        max=1e6,
        nominal=0.01,
        doc="inverse square of the charge at which elongation levels off (c)",
    )

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, levelling off; alpha Q_sat tanh(Q / Q_sat) over the
        base model.
        """
        square = self.strain_saturation_coefficient * (charge * charge)
        return super().charge_elongation(charge) * tanhc(square)


class SlowStrainSaturation(ActuatorEffect):
    """Elongation that levels off from the first charge on: ``x_e = alpha Q / (1 + c_1 |Q|)``.

    Its curvature is largest at zero, where `StrainSaturation` is nearly straight; its limit is
    ``alpha / c_1``. Relaxes assumption 5, the proportionality of eq. 3.4; ``c_1 = 0`` is the
    base model.
    """

    id = "strain_saturation"
    title = "Strain that levels off slowly at large charge"
    neutral = "strain_levelling"
    assumption = 5
    term = Term("charge_elongation", "charge", "alpha Q / (1 + c_1 |Q|)", _ODD, "slow")
    sizes = (Size("half of it lost at {}", ("strain_levelling",), "C", lambda c: 1.0 / c),)

    strain_levelling = Parameter(
        0.0,
        "1/C",
        min=0,
        max=1e3,
        nominal=0.05,
        doc="inverse of the charge at which elongation is half of alpha Q",
    )

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, levelling off; alpha Q / (1 + c_1 |Q|) over the base model."""
        return super().charge_elongation(charge) / (1.0 + self.strain_levelling * absolute(charge))


class StrainLag(ActuatorEffect):
    """Elongation that follows the charge with a time constant ``T``.

    The charge ``q`` that has not yet acted obeys ``dq/dt = dQ/dt - q / D``; the elongation is that
    of the base model at the charge that has acted, ``Q - T / D q``. ``D = T + m exp(-T / m)`` with
    m = 0.05 s keeps the equations regular at ``T = 0``, the base model. The transfer function is
    ``X_e / Q = alpha ((D - T) s + 1) / (D s + 1)``, a first-order lag of time T where T is several
    times m. ``q`` starts at zero, which is a start at rest. Relaxes assumption 5, that elongation
    is proportional to charge at every instant (eq. 3.4, fig. 3-10).
    """

    id = "strain_lag"
    title = "Strain that lags behind charge"
    neutral = "lag_time"
    term = Term("charge_elongation", "charge", "1 / (T s + 1)", _BEHIND)
    assumption = 5
    sizes = (Size("a time constant of {}", ("lag_time",)),)

    lag_time = Parameter(
        0.0,
        "s",
        min=0,
        max=1e6,
        tunable=False,  # the charge that is pending hangs on it
        doc="time constant with which elongation follows charge",
    )
    pending_charge = State(
        "C", rate="pending_charge_rate", doc="charge that has not yet elongated the films"
    )

    def pending_charge_rate(self) -> Any:
        """Rate of the charge not yet acting, dQ/dt - q / D."""
        return self.capacitor_current() - self.pending_charge / _regular(self.lag_time)

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to the charge that has acted, alpha (Q - T / D q) over the base model."""
        share = self.lag_time / _regular(self.lag_time)
        return super().charge_elongation(charge - share * self.pending_charge)


class TwoStageStrainLag(ActuatorEffect):
    """Elongation that follows the charge in two equal stages of ``T / 2`` each.

    The charge behind the first stage ``q_1`` and behind the second ``q_2`` obey ``dq_1/dt = dQ/dt -
    q_1 / D`` and ``dq_2/dt = q_1 / D - q_2 / D`` with ``D = T/2 + m exp(-T / (2 m))``; the
    elongation is that of the base model at ``Q - (T/2) / D (q_1 + q_2)``. Both stages start at
    rest. ``m`` is that of `StrainLag`; a ramp lags by ``T`` in both, but here the lag sets in
    without a corner. Relaxes assumption 5, that elongation is proportional to charge at every
    instant (eq. 3.4, fig. 3-10); ``T = 0`` is the base model.
    """

    id = "strain_lag"
    title = "Strain that lags behind charge in two stages"
    neutral = "staged_lag_time"
    assumption = 5
    term = Term("charge_elongation", "charge", "1 / (T/2 s + 1)^2", _BEHIND, "two_stages")
    sizes = (
        Size("two time constants of {} each", ("staged_lag_time",), "s", lambda time: 0.5 * time),
    )

    staged_lag_time = Parameter(
        0.0,
        "s",
        min=0,
        max=1e6,
        tunable=False,  # as `StrainLag.lag_time`
        doc="time of two stages with which elongation follows charge",
    )
    first_stage_charge = State(
        "C", rate="first_stage_rate", doc="charge that has not passed the first stage"
    )
    second_stage_charge = State("C", rate="second_stage_rate", doc="charge between the stages")

    def stage_time(self) -> Any:
        """Regularised time constant of one stage, D."""
        return _regular(0.5 * self.staged_lag_time)

    def first_stage_rate(self) -> Any:
        """Rate of the charge before the first stage, dQ/dt - q_1 / D."""
        return self.capacitor_current() - self.first_stage_charge / self.stage_time()

    def second_stage_rate(self) -> Any:
        """Rate of the charge between the stages, (q_1 - q_2) / D."""
        return (self.first_stage_charge - self.second_stage_charge) / self.stage_time()

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to the charge that has passed both stages."""
        share = 0.5 * self.staged_lag_time / self.stage_time()
        return super().charge_elongation(
            charge - share * (self.first_stage_charge + self.second_stage_charge)
        )


class StrainHysteresis(ActuatorEffect):
    """Rate-independent hysteresis of the elongation over the charge, after Duhem and Dahl.

    A trailing charge ``z`` obeys ``dz/dt = dQ/dt - |dQ/dt| z / w`` and stays within ``-w`` and
    ``w`` at any speed; the elongation is that of the base model at ``Q - h z``. A large loop is
    ``2 h w`` wide; after a reversal the elongation starts with the share ``1 - 2 h`` of its slope.
    ``z`` starts at zero, the middle of the loop. Relaxes assumption 5,
    that elongation is one function of charge (the loops of figs. 3-11 and 3-12); ``h = 0`` is the
    base model.
    """

    id = "strain_hysteresis"
    title = "Hysteresis of strain over charge"
    neutral = "hysteresis_share"
    term = Term(
        "charge_elongation",
        "charge",
        "h z with dz/dt = dQ/dt - |dQ/dt| z / w",
        "charge_elongation loop of charge",
    )
    assumption = 5
    sizes = (
        Size(
            "a loop {} wide",
            ("hysteresis_share", "hysteresis_width"),
            "C",
            lambda share, width: 2.0 * share * width,
        ),
        Size(
            "{} of the slope lost after a reversal",
            ("hysteresis_share",),
            "%",
            lambda share: 200.0 * share,
        ),
    )

    hysteresis_share = Parameter(
        0.0,
        "1",
        min=0,
        max=0.5,
        nominal=0.1,
        doc="share of the trailing charge that has no elongation (h)",
    )
    hysteresis_width = Parameter(
        0.5,
        "C",
        min=1e-6,
        max=1e6,
        doc="charge that trails behind, at most (w)",
        source="estimate, about half of the charge moved in fig. 3-11",
    )
    trailing_charge = State(
        "C", rate="trailing_charge_rate", doc="charge trailing behind in the hysteresis"
    )

    def trailing_charge_rate(self) -> Any:
        """Rate of the trailing charge, dQ/dt - |dQ/dt| z / w."""
        current = self.capacitor_current()
        return current - abs(current) * self.trailing_charge / self.hysteresis_width

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, alpha (Q - h z) over the base model."""
        return super().charge_elongation(charge - self.hysteresis_share * self.trailing_charge)


class ChargeDependentStiffness(ActuatorEffect):
    """Springs that soften as the films are charged: both compliances, ``1/k1`` and ``1/k2``, times
    ``exp(s Q)``.

    Relaxes assumption 1, that charge and creep do not influence each other; ``s = 0`` is the base
    model.
    """

    id = "charge_dependent_stiffness"
    title = "Stiffness that changes with charge"
    neutral = "softening_per_charge"
    term = Term("spring_elongation", "charge", "exp(s Q)", _SOFTNESS)
    assumption = 1
    sizes = (
        Size(
            "the compliance changes by {} at 1 C",
            ("softening_per_charge",),
            "%",
            lambda s: 100.0 * (exp(s) - 1.0),
        ),
    )

    softening_per_charge = Parameter(
        0.0,
        "1/C",
        min=-10.0,
        max=10.0,
        nominal=0.05,
        doc="relative rise of the compliance per charge (s)",
    )

    def softening(self) -> Any:
        """Compliance relative to that of the uncharged films, exp(s Q)."""
        return exp(self.softening_per_charge * self.charge)

    def spring_elongation(self, load: Any) -> Any:
        """Instantaneous elongation of the softened spring."""
        return super().spring_elongation(load) * self.softening()

    def spring_force(self, elongation: Any) -> Any:
        """Force of the softened spring, the inverse of :meth:`spring_elongation`."""
        return super().spring_force(elongation / self.softening())

    def kelvin_force(self) -> Any:
        """Force of the softened Kelvin spring."""
        return super().kelvin_force() / self.softening()
