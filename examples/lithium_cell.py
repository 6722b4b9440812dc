"""A family of lithium-ion cells: open-circuit voltage, RC pairs, hysteresis and temperature.

``LithiumCell`` has the curve of the voltage at rest, a series resistance and one RC pair;
``WarmingCell`` has a temperature too, by which its resistances fall. A second pair and the
hysteresis (Plett: Battery Management Systems, volume 1, 2015, chapter 2) are effects, which a
diagnosis tries and any command lays over either cell::

    ppy diagnose record.csv --model examples/lithium_cell.py:WarmingCell
    ppy build examples/lithium_cell.py:WarmingCell --with second_pair,hysteresis --runtime native

Another chemistry is a subclass with ``charges`` and ``voltages`` of its own, and a third pair is
``rc_pair("third", 3, 2000.0)`` among the effects.
"""

from fmus.kit import Component, Effect, Input, Output, Parameter, State, absolute, exp, smooth_table
from fmus.kit.arms import lag_effect
from fmus.kit.curves import EffectNames
from fmus.kit.generic import describe_effect

HOUR = 3600.0  # s
REFERENCE = 298.15  # K, at which resistances are given


class LithiumCell(Component):
    """One RC pair: v = U(z) - R0 i - u with C1 du/dt = i - u / R1 and Q dz/dt = -i."""

    name = "lithium_cell"
    experiment = (3600.0, 1.0)

    # state of charge, and the voltage at rest there: of NMC against graphite, to the millivolt
    charges = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    voltages = (2.955, 3.192, 3.313, 3.43, 3.499, 3.563, 3.639, 3.738, 3.838, 3.928, 4.025, 4.135)

    capacity = Parameter(2.5, "A*h", min=1e-3, max=1e4, doc="capacity (Q)")
    R0 = Parameter(0.03, "ohm", min=1e-6, max=100, nominal=0.01, doc="series resistance")
    R1 = Parameter(0.02, "ohm", min=1e-6, max=100, nominal=0.01, doc="resistance of the RC pair")
    C1 = Parameter(2000.0, "F", min=1e-3, max=1e9, nominal=1e3, doc="capacitance of the RC pair")

    current = Input("A", nominal=2.5, doc="current, positive in discharge (i)")
    charge = State("1", rate="charge_rate", start=0.9, doc="state of charge (z)")
    pair_voltage = State("V", rate="pair_rate", nominal=0.05, doc="voltage of the RC pair (u)")

    def charge_rate(self):
        """Coulomb counting."""
        return -self.current / (HOUR * self.capacity)

    def resistance_factor(self):
        """Resistances, as a share of what they are at 25 degrees Celsius."""
        return 1.0

    def pair_rate(self):
        """Charge of the capacitor, by what its resistor leaves of the current."""
        resistance = self.R1 * self.resistance_factor()
        return (self.current - self.pair_voltage / resistance) / self.C1

    def open_circuit_voltage(self):
        """Voltage at rest."""
        return smooth_table(self.charge, self.charges, self.voltages)

    def voltage_drop(self):
        """Voltage lost inside."""
        return self.R0 * self.resistance_factor() * self.current + self.pair_voltage

    @Output("V", nominal=0.1)
    def voltage(self):
        """Voltage at the terminals."""
        return self.open_circuit_voltage() - self.voltage_drop()


class WarmingCell(LithiumCell):
    """A cell that its losses warm: C dT/dt = i (U - v) - (T - T_a) / R, and R0, R1 ~ exp(B / T)."""

    name = "warming_cell"

    heat_capacity = Parameter(45.0, "J/K", min=1e-3, max=1e6, nominal=45.0, doc="of the cell (C)")
    thermal_resistance = Parameter(
        8.0, "K/W", min=1e-6, max=1e4, nominal=8.0, doc="from the cell to the ambient (R)"
    )
    activation = Parameter(
        2000.0, "K", min=0, max=2e4, nominal=1e3, doc="of the resistances, by Arrhenius (B)"
    )

    ambient = Input("K", start=REFERENCE, nominal=10.0, doc="temperature around the cell (T_a)")
    cell_temperature = State(
        "K", rate="temperature_rate", start=REFERENCE, nominal=10.0, doc="temperature (T)"
    )

    def resistance_factor(self):
        """Arrhenius' law."""
        return exp(self.activation * (1.0 / self.cell_temperature - 1.0 / REFERENCE))

    def heat(self):
        """Power of the losses."""
        return self.current * self.voltage_drop()

    def heat_loss(self):
        """Newton's law of cooling."""
        return (self.cell_temperature - self.ambient) / self.thermal_resistance

    def temperature_rate(self):
        """Balance of heat."""
        return (self.heat() - self.heat_loss()) / self.heat_capacity

    @Output("K", nominal=10.0)
    def temperature(self):
        """Temperature of the cell, as measured."""
        return self.cell_temperature


class Hysteresis(Effect):
    """Voltage at rest that depends on the direction of the current before: M h less.

    h goes to the sign of the current with the charge that passes; M = 0 is the base model.
    """

    id = "hysteresis"
    title = "Hysteresis of the voltage at rest"
    neutral = "hysteresis_voltage"
    assumption = "the voltage at rest is a function of the charge"

    hysteresis_voltage = Parameter(
        0.0, "V", min=0, max=1, nominal=0.01, doc="half the width of the loop (M)"
    )
    hysteresis_rate = Parameter(
        50.0, "1", min=1, max=1e4, nominal=50.0, doc="loops that a capacity passes (gamma)"
    )
    hysteresis_state = State("1", rate="hysteresis_change", doc="side of the loop (h)")

    def hysteresis_change(self):
        """Change of side (Plett, Journal of Power Sources 134, 2004, part 2)."""
        rest = self.current - absolute(self.current) * self.hysteresis_state
        return self.hysteresis_rate * rest / (HOUR * self.capacity)

    def voltage_drop(self):
        """Voltage lost inside, with the loop."""
        return super().voltage_drop() + self.hysteresis_voltage * self.hysteresis_state


def rc_pair(ordinal: str, number: int, time: float) -> type[Effect]:
    """Make the effect of one more RC pair, with a time constant in s from which a fit starts."""
    names = EffectNames(f"{ordinal}_pair", (f"R{number}", f"tau{number}", f"pair_current{number}"))
    effect = lag_effect(
        LithiumCell, "voltage_drop", "current", "lagging", time, "V", nominal=0.05, names=names
    )
    text = f"One more RC pair, ``R i`` behind a lag of ``tau``; R{number} = 0 is the base model."
    assumption = "the cell relaxes with fewer time constants"
    return describe_effect(effect, assumption, text, f"A {ordinal} RC pair")


EFFECTS = {effect.id: effect for effect in (rc_pair("second", 2, 300.0), Hysteresis)}
