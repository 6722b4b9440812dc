"""Effects of the circuit beyond R1, R2 and C: double layer, diffusion, leakage, capacitance."""

from __future__ import annotations

from math import pi
from typing import Any

from ...kit import Parameter, Size, State, Term, absolute, exp, maximum, sign, sqrt, where
from .base import ActuatorEffect

# RC sections that approximate a diffusion; 4 % of its resistance stays immediate.
_SECTIONS = (1, 2, 3, 4, 5)
# |z| below which (exp(z) - 1)/z is computed from its series; the truncation error is below
# rounding.
_SMALL = 1e-3
_CAPACITANCE = "film_voltage over charge"


class DoubleLayer(ActuatorEffect):
    """Double layer at the interface of electrolyte and polymer: a fast RC branch in series with R1
    and C.

    ``V_C = Q/C + R_dl i_f`` and ``tau_dl di_f/dt = dQ/dt - i_f``, where ``i_f`` is the part of the
    charging current that crosses the interface through ``R_dl`` and the rest charges ``C_dl =
    tau_dl / R_dl``. Relaxes assumption 4, that the double layer charges too fast to be seen
    (section 3.1.1); ``R_dl = 0`` is the base model.
    """

    id = "double_layer"
    title = "A double layer, a second RC pair"
    neutral = "double_layer_resistance"
    term = Term(
        "capacitor_voltage",
        "current",
        "R_dl / (tau_dl s + 1)",
        "capacitor_voltage remembering current",
    )
    assumption = 4
    sizes = (
        Size("{}", ("double_layer_resistance",)),
        Size("a time constant of {}", ("double_layer_time",)),
    )

    double_layer_resistance = Parameter(
        0.0,
        "ohm",
        min=0,
        max=1e6,
        doc="charge-transfer resistance across the double layer; 0 is without",
    )
    double_layer_time = Parameter(
        0.2,
        "s",
        min=1e-3,
        max=1e6,
        doc="time constant of the double layer, its resistance times its capacitance",
    )
    faradaic_current = State(
        "A", rate="faradaic_current_rate", doc="current that crosses the double layer"
    )

    def faradaic_current_rate(self) -> Any:
        """Rate of the current across the double layer, (dQ/dt - i_f) / tau_dl."""
        return (self.capacitor_current() - self.faradaic_current) / self.double_layer_time

    def capacitor_voltage(self) -> Any:
        """Voltage behind R1: the film capacitance and the double layer in series."""
        return super().capacitor_voltage() + self.double_layer_resistance * self.faradaic_current


def _diffusion_current(section: int) -> Any:
    """Declare the state of one section, the current through it."""
    about = f"current through section {section} of the diffusion"
    return State("A", rate=f"diffusion_rate_{section}", doc=about)


def _diffusion_rate(section: int) -> Any:
    """Return the law of one section, a lag with a time constant of T / ((k - 1/2)^2 pi^2)."""

    def rate(self: Any) -> Any:
        lag = self.diffusion_time / ((section - 0.5) * pi) ** 2
        return (self.capacitor_current() - getattr(self, f"diffusion_current_{section}")) / lag

    return rate


class Diffusion(ActuatorEffect):
    """Finite-length diffusion: a share ``d`` of the series resistance builds up as ions diffuse to
    the films.

    The thesis counts ion diffusion in R1 (section 3.1.1). Here ``d R1`` becomes the impedance of a
    layer of diffusion time ``T`` (thickness squared over diffusivity), ``d R1 tanh(sqrt(s T)) /
    sqrt(s T)``; resistance at rest, total capacitance and DC gain are those of the base model. Five
    RC sections in series approximate it, the first partial fractions of tanh: ``tanh(z)/z = sum_k
    2 / (z^2 + (k - 1/2)^2 pi^2)``; the 4 % of ``d R1`` of the faster sections have no memory.
    Relaxes assumption 8, that the circuit is one R1 and one C; ``d = 0`` is the base model.
    """

    id = "diffusion"
    title = "Diffusion into the films"
    neutral = "diffusion_share"
    term = Term(
        "capacitor_voltage",
        "current",
        "d R1 tanh(sqrt(s T)) / sqrt(s T)",
        "capacitor_voltage diffusion of current",
    )
    assumption = 8
    sizes = (
        Size("{} of the series resistance", ("diffusion_share",), "%", lambda share: 100.0 * share),
        Size("a diffusion time of {}", ("diffusion_time",)),
    )

    diffusion_share = Parameter(
        0.0,
        "1",
        min=0,
        max=1,
        nominal=0.1,
        doc="share of the series resistance that is due to diffusion (d)",
    )
    diffusion_time = Parameter(
        10.0,
        "s",
        min=0.1,
        max=1e6,
        nominal=10.0,
        doc="square of the diffusion length over the diffusivity (T)",
        source="estimate, 10 um at 1e-11 m^2/s",
    )
    (
        diffusion_current_1,
        diffusion_current_2,
        diffusion_current_3,
        diffusion_current_4,
        diffusion_current_5,
    ) = map(_diffusion_current, _SECTIONS)
    diffusion_rate_1, diffusion_rate_2, diffusion_rate_3, diffusion_rate_4, diffusion_rate_5 = map(
        _diffusion_rate, _SECTIONS
    )

    def immediate_resistance(self) -> Any:
        """Series resistance less that of the sections."""
        resolved = sum(2.0 / ((k - 0.5) * pi) ** 2 for k in _SECTIONS)
        return super().immediate_resistance() * (1.0 - self.diffusion_share * resolved)

    def capacitor_voltage(self) -> Any:
        """Voltage of the films and across the sections, d R1 times 2 / ((k - 1/2)^2 pi^2) times the
        current of each.
        """
        weighted = sum(
            2.0 / ((k - 0.5) * pi) ** 2 * getattr(self, f"diffusion_current_{k}") for k in _SECTIONS
        )
        return super().capacitor_voltage() + self.diffusion_share * (
            self.series_resistance() * weighted
        )


class NonlinearLeakage(ActuatorEffect):
    """Leakage that grows above an onset voltage: a second path past the films that draws ``g (|V| -
    V_on)^2``.

    The terminal voltage then obeys a quadratic equation, solved here in closed form, and the
    current of the circuit of fig. 3-1 is ``i - sign(V) g (|V| - V_on)^2``. Relaxes assumption
    8, that leakage is the resistance R2; ``g = 0`` is the base model. Only a record whose
    voltage passes the onset shows it.
    """

    id = "nonlinear_leakage"
    title = "Leakage that grows above an onset voltage"
    neutral = "leakage_growth"
    term = Term(
        "supply_current", "voltage", "g max(|V| - V_on, 0)^2", "supply_current over voltage"
    )
    assumption = 8
    sizes = (
        Size("{} at 0.1 V above the onset", ("leakage_growth",), "A", lambda growth: 0.01 * growth),
        Size("sets in at {}", ("leakage_onset",)),
    )

    leakage_growth = Parameter(
        0.0,
        "A/V^2",
        min=0,
        max=1e6,
        nominal=0.1,
        doc="additional leakage per square of the voltage above the onset (g)",
    )
    leakage_onset = Parameter(
        0.6,
        "V",
        min=0,
        max=1e3,
        doc="voltage above which leakage grows (V_on)",
        source="estimate; overoxidation of polypyrrole sets in about there",
    )

    def supply_current(self) -> Any:
        """Current that reaches the circuit, less the additional leakage."""
        current, resistance = super().supply_current(), self.immediate_resistance()
        share = self.R2 / (resistance + self.R2)
        # terminal voltage at g = 0
        voltage = share * (resistance * current + self.capacitor_voltage())
        unloaded = maximum(abs(voltage) - self.leakage_onset, 0.0)
        slope = self.leakage_growth * (share * resistance)
        # |V| - V_on, positive root of slope x^2 + x = unloaded: leakage itself lowers the voltage
        excess = 2.0 * unloaded / (1.0 + sqrt(1.0 + 4.0 * slope * unloaded))
        return current - sign(voltage) * (self.leakage_growth * (excess * excess))


class ChargeDependentCapacitance(ActuatorEffect):
    """Capacitance that changes with the charge: ``dQ/dV = C exp(-a Q)``.

    The voltage of the films is multiplied by ``(exp(z) - 1) / z``, ``z = a Q``; it rises with the
    charge for either sign of ``a``. Relaxes assumption 8, that C is constant; ``a = 0`` is the
    base model.
    """

    id = "charge_dependent_capacitance"
    title = "Capacitance that changes with charge"
    neutral = "capacitance_falloff"
    term = Term("film_voltage", "charge", "(exp(a Q) - 1) / (a Q)", _CAPACITANCE)
    assumption = 8
    sizes = (
        Size(
            "changes by {} at 1 C", ("capacitance_falloff",), "%", lambda a: 100.0 * (exp(-a) - 1.0)
        ),
    )

    capacitance_falloff = Parameter(
        0.0,
        "1/C",
        min=-10.0,
        max=10.0,
        nominal=0.1,
        doc="relative fall of the differential capacitance per charge (a)",
    )

    def film_voltage(self) -> Any:
        """Voltage of the films, (exp(a Q) - 1) / (a C) over the base model."""
        return super().film_voltage() * _mean_of_exp(self.capacitance_falloff * self.charge)


class CapacitanceOverModulus(ActuatorEffect):
    """Capacitance that changes with the modulus of the charge: ``dQ/dV = C exp(-a |Q|)``; it rises
    where ``a < 0``.

    The even counterpart of `ChargeDependentCapacitance`, with a corner at zero. Relaxes assumption
    8, that C is constant; ``a = 0`` is the base model.
    """

    id = "charge_dependent_capacitance"
    title = "Capacitance that changes with the modulus of charge"
    neutral = "capacitance_falloff_either_way"
    assumption = 8
    term = Term("film_voltage", "charge", "(exp(a |Q|) - 1) / (a |Q|)", _CAPACITANCE, "modulus")
    sizes = (
        Size(
            "changes by {} at 1 C of either sign",
            ("capacitance_falloff_either_way",),
            "%",
            lambda a: 100.0 * (exp(-a) - 1.0),
        ),
    )

    capacitance_falloff_either_way = Parameter(
        0.0,
        "1/C",
        min=-10.0,
        max=10.0,
        nominal=0.1,
        doc="relative fall of the differential capacitance per modulus of the charge (a)",
    )

    def film_voltage(self) -> Any:
        """Voltage of the films, sign(Q) (exp(a |Q|) - 1) / (a C) over the base model."""
        return super().film_voltage() * _mean_of_exp(
            self.capacitance_falloff_either_way * absolute(self.charge)
        )


class EvenCapacitance(ActuatorEffect):
    """Capacitance that changes with the square of the charge: ``V_C = Q/C sqrt(1 + b Q^2)``, smooth
    and even.

    Where ``b`` is negative, ``V_C = Q/C / sqrt(1 - b Q^2)``: the capacitance rises, and the voltage
    still rises with the charge. Near zero, ``dQ/dV = C (1 - 3/2 b Q^2)`` for either sign of ``b``.
    Relaxes assumption 8, that C is constant; ``b = 0`` is the base model.
    """

    id = "charge_dependent_capacitance"
    title = "Capacitance that bends with charge"
    neutral = "capacitance_bend"
    assumption = 8
    term = Term("film_voltage", "charge", "sqrt(1 + b Q^2)", _CAPACITANCE, "even")
    sizes = (
        Size(
            "charge per voltage changes by {} at 1 C",
            ("capacitance_bend",),
            "%",
            lambda b: 100.0 * (where(b < 0.0, sqrt(1.0 + abs(b)), 1.0 / sqrt(1.0 + abs(b))) - 1.0),
        ),
    )

    capacitance_bend = Parameter(
        0.0,
        "1/C^2",
        min=-1e6,
        max=1e6,
        nominal=0.05,
        doc="relative fall of the capacitance per square of charge (b)",
    )

    def film_voltage(self) -> Any:
        """Voltage of the films, times sqrt(1 + b Q^2), or divided by sqrt(1 - b Q^2)."""
        bend = self.capacitance_bend * (self.charge * self.charge)
        rises = bend < 0.0
        # not abs(bend), which has no derivative at zero
        root = sqrt(1.0 + where(rises, -bend, bend))
        return super().film_voltage() * where(rises, 1.0 / root, root)


def _mean_of_exp(z: Any) -> Any:
    """Return the mean of the exponential between zero and z, (exp(z) - 1) / z; 1 at zero."""
    small = abs(z) < _SMALL
    series = 1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0)))
    return where(small, series, (exp(z) - 1.0) / where(small, 1.0, z))
