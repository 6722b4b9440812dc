"""Hidden variations of the circuit."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from demonstrations.emulator.physics import Array, Physics

_CELLS = 30  # of the diffusion layer
_AMBIENT = 296.0  # K
_BREEZE = 10.0  # K, rise at which convection has doubled the cooling


@dataclass
class DoubleLayer(Physics):
    """A double layer at the interface, crossed with a voltage that bends like Butler-Volmer's."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # voltage across the layer, V
    transfer_resistance: float = 0.1  # ohm, of a small current
    layer_time: float = 0.2  # s, of a small current
    bending_voltage: float = 0.6  # V

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Add the layer's voltage to the films'."""
        return super().capacitor_voltage(state, force) + self.own(DoubleLayer, state)[0]

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate at which the current that does not cross charges the layer."""
        rates = super().rates(state, current, force)
        crossing = self.bending_voltage * np.sinh(
            self.own(DoubleLayer, state)[0] / self.bending_voltage
        )
        return [*rates, (self.transfer_resistance * rates[0] - crossing) / self.layer_time]


@dataclass
class DiffusionLayer(Physics):
    """Part of the series resistance is that of ions diffusing through a layer, in finite volumes.

    The concentration of each cell is expressed as the current that would sustain it; the films' end
    of the layer holds it at zero.
    """

    extra_states: ClassVar[int] = _CELLS
    diffusing_share: float = 0.3  # of the series resistance
    diffusion_time: float = 10.0  # s, thickness squared over diffusivity

    def series_resistance(self, state: Array) -> Any:
        """Leave what does not diffuse, and half a cell."""
        return super().series_resistance(state) * (1 - self.diffusing_share * (1 - 0.5 / _CELLS))

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Add the voltage of the first cell."""
        across = (
            self.diffusing_share
            * super().series_resistance(state)
            * self.own(DiffusionLayer, state)[0]
        )
        return super().capacitor_voltage(state, force) + across

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the balance of every cell."""
        rates = super().rates(state, current, force)
        cells = self.own(DiffusionLayer, state)
        between = -_CELLS * np.diff(cells, axis=0)
        flux = np.concatenate([np.array(rates[:1]), between, 2 * _CELLS * cells[-1:]])
        gained = (flux[:-1] - flux[1:]) * (_CELLS / self.diffusion_time)
        return [*rates, *gained]


@dataclass
class OnsettingLeakage(Physics):
    """A second leakage that sets in smoothly around a voltage, by the power 3/2 of the excess."""

    linear: ClassVar[bool] = False
    leakage_rise: float = 0.1  # A/V^1.5
    onset_voltage: float = 0.7  # V
    onset_width: float = 0.08  # V

    def leakage_current(self, voltage: Any) -> Any:
        """Add the second leakage, zero without voltage and odd."""
        exceeding = np.logaddexp(0, (np.abs(voltage) - self.onset_voltage) / self.onset_width)
        at_zero = np.logaddexp(0, -self.onset_voltage / self.onset_width)
        second = (self.onset_width * exceeding) ** 1.5 - (self.onset_width * at_zero) ** 1.5
        return super().leakage_current(voltage) + self.leakage_rise * np.sign(voltage) * second


@dataclass
class ChargeDependentCapacitance(Physics):
    """The inverse capacitance rises with the charge, from one level to another."""

    linear: ClassVar[bool] = False
    # 1/C, relative rise of the inverse capacitance, per charge and about zero
    stiffening: float = 0.1
    levelling_charge: float = 3.0  # C

    def film_voltage(self, state: Array) -> Any:
        """Integrate 1/C (1 + a Q / sqrt(1 + (Q/Q0)^2)) over the charge."""
        levelling = self.levelling_charge
        charge = state[0]
        gained = self.stiffening * levelling**2 * (np.sqrt(1 + (charge / levelling) ** 2) - 1)
        return super().film_voltage(state) + gained / self.capacitance(state)


@dataclass
class GrowingResistance(Physics):
    """Series resistance that rises with the charge moved in and out, and levels off."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # throughput, C
    growth: float = 0.5  # of the resistance, in the end
    endurance: float = 500.0  # C, throughput that brings about half of it

    def series_resistance(self, state: Array) -> Any:
        """Grow by a fraction that saturates with throughput, as sites for damage are used up."""
        throughput = self.own(GrowingResistance, state)[0]
        return super().series_resistance(state) * (
            1 + self.growth * throughput / (self.endurance + throughput)
        )

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate of the throughput."""
        rates = super().rates(state, current, force)
        return [*rates, abs(rates[0])]


@dataclass
class FadingCapacitance(Physics):
    """Capacitance that falls exponentially, towards a rest, with the charge moved in and out."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # throughput, C
    fade: float = 0.2  # of the capacitance, in the end
    fading_charge: float = 500.0  # C

    def capacitance(self, state: Array) -> Any:
        """Lose active sites one by one."""
        lost = -self.fade * np.expm1(-self.own(FadingCapacitance, state)[0] / self.fading_charge)
        return super().capacitance(state) * (1 - lost)

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate of the throughput."""
        rates = super().rates(state, current, force)
        return [*rates, abs(rates[0])]


@dataclass
class SelfHeating(Physics):
    """Dissipation that warms the actuator: its resistance falls after Arrhenius.

    Its cooling improves with the rise of temperature.
    """

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # temperature above the ambient one, K
    activation_temperature: float = 1800.0  # K, activation energy over the gas constant
    heat_resistance: float = 20.0  # K/W, of a small rise
    heat_time: float = 400.0  # s, of a small rise

    def series_resistance(self, state: Array) -> Any:
        """Conduct better when warm."""
        rise = self.own(SelfHeating, state)[0]
        return super().series_resistance(state) * np.exp(
            -self.activation_temperature * rise / _AMBIENT / (_AMBIENT + rise)
        )

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the heat balance: power supplied and not stored, less the loss by convection."""
        rates = super().rates(state, current, force)
        rise = self.own(SelfHeating, state)[0]
        heat = (
            self.terminal_voltage(state, current, force) * current
            - self.film_voltage(state) * rates[0]
        )
        cooling = rise * (1 + (abs(rise) / _BREEZE) ** 1.25)
        return [*rates, (self.heat_resistance * heat - cooling) / self.heat_time]
