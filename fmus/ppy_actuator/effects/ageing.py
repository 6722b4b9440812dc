"""Effects that change the circuit slowly: with the charge that has passed, and with temperature."""

from __future__ import annotations

from typing import Any

from ...kit import Parameter, Size, State, Term
from .base import ActuatorEffect


class ResistanceGrowth(ActuatorEffect):
    """Ageing: the series resistance grows with the charge moved into and out of the films.

    ``R = R1 (1 + gamma q)`` with ``dq/dt = |dQ/dt|``. Relaxes assumption 6, that the parameters do
    not change with use; ``gamma = 0`` is the base model.
    """

    id = "resistance_growth"
    title = "Series resistance that grows with use"
    neutral = "resistance_growth_rate"
    term = Term(
        "series_resistance", "throughput", "R1 gamma q", "series_resistance over throughput"
    )
    assumption = 6
    sizes = (
        Size(
            "twice as large after {} moved",
            ("resistance_growth_rate",),
            "C",
            lambda gamma: 1.0 / gamma,
        ),
    )

    resistance_growth_rate = Parameter(
        0.0,
        "1/C",
        min=0,
        max=1e3,
        nominal=1e-3,
        tunable=False,  # a new rate would act on the charge moved before
        doc="relative growth of the series resistance per charge moved (gamma)",
    )
    throughput = State(
        "C", rate="throughput_rate", min=0, doc="charge moved into and out of the films so far"
    )

    def throughput_rate(self) -> Any:
        """Rate of the charge throughput, |dQ/dt|."""
        return abs(self.capacitor_current())

    def series_resistance(self) -> Any:
        """Grown series resistance, R1 (1 + gamma q) over the base model."""
        return super().series_resistance() * (1.0 + self.resistance_growth_rate * self.throughput)


class CapacitanceFade(ActuatorEffect):
    """Ageing: the capacitance falls with the charge moved into and out of the films.

    ``C / (1 + phi q)`` with ``dq/dt = |dQ/dt|``; the films keep their charge, so their voltage
    rises. Relaxes assumption 6, that the parameters do not change with use; ``phi = 0`` is the base
    model.
    """

    id = "capacitance_fade"
    title = "Capacitance that fades with use"
    neutral = "capacitance_fade_rate"
    term = Term(
        "capacitance", "fading_throughput", "C / (1 + phi q)", "capacitance over throughput"
    )
    assumption = 6
    sizes = (
        Size(
            "half as large after {} moved", ("capacitance_fade_rate",), "C", lambda phi: 1.0 / phi
        ),
    )

    capacitance_fade_rate = Parameter(
        0.0,
        "1/C",
        min=0,
        max=1e3,
        nominal=1e-3,
        tunable=False,  # as the rate of `ResistanceGrowth`
        doc="relative fall of the capacitance per charge moved (phi)",
    )
    fading_throughput = State(
        "C",
        rate="fading_throughput_rate",
        min=0,
        doc="charge moved into and out of the fading films so far",
    )

    def fading_throughput_rate(self) -> Any:
        """Rate of the charge throughput, |dQ/dt|."""
        return abs(self.capacitor_current())

    def capacitance(self) -> Any:
        """Faded capacitance, C / (1 + phi q) over the base model."""
        return super().capacitance() / (1.0 + self.capacitance_fade_rate * self.fading_throughput)


class SelfHeating(ActuatorEffect):
    """Dissipation warms the actuator, and the warm electrolyte conducts better.

    ``R = R1 / (1 + kappa theta)``, where the rise ``theta`` over the ambient temperature, one for
    the whole actuator, obeys ``tau dtheta/dt = R_th P - theta`` with the dissipation ``P = V i -
    V_films dQ/dt`` of :meth:`dissipation`; the heat capacity is ``tau / R_th``. Relaxes assumption
    7, that the actuator is isothermal; ``kappa = 0`` is the base model.
    """

    id = "self_heating"
    title = "Self-heating of the actuator"
    neutral = "conductance_rise_per_kelvin"
    term = Term(
        "series_resistance",
        "temperature_rise",
        "R1 / (1 + kappa theta)",
        "series_resistance over temperature",
    )
    assumption = 7
    sizes = (
        Size(
            "conducts {} better per kelvin",
            ("conductance_rise_per_kelvin",),
            "%",
            lambda kappa: 100.0 * kappa,
        ),
        Size("warms by {}", ("thermal_resistance",)),
        Size("a time constant of {}", ("thermal_time",)),
    )

    conductance_rise_per_kelvin = Parameter(
        0.0,
        "1/K",
        min=0,
        max=10.0,
        nominal=0.02,
        doc="relative rise of the series conductance per kelvin (kappa)",
        source="0 is the isothermal base; aqueous electrolytes have about 0.02/K",
    )
    thermal_resistance = Parameter(
        20.0,
        "K/W",
        min=1e-6,
        max=1e6,
        nominal=20.0,
        doc="temperature rise per dissipated power, in the end (R_th)",
        source="estimate for a palm-sized part in still air, 50 cm^2 at 10 W/(m^2 K)",
    )
    thermal_time = Parameter(
        1000.0,
        "s",
        min=1e-3,
        max=1e9,
        nominal=1e3,
        doc="time constant of warming and cooling (tau)",
        source="estimate, 50 J/K at 20 K/W",
    )
    temperature_rise = State(
        "K", rate="temperature_rate", doc="temperature of the actuator above the ambient one"
    )

    def dissipation(self) -> Any:
        """Dissipated power, V i less the power stored in the films; R1 (dQ/dt)^2 + V^2 / R2 over
        the base model.
        """
        return (
            self.terminal_voltage() * self.drawn_current()
            - self.film_voltage() * self.capacitor_current()
        )

    def temperature_rate(self) -> Any:
        """Rate of the temperature rise, (R_th P - theta) / tau."""
        return (
            self.thermal_resistance * self.dissipation() - self.temperature_rise
        ) / self.thermal_time

    def series_resistance(self) -> Any:
        """Series resistance of the warm actuator, R1 / (1 + kappa theta) over the base model."""
        return super().series_resistance() / (
            1.0 + self.conductance_rise_per_kelvin * self.temperature_rise
        )
